"""Solve one design to one row of the table; designs of one geometry share mesh and operators."""

from __future__ import annotations

import hashlib
import json
import logging
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from spindle_fem import __version__
from spindle_fem.cache import one_at_a_time, source_digest
from spindle_fem.definition.inherit import apply_overrides
from spindle_fem.definition.load import validate
from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.effects import registry as effects
from spindle_fem.errors import FaultsError, GeometryError, MeshQualityError, SpecError, SpindleFemError
from spindle_fem.machine.geometry.assembly import AssemblyGeometry, build_assembly
from spindle_fem.machine.geometry.joint_groups import group_of_contacts
from spindle_fem.machine.meshing.build_mesh import build_mesh
from spindle_fem.machine.meshing.mesh_cache import mesh_digest
from spindle_fem.machine.meshing.sizes import build_sizes
from spindle_fem.machine.meshing.tagged_mesh import TaggedMesh
from spindle_fem.model.mesh.mesh_operators import ThermalOperators, build_operators
from spindle_fem.model.reduced.heat_tables import mechanical_key
from spindle_fem.operation.coolant_loop import CoolantLoop
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.parallel import one_thread
from spindle_fem.registry import source_from_outside
from spindle_fem.results.run_summary import build_summary
from spindle_fem.results.thermal_result import ThermalResult
from spindle_fem.solvers.prepared_machine import machine_on_mesh
from spindle_fem.studies.run_checks import require_checks
from spindle_fem.studies.solve_machine import solve_prepared
from spindle_fem.studies.sweep.designs import Design
from spindle_fem.studies.sweep.morphing import lattice_assembly, move_mesh, moved_digest
from spindle_fem.studies.sweep.outputs import derived_values, of_rings, of_shape, value_of
from spindle_fem.studies.sweep.results_table import FAILED, FULL, IMPOSSIBLE, MOVED, NEW, OK, Row
from spindle_fem.studies.sweep.structure import refusal, structure_digest, without_marks

LOGGER = logging.getLogger(__name__)

# Tables of a definition that shape the mesh; designs that agree in them share it.
_SHAPING = ("part", "bearing_types", "bearing_set", "channel", "surface", "remaining_surfaces", "mesh")
# Keys that do not change a result.
_NOT_IN_KEY = ("name", "title", "description", "marks")
FILM_LOW, FILM_HIGH = "@film_low", "@film_high"
# Errors that make a design fail; anything else is a fault of the program.
SOLVE_ERRORS = (SpindleFemError, ArithmeticError, np.linalg.LinAlgError)


