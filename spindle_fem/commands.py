"""One function behind each command; everything the command line does is here to call."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from spindle_fem.errors import SpecError
from spindle_fem.spec.load import load_machine
from spindle_fem.units import to_si

if TYPE_CHECKING:
    from spindle_fem.spec.model import MachineSpec


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
    from spindle_fem.checks import require_checks
    from spindle_fem.coupling import prepare_machine
    from spindle_fem.reporting.output import output_folder
    from spindle_fem.reporting.report import read_summary, write_outputs
    from spindle_fem.solve import estimate_refinement, solve_prepared, with_heat_study

    started = time.perf_counter()
    spec = _load_buildable(machine, overrides)
    with output_folder(folder) as place, stages(progress) as tell:
        result = solve_prepared(prepare_machine(spec, progress=tell), progress=tell)
        if estimate_mesh_error:
            tell("second mesh")
            result = estimate_refinement(result, spec)
        tell("heat over speed")
        write_outputs(with_heat_study(result), place, started=started, notify=tell)
    require_checks(result.checks, spec.name)
    return read_summary(place / "summary.json")


def check_machine(machine: str | Path, *, overrides: Iterable[str] = ()) -> dict[str, Any]:
    """Validate a machine without meshing or solving; every fault at once.

    Returns
    -------
    dict
        ``machine``, ``parts``, ``surfaces``, ``contacts``, ``probes``, ``warnings``.
    """
    from spindle_fem.geometry.assembly import build_assembly
    from spindle_fem.loads.joints import group_of_contacts

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
        "warnings": [{"code": "geometry_note", "text": note} for note in assembly.notes],
    }


def mesh_machine(machine: str | Path, file: Path, *, overrides: Iterable[str] = ()) -> dict[str, Any]:
    """Write the mesh as .msh or .vtu, or the solid model as .step.

    Raises
    ------
    SpecError
        Another file ending.
    """
    from spindle_fem.geometry.assembly import build_assembly

    endings = (".msh", ".vtu", ".step")
    if file.suffix not in endings:
        raise SpecError(
            str(file), f'"{file.suffix}" is no format of the mesh.', f"Allowed: {', '.join(endings)}."
        )
    spec = _load_buildable(machine, overrides)
    assembly = build_assembly(spec)
    if file.suffix == ".step":
        from spindle_fem.geometry.step import export_step

        export_step(assembly, file)
        return {"machine": spec.name, "parts": len(assembly.parts)}
    from spindle_fem.meshing.build import build_mesh
    from spindle_fem.meshing.io import write_mesh

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
    from spindle_fem.heat_study import heat_study, write_heat_study

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
    from spindle_fem.reporting.output import require_complete

    place = require_complete(folder)
    if (place / "crosscheck.json").is_file():
        from spindle_fem.crosscheck.report import write_report

        return write_report(place)
    if (place / "diagnosis.json").is_file():
        from spindle_fem.reporting.diagnosis_report import write_diagnosis_report

        return write_diagnosis_report(place)
    if (place / "sweep.json").is_file():
        from spindle_fem.reporting.sweep_report import rebuild_sweep_report

        return rebuild_sweep_report(place)
    from spindle_fem.reporting.report import rebuild_report

    return rebuild_report(place)


def _load_buildable(machine: str | Path, overrides: Iterable[str]) -> MachineSpec:
    """Machine whose parts fit together; faults of its tables and of its geometry at once."""
    from spindle_fem.effect_entries import require_known_effects
    from spindle_fem.geometry.assembly import build_assembly
    from spindle_fem.loads.joints import group_of_contacts

    def fits_together(spec: MachineSpec) -> None:
        group_of_contacts(spec, build_assembly(spec).joint_names)

    def knows_its_effects(spec: MachineSpec) -> None:
        require_known_effects(spec.effects)

    return load_machine(machine, overrides, checks=(fits_together, knows_its_effects))


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
