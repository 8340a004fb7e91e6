"""``report.html`` and the figures of a study."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from operator import itemgetter
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from spindle_fem.definition.load import read_toml, validate
from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.report import sweep_charts, sweep_film
from spindle_fem.report.block_page import (
    Bullets,
    Cards,
    Illustration,
    Interactive,
    Notice,
    Section,
    illustration_of,
    render_document,
)
from spindle_fem.report.figure_style import save_png
from spindle_fem.report.sweep_best import best_designs
from spindle_fem.report.sweep_scales import Scale, scale_of_column
from spindle_fem.report.table_rows import MISSING, Field, table_of, whole, words
from spindle_fem.results.output_folder import read_content, replace_text, require_complete
from spindle_fem.results.thermal_result import ThermalResult
from spindle_fem.studies.sweep.file_names import MACHINE_FILE, SUMMARY_FILE, SWEEP_SCHEMA
from spindle_fem.studies.sweep.film_study import FilmChart, film_study, pump_limits
from spindle_fem.studies.sweep.results_table import MOVED, read_results

Row = Mapping[str, Any]
FIGURE_FOLDER = "figures"
# Outputs drawn as maps and as columns; the table has all of them.
MOST_PANELS = 6
BEST_PICTURE = "best_designs.png"
# Designs listed that are as good as the best within the mesh's error.
MOST_ALIKE = 12

_CAPTIONS = {
    "responses": "Outputs over the parameters that move them most. Dots are solved designs, crosses break "
    "a limit.",
    "best_designs": "Temperature in the vertical plane through the axis, on one scale.",
    "parallel_coordinates": "Each line is a design; dotted ones break a limit, thick ones are the best.",
    "pareto_front": "Designs of the front are not beaten in every objective by any other.",
    "sensitivities": "Which parameter each output depends on, over the whole space of the study.",
    "film_maps": "The paper's Figure 22 and the same by correlations of a helical duct, each row on one "
    "scale. White line: laminar to turbulent, by the paper at Re 2300 on the depth, in a helical duct where "
    "Schmidt puts it, some 8000 on the hydraulic diameter. Dashed: the pump's limit of the study, for the "
    "channel alone; hatched is what lies beyond. The paper names neither velocity nor flow; what it would "
    "choose depends on it.",
    "pump_maps": "What the pump must do for it, through the channel alone; dashed is the study's limit.",
}


def write_sweep_report(
    folder: Path,
    summary: Mapping[str, Any],
    rows: Sequence[Row],
    spec: MachineSpec,
    results: Mapping[int, ThermalResult] | None = None,
) -> Path:
    """Draw the figures of a study and write its report.

    Parameters
    ----------
    folder : Path
        Of the study.
    summary : mapping
        ``sweep.json``.
    rows : sequence of Row
        Of the table.
    spec : MachineSpec
        The machine before any design, for the film maps.
    results : mapping of design to ThermalResult, optional
        Fields of the best designs; without them the existing picture is kept.
    """
    solved, parameters, outputs = drawn_columns(summary, rows)
    films = film_study(spec)
    figures = draw_figures(summary, solved, parameters, outputs, films)
    place = folder / FIGURE_FOLDER
    place.mkdir(exist_ok=True)
    if results:
        figures["best_designs"] = best_designs(_titled(results, summary, rows, parameters))
    kept = BEST_PICTURE if not results and summary["pictured"] else ""
    for old in place.glob("*.png"):
        if old.name != kept:
            old.unlink()
    pictures: dict[str, Illustration] = {}
    if kept and (place / kept).is_file():
        pictures["best_designs"] = illustration_of(place / kept, _CAPTIONS["best_designs"])
    for name, figure in figures.items():
        pictures[name] = illustration_of(save_png(figure, place / f"{name}.png"), _CAPTIONS[name])
    sections = _sections(summary, rows, parameters, outputs, films, pictures)
    explorer = Interactive("designs.html.j2", "designs.js", _explorer(summary, solved, parameters, outputs))
    sections.append(Section("explore", "Designs one by one", [explorer], screen_only=True))
    subtitle = f"{summary['designs']} designs of {summary['machine']}."
    html = render_document("Design study", summary["study"], sections, subtitle)
    return replace_text(folder / "report.html", html)


def rebuild_sweep_report(folder: str | Path) -> Path:
    """Draw and write the report of a finished study again, from its files.

    Raises
    ------
    BadInputError
        The folder is missing or incomplete, or a file is missing or unknown.
    """
    folder = require_complete(folder)
    summary = read_content(folder / SUMMARY_FILE, SWEEP_SCHEMA, "sweep")
    machine = read_toml(folder / MACHINE_FILE)
    return write_sweep_report(folder, summary, read_results(folder), validate(machine, MACHINE_FILE))


def drawn_columns(
    summary: Mapping[str, Any], rows: Sequence[Row]
) -> tuple[list[Row], list[Scale], list[Scale]]:
    """Rows that were solved, and the scales of the parameters and of the outputs."""
    solved = [row for row in rows if row["status"] == "ok"]
    parameters = [scale_of_column(item["path"], item["unit"], rows) for item in summary["parameters"]]
    outputs = [scale_of_column(item["path"], item["unit"], rows) for item in summary["outputs"]]
    return solved, parameters, outputs


def draw_figures(
    summary: Mapping[str, Any],
    solved: Sequence[Row],
    parameters: Sequence[Scale],
    outputs: Sequence[Scale],
    films: Sequence[FilmChart],
) -> dict[str, Figure]:
    """Figures that the study gives reason for, by file name."""
    figures: dict[str, Figure] = {}
    varying = [item for item in parameters if len({row[item.path] for row in solved}) > 1]
    drawn = [item for item in outputs if not item.words and all(row[item.path] is not None for row in solved)]
    drawn = drawn[:MOST_PANELS]
    optimum = summary["optimum"]
    best = [] if optimum is None else optimum["front"]
    marks = {}
    if optimum is not None and optimum["best"] is not None:
        marks["best design"] = solved_row(solved, optimum["best"]["design"])
    marks |= {name: solved_row(solved, item["design"]) for name, item in summary["references"].items()}
    marks = {name: row for name, row in marks.items() if row is not None}
    if drawn and len(varying) == 1 and not varying[0].words:
        figures["responses"] = sweep_charts.response_lines(solved, varying[0], drawn)
    elif drawn and len(varying) >= 2:
        across, up = _most_important(varying, summary)
        figures["responses"] = sweep_charts.response_maps(solved, across, up, drawn, marks)
    if drawn and len(varying) >= 1 and len(solved) >= 2:
        columns = [*varying, *drawn]
        colour = next(
            (o for o in drawn if summary["objectives"] and o.path == summary["objectives"][0]["output"]),
            drawn[0],
        )
        figures["parallel_coordinates"] = sweep_charts.parallel_coordinates(solved, columns, colour, best)
    if optimum is not None and len(summary["objectives"]) >= 2:
        by_path = {item.path: item for item in outputs}
        first, second = (by_path[item["output"]] for item in summary["objectives"][:2])
        figures["pareto_front"] = sweep_charts.pareto_front(solved, first, second, best)
    if summary["sensitivities"]:
        names = {item.path: item.label.split(" / ")[0] for item in outputs}
        figures["sensitivities"] = sweep_charts.sensitivity_bars(
            summary["sensitivities"][:MOST_PANELS], names
        )
    if films:
        limits = pump_limits(summary["constraints"])
        figures["film_maps"] = sweep_film.film_maps(films, limits)
        figures["pump_maps"] = sweep_film.pump_maps(films, limits)
    return figures


def _titled(
    results: Mapping[int, ThermalResult],
    summary: Mapping[str, Any],
    rows: Sequence[Row],
    parameters: Sequence[Scale],
) -> dict[str, ThermalResult]:
    """Results by a title that gives name and parameters of the design."""
    names = {item["design"]: name for name, item in summary["references"].items()}
    titled = {}
    for design, result in results.items():
        row = solved_row(rows, design)
        values = ", ".join(f"{item.text(row[item.path])} {item.unit}".rstrip() for item in parameters)
        titled[f"{names.get(design, f'design {design}')}: {values}"] = result
    return titled


def solved_row(rows: Sequence[Row], design: int) -> Row | None:
    """Row of a design, None where it was not solved."""
    return next((row for row in rows if row["design"] == design), None)


def _most_important(varying: Sequence[Scale], summary: Mapping[str, Any]) -> tuple[Scale, Scale]:
    """Two parameters for the axes of maps: those with the largest shares over all outputs."""
    share = dict.fromkeys((item.path for item in varying), 0.0)
    for item in summary["sensitivities"]:
        for parameter in item["parameters"]:
            share[parameter["path"]] += parameter["total"]
    chosen = sorted(varying, key=lambda item: (bool(item.words), -share[item.path]))[:2]
    first, second = (item for item in varying if item in chosen)
    return first, second


def _sections(
    summary: Mapping[str, Any],
    rows: Sequence[Row],
    parameters: Sequence[Scale],
    outputs: Sequence[Scale],
    films: Sequence[FilmChart],
    pictures: Mapping[str, Illustration],
) -> list[Section]:
    counts = [
        ("designs", "designs"), ("ok", "solved"), ("feasible", "keep every limit"), ("failed", "failed"),
        ("impossible", "impossible"), ("geometries", "geometries"),
    ]  # fmt: skip
    cards = Cards([{"value": str(summary[key]), "name": name} for key, name in counts])
    sections = [Section("overview", "Overview", [cards, *_limits(summary, outputs)])]
    if summary["optimum"] is not None:
        sections.append(Section("optimum", "Best designs", _optimum(summary, rows, parameters, outputs)))
    elif summary["objectives"]:
        text = "No design keeps every limit; the table tells which one each of them breaks."
        sections.append(Section("optimum", "Best designs", [Notice(text, "bad")]))
    if "best_designs" in pictures:
        sections.append(Section("machines", "The best designs, cut open", [pictures["best_designs"]]))
    maps = [
        pictures[name] for name in ("responses", "parallel_coordinates", "pareto_front") if name in pictures
    ]
    if maps:
        sections.append(Section("maps", "Outputs over the parameters", maps))
    if "sensitivities" in pictures:
        said = [
            f"{item['output']}: {item['method']}"
            + (
                ""
                if item["method"] == "whole grid"
                else f", which predicts {item['predicted_share']:.0%} of designs left out"
            )
            for item in summary["sensitivities"]
        ]
        sections.append(Section("sensitivity", "What matters", [pictures["sensitivities"], Bullets(said)]))
    if films:
        film_blocks = sweep_film.film_words(films, pump_limits(summary["constraints"]))
        blocks = [*film_blocks, pictures["film_maps"], pictures["pump_maps"]]
        sections.append(Section("film", "The paper's choice of depth and coolant temperature", blocks))
    sections.append(Section("table", "All designs", _table(rows, parameters, outputs)))
    packages = (words("package", itemgetter(0)), words("version", itemgetter(1)))
    sections.append(Section("versions", "Versions", [table_of(packages, summary["versions"].items())]))
    return sections


def _limits(summary: Mapping[str, Any], outputs: Sequence[Scale]) -> list[Any]:
    scales = {item.path: item for item in outputs}
    lines = []
    for item in summary["constraints"]:
        scale = scales[item["output"]]
        bounds = [
            f"{word} {scale.text(item[key])} {scale.unit}"
            for key, word in (("min", "at least"), ("max", "at most"))
            if item[key] is not None
        ]
        lines.append(f"Limit: {scale.label.split(' / ')[0]} {' and '.join(bounds)}".rstrip() + ".")
    lines += [
        f"Objective: {item['direction']} {scales[item['output']].label.split(' / ')[0]}."
        for item in summary["objectives"]
    ]
    if summary["film_uncertainty"]:
        lines.append(
            "Every design was also solved with its channel film at the low and the high end of what the "
            "correlations leave open; a design is called better only when it is so at its worst end and the "
            "other's best."
        )
    return [Bullets(lines)] if lines else []


def _optimum(
    summary: Mapping[str, Any], rows: Sequence[Row], parameters: Sequence[Scale], outputs: Sequence[Scale]
) -> list[Any]:
    optimum = summary["optimum"]
    by_number = {row["design"]: row for row in rows}
    open_ones = [n for n in optimum["not_certainly_worse"] if n not in optimum["front"]]
    # Folders of earlier versions lack the key.
    alike = optimum.get("within_mesh_error", [])
    blocks: list[Any] = []
    if len(summary["objectives"]) == 1:
        text = f"Design {optimum['front'][0]} is best of those that keep every limit"
    else:
        text = (
            f"{len(optimum['front'])} designs make the front: none of the others beats one in every objective"
        )
    if summary["film_uncertainty"] and open_ones:
        text += f"; but within the band of the film coefficient {len(open_ones)} more may be as good."
        blocks.append(Notice(text))
    else:
        sure = (
            ", also over the whole uncertainty of the film coefficient."
            if summary["film_uncertainty"]
            else "."
        )
        blocks.append(Notice(text + sure, "" if alike else "good"))
    if alike:
        blocks.append(Notice(_alike_words(len(alike), summary["mesh_error_K"])))
    lines = [("best", n) for n in optimum["front"]]
    lines += [("as good within the mesh's error", n) for n in alike[:MOST_ALIKE]]
    lines += [(name, item["design"]) for name, item in summary["references"].items()]
    near = [item["design"] for item in optimum["neighbours"]]
    lines += [("neighbour of the best", number) for number in near if number not in alike[:MOST_ALIKE]]
    fields = (words("what", "what"), *_fields(parameters, outputs))
    compared = [{"what": what, **by_number[n]} for what, n in lines]
    caption = "The best designs, those to compare with, and the nearest ones solved."
    return [*blocks, table_of(fields, compared, caption)]


def _alike_words(number: int, error: float) -> str:
    """What to think of designs that are nearer to the best ones than the mesh's error."""
    many = "1 design more is" if number == 1 else f"{number} designs more are"
    return (
        f"{many} as good as far as this mesh tells: temperatures of designs with meshes of their own may "
        f"differ by {error:g} K because of the mesh alone. Which of them is best, a finer mesh or the other "
        "outputs decide."
    )


