"""One function behind each command; everything the command line does is here to call."""

from __future__ import annotations

import contextlib
import re
import time
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from spindle_fem.definition.load import load_machine
from spindle_fem.errors import BadInputError, FaultsError, SpecError, SpindleFemError
from spindle_fem.units import ZERO_CELSIUS_K, to_si

if TYPE_CHECKING:
    from spindle_fem.definition.effect_entries import EffectEntry
    from spindle_fem.definition.machine_spec import MachineSpec
    from spindle_fem.definition.network_tables import NetworkMachineSpec
    from spindle_fem.units import Uncertain


def run_machine(
    machine: str | Path,
    folder: Path,
    *,
    overrides: Iterable[str] = (),
    estimate_mesh_error: bool = False,
    progress: bool = False,
) -> dict[str, Any]:
    """Solve a machine and write summary, fields, pictures and report.

    Parameters
    ----------
    machine : str or Path
        A definition file, or the name of a machine that ships.
    folder : Path
        Made when missing; complete, or marked incomplete.
    overrides : iterable of str
        ``path=value`` texts.
    estimate_mesh_error : bool
        Solve on a second mesh with elements half as large again, and report
        how far the probes move.
    progress : bool
        Show the stage on the terminal.

    Returns
    -------
    dict
        The summary, as written to ``summary.json``.

    Raises
    ------
    SpindleFemError
        Bad input, a failed solve, or a failed self-check (after writing).
    """
    from spindle_fem.report.run_outputs import OutputHelpers, write_outputs
    from spindle_fem.results.output_folder import output_folder

    started = time.perf_counter()
    spec = _load_buildable(machine, overrides)
    with output_folder(folder) as place, stages(progress) as tell, OutputHelpers() as helpers:
        # loaded after the helpers start, which load their own at the same time
        from spindle_fem.report.run_report import read_summary
        from spindle_fem.solvers.coupled_steady import prepare_machine
        from spindle_fem.studies.run_checks import require_checks
        from spindle_fem.studies.solve_machine import estimate_refinement, solve_prepared, with_heat_study

        prepared = prepare_machine(spec, progress=tell)
        helpers.prepare(spec, prepared.mesh, prepared.operators.n_unknowns)
        result = solve_prepared(prepared, progress=tell)
        if estimate_mesh_error:
            tell("second mesh")
            result = estimate_refinement(result, spec)
        helpers.begin(result, place)
        tell("heat over speed")
        write_outputs(with_heat_study(result), place, started=started, notify=tell, helpers=helpers)
    require_checks(result.checks, spec.name)
    return read_summary(place / "summary.json")


def check_machine(machine: str | Path, *, overrides: Iterable[str] = ()) -> dict[str, Any]:
    """Validate a machine without meshing or solving; every fault at once.

    Returns
    -------
    dict
        ``machine``, ``parts``, ``surfaces``, ``contacts``, ``probes``,
        ``effects``, ``warnings``; of a ``[network]`` machine ``machine``,
        ``nodes``, ``boundaries``, ``links``, ``sources``, ``effects``,
        ``warnings``.

    Raises
    ------
    FaultsError
    """
    from spindle_fem.definition.load import find_machine, read_definition
    from spindle_fem.definition.network_tables import is_network_machine
    from spindle_fem.machine.geometry.assembly import build_assembly
    from spindle_fem.machine.geometry.joint_groups import group_of_contacts

    if is_network_machine(read_definition(find_machine(machine))):
        return _check_network(machine, overrides)
    spec = _load_buildable(machine, overrides)
    assembly = build_assembly(spec)
    groups = group_of_contacts(spec, assembly.joint_names)

    def conductance(name: str) -> str:
        value = groups[name].conductance
        return "perfect" if value == "perfect" else f"{groups[name].name}: {value.value:g} W/(m²·K)"

    return {
        "machine": spec.name,
        "parts": [
            {
                "name": part.name,
                "detail": f"{'rotating, ' if part.rotating else ''}{len(part.segments)} segments",
            }
            for part in assembly.parts
        ],
        "surfaces": [{"name": surface.name, "detail": surface.part} for surface in spec.all_surfaces],
        "contacts": [{"name": name, "detail": conductance(name)} for name in assembly.joint_names],
        "probes": [
            {"name": probe.name, "detail": probe.part or "mixed coolant outlet"} for probe in spec.probe
        ],
        "effects": _effect_rows(spec.effects),
        "warnings": [{"code": "geometry_note", "text": note} for note in assembly.notes],
    }


