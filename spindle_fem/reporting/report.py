"""Files of a finished run, and its self-contained report."""

from __future__ import annotations

import json
import resource
import sys
import time
import tomllib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from spindle_fem.errors import BadInputError
from spindle_fem.reporting import tables
from spindle_fem.reporting.document import Illustration, illustration_of
from spindle_fem.reporting.inputs import input_groups
from spindle_fem.reporting.output import replace_text, require_complete
from spindle_fem.reporting.page import render_page
from spindle_fem.results.summary import SUMMARY_SCHEMA, build_summary

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

    from spindle_fem.results.thermal_result import ThermalResult

FIGURE_FOLDER = "figures"

_SHADED = ("meridian_temperature",)  # a palette would show as bands

OVER_SPEED = "over_speed_"
CAPTIONS = {
    f"{OVER_SPEED}heat_terms": "Friction heat over speed, stacked by term.",
    f"{OVER_SPEED}heat_models": "The same bearings by every heat model: the spread a designer should expect.",
    f"{OVER_SPEED}film_thickness": (
        "Central film: flooded and isothermal (dashed), and as it is at this run's temperatures."
    ),
    f"{OVER_SPEED}film_ratio": "Film thickness over composite roughness; from 3 on the film carries alone.",
    f"{OVER_SPEED}thrust": "Axial load and displacement of the set that carries the thrust.",
    f"{OVER_SPEED}contacts": "Deformation, contact angle and ellipse: inner contact solid, outer dashed.",
    f"{OVER_SPEED}ball_speeds": "Orbit and spin of the balls, centrifugal force and gyroscopic moment.",
    "machine_definition": (
        "The machine as defined: parts by colour, contact lines of the bearings in red, oil in yellow, "
        "surfaces with a film as thick lines, probes as dots."
    ),
    "temperature_cut": "The machine cut open along the vertical plane through its axis.",
    "meridian_temperature": "Temperature in the vertical plane through the axis, dimensions in mm.",
    "axial_profiles": "Temperature along the machine on its main surfaces.",
    "radial_profiles": "Temperature from the bore to the outside through each bearing; steps are joints.",
    "heat_by_bearing": "Friction heat of each bearing by its terms, and the bodies that it enters.",
    "coolant": "Oil along the channel: temperatures, and the film coefficient with its low and high value.",
    "channel_walls": "Walls of the channel, seen without the housing.",
    "heat_balance": "Where the heat comes from and where it goes.",
    "mesh": "The mesh, opened along the vertical plane; colours are parts.",
}

_LIMITS = (
    "Steady state of one operating point; loads, speed and surroundings constant.",
    "Turning parts have one temperature all round in the time mean; standing parts are three-dimensional.",
    "Joints have the constant conductance of the definition, the least certain input of such a model; "
    "seats that close or open with temperature are not followed unless the definition says so.",
    "The balls of a bearing are one body with one temperature; they meet the races through the contact "
    "resistances of the definition.",
    "The film coefficient of the channel is a correlation; its low and high value show what the sources "
    "leave open. Pipes, filter and pump outside the machine are not part of the pressure drop.",
    "Heat of seals, drive, churning and cutting is included only where the definition names it.",
)


