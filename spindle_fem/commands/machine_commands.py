"""The functions behind ``spindle-fem run``, ``check`` and ``mesh``."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from spindle_fem.commands.checked_machine import load_buildable, load_network
from spindle_fem.commands.console import stages
from spindle_fem.errors import FaultsError, SpecError
from spindle_fem.units import ZERO_CELSIUS_K

if TYPE_CHECKING:
    from spindle_fem.definition.effect_entries import EffectEntry
    from spindle_fem.units import Uncertain


def run_machine(
    machine: str | Path,
    folder: Path,
    *,
    overrides: Iterable[str] = (),
    estimate_mesh_error: bool = False,
    solid_growth: bool = False,
    progress: bool = False,
    shown: Callable[[dict[str, Any]], object] = lambda summary: None,
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
    solid_growth : bool
        Work out growth in three dimensions too: ``growth.three_dimensional`` of the summary and
        ``displacement`` of ``fields.vtu``.
    progress : bool
        Show the stage on the terminal.
    shown : callable
        Called with the summary before a failed self-check ends the run.

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
    from spindle_fem.results.output_folder import output_folder, read_content

    started = time.perf_counter()
    spec = load_buildable(machine, overrides)
    with output_folder(folder) as place, stages(progress) as tell, OutputHelpers() as helpers:
        # loaded after the first helper starts, which loads its own at the same time
        from spindle_fem.results.run_summary import SUMMARY_SCHEMA
        from spindle_fem.solvers.prepared_machine import prepare_machine
        from spindle_fem.studies.run_checks import require_checks
        from spindle_fem.studies.solve_machine import estimate_refinement, solve_prepared
        from spindle_fem.studies.wetting_range import with_wetting_range

        helpers.start_charts()
        prepared = prepare_machine(spec, progress=tell)
        helpers.prepare(spec, prepared.mesh, prepared.operators.n_unknowns)
        result = solve_prepared(
            prepared, progress=tell, find_fold=True, solved=lambda first: helpers.begin(first, place)
        )
        result = with_wetting_range(result)
        if estimate_mesh_error:
            tell("second mesh")
            result = estimate_refinement(result, spec)
        if solid_growth:
            tell("growth in three dimensions")
            result = result.with_solid_growth()
        write_outputs(result, place, started=started, notify=tell, helpers=helpers)
    summary = read_content(place / "summary.json", SUMMARY_SCHEMA, "run")
    shown(summary)
    require_checks(result.checks, spec.name, str(place / "report.html"))
    return summary


def check_machine(
    machine: str | Path, *, overrides: Iterable[str] = (), picture: Path | None = None
) -> dict[str, Any]:
    """Validate a machine without meshing or solving; every fault at once.

    Parameters
    ----------
    picture : Path, optional
        Drawing of the section to write, with any faults marked.

    Returns
    -------
    dict
        ``machine``, ``operation``, ``parts``, ``surfaces``, ``adiabatic`` (faces without heat
        exchange), ``contacts``, ``probes``, ``sources``, ``bearing_sets`` (with the preload that a class
        means), ``channel``, ``circuits``, ``displacement_sensors``, ``radial_loads`` (of bearing sets),
        ``effects``, ``assumed``
        (what rules gave that the file leaves out), ``warnings``; of a ``[network]`` machine ``machine``,
        ``nodes``, ``boundaries``, ``links``, ``sources``, ``effects``,
        ``warnings``.

    Raises
    ------
    FaultsError
    """
    from spindle_fem.commands.machine_contents import contents_of
    from spindle_fem.definition.load import examine_machine, find_machine, read_definition
    from spindle_fem.definition.network_load import is_network_machine
    from spindle_fem.machine.geometry.assembly import build_assembly
    from spindle_fem.operation.driven_flow import flow_warnings
    from spindle_fem.operation.open_gaps import heated_gaps_without_exchange
    from spindle_fem.operation.operating_limits import (
        lost_to_air,
        operation_warnings,
        speeds_beyond_catalogues,
    )

    if picture is not None and picture.suffix != ".png":
        raise SpecError(str(picture), f'"{picture.suffix}" is no format of pictures.', "Allowed: .png.")
    if is_network_machine(read_definition(find_machine(machine))):
        if picture is not None:
            raise SpecError(str(machine), "is a network.", "--picture draws machines with geometry.")
        return _check_network(machine, overrides)
    try:
        spec = load_buildable(machine, overrides)
    except FaultsError as error:
        if picture is not None:
            _draw_faults(picture, machine, overrides, error)
        raise
    if picture is not None:
        from spindle_fem.report.definition_picture import draw_definition

        draw_definition(picture, spec)
    assembly = build_assembly(spec)
    said = (
        *flow_warnings(spec),
        *lost_to_air(spec),
        *operation_warnings(spec, spec.operation.speed),
        *heated_gaps_without_exchange(spec, assembly),
        *speeds_beyond_catalogues(spec, max(spec.operation.speed, *(spec.operation.speed_range or (0.0,)))),
    )
    return {
        "machine": spec.name,
        **contents_of(spec, assembly),
        "effects": _effect_rows(spec.effects),
        "assumed": [
            {"name": item.where, "detail": item.rule} for item in examine_machine(machine, overrides).assumed
        ],
        "warnings": [
            *({"code": item.code, "text": item.text} for item in said),
            *({"code": "geometry_note", "text": note} for note in assembly.notes),
        ],
    }


def mesh_machine(machine: str | Path, file: Path, *, overrides: Iterable[str] = ()) -> dict[str, Any]:
    """Write the mesh as .msh or .vtu, or the solid model as .step.

    Raises
    ------
    SpecError
        Another file ending.
    """
    from spindle_fem.machine.geometry.assembly import build_assembly
    from spindle_fem.results.output_folder import whole_file

    endings = (".msh", ".vtu", ".step")
    if file.suffix not in endings:
        raise SpecError(
            str(file), f'"{file.suffix}" is no format of the mesh.', f"Allowed: {', '.join(endings)}."
        )
    spec = load_buildable(machine, overrides)
    assembly = build_assembly(spec)
    file.parent.mkdir(parents=True, exist_ok=True)
    if file.suffix == ".step":
        from spindle_fem.machine.geometry.step_file import export_step

        with whole_file(file) as partial:
            export_step(assembly, partial)
        return {"machine": spec.name, "parts": len(assembly.parts)}
    from spindle_fem.machine.meshing.build_mesh import build_mesh
    from spindle_fem.machine.meshing.mesh_files import write_mesh

    settings = spec.mesh
    mesh = build_mesh(assembly, preset=settings.preset, size_factor=settings.size_factor, sizes=settings.size)
    with whole_file(file) as partial:
        write_mesh(mesh, partial)
    return {
        "machine": spec.name,
        "nodes": len(mesh.points),
        "elements": mesh.n_elements,
        "min_quality": mesh.min_quality,
        "digest": mesh.digest,
    }


def _check_network(machine: str | Path, overrides: Iterable[str]) -> dict[str, Any]:
    """Contents of a sound ``[network]`` machine; every fault at once."""
    spec = load_network(machine, overrides)
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


def _draw_faults(picture: Path, machine: str | Path, overrides: Iterable[str], error: FaultsError) -> None:
    """Picture of what is sound in a faulty definition."""
    from spindle_fem.definition.load import examine_machine
    from spindle_fem.report.definition_picture import draw_definition

    spec = None
    with contextlib.suppress(FaultsError):  # of overrides, which are among the faults
        spec = examine_machine(machine, overrides).spec
    draw_definition(picture, spec, error.faults)


def _amount(value: Uncertain, unit: str, zero: float = 0.0) -> str:
    text = f"{value.value - zero:g} {unit}".rstrip()
    return text if value.is_fixed else f"{text}, uncertain"


def _effect_rows(entries: Sequence[EffectEntry]) -> list[dict[str, str]]:
    return [{"name": entry.effect, "detail": f"{entry.component} {entry.form}".rstrip()} for entry in entries]
