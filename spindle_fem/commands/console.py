"""Terminal output: tables of results, the stage or the number of designs done."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table
from rich.text import Text

from spindle_fem.commands.verbosity import Verbosity
from spindle_fem.results.run_log import LOGGER

# Lines of one kind that are printed; files have them all.
MOST_LINES = 12
# Without a terminal, stages that begin later than this after the start are told [s].
FIRST_LINE = 3.0


def open_console() -> Console:
    """Console as wide as the terminal, or 120 columns if the output goes to a file or a pipe.

    Markup is off: names of tables and the user's own texts may contain brackets.
    """
    console = Console(quiet=Verbosity.quiet, markup=False)
    return console if console.is_terminal else Console(width=120, quiet=Verbosity.quiet, markup=False)


def _print_marked(console: Console, mark: str, text: str, style: str) -> None:
    """Print a line whose first word has a style of its own."""
    console.print(Text.assemble((mark, style), text))


def _print_warnings(console: Console, content: dict[str, Any]) -> None:
    """Print assumptions completed by rule, and warnings."""
    for row in sorted(content.get("assumed", ()), key=lambda row: row["name"].partition(".")[0]):
        _print_marked(console, "assumed", f" {row['name']}: {row['detail']}", "bold")
    for warning in content["warnings"]:
        _print_marked(console, warning["code"], f": {warning['text']}", "yellow")


def headed_table(title: str, *columns: str, sentences: bool = False) -> Table:
    """An empty table: the first column names the rows, in lines that may break; others hold numbers."""
    table = Table(
        title=title, title_justify="left", title_style="bold", box=SIMPLE_HEAD, padding=(0, 1, 0, 0)
    )
    table.add_column(columns[0], no_wrap=not sentences)
    for column in columns[1:]:
        table.add_column(column, justify="right")
    return table


def _number(value: Any, digits: int) -> str:
    return "–" if value is None else f"{value:.{digits}f}"


def print_run(summary: dict[str, Any], folder: Path) -> None:
    """Headline of a run: temperatures, bearings, balance, checks and warnings."""
    from spindle_fem.report.run_tables import warmest_at

    console = open_console()
    table = headed_table(
        *("Bearings", "", "heat W", "inner °C", "outer °C", "balls °C", "difference K"),
        *("preload N", "axial load N", "lambda"),
    )
    for name, bearing in summary["bearings"].items():
        table.add_row(
            name,
            _number(bearing["heat_W"], 1),
            _number(bearing["temperature_inner_degC"], 2),
            _number(bearing["temperature_outer_degC"], 2),
            _number(bearing["temperature_ball_degC"], 2),
            _number(bearing["ring_difference_K"], 2),
            _number(bearing["preload_N"], 0),
            _number(bearing["axial_load_N"], 0),
            _number(bearing["lambda"], 1),
        )
    console.print(table)
    if summary["probes"]:
        probes = headed_table("Probes", *(["", *summary["probes"]]))
        probes.add_row("°C", *(_number(value, 2) for value in summary["probes"].values()))
        console.print(probes)
    coolant = summary["coolant"]
    if coolant:
        film = coolant["film_coefficient_W_m2K"]
        console.print(
            f"Coolant {coolant['flow_m3_s'] * 6e4:.3g} L/min, "
            f"{coolant['inlet_degC']:.2f} → {coolant['outlet_degC']:.2f} °C, {coolant['regime']}, "
            f"Re {coolant['reynolds']:.0f}, "
            f"film {film['value']:.0f} ({film['low']:.0f}–{film['high']:.0f}) W/(m²·K), "
            f"pressure drop {coolant['pressure_drop_Pa'] / 1e5:.2f} bar{_in_ports(coolant)}"
        )
    for name, circuit in summary["circuits"].items():
        console.print(
            f"Circuit {name} {circuit['flow_m3_s'] * 6e4:.3g} L/min, "
            f"{circuit['inlet_degC']:.2f} → {circuit['outlet_degC']:.2f} °C, {circuit['heat_W']:.1f} W, "
            f"{circuit['regime']}, film {circuit['film_coefficient_W_m2K']:.0f} W/(m²·K)"
        )
    temperature, energy, mesh = summary["temperature"], summary["energy"], summary["mesh"]
    console.print(f"Hottest {temperature['max_degC']:.2f} °C in the solid at {warmest_at(summary)}")
    console.print(
        f"Heat in {energy['heat_in_W']:.2f} W, imbalance {energy['imbalance_relative']:.1e}; "
        f"{mesh['nodes']:,} temperatures, {mesh['elements']:,} elements, "
        f"worst quality {mesh['min_quality']:.2f}"
    )
    split = _time_split(summary["timings_s"])
    console.print(f"{summary['wall_time_s']:.1f} s ({split}), peak {summary['peak_rss_MB']:.0f} MB")
    for check in summary["checks"]:
        if not check["passed"]:
            _print_marked(
                console,
                "FAILED",
                f" {check['name']}: {check['value']:.4g} {check['unit']}, "
                f"limit {check['limit']:.4g}. {check['explanation']}",
                "bold red",
            )
    _print_warnings(console, {"warnings": summary["warnings"]})
    console.print(f"Report: {folder / 'report.html'}")


def _in_ports(coolant: Mapping[str, Any]) -> str:
    """Share of the drillings in the pressure drop; nothing of channels without."""
    ports = coolant["ports_pressure_drop_Pa"]
    return f", {ports / 1e5:.2f} of it in the ports" if ports else ""


def _time_split(times: Mapping[str, float]) -> str:
    """Seconds of each step; those that ran in parallel are listed once, after the others."""
    mark = "in parallel: "
    after_another = [f"{name} {time:.1f}" for name, time in times.items() if not name.startswith(mark)]
    parallel = [f"{name[len(mark) :]} {time:.1f}" for name, time in times.items() if name.startswith(mark)]
    return ", ".join(after_another) + (f"; {mark}{', '.join(parallel)}" if parallel else "")


def print_check(content: dict[str, Any], picture: Path | None = None) -> None:
    """Operation, parts, surfaces, contacts, probes and sources of a valid machine, and its picture."""
    console = open_console()
    drawn = "." if picture is None else f", drawn in {picture}."
    _print_marked(console, content["machine"], f" is valid{drawn}", "bold")
    lists = [key for key, rows in content.items() if isinstance(rows, list)]
    for key in (key for key in lists if key not in ("assumed", "warnings")):
        if not content[key]:
            continue
        table = headed_table(key.replace("_", " ").capitalize(), "", "")
        table.show_header = False
        for row in content[key]:
            table.add_row(row["name"], row.get("detail", ""))
        console.print(table)
    _print_warnings(console, content)
    _print_marked(console, content["machine"], f" is valid{drawn}", "bold")


def print_pairs(title: str, content: dict[str, Any]) -> None:
    """A title and one line for each key."""
    console = open_console()
    console.print(title)
    for key, value in content.items():
        console.print(f"  {key}: {value}")


def print_export(content: dict[str, Any]) -> None:
    """Inputs and outputs of an exported model."""
    console = open_console()
    console.print(
        f"wrote {', '.join(content['files'])}: {content['states']} states, {content['scheme']} steps"
    )
    for key in ("inputs", "outputs"):
        named = (f"{item['name']} ({item['unit']}{_range_of(item)})" for item in content[key])
        console.print(f"  {key}: {', '.join(named)}")
    for note in content["notes"]:
        console.print(f"  {note}")


def _range_of(item: dict[str, Any]) -> str:
    """Range of an input that has one."""
    ends = item.get("low"), item.get("high")
    return "" if None in ends else f", {ends[0]:.4g} to {ends[1]:.4g}"


_HEAT_ROWS = (
    ("axial_load_N", "axial load N", 0),
    ("preload_N", "preload N", 0),
    ("contact_angle_inner_deg", "α inner °", 2),
    ("contact_angle_outer_deg", "α outer °", 2),
    ("film_um", "film µm", 3),
    ("lambda", "lambda", 1),
    ("orbital_speed_rad_s", "orbit rad/s", 1),
    ("centrifugal_force_N", "centrifugal N", 1),
)


def print_heat(content: dict[str, Any], folder: Path | None) -> None:
    """Heat term by term, one table a bearing, one column a speed; where the report is, if there is one."""
    from spindle_fem.report.heat_report import heat_conditions

    console = open_console()
    for name, rows in content["bearings"].items():
        table = headed_table(
            f"{name}, model {content['model']}", "rpm", *(f"{row['speed_rpm']:.0f}" for row in rows)
        )
        table.add_row("heat W", *(_number(row["heat_W"], 1) for row in rows), style="bold")
        for term in dict.fromkeys(term for row in rows for term in row["terms_W"]):
            values = [row["terms_W"].get(term) for row in rows]
            if any(values):
                table.add_row(f"· {term.replace('_', ' ')}", *(_number(value, 1) for value in values))
        for key, label, digits in _HEAT_ROWS:
            table.add_row(label, *(_number(row[key], digits) for row in rows))
        for level in content["models"][0]["heat_W"] if content["models"] else ():
            values = [row["heat_W"][level][name] for row in content["models"]]
            table.add_row(f"by {level} W", *(_number(value, 1) for value in values), style="dim")
        console.print(table)
    console.print(f"At {heat_conditions(content)}")
    _print_warnings(console, content)
    if folder is not None:
        console.print(f"Report: {folder / 'report.html'}")


def print_crosscheck(content: dict[str, Any], folder: Path) -> None:
    """Largest differences between network and elements."""
    console = open_console()
    table = headed_table("Largest differences", "node", "network °C", "FEM °C", "difference K")
    for node in sorted(content["nodes"], key=lambda item: -abs(item["difference_K"]))[:12]:
        table.add_row(
            node["node"],
            _number(node["network_degC"], 2),
            _number(node["fem_degC"], 2),
            _number(node["difference_K"], 2),
        )
    console.print(table)
    console.print(
        f"{len(content['nodes'])} nodes, {len(content['links'])} links; report: {folder / 'report.html'}"
    )


def print_simulation(content: dict[str, Any], folder: Path) -> None:
    """Error of every temperature channel."""
    console = open_console()
    table = headed_table("Channels", "channel", "rmse K", "noise K")
    for channel in content["channels"]:
        table.add_row(channel["channel"], _number(channel["rmse_K"], 3), _number(channel["noise_K"], 3))
    console.print(table)
    for line in (*content["defects_text"], *content["notes"]):
        console.print(line, style="dim")
    console.print(f"Report: {folder / 'report.html'}")


def print_diagnosis(content: dict[str, Any], folder: Path) -> None:
    """Verdict, findings, alternatives and the fit before and after."""
    from spindle_fem.report import diagnosis_words as words

    console = open_console()
    fit, p, verdict = content["fit"], words.level_of(content), content["verdict"]
    _print_marked(console, verdict, f"  (p {p})" if p else "", "bold")
    if content["reason"]:
        console.print(content["reason"])
    lead = "Comes nearest: " if verdict == "unexplained" else ""
    for finding in content["findings"]:
        console.print(f"{lead}{finding['statement']}  (set: {content['set_probability']:.2f})")
    for row in words.wrong_rows(content) if content["findings"] or verdict == "unexplained" else ():
        console.print(words.wrong_definition_words(row))
    if content["alternatives"]:
        table = headed_table("Not ruled out", "set", "probability", sentences=True)
        for item in content["alternatives"]:
            table.add_row(words.set_words(item["findings"]), _number(item["probability"], 3))
        console.print(table)
    if fit["noise_K"] is not None:
        table = headed_table("Fit", "", "fitted K", "held out K")
        for row in words.fit_rows(fit):
            table.add_row(row["model"], _number(row["fitted"], 3), _number(row["heldout"], 3))
        full = fit["full_model"]
        for when, name in words.fits_told(fit).items() if full["reason"] is None else ():
            errors = (full[when]["train_rmse_K"], full[when]["heldout_rmse_K"])
            table.add_row(f"{name}, full model", *(_number(error, 3) for error in errors))
        table.add_row("noise", _number(fit["noise_K"], 3), _number(fit["noise_K"], 3))
        console.print(table)
    if fit["full_model"]["mesh"] != "off" and fit["full_model"]["reason"]:
        console.print(f"Full model: {fit['full_model']['reason']}")
    for note in content.get("notes", ()):
        console.print(note, style="dim")
    console.print("Next: {quantity} at {where}, {condition}.".format_map(content["next_measurement"]))
    console.print(f"Files: {folder}")


def print_plan(content: dict[str, Any], folder: Path) -> None:
    """Findings of a plan: distinguishable effects, the best further sensors and tests."""
    console = open_console()
    for sentence in content["summary"]:
        console.print(sentence)
    hours = f"Tests of {content['best_test']['length_s'] / 3600.0:.3g} h" if content["best_test"] else ""
    for key, title in (("sensors_in_turn", "Further sensors, one after another"), ("tests", hours)):
        table = headed_table(title, "", "information bit", "seen", "told from all", sentences=True)
        for item in content[key]:
            table.add_row(
                item["words"],
                _number(item["information_bit"], 3),
                str(item["seen"]),
                str(item["told_from_all"]),
            )
        if content[key]:
            console.print(table)
    for note in content["notes"]:
        console.print(note, style="dim")
    console.print(f"Report: {folder / 'report.html'}")


def print_diagnoses(content: dict[str, Any], folder: Path) -> None:
    """Verdict and findings of every recording, and the reasons of those that failed."""
    console = open_console()
    table = headed_table(
        "Recordings", "recording", "verdict", "findings", "probability", "before K", "after K"
    )
    for row in content["rows"]:
        table.add_row(
            row["recording"],
            row["verdict"] or row["status"],
            row["findings"] or "",
            _number(row["probability"], 2),
            _number(row["before_rmse_K"], 3),
            _number(row["after_rmse_K"], 3),
        )
    console.print(table)
    for row in content["rows"]:
        if row["status"] != "ok":
            console.print(f"{row['recording']}: {row['reason']}")
    console.print(f"{content['diagnosed']} of {content['recordings']} diagnosed; {folder / 'report.html'}")


def print_sweep(content: dict[str, Any], folder: Path) -> None:
    """Number of designs solved, the best one, and the path of the table."""
    console = open_console()
    for key, value in content.items():
        if isinstance(value, (str, int, float)) and key != "schema":
            console.print(f"{key.replace('_', ' ')}: {value}")
    for line in _best_designs(content):
        console.print(line)
    console.print(f"Table: {folder / 'results.csv'}; report: {folder / 'report.html'}")


def _best_designs(content: dict[str, Any]) -> list[str]:
    """The best design with what it is and reaches, or the designs of the front."""
    from spindle_fem.report.sweep_scales import scale_of_column

    if not content["objectives"]:
        return []
    wanted = ", ".join(f"{item['direction']} {item['output']}" for item in content["objectives"])
    optimum = content["optimum"]
    if optimum is None:
        return [f"best ({wanted}): none of the solved designs keeps every limit"]
    if (best := optimum["best"]) is None:
        return [f"front ({wanted}): designs {', '.join(map(str, optimum['front']))}"]
    scales = {
        item["path"]: scale_of_column(item["path"], item["unit"], ())
        for item in (*content["parameters"], *content["outputs"])
    }

    def listed(values: dict[str, Any]) -> str:
        shown = ((path, scales[path], value) for path, value in values.items() if path in scales)
        return ", ".join(
            f"{path} = {scale.text(value)} {scale.unit}".rstrip() for path, scale, value in shown
        )

    alike = ", ".join(map(str, optimum.get("within_mesh_error", ())))  # folders of earlier versions lack it
    return [
        f"best ({wanted}): design {best['design']}, {listed(best['parameters'])}",
        f"  there {listed(best['outputs'])}",
        *([f"  as good within the mesh's error: {alike}"] if alike else ()),
    ]


def print_transient(content: dict[str, Any], folder: Path) -> None:
    """Headline of a transient study: the end of every phase, and the approach to equilibrium."""
    from spindle_fem.report.transient_report import equilibrium_text

    console = open_console()
    phases, equilibrium = content["phases"], content["equilibrium"]
    probes = list(phases[0]["probes_degC"])
    table = headed_table(
        f"{content['study']}: {content['machine']}, {content['unknowns']:,} temperatures",
        "end of",
        "after h",
        "heat W",
        "hottest °C",
        *probes,
    )
    for phase in phases:
        table.add_row(
            phase["name"] + (" (not settled)" if phase["settled"] is False else ""),
            _number(phase["end_s"] / 3600.0, 2),
            _number(phase["heat_W"], 1),
            _number(phase["hottest_degC"], 2),
            *(_number(phase["probes_degC"][name], 2) for name in probes),
        )
    console.print(table)
    console.print(equilibrium_text(equilibrium))
    worst = max(phase["energy"]["imbalance_relative"] for phase in phases)
    console.print(
        f"{sum(phase['steps'] for phase in phases)} steps, heat in less out and stored {worst:.1e}, "
        f"{sum(phase['cpu_seconds'] for phase in phases):.0f} s of processor"
    )
    console.print(f"Report: {folder / 'report.html'}")


@contextlib.contextmanager
def stages(show: bool, shares: Mapping[str, float] | None = None) -> Iterator[Any]:
    """Stage names and the time since the start on the terminal while they run, and in the log.

    Without a terminal, each stage that begins after the first seconds is a line of the error output.

    Parameters
    ----------
    shares : mapping of str to float
        Of the whole time, by stage: what has usually passed when it begins; time left follows from it.
    """
    console = Console(stderr=True)
    if not show or Verbosity.quiet or Verbosity.verbose:
        yield LOGGER.info
        return
    if not console.is_terminal:
        yield _stage_lines(Console(stderr=True, width=120, markup=False, highlight=False))
        return
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    from spindle_fem.commands.usual_time import TimeLeft

    shown_stage = TextColumn("{task.description}", markup=False)
    columns = (SpinnerColumn(), shown_stage, TimeElapsedColumn(), TimeLeft())
    with Progress(*columns, console=console, transient=True) as shown:
        task = shown.add_task("starting", total=None, begun=0.0, share=0.0)

        def tell(stage: str) -> None:
            LOGGER.info(stage)
            found = {}
            if stage in (shares or {}):
                found = {"begun": shown.tasks[task].elapsed or 0.0, "share": shares[stage]}
            shown.update(task, description=f"{stage} ...", **found)

        yield tell


def _stage_lines(console: Console) -> Callable[[str], None]:
    """Stages as lines with the time since now, from :data:`FIRST_LINE` on."""
    began = time.monotonic()

    def tell(stage: str) -> None:
        LOGGER.info(stage)
        passed = time.monotonic() - began
        if passed >= FIRST_LINE:
            console.print(f"after {passed:.0f} s: {stage} ...")

    return tell


@contextlib.contextmanager
def designs_done(show: bool, total: int) -> Iterator[Callable[[int], None]]:
    """Rows done and time left on the terminal; the callable takes how many more are done."""
    if not show or Verbosity.quiet:
        yield lambda done: None
        return
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (
        TextColumn("designs"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(elapsed_when_finished=False),
    )
    with Progress(*columns, console=Console(stderr=True)) as bar:
        task = bar.add_task("designs", total=total)
        yield lambda done: bar.advance(task, done)


def print_draft(content: dict[str, Any], folder: Path) -> None:
    """Guessed meaning of each column, how the files were read, and doubts."""
    console = open_console()
    table = headed_table("Channels", "column", "role", "stands for", "unit")
    for channel in content["channels"]:
        means = channel["probe"] or channel["drives"] or "–"
        table.add_row(channel["column"], channel["role"], means, channel["unit"] or "–")
    console.print(table)
    for heading, key in (("found", "found"), ("unsure", "unsure"), ("cells without a number", "lost_cells")):
        for text in content[key][:MOST_LINES]:
            console.print(f"{heading}: {text}", highlight=False)
        if len(content[key]) > MOST_LINES:
            console.print(f"{heading}: and {len(content[key]) - MOST_LINES} more")
    console.print(*content["defects_text"], sep="\n", highlight=False)
    console.print(f"wrote {folder}; check what recording.toml marks UNSURE", highlight=False)