@dataclass(frozen=True, slots=True)
class Question:
    """Outputs and options common to all designs of a study.

    Attributes
    ----------
    film_uncertainty : bool
        Whether the film's band is carried.
    backend : {"auto", "full", "reduced"}
        What may answer: full solves, or also the projected model of a group
        of designs; with "auto" where the group is large enough to pay.
    mesh : {"new", "moved"}
        Whether a mesh may be moved from that of a machine with a channel near by.
    """

    outputs: tuple[str, ...]
    film_uncertainty: bool
    backend: str = "auto"
    mesh: str = NEW

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns of the answers: each output, and its values at the low and the high film."""
        ends = (FILM_LOW, FILM_HIGH) if self.film_uncertainty else ()
        return tuple(path + end for path in self.outputs for end in ("", *ends))


@dataclass(frozen=True, slots=True)
class DesignTask:
    """A design ready to be solved by any process.

    Attributes
    ----------
    key : str
        Hash of all that the result depends on: the same key, the same numbers.
    spec : MachineSpec or None
        None where the design is impossible.
    geometry : str
        Hash of mesh and order of the temperature's polynomials.
    reason : str
        Why the design is impossible.
    structure : str
        Hash of the mesh and of all that a projected model is made for: designs
        that agree in it can share one. Empty where none can answer the design.
    mechanics : str
        Key of what makes heat, for designs that have a structure.
    source : str
        Hash of the mesh that the design's own is to be moved from, where it is.
    """

    design: Design
    key: str
    spec: MachineSpec | None
    geometry: str
    reason: str = ""
    structure: str = ""
    mechanics: str = ""
    source: str = ""


@dataclass(frozen=True, slots=True)
class _Shape:
    geometry: str
    joints: tuple[str, ...]
    reason: str = ""
    source: str = ""


class TaskBuilder:
    """Turns designs into tasks; geometries that were seen are not built again.

    Parameters
    ----------
    content : mapping
        Raw tables of the machine.
    """

    def __init__(self, content: Mapping[str, Any], question: Question) -> None:
        self._content = content
        self._question = question
        self._geometries: dict[str, _Shape] = {}
        # Rows of an earlier version of the program, or of a user's own model, are not taken for this one's.
        self._made_by = [__version__, source_digest(__name__), source_from_outside(effects.GROUP)]

    def task(self, design: Design) -> DesignTask:
        """Task of a design, checked as ``spindle-fem check`` would."""
        try:
            spec = validate(apply_overrides(self._content, design.overrides), "design")
        except SpecError as error:
            return self._impossible(design, error)
        dump = spec.model_dump(mode="json", by_alias=True, exclude_none=True)
        shape = _digest(without_marks({key: dump.get(key) for key in _SHAPING}))
        if shape not in self._geometries:
            self._geometries[shape] = _examine_geometry(spec, self._question.mesh)
        found = self._geometries[shape]
        machine = without_marks({key: value for key, value in dump.items() if key not in _NOT_IN_KEY})
        key = self._key(machine)
        if found.reason:
            return DesignTask(design, key, None, "", found.reason)
        try:
            group_of_contacts(spec, found.joints)
        except SpindleFemError as error:
            return DesignTask(design, key, None, "", reason_of(error))
        structure = mechanics = ""
        if self._question.backend != "full" and not refusal(spec):
            structure = _digest([found.geometry, structure_digest(dump)])
            mechanics = mechanical_key(spec, OperatingPoint.of(spec), machine)
        return DesignTask(
            design, key, spec, found.geometry, structure=structure, mechanics=mechanics, source=found.source
        )

    def _impossible(self, design: Design, error: SpindleFemError) -> DesignTask:
        # Without a machine to hash, the key is that of the definition and what the design changes.
        key = self._key([self._content, list(design.overrides)])
        return DesignTask(design, key, None, "", reason_of(error))

    def _key(self, machine: Any) -> str:
        question = self._question
        asked = [question.outputs, question.film_uncertainty, question.backend, question.mesh]
        return _digest([*self._made_by, asked, machine])[:24]


def _examine_geometry(spec: MachineSpec, mesh: str) -> _Shape:
    try:
        assembly = build_assembly(spec)
        digest = _mesh_digest(spec, assembly)
    except SpindleFemError as error:
        return _Shape("", (), reason_of(error))
    near = lattice_assembly(spec) if mesh == MOVED else None
    source = ""
    if near is not None:
        source = _mesh_digest(*near)
        digest = moved_digest(source, assembly)
    return _Shape(f"{digest}/{spec.mesh.order}", assembly.joint_names, source=source)


def _mesh_digest(spec: MachineSpec, assembly: AssemblyGeometry) -> str:
    sizes = build_sizes(
        assembly, spec.mesh.preset, size_factor=spec.mesh.size_factor, overrides=spec.mesh.size
    )
    return mesh_digest(assembly, sizes)


def _digest(content: Any) -> str:
    return hashlib.sha256(
        json.dumps(content, sort_keys=True, separators=(",", ":"), default=str).encode()
    ).hexdigest()


def reason_of(error: BaseException) -> str:
    """One line that describes an error."""
    if isinstance(error, FaultsError):
        return "; ".join(reason_of(fault) for fault in error.faults)
    text = str(error) if isinstance(error, SpindleFemError) else f"{type(error).__name__}: {error}"
    return " ".join(text.removeprefix("design: ").split())


# The mesh and operators that this process used last, and the mesh that was moved last: tasks come sorted.
_LAST: dict[str, tuple[TaggedMesh, ThermalOperators]] = {}
_LAST_SOURCE: dict[str, TaggedMesh] = {}


def evaluate_tasks(tasks: Sequence[DesignTask], question: Question) -> list[Row]:
    """Rows of some tasks, the same numbers in whatever process, order or company they are solved.

    Every design is solved from a cold start and with one thread of the linear
    algebra, so that no row depends on what was solved before it.
    """
    with threadpool_limits(1), one_thread():
        return [evaluate(task, question) for task in tasks]


def evaluate(task: DesignTask, question: Question) -> Row:
    """Row of one task; an error of the model becomes a row with its reason."""
    if task.spec is None:
        return _without_answers(task, question, IMPOSSIBLE, task.reason)
    try:
        return row_of(task, question, solve_checked(task))
    except SOLVE_ERRORS as error:
        return _without_answers(task, question, FAILED, reason_of(error))


def row_of(task: DesignTask, question: Question, result: ThermalResult) -> Row:
    """Row of a design that was solved in full; the ends of its film's band are solved here.

    Raises
    ------
    SpindleFemError, ArithmeticError, LinAlgError
        An end of the band has no solution.
    """
    spec = task.spec
    answers = _values(result, spec, question.outputs)
    if question.film_uncertainty:
        coolant = result.coolant
        for ending, film in ((FILM_LOW, coolant.film_low), (FILM_HIGH, coolant.film_high)):
            at_end = solve_checked(task, film / coolant.film_coefficient)
            answers |= {
                path + ending: value for path, value in _values(at_end, spec, question.outputs).items()
            }
    head = _without_answers(task, question, OK, "")
    return {**head, **answers, "backend": FULL, "mesh": how_meshed(task, result.mesh.digest)}


def _without_answers(task: DesignTask, question: Question, status: str, reason: str) -> Row:
    head = {"design": task.design.number, **task.design.values, "key": task.key}
    empty = dict.fromkeys((*question.columns, "backend", "error_estimate_K", "mesh"))
    return {**head, **empty, "geometry": task.geometry[:12], "status": status, "reason": reason}


def solve_task(task: DesignTask) -> ThermalResult:
    """The whole result of a possible design, as its row was made from; for pictures."""
    with threadpool_limits(1), one_thread():
        return solve_checked(task)


def solve_checked(task: DesignTask, film_ratio: NDArray[np.float64] | None = None) -> ThermalResult:
    """Full solve of a possible design that passes its self-checks.

    Parameters
    ----------
    film_ratio : (n_along,) ndarray, optional
        Further factor on the film of each cell along the channel.

    Raises
    ------
    SpindleFemError
        The solve or a check fails.
    """
    machine = machine_on_mesh(task.spec, *shared_operators(task))
    if film_ratio is not None:
        machine.builder.coolant_loop = CoolantLoop(task.spec, machine.builder.cells, film_ratio)
    result = solve_prepared(machine)
    require_checks(result.checks, task.spec.name)
    return result


def _values(result: ThermalResult, spec: MachineSpec, outputs: Iterable[str]) -> dict[str, Any]:
    outputs = tuple(outputs)
    wanted = {"with_shape": any(map(of_shape, outputs)), "with_rings": any(map(of_rings, outputs))}
    summary = build_summary(result, 0.0, 0.0, **wanted)
    summary["derived"] = derived_values(summary, spec)
    return {path: value_of(summary, path) for path in outputs}


def shared_operators(task: DesignTask) -> tuple[TaggedMesh, ThermalOperators]:
    """Mesh and operators of a possible design, those used last without any work."""
    if task.geometry not in _LAST:
        _LAST.clear()  # a normal mesh with its operators takes hundreds of megabytes
        mesh = _mesh_of(task)
        _LAST[task.geometry] = mesh, build_operators(mesh, task.spec.mesh.order)
    return _LAST[task.geometry]


def how_meshed(task: DesignTask, digest: str) -> str:
    """``moved`` or ``new``, from the hash of the mesh that a design was solved on."""
    return MOVED if task.source and digest == task.geometry.partition("/")[0] else NEW


def _mesh_of(task: DesignTask) -> TaggedMesh:
    """A mesh moved from its source where that is planned and passes every check, else a new one."""
    target = build_assembly(task.spec)
    if task.source:
        spec, assembly = lattice_assembly(task.spec)
        try:
            if task.source not in _LAST_SOURCE:
                _LAST_SOURCE.clear()
                _LAST_SOURCE[task.source] = _meshed(spec, assembly)
            return move_mesh(_LAST_SOURCE[task.source], assembly, target)
        except (GeometryError, MeshQualityError) as error:
            LOGGER.info("design %d is meshed anew: %s", task.design.number, error.what)
    return _meshed(task.spec, target)


def _meshed(spec: MachineSpec, assembly: AssemblyGeometry) -> TaggedMesh:
    with one_at_a_time(_mesh_digest(spec, assembly)):
        return build_mesh(
            assembly,
            preset=spec.mesh.preset,
            size_factor=spec.mesh.size_factor,
            sizes=spec.mesh.size,
            threads=1,
        )
