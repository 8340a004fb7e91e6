"""Every file of a run, written by this process and three that were started beside it.

One draws the pictures, one works out and draws the bearings over speed, one draws the charts and writes
the data and the page; they load what they need, and do what depends on definition and mesh alone, while
the machine is still solved. This file itself loads little: it is read before they are started.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from spindle_fem.parallel import BackgroundProcess
from spindle_fem.report.run_figures import FIGURE_FOLDER, OVER_SPEED, caption_of, in_order
from spindle_fem.results.output_folder import replace_text

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure
    from PIL.Image import Image

    from spindle_fem.definition.machine_spec import MachineSpec
    from spindle_fem.machine.meshing.tagged_mesh import TaggedMesh
    from spindle_fem.model.elastic.deformed_shape import BodyShape
    from spindle_fem.operation.bearing_heat import BearingTemperatures
    from spindle_fem.physics.bearings.seat_contact import SeatBodies
    from spindle_fem.report.block_page import Illustration
    from spindle_fem.report.drawn_surfaces import SegmentSet
    from spindle_fem.report.profiles import MeridianSection
    from spindle_fem.results.thermal_result import ThermalResult

_SHADED = ("meridian_temperature", "deformed_machine", "deformed_section")  # a palette would show as bands
_MESH_COLOURS = 192
_CHART_COLOURS = 256


class OutputHelpers:
    """The processes that write a run's files beside this one; use as a context manager.

    Start them before the machine is meshed and solved: what they load then
    costs no time. The first is started at once, the others by :meth:`start_charts`.
    """

    def __init__(self) -> None:
        # A copy of a process that has drawn would share the threads of its renderer without having them.
        self._pictures = BackgroundProcess(_PictureWorker, beside=_no_renderer())
        self._charts: BackgroundProcess | None = None
        self._over_speed: BackgroundProcess | None = None
        self._waiting: dict[str, Callable[[], Any]] = {}
        self._begun: Path | None = None

    def __enter__(self) -> OutputHelpers:
        return self

    def __exit__(self, *_: object) -> None:
        for process in (self._pictures, self._charts, self._over_speed):
            if process is not None:
                process.close()

    def start_charts(self) -> None:
        """Start what draws charts and writes data, as copies of this process.

        What this process has loaded until then, the solver above all, they need not load again.
        """
        self._charts = self._charts or BackgroundProcess(_ChartWorker)
        self._over_speed = self._over_speed or BackgroundProcess(_OverSpeedWorker)

    def prepare(self, spec: MachineSpec, mesh: TaggedMesh, n_unknowns: int) -> None:
        """Start the work that needs only mesh and definition."""
        self.start_charts()
        self._pictures.ask("prepare", mesh, n_unknowns)
        self._charts.ask("draw_definition", spec)

    def begin(self, result: ThermalResult, folder: Path) -> None:
        """Write pictures, data and charts of a result, all but those of growth."""
        figures = folder / FIGURE_FOLDER
        figures.mkdir(exist_ok=True)
        for old in figures.glob("*.png"):
            old.unlink()
        self.start_charts()
        # what growth is worked out with is large, and not for other processes
        plain = replace(result, growth_model=None)
        self._begun = folder
        self._waiting["pictures"] = self._pictures.ask("write", plain, figures)
        self._waiting["data"] = self._charts.ask("write_data", plain, folder)
        self._waiting["charts"] = self._charts.ask("write_charts")
        if result.spec.heat.model != "table" and result.bearing_temperatures:
            growth = result.growth_model
            seats = None if growth is None else growth.seating.of_sets(result.spec)
            known = dict(result.bearing_temperatures), seats
            self._waiting["over speed"] = self._over_speed.ask("write", result.spec, *known, figures)

    def begun_in(self, folder: Path) -> bool:
        """Whether a result's files are being written to this folder."""
        return self._begun == folder

    def draw_growth(self, shapes: Mapping[str, BodyShape], section: MeridianSection | None) -> None:
        """Write how the bodies of the result begun have grown; ``section`` with displacements."""
        self._waiting["growth"] = self._charts.ask("write_growth", dict(shapes), section)

    def wait(self) -> dict[str, float]:
        """Wait for all that was begun; seconds of each part."""
        return {f"in parallel: {name}": answer() for name, answer in self._waiting.items()}

    def write_report(self, summary: dict[str, Any]) -> None:
        """Write the page of the result begun."""
        pictures = self._pictures.ask("illustrations")() | self._over_speed.ask("illustrations")()
        self._charts.ask("write_report", summary, pictures)()