def _fields(parameters: Sequence[Scale], outputs: Sequence[Scale]) -> tuple[Field, ...]:
    scales = (*parameters, *outputs)
    shown = (Field(item.label, item.path, item.text, "number") for item in scales)
    return (whole("design", "design"), *shown)


def _table(rows: Sequence[Row], parameters: Sequence[Scale], outputs: Sequence[Scale]) -> list[Any]:
    kept = {"yes": "kept", "no": "broken", None: MISSING}
    fields = (
        *_fields(parameters, outputs),
        words("status", "status"),
        words("limits", lambda row: kept[row["feasible"]]),
        words("answered by", answered_by),
        words("reason", "reason"),
    )
    folded = f"{len(rows)} designs (results.csv has them with all digits)"
    return [table_of(fields, rows, folded=folded)]


def answered_by(row: Row) -> str:
    """Backend that solved a design, with a reduced model's error estimate, and whether its mesh was moved."""
    if row["backend"] is None:
        return MISSING
    error = row["error_estimate_K"]
    answered = row["backend"] if error is None else f"{row['backend']}, within {1e3 * error:.2g} mK"
    return f"{answered}, moved mesh" if row["mesh"] == MOVED else answered


def _explorer(
    summary: Mapping[str, Any], solved: Sequence[Row], parameters: Sequence[Scale], outputs: Sequence[Scale]
) -> dict[str, Any]:
    """Data of the clickable chart: every solved design by every column that is a number."""
    columns = [item for item in (*parameters, *outputs) if not item.words]
    optimum = summary["optimum"]
    return {
        "columns": [item.label for item in columns],
        "start": _start_columns(summary, columns, len(parameters)),
        "front": [] if optimum is None else optimum["front"],
        "designs": [
            {
                "number": row["design"],
                "feasible": row["feasible"] == "yes",
                "values": [
                    None if row[c.path] is None else float(f"{c.factor * row[c.path]:.6g}") for c in columns
                ],
            }
            for row in solved
        ],
    }


def _start_columns(summary: Mapping[str, Any], columns: Sequence[Scale], first_output: int) -> list[int]:
    paths = [item.path for item in columns]
    chosen = [paths.index(item["output"]) for item in summary["objectives"] if item["output"] in paths][:2]
    rest = [*range(min(first_output, len(paths) - 1), len(paths)), 0]
    return [*chosen, *(index for index in rest if index not in chosen), 0, 0][:2]