def write_outputs(
    result: ThermalResult,
    folder: str | Path,
    *,
    started: float | None = None,
    notify: Callable[[str], None] | None = None,
) -> dict[str, float]:
    """Write every file of a run: fields, data, pictures, machine, summary, report.

    Call it inside :func:`spindle_fem.reporting.output.output_folder`, which
    marks the folder until all of it is there.

    Parameters
    ----------
    result : ThermalResult
    folder : str or Path
        An existing folder.
    started : float, optional
        ``time.perf_counter()`` when the run began, for ``wall_time_s``.
    notify : callable, optional
        Told the name of each step as it begins.

    Returns
    -------
    dict of str to float, [s]
        Time of each step, also in ``summary.json``. Steps ``files: ...`` ran
        beside ``pictures``; ``files`` is what was waited for them.
    """
    from spindle_fem.reporting.beside import start_beside
    from spindle_fem.reporting.interactive import SURFACE_GROUP
    from spindle_fem.results.dataset import read_dataset

    folder = Path(folder)
    figures = folder / FIGURE_FOLDER
    figures.mkdir(exist_ok=True)
    for old in figures.glob("*.png"):
        old.unlink()
    clock = _Clock(notify)
    wait = start_beside(lambda: _write_files(result, folder))
    try:
        with clock.step("pictures"):
            _write_pictures(result, figures)
    finally:  # also after an error nothing must go on writing here
        with clock.step("files"):
            beside = wait()
    with clock.step("report"):
        dataset, surface = (
            read_dataset(folder / "result.nc", group=group) for group in (None, SURFACE_GROUP)
        )
        wall_time = time.perf_counter() - started if started is not None else sum(clock.times.values())
        summary = build_summary(result, wall_time, peak_memory_MB())
        summary["timings_s"] = {**summary["timings_s"], **clock.times, **beside}
        replace_text(
            folder / "summary.json", json.dumps(summary, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
        )
        replace_text(folder / "report.html", render_run_report(summary, dataset, surface, figures))
    return {**clock.times, **beside}


def _write_files(result: ThermalResult, folder: Path) -> dict[str, float]:
    """Everything of a run that needs no rendering; times of its steps."""
    from spindle_fem.reporting.figures import save_png
    from spindle_fem.reporting.interactive import SURFACE_GROUP, display_surface
    from spindle_fem.results.dataset import build_dataset, write_dataset
    from spindle_fem.results.fields import write_fields
    from spindle_fem.spec.load import write_machine

    clock = _Clock(None)
    with clock.step("files: fields"):
        write_fields(result, folder / "fields.vtu")
    with clock.step("files: data"):
        write_dataset(build_dataset(result), folder / "result.nc")
        write_dataset(display_surface(result), folder / "result.nc", group=SURFACE_GROUP)
        replace_text(folder / "machine.toml", write_machine(result.spec))
    with clock.step("files: charts"):
        for name, draw in draw_figures(result).items():
            figure = draw()
            if figure is not None:
                save_png(
                    figure, folder / FIGURE_FOLDER / f"{name}.png", colours=0 if name in _SHADED else 256
                )
    return clock.times


def draw_figures(result: ThermalResult) -> Mapping[str, Callable[[], Figure | None]]:
    """Charts of a run by file name, drawn when called (the 3-D pictures are in ``pictures``)."""
    from spindle_fem.reporting import balance_charts, charts
    from spindle_fem.reporting.heat_charts import CHARTS as HEAT_CHARTS
    from spindle_fem.reporting.machine_drawing import machine_drawing
    from spindle_fem.reporting.profiles import meridian_section, temperature_scale

    section = meridian_section(result.mesh, result.temperature)
    bar = temperature_scale(result)
    study = result.heat_study
    over_speed = (
        {}
        if study is None
        else {f"{OVER_SPEED}{name}": (lambda draw=draw: draw(study)) for name, draw in HEAT_CHARTS.items()}
    )
    return over_speed | {
        "machine_definition": lambda: machine_drawing(result.spec),
        "meridian_temperature": lambda: charts.meridian_temperature(result, section, bar),
        "radial_profiles": lambda: charts.radial_profiles(result, section),
        "axial_profiles": lambda: charts.axial_profiles(result, section),
        "heat_balance": lambda: balance_charts.heat_balance(result.energy, result.bearings),
        "heat_by_bearing": lambda: balance_charts.heat_by_bearing(result),
        "coolant": lambda: (
            None
            if result.coolant is None
            else balance_charts.coolant_along_channel(result.coolant, ports=_wetted_ports(result))
        ),
    }


def _write_pictures(result: ThermalResult, folder: Path) -> None:
    from spindle_fem.reporting import pictures
    from spindle_fem.reporting.figures import save_png
    from spindle_fem.reporting.profiles import meridian_section, temperature_scale
    from spindle_fem.reporting.scenes import SceneRenderer
    from spindle_fem.reporting.surfaces import part_edges

    with SceneRenderer() as renderer:
        bar = temperature_scale(result)
        section = meridian_section(result.mesh, result.temperature)
        pictures.add_half_machine(renderer, result, section, part_edges(result.mesh), bar)
        save_png(
            pictures.temperature_cut(renderer, result, section, bar),
            folder / "temperature_cut.png",
        )
        for name, figure in pictures.bearing_close_ups(renderer, result, bar).items():
            save_png(figure, folder / f"bearings_{name}.png")
        channel = pictures.channel_walls(renderer, result)
        if channel is not None:
            save_png(channel, folder / "channel_walls.png")
        save_png(pictures.mesh_picture(renderer, result), folder / "mesh.png", colours=192)


def rebuild_report(folder: str | Path) -> Path:
    """Write ``report.html`` of a finished run again, from its other files.

    Parameters
    ----------
    folder : str or Path
        With ``summary.json``, ``result.nc`` and ``figures``.

    Returns
    -------
    Path
        Of the report.

    Raises
    ------
    BadInputError
        The folder is missing or incomplete, or a file is missing or unknown.
    """
    from spindle_fem.reporting.interactive import SURFACE_GROUP
    from spindle_fem.results.dataset import read_dataset

    folder = require_complete(folder)
    summary = read_summary(folder / "summary.json")
    dataset = read_dataset(folder / "result.nc")
    surface = read_dataset(folder / "result.nc", group=SURFACE_GROUP)
    html = render_run_report(summary, dataset, surface, folder / FIGURE_FOLDER)
    return replace_text(folder / "report.html", html)


def read_summary(path: Path) -> dict[str, Any]:
    """Content of ``summary.json``.

    Raises
    ------
    BadInputError
        No such file, no JSON, or another schema.
    """
    try:
        summary = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise BadInputError(
            str(path), f"cannot be read ({error.strerror}).", "Give the folder of a run."
        ) from error
    except json.JSONDecodeError as error:
        raise BadInputError(
            str(path), f"is not valid JSON: {error}.", "Run again to write it anew."
        ) from error
    schema = summary.get("schema") if isinstance(summary, dict) else None
    if schema != SUMMARY_SCHEMA:
        raise BadInputError(str(path), f"schema is {schema!r}.", f'Known: "{SUMMARY_SCHEMA}".')
    return summary


def render_run_report(
    summary: Mapping[str, Any], dataset: xr.Dataset, surface: xr.Dataset | None, figures: Path
) -> str:
    """HTML of a run; everything it needs is inside."""
    from spindle_fem.reporting.interactive import viewer_payload

    definition = tomllib.loads(dataset.attrs["machine_definition_toml"])
    view = None if surface is None else json.dumps(viewer_payload(surface)).replace("</", "<\\/")
    failed = [item["name"] for item in summary.get("checks", ()) if not item["passed"]]
    has_bearings, coolant = bool(summary["bearings"]), tables.coolant_table(summary)
    sections = [
        ("headline", "Headline numbers", True),
        ("answers", "What this answers", True),
        ("temperature", "Temperature field", True),
        ("bearings", "Bearings", has_bearings),
        ("over_speed", "Bearings over speed", any(figures.glob(f"{OVER_SPEED}*.png"))),
        ("coolant", "Coolant", coolant is not None),
        ("balance", "Energy balance", True),
        ("probes", "Probes, joints and surfaces", True),
        ("checks", "Checks", True),
        ("inputs", "Inputs", True),
        ("limits", "Limits of validity", True),
        ("versions", "Versions", True),
    ]
    return render_page(
        "run.html.j2",
        kind="Thermal run",
        title=dataset.attrs["title"],
        subtitle=_subtitle(definition),
        sections=[{"id": key, "title": title} for key, title, shown in sections if shown],
        headline=tables.headline(summary),
        warnings=summary["warnings"],
        failed_checks=failed,
        imbalance=tables.significant(abs(summary["energy"]["imbalance_relative"]), 2),
        figures=embed_figures(figures, CAPTIONS),
        over_speed_captions=tuple(name for name in CAPTIONS if name.startswith(OVER_SPEED)),
        view3d=view,
        bearings=tables.bearing_table(summary),
        terms=tables.term_table(summary),
        coolant=coolant,
        balance=tables.balance_table(summary),
        probes=tables.probe_table(summary),
        joints=tables.joint_table(summary),
        surfaces=tables.surface_table(dataset),
        checks=tables.check_table(summary),
        mesh=tables.mesh_table(summary),
        inputs=input_groups(definition, dataset.attrs.get("machine_defaults", "").split("\n")),
        limits=_LIMITS,
        versions=tables.version_table(summary, dataset.attrs),
        sources=[line for line in str(dataset.attrs.get("sources", "")).split("\n") if line],
    )


def embed_figures(folder: Path, captions: Mapping[str, str]) -> dict[str, Illustration | None]:
    """Figures of a folder for the page, by name; None for a captioned one that is absent."""
    embedded: dict[str, Illustration | None] = dict.fromkeys(captions)
    for path in sorted(folder.glob("*.png")):
        embedded[path.stem] = illustration_of(path, captions.get(path.stem) or _caption(path.stem))
    return embedded


def _caption(stem: str) -> str:
    kind, _, name = stem.partition("_")
    if kind == "bearings" and name:
        return f"Bearing set {name}: where its heat goes, and the temperatures of races and balls."
    return stem.replace("_", " ").capitalize() + "."


def peak_memory_MB() -> float:  # noqa: N802 - the unit belongs to the name
    """Largest resident memory of this process so far."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (1024.0**2 if sys.platform == "darwin" else 1024.0)


def _wetted_ports(result: ThermalResult) -> bool:
    channel = result.spec.channel
    return channel is not None and channel.ports is not None and channel.ports.wetted


def _subtitle(definition: Mapping[str, Any]) -> str:
    from spindle_fem.reporting.inputs import customary

    operation = definition["operation"]
    parts = [customary(operation["speed"]), f"thrust {customary(operation['thrust'])}"]
    parts.append(f"ambient {customary(operation['ambient_temperature'])}")
    coolant = definition.get("coolant")
    if coolant:
        parts.append(f"coolant {customary(coolant['flow'])} at {customary(coolant['inlet_temperature'])}")
    parts.append(f"heat model “{definition['heat']['model']}”")
    return ", ".join(parts) + "."


class _Clock:
    def __init__(self, notify: Callable[[str], None] | None) -> None:
        self.times: dict[str, float] = {}
        self._notify = notify
        self._name = ""
        self._start = 0.0

    def step(self, name: str) -> _Clock:
        self._name = name
        return self

    def __enter__(self) -> None:
        if self._notify is not None:
            self._notify(self._name)
        self._start = time.perf_counter()

    def __exit__(self, *_: object) -> None:
        self.times[self._name] = time.perf_counter() - self._start