def mesh_machine(machine: str | Path, file: Path, *, overrides: Iterable[str] = ()) -> dict[str, Any]:
    """Write the mesh as .msh or .vtu, or the solid model as .step.

    Raises
    ------
    SpecError
        Another file ending.
    """
    from spindle_fem.machine.geometry.assembly import build_assembly

    endings = (".msh", ".vtu", ".step")
    if file.suffix not in endings:
        raise SpecError(
            str(file), f'"{file.suffix}" is no format of the mesh.', f"Allowed: {', '.join(endings)}."
        )
    spec = _load_buildable(machine, overrides)
    assembly = build_assembly(spec)
    if file.suffix == ".step":
        from spindle_fem.machine.geometry.step_file import export_step

        export_step(assembly, file)
        return {"machine": spec.name, "parts": len(assembly.parts)}
    from spindle_fem.machine.meshing.build_mesh import build_mesh
    from spindle_fem.machine.meshing.mesh_files import write_mesh

    settings = spec.mesh
    mesh = build_mesh(assembly, preset=settings.preset, size_factor=settings.size_factor, sizes=settings.size)
    write_mesh(mesh, file)
    return {
        "machine": spec.name,
        "nodes": len(mesh.points),
        "elements": mesh.n_elements,
        "min_quality": mesh.min_quality,
        "digest": mesh.digest,
    }


def heat_table(
    machine: str | Path,
    *,
    speeds: Iterable[str] = (),
    temperature: str = "40 degC",
    coupled: bool = False,
    folder: Path | None = None,
    overrides: Iterable[str] = (),
) -> dict[str, Any]:
    """Bearing loads, angles, films and heat term by term over speed.

    Parameters
    ----------
    speeds : iterable of str
        With units; 500 to 4500 rpm in steps of 500 when empty.
    temperature : str
        Of rings, balls and grease.
    coupled : bool
        Solve the machine at every speed and take its temperatures.
    folder : Path, optional
        For ``heat.json``, ``heat.csv`` and charts.
    """
    from spindle_fem.studies.heat_study import heat_study, write_heat_study

    spec = load_machine(machine, overrides)
    chosen = [to_si(text, "rad/s", where="--speed") for text in speeds]
    kelvin = to_si(temperature, "K", where="--temperature", kind="temperature")
    content = heat_study(spec, chosen, kelvin, coupled=coupled)
    if folder is not None:
        write_heat_study(content, folder)
    return content


def rebuild(folder: Path) -> Path:
    """Rebuild the report of an output folder, of whichever command, from its files.

    Raises
    ------
    BadInputError
        The folder holds no results, or is marked incomplete.
    """
    from spindle_fem.results.output_folder import require_complete

    place = require_complete(folder)
    if (place / "crosscheck.json").is_file():
        from spindle_fem.report.crosscheck_report import write_report

        return write_report(place)
    if (place / "diagnosis.json").is_file():
        from spindle_fem.report.diagnosis_report import write_diagnosis_report

        return write_diagnosis_report(place)
    if (place / "simulation.json").is_file():
        from spindle_fem.report.simulation_report import write_simulation_report

        return write_simulation_report(place)
    if (place / "sweep.json").is_file():
        from spindle_fem.report.sweep_report import rebuild_sweep_report

        return rebuild_sweep_report(place)
    from spindle_fem.report.run_report import rebuild_report

    return rebuild_report(place)


def _load_buildable(machine: str | Path, overrides: Iterable[str]) -> MachineSpec:
    """Machine whose parts fit together; faults of its tables, geometry and effects at once."""
    from spindle_fem.definition.load import examine_machine
    from spindle_fem.machine.geometry.assembly import build_assembly
    from spindle_fem.machine.geometry.joint_groups import group_of_contacts
    from spindle_fem.model.reduced.defined_effects import check_effects, require_known_effects

    overrides = tuple(overrides)

    def fits_together(spec: MachineSpec) -> None:
        group_of_contacts(spec, build_assembly(spec).joint_names)

    def has_possible_effects(spec: MachineSpec) -> None:
        if not spec.effects:
            return
        examination = examine_machine(machine, overrides)
        entries = _by_number(spec.effects, [fault.where for fault in examination.faults])
        others = [fault for fault in examination.faults if not _ENTRY.search(fault.where)]
        try:
            fits_together(spec)
        except BadInputError as error:
            others.append(error)
        # Where they act needs the rest of the machine; that they exist does not.
        if others:
            require_known_effects(entries)
        else:
            check_effects(entries, spec)

    return load_machine(machine, overrides, checks=(fits_together, has_possible_effects))