def write_outputs(
    result: ThermalResult,
    folder: str | Path,
    *,
    started: float | None = None,
    notify: Callable[[str], None] | None = None,
    helpers: OutputHelpers | None = None,
) -> dict[str, float]:
    """Write every file of a run: fields, data, pictures, machine, summary, report.

    Call it inside :func:`spindle_fem.results.output_folder.output_folder`, which
    marks the folder until all of it is there.

    Parameters
    ----------
    folder : str or Path
        An existing folder.
    started : float, optional
        ``time.perf_counter()`` when the run began, for ``wall_time_s``.
    notify : callable, optional
        Called with the name of each step as it begins.
    helpers : OutputHelpers, optional
        Started before, perhaps with this result begun in this folder; started
        here when not given.

    Returns
    -------
    dict of str to float, [s]
        Time of each step, also in ``summary.json``. Steps ``in parallel: ...`` ran
        in other processes; ``pictures`` is what was waited for them.
    """
    if helpers is None:
        with OutputHelpers() as own:
            return write_outputs(result, folder, started=started, notify=notify, helpers=own)
    from spindle_fem.report.profiles import displacement_section
    from spindle_fem.results.field_file import write_fields
    from spindle_fem.results.run_summary import build_summary, peak_memory_MB

    folder = Path(folder)
    clock = _Clock(notify)
    if not helpers.begun_in(folder):
        helpers.begin(result, folder)
    try:
        with clock.step("fields"):
            helpers.draw_growth(result.shapes, displacement_section(result))
            write_fields(result, folder / "fields.vtu")
    finally:  # also after an error nothing must go on writing here
        with clock.step("pictures"):
            beside = helpers.wait()
    with clock.step("report"):
        wall_time = time.perf_counter() - started if started is not None else sum(clock.times.values())
        summary = build_summary(result, wall_time, peak_memory_MB())
        summary["timings_s"] = {**summary["timings_s"], **clock.times, **beside}
        replace_text(
            folder / "summary.json", json.dumps(summary, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
        )
        helpers.write_report(summary)
    return {**clock.times, **beside}


class _PictureWorker:
    """Draws the three-dimensional pictures."""

    def __init__(self) -> None:
        from spindle_fem.report import run_pictures as pictures
        from spindle_fem.report.scenes import SceneRenderer

        self._pictures = pictures
        self._renderer = SceneRenderer()
        self._renderer.open()
        self._mesh_image: Image | None = None
        self._edges: SegmentSet | None = None
        self._drawn: dict[str, Illustration] = {}

    def prepare(self, mesh: TaggedMesh, n_unknowns: int) -> None:
        """Draw the mesh and find the edges of its parts."""
        from spindle_fem.report.drawn_surfaces import part_edges
        from spindle_fem.report.figure_style import image_of

        figure = self._pictures.mesh_picture(self._renderer, mesh, n_unknowns)
        self._mesh_image = image_of(figure, colours=_MESH_COLOURS)
        self._renderer.clear()
        self._edges = part_edges(mesh)

    def write(self, result: ThermalResult, figures: Path) -> float:
        """Write every picture; return the seconds it took."""
        from spindle_fem.report.figure_style import image_of
        from spindle_fem.report.profiles import meridian_section, temperature_scale

        began = time.perf_counter()
        try:
            if self._mesh_image is None:
                self.prepare(result.mesh, result.n_unknowns)
            pictures, renderer = self._pictures, self._renderer
            bar = temperature_scale(result)
            section = meridian_section(result.mesh, result.temperature)
            pictures.add_half_machine(renderer, result, section, self._edges, bar)
            drawn = {"temperature_cut": pictures.temperature_cut(renderer, result, section, bar)}
            for name, figure in pictures.bearing_close_ups(renderer, result, bar).items():
                drawn[f"bearings_{name}"] = figure
            channel = pictures.channel_walls(renderer, result)
            if channel is not None:
                drawn["channel_walls"] = channel
        finally:
            self._renderer.close()
        images = {name: image_of(figure) for name, figure in drawn.items()} | {"mesh": self._mesh_image}
        self._drawn = {name: _write(image, name, figures) for name, image in images.items()}
        return time.perf_counter() - began

    def illustrations(self) -> dict[str, Illustration]:
        """The pictures for the page."""
        return self._drawn


class _OverSpeedWorker:
    """Works out and draws the bearings over speed, at the temperatures of a result."""

    def __init__(self) -> None:
        from spindle_fem.report import heat_charts
        from spindle_fem.studies.heat_study import heat_study

        self._heat_study, self._charts = heat_study, heat_charts.CHARTS
        self._drawn: dict[str, Illustration] = {}

    def write(
        self,
        spec: MachineSpec,
        temperatures: Mapping[str, BearingTemperatures],
        seats: Mapping[str, SeatBodies] | None,
        figures: Path,
    ) -> float:
        """Write the charts, none where no speed examined has an equilibrium; return the seconds."""
        from spindle_fem.report.figure_style import image_of

        began = time.perf_counter()
        study = self._heat_study(spec, temperatures=temperatures, seats=seats)
        for name, draw in self._charts.items() if study["models"] else ():
            figure = draw(study)
            if figure is not None:
                name = f"{OVER_SPEED}{name}"
                self._drawn[name] = _write(image_of(figure, colours=_CHART_COLOURS), name, figures)
        return time.perf_counter() - began

    def illustrations(self) -> dict[str, Illustration]:
        """The charts for the page."""
        return self._drawn


class _ChartWorker:
    """Draws the charts, writes data and machine, and puts the page together."""

    def __init__(self) -> None:
        # what is loaded now is not waited for later
        import h5netcdf  # noqa: F401
        import jinja2  # noqa: F401
        import xarray  # noqa: F401

        import spindle_fem.report.growth_chart
        import spindle_fem.report.machine_drawing
        import spindle_fem.report.run_report  # noqa: F401

        self._folder = Path()
        self._result: ThermalResult | None = None
        self._definition: Image | None = None
        self._dataset: xr.Dataset | None = None
        self._surface: xr.Dataset | None = None
        self._drawn: dict[str, Illustration] = {}

    def draw_definition(self, spec: MachineSpec) -> None:
        """Draw the machine as defined."""
        from spindle_fem.report.figure_style import image_of
        from spindle_fem.report.machine_drawing import machine_drawing

        self._definition = image_of(machine_drawing(spec), colours=_CHART_COLOURS)

    def write_data(self, result: ThermalResult, folder: Path) -> float:
        """Write the data and the machine; seconds."""
        from spindle_fem.definition.load import write_machine
        from spindle_fem.report.interactive_view import SURFACE_GROUP, display_surface
        from spindle_fem.results.dataset import build_dataset, write_dataset

        began = time.perf_counter()
        self._result, self._folder = result, folder
        self._dataset, self._surface = build_dataset(result), display_surface(result)
        write_dataset(self._dataset, folder / "result.nc")
        write_dataset(self._surface, folder / "result.nc", group=SURFACE_GROUP)
        replace_text(folder / "machine.toml", write_machine(result.spec))
        return time.perf_counter() - began

    def write_charts(self) -> float:
        """Write the charts of the result; seconds."""
        began = time.perf_counter()
        if self._definition is None:
            self.draw_definition(self._result.spec)
        self._keep(self._definition, "machine_definition")
        self._write_all(draw_charts(self._result))
        return time.perf_counter() - began

    def write_growth(self, shapes: Mapping[str, BodyShape], section: MeridianSection | None) -> float:
        """Write the growth of the bodies and pictures of the deformed machine; return the seconds."""
        from spindle_fem.model.elastic.deformed_shape import still_place
        from spindle_fem.report.growth_chart import deformed_machine, deformed_section
        from spindle_fem.results.dataset import write_dataset
        from spindle_fem.results.growth_file import GROWTH_GROUP, growth_dataset

        began = time.perf_counter()
        if shapes:
            write_dataset(growth_dataset(shapes), self._folder / "result.nc", group=GROWTH_GROUP)
        spec = self._result.spec
        self._write_all(
            {
                "deformed_machine": lambda: deformed_machine(shapes, still_place(spec)),
                "deformed_section": lambda: deformed_section(section, still_place(spec, solid=True)),
            }
        )
        return time.perf_counter() - began

    def write_report(self, summary: dict[str, Any], pictures: Mapping[str, Illustration]) -> None:
        """Write the page."""
        from spindle_fem.report.run_report import render_run_report

        illustrations = in_order({**self._drawn, **pictures})
        page = render_run_report(summary, self._dataset, self._surface, illustrations)
        replace_text(self._folder / "report.html", page)

    def _write_all(self, charts: Mapping[str, Callable[[], Figure | None]]) -> None:
        from spindle_fem.report.figure_style import image_of

        for name, draw in charts.items():
            figure = draw()
            if figure is not None:
                self._keep(image_of(figure, colours=0 if name in _SHADED else _CHART_COLOURS), name)

    def _keep(self, image: Image, name: str) -> None:
        self._drawn[name] = _write(image, name, self._folder / FIGURE_FOLDER)


def draw_charts(result: ThermalResult) -> Mapping[str, Callable[[], Figure | None]]:
    """Charts of a result by file name, drawn when called: not those over speed nor of the definition."""
    from spindle_fem.report import balance_charts
    from spindle_fem.report import run_charts as charts
    from spindle_fem.report.profiles import meridian_section, temperature_scale

    section = meridian_section(result.mesh, result.temperature)
    bar = temperature_scale(result)
    return {
        "meridian_temperature": lambda: charts.meridian_temperature(result, section, bar),
        "radial_profiles": lambda: charts.radial_profiles(result, section),
        "axial_profiles": lambda: charts.axial_profiles(result, section),
        "heat_balance": lambda: balance_charts.heat_balance(result.energy, result.bearings, result.circuits),
        "heat_by_bearing": lambda: balance_charts.heat_by_bearing(result),
        "coolant": lambda: (
            None
            if result.coolant is None
            else balance_charts.coolant_along_channel(result.coolant, ports=_wetted_ports(result))
        ),
    }


def _write(image: Image, name: str, figures: Path) -> Illustration:
    from spindle_fem.report.block_page import illustration_of
    from spindle_fem.report.figure_style import write_png

    write_png(image, figures / f"{name}.png")
    return illustration_of(image, caption_of(name))


def _no_renderer() -> bool:
    return "vtkmodules" not in sys.modules


def _wetted_ports(result: ThermalResult) -> bool:
    channel = result.spec.channel
    return channel is not None and channel.ports is not None and channel.ports.wetted


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
