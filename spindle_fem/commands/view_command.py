"""The function behind ``spindle-fem view``: the interactive page of a result folder."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.load import load_machine, read_definition
from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.definition.network_load import is_network_machine, load_network_machine
from spindle_fem.definition.network_tables import NetworkMachineSpec
from spindle_fem.errors import BadInputError, SpindleFemError
from spindle_fem.report.block_page import Interactive, Section, render_document
from spindle_fem.report.growth_chart import exaggeration
from spindle_fem.report.machine_scene import (
    Solid,
    bearing_balls,
    network_scene,
    probes_of,
    read_run_fields,
    solid_scene,
    table_times,
)
from spindle_fem.report.recorded_scene import MOST_FRAMES, READ, Course, read_course
from spindle_fem.report.viewed_scene import Curve, Layer, Scene
from spindle_fem.results.growth_file import GROWTH_GROUP, growth_dataset, has_growth, shift_of_points
from spindle_fem.results.output_folder import read_content, reading_results, replace_text, require_complete
from spindle_fem.units import ZERO_CELSIUS_K

Array = NDArray[np.float64]
Progress = Callable[[str], None]
PAGE = "view.html"
TEMPERATURE = "temperature"
BEFORE, AFTER = "before", "after"
CHANGE = "after less before"
LEFT_BEFORE, LEFT_AFTER = "read less before", "read less after"


def view_folder(
    folder: str | Path, *, design: int | None = None, progress: Progress = lambda stage: None
) -> Path:
    """Write ``view.html`` of a finished folder: one file that needs no network and no other.

    Parameters
    ----------
    folder : str or Path
        Of ``run``, ``transient``, ``sweep``, ``simulate`` or ``diagnose``.
    design : int, optional
        Which design of a sweep; its optimum when absent.
    progress : callable
        Called with the name of each stage as it begins.

    Returns
    -------
    Path
        Of the page.

    Raises
    ------
    BadInputError
        The folder holds no results of these, is marked incomplete, or a file is missing or unknown.
    """
    place = require_complete(folder)
    kinds = {
        "diagnosis.json": ("Diagnosis", _diagnosis),
        "simulation.json": ("Simulation", _simulation),
        "sweep.json": ("Sweep", _sweep),
        "transient.json": ("Transient", _transient),
        "summary.json": ("Thermal run", _run),
    }
    found = next((name for name in kinds if (place / name).is_file()), None)
    if found is None:
        raise BadInputError(
            str(place),
            "holds nothing that a view could show.",
            "Give a folder of run, transient, sweep, simulate or diagnose.",
        )
    if design is not None and found != "sweep.json":
        raise BadInputError("--design", "the folder is not of a sweep.", "Leave it out.")
    kind, build = kinds[found]
    with reading_results(place):
        title, scene = build(place, design, progress)
    progress("page")
    view = Interactive("viewer.html.j2", "viewer.js", scene.payload())
    page = render_document(kind, title, [Section("machine", "", [view])])
    return replace_text(place / PAGE, page)


# ------------------------------------------------------------------ fields that are there, or a solve away
def _run(place: Path, _design: int | None, _progress: Progress) -> tuple[str, Scene]:
    from spindle_fem.results.dataset import read_dataset

    solid, temperature = read_run_fields(place / "fields.vtu")
    spec = load_machine(place / "machine.toml")
    data = read_dataset(place / "result.nc")
    growth = (
        read_dataset(place / "result.nc", group=GROWTH_GROUP) if has_growth(place / "result.nc") else None
    )
    scene = _steady_scene(spec, solid, temperature, growth)
    balls, probes = {}, {}
    if "bearing" in data.coords:
        balls = _named(data["bearing"].values, data["bearing_temperature_ball"].values)
    if "probe" in data.coords:
        probes = _named(data["probe"].values, data["probe_temperature"].values)
    return data.attrs["title"], _with_readings(scene, spec, balls, probes)


def _named(names: Any, values: Array) -> dict[str, dict[str, Array]]:
    """Temperatures by name in the form that the spheres of a steady scene need."""
    return {
        str(name): {TEMPERATURE: np.array([float(value)])} for name, value in zip(names, values, strict=True)
    }


def _steady_scene(spec: MachineSpec, solid: Solid, temperature: Array, growth: Any) -> Scene:
    shift, factor = None, 1.0
    if growth is not None:
        shift = shift_of_points(growth, solid.points, solid.part_of_point, solid.part_names)
        largest = float(np.linalg.norm(shift, axis=1).max())
        if largest > 0.0:
            factor = exaggeration(largest, float(np.ptp(solid.points[:, 2])))
    scene = solid_scene(solid, {TEMPERATURE: temperature[None]}, shift=shift, exaggeration=factor)
    if shift is None:
        return scene
    from spindle_fem.model.elastic.deformed_shape import still_place

    note = (
        f"Growth is the mean round the axis against {still_place(spec)}, bending left out; covers move "
        "with the housing, balls and probes stay where they are drawn."
    )
    return replace(scene, notes=(note,))


def _with_readings(
    scene: Scene, spec: MachineSpec, balls: dict[str, dict[str, Array]], probes: dict[str, dict[str, Array]]
) -> Scene:
    return replace(scene, balls=bearing_balls(spec, balls), places=probes_of(spec, scene, probes))


def _sweep(place: Path, design: int | None, progress: Progress) -> tuple[str, Scene]:
    from spindle_fem.studies.solve_machine import solve
    from spindle_fem.studies.sweep.file_names import SWEEP_SCHEMA
    from spindle_fem.studies.sweep.results_table import read_results

    summary = read_content(place / "sweep.json", SWEEP_SCHEMA, "sweep")
    rows = {int(row["design"]): row for row in read_results(place) if row["status"] == "ok"}
    optimum = None if summary["optimum"] is None else int(summary["optimum"]["front"][0])
    number = optimum if design is None else design
    if number not in rows:
        what = (
            "has no optimum: it has no objective." if number is None else f"design {number} was not solved."
        )
        raise BadInputError(str(place), what, f"Give --design, one of: {', '.join(map(str, sorted(rows)))}.")
    row = rows[number]
    parameters = summary["parameters"]
    values = {item["path"]: f"{row[item['path']]} {item['unit']}".strip() for item in parameters}
    progress(f"design {number}")
    result = solve(load_machine(place / "machine.toml", [f"{path}={text}" for path, text in values.items()]))
    growth = growth_dataset(result.shapes) if result.shapes else None
    solid = Solid.of(result.mesh)
    scene = _steady_scene(result.spec, solid, result.temperature - ZERO_CELSIUS_K, growth)
    balls = _named(
        result.bearings, [item.temperature_ball - ZERO_CELSIUS_K for item in result.bearings.values()]
    )
    probes = _named(result.probes, [value - ZERO_CELSIUS_K for value in result.probes.values()])
    scene = _with_readings(scene, result.spec, balls, probes)
    said = ", ".join(f"{item['path']} {_short(row[item['path']])} {item['unit']}" for item in parameters)
    which = "the optimum" if number == optimum else "as asked"
    return summary["study"], replace(scene, notes=(f"Design {number}, {which}: {said}.", *scene.notes))


def _short(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _transient(place: Path, _design: int | None, progress: Progress) -> tuple[str, Scene]:
    from spindle_fem.results.field_series import read_series

    summary = json.loads((place / "transient.json").read_text(encoding="utf-8"))
    spec = load_machine(place / "machine.toml")
    times, columns = _transient_table(place / "transient.csv")
    path = place / "fields.vtkhdf"
    notes: tuple[str, ...] = ()
    if path.is_file():
        arrays, names = read_series(path)
        chosen = table_times(len(arrays["times"]), MOST_FRAMES)
        shown, fields = arrays["times"][chosen], arrays["temperature"][chosen].astype(np.float64)
        solid = Solid(arrays["points"], arrays["tetrahedra"], arrays["part"], names)
        if len(chosen) < len(arrays["times"]):
            notes = (f"{len(chosen)} of {len(arrays['times'])} fields are shown.",)
    else:
        solid, fields, time = _last_state(place, spec, progress)
        shown = np.array([time])
        notes = (
            'Only the last field was kept; with fields_every = "10 min" a study keeps fields over time.',
        )
    scene = solid_scene(solid, {TEMPERATURE: fields}, shown)
    at_shown = {name: np.interp(shown, times, values) for name, values in columns.items()}
    balls = {
        bearing.name: {TEMPERATURE: at_shown[f"{bearing.name}_balls_degC"]}
        for _, bearing in spec.bearings
        if f"{bearing.name}_balls_degC" in at_shown
    }
    probes = {
        probe.name: {TEMPERATURE: at_shown[f"{probe.name}_degC"]}
        for probe in spec.probe
        if f"{probe.name}_degC" in at_shown
    }
    histories = {name: (Curve(TEMPERATURE, times, columns[f"{name}_degC"]),) for name in probes}
    return str(summary["study"]), replace(
        _with_readings(scene, spec, balls, probes), histories=histories, notes=notes
    )


def _transient_table(path: Path) -> tuple[Array, dict[str, Array]]:
    try:
        with path.open(encoding="utf-8", newline="") as stream:
            header, *rows = csv.reader(stream)
        table = np.array(rows, dtype=np.float64)
        return table[:, 0], {name: table[:, column] for column, name in enumerate(header)}
    except (OSError, ValueError, IndexError) as error:
        raise BadInputError(
            str(path), f"cannot be read ({error}).", "Run spindle-fem transient again."
        ) from error


def _last_state(place: Path, spec: MachineSpec, progress: Progress) -> tuple[Solid, Array, float]:
    """Field at the end of a transient that kept no others."""
    from spindle_fem.model.mesh.evaluate import temperature_at_nodes
    from spindle_fem.solvers.machine_transient import require_state
    from spindle_fem.solvers.prepared_machine import prepare_machine
    from spindle_fem.solvers.saved_state import load_state

    state, _ = load_state(place / "state.npz")
    machine = prepare_machine(spec, progress=progress)
    require_state(machine, state)
    field = temperature_at_nodes(machine.operators, state.temperature) - ZERO_CELSIUS_K
    return Solid.of(machine.mesh), field[None], float(state.time)


# ------------------------------------------------------------------ recordings
def _simulation(place: Path, _design: int | None, progress: Progress) -> tuple[str, Scene]:
    content = json.loads((place / "simulation.json").read_text(encoding="utf-8"))
    course = read_course(place / "simulation.nc", "simulate")
    machine = place / "calibrated_machine.toml"
    machine = machine if machine.is_file() else place / "machine.toml"
    return str(content["recording"]), _recorded(course, {"model": machine}, progress)


def _diagnosis(place: Path, _design: int | None, progress: Progress) -> tuple[str, Scene]:
    from spindle_fem.inference.diagnosis_content import SCHEMA

    content = read_content(place / "diagnosis.json", SCHEMA, "diagnose")
    course = read_course(place / "diagnosis.nc", "diagnose")
    scene = _recorded(
        course, {BEFORE: place / "machine.toml", AFTER: place / "improved_machine.toml"}, progress
    )
    found = [item["statement"] for item in content["findings"]]
    notes = (f"Verdict: {content['verdict'].replace('_', ' ')}.", *found, *scene.notes)
    return f"Diagnosis of {content.get('machine', 'a machine')}", replace(scene, notes=notes)


def _recorded(course: Course, machines: dict[str, Path], progress: Progress) -> Scene:
    """Scene of a recording: the field of every machine along it, what probes read and should have read.

    Parameters
    ----------
    machines : dict of str to Path
        Definitions by the name of their layer.
    """
    for path in machines.values():
        if not path.is_file():
            raise BadInputError(
                str(path),
                "there is no such file: the folder is of an earlier version.",
                "Run the command again.",
            )
    times = course.times[course.frames]
    kept = (
        {LEFT_BEFORE: "before", LEFT_AFTER: "after"}
        if AFTER in machines
        else {"read less model": "predicted"}
    )
    values = course.at_frames(times, kept)
    notes = ("Of several recordings the first is shown.",) if course.several else ()
    last = next(reversed(machines.values()))
    if is_network_machine(read_definition(last)):
        none = np.zeros((len(times), 0))
        layers = [Layer(name, "°C", none) for name in (READ, *course.predictions.values())]
        layers += [Layer(name, "K", none, difference=True) for name in kept]
        spec = load_network_machine(last)
        values |= _boundary_values(spec, course, times)
        scene = network_scene(spec, tuple(layers), times, values)
        return replace(scene, histories=course.histories(), notes=notes)
    scene, said = _fields_along(course, machines, times, progress)
    notes = (*notes, *said)
    none = np.zeros((len(times), 0))
    beside = (
        *([] if READ in {layer.name for layer in scene.layers} else [Layer(READ, "°C", none)]),
        *(Layer(name, "K", none, difference=True) for name in kept),
    )
    spec = load_machine(last)
    if CHANGE in {layer.name for layer in scene.layers}:
        for layers in values.values():
            layers[CHANGE] = layers[AFTER] - layers[BEFORE]
    scene = replace(scene, layers=(*scene.layers, *beside), histories=course.histories(), notes=notes)
    return replace(scene, places=probes_of(spec, scene, values))


def _boundary_values(spec: NetworkMachineSpec, course: Course, times: Array) -> dict[str, dict[str, Array]]:
    """Temperatures of boundaries that an input gives, the same in every layer that is no difference."""
    inputs = course.inputs
    found = {}
    for item in spec.network.boundary:
        if item.temperature in inputs.names:
            column = inputs.values[:, inputs.names.index(item.temperature)] - ZERO_CELSIUS_K
            shown = np.interp(times, inputs.times, column)
            found[item.name] = dict.fromkeys((READ, *course.predictions.values()), shown)
    return found


def _fields_along(
    course: Course, machines: dict[str, Path], times: Array, progress: Progress
) -> tuple[Scene, tuple[str, ...]]:
    """Machine with its field along a recording; grey, and why, where the full model cannot follow it."""
    from spindle_fem.inference.full_model_check import COARSE, spec_on
    from spindle_fem.solvers.prepared_machine import prepare_machine
    from spindle_fem.studies.recorded_fields import fields_of_recording

    specs = {name: load_machine(path) for name, path in machines.items()}
    fields: dict[str, Array] = {}
    mesh = None
    try:
        for name, spec in specs.items():
            progress(f"fields: {name}")
            run = fields_of_recording(spec, course.inputs, course.first_reading, times, progress)
            if mesh is not None and mesh.digest != run.mesh.digest:
                raise BadInputError(name, "has another geometry.", "Views compare machines of one mesh.")
            mesh, fields[name] = run.mesh, run.temperature
    except SpindleFemError as error:
        prepared = prepare_machine(spec_on(next(reversed(specs.values())), COARSE))
        none = np.zeros((len(times), 0))
        layers = tuple(Layer(name, "°C", none) for name in (READ, *course.predictions.values()))
        scene = replace(solid_scene(Solid.of(prepared.mesh), {}, times), layers=layers)
        return scene, (
            f"The machine is grey, because its field along the recording was not worked out: {error}",
        )
    changes = {CHANGE: fields[AFTER] - fields[BEFORE]} if AFTER in fields else {}
    scene = solid_scene(Solid.of(mesh), fields, times, differences=changes)
    note = (
        "Fields are of the full model on the coarse mesh under the recorded inputs; probes show what the "
        "recording has. What belongs to a sensor alone changes no field."
    )
    if AFTER in fields:
        note += " Before is the machine as defined; after has what was found and parameters as fitted."
    return scene, (note,)