_ENTRY = re.compile(r"(?:^|: )effect\[(\d+)\]")


def _by_number(entries: Sequence[EffectEntry], faulty: Iterable[str]) -> list[EffectEntry | None]:
    """Sound entries at their places in the file, None at those of faulty ones."""
    refused = {int(match[1]) for where in faulty if (match := _ENTRY.search(where))}
    sound = iter(entries)
    return [
        None if number in refused else next(sound) for number in range(1, len(entries) + len(refused) + 1)
    ]


def _check_network(machine: str | Path, overrides: Iterable[str]) -> dict[str, Any]:
    """Contents of a sound ``[network]`` machine; every fault at once."""
    spec = _load_network(machine, overrides)
    tables = spec.network
    return {
        "machine": spec.name,
        "nodes": [{"name": n.name, "detail": _amount(n.capacity, "J/K")} for n in tables.node],
        "boundaries": [
            {
                "name": boundary.name,
                "detail": f'input "{boundary.temperature}"'
                if isinstance(boundary.temperature, str)
                else _amount(boundary.temperature, "°C", ZERO_CELSIUS_K),
            }
            for boundary in tables.boundary
        ],
        "links": [{"name": k.label, "detail": _amount(k.conductance, "W/K")} for k in tables.link],
        "sources": [
            {"name": source.label, "detail": _amount(source.gain.amount, source.gain.unit)}
            for source in tables.source
        ],
        "effects": _effect_rows(spec.effects),
        "warnings": [],
    }


def _load_network(machine: str | Path, overrides: Iterable[str]) -> NetworkMachineSpec:
    """A sound ``[network]`` machine; faults of its keys, its network and its effects at once."""
    from pydantic import ValidationError

    from spindle_fem.definition.effect_entries import EffectEntry
    from spindle_fem.definition.inherit import apply_overrides
    from spindle_fem.definition.load import find_machine, read_toml
    from spindle_fem.definition.network_faults import network_faults
    from spindle_fem.definition.network_tables import (
        NetworkMachineSpec,
        NetworkSpec,
        validate_network_machine,
    )
    from spindle_fem.model.lumped.written_network import build_network
    from spindle_fem.model.reduced.defined_effects import check_network_effects, require_known_effects

    path = find_machine(machine)
    content = read_toml(path)
    faults: list[SpindleFemError] = []
    for override in overrides:
        try:
            content = apply_overrides(content, [override], NetworkMachineSpec)
        except SpecError as error:
            faults.append(error)
    spec, network = None, None
    try:
        spec = validate_network_machine(content, path.name)
        network = spec.network
    except FaultsError as error:
        faults += error.faults
        with contextlib.suppress(ValidationError):
            network = NetworkSpec.model_validate(content["network"])
    known = {str(fault) for fault in faults}

    def add(found: Iterable[SpindleFemError]) -> None:
        located = [type(f)(f"{path.name}: {f.where}", f.what, f.how_to_fix) for f in found]
        faults.extend(fault for fault in located if str(fault) not in known)

    between = [] if network is None else network_faults(network)
    add(between)
    written = content.get("effect", ())
    entries: list[EffectEntry | None] = []
    for item in written if isinstance(written, (list, tuple)) else ():
        entries.append(None)
        with contextlib.suppress(ValidationError):
            entries[-1] = EffectEntry.model_validate(item)
    try:
        if network is None or between:
            require_known_effects(entries)
        else:
            check_network_effects(entries, build_network(network))
    except FaultsError as error:
        add(error.faults)
    if faults or spec is None:
        raise FaultsError(path.name, faults)
    return spec


def _amount(value: Uncertain, unit: str, zero: float = 0.0) -> str:
    text = f"{value.value - zero:g} {unit}".rstrip()
    return text if value.is_fixed else f"{text}, uncertain"


def _effect_rows(entries: Sequence[EffectEntry]) -> list[dict[str, str]]:
    return [{"name": entry.effect, "detail": f"{entry.component} {entry.form}".rstrip()} for entry in entries]


@contextlib.contextmanager
def stages(show: bool) -> Iterator[Any]:
    """Stage names on the terminal while they run."""
    if not show:
        yield lambda stage: None
        return
    from rich.console import Console

    console = Console(stderr=True)
    with console.status("starting") as status:
        yield lambda stage: status.update(f"{stage} ...")
