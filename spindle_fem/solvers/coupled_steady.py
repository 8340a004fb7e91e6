"""A solved machine: heat, films, coolant and temperature made to agree."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.errors import ConvergenceError, NoEquilibriumError, NoSteadyStateError, OutOfValidityError
from spindle_fem.machine.geometry.assembly import build_assembly
from spindle_fem.machine.geometry.joint_groups import group_of_contacts
from spindle_fem.machine.meshing.build_mesh import build_mesh
from spindle_fem.machine.meshing.tagged_mesh import TaggedMesh
from spindle_fem.model.mesh.conduction_problem import ConductionProblem, Film, LumpedNode
from spindle_fem.model.mesh.linear_solvers import RELATIVE_TOLERANCE
from spindle_fem.model.mesh.mesh_operators import ThermalOperators, build_operators
from spindle_fem.model.mesh.steady_conduction import ConductionSolution, solve_steady
from spindle_fem.operation.bearing_heat import heat_model_of
from spindle_fem.operation.coolant_loop import CoolantState
from spindle_fem.operation.loads import NO_CHANGE, LoadChange, Loads
from spindle_fem.operation.machine_loads import FieldState, LoadsBuilder
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.solvers.preload_runaway import RELAXATION, highest_stable_speed, preload_runs_away

# The coolant's energy closes to 1e-8 only when the wall is known to about 1e-7 K.
FIELD_TOLERANCE = 1.0e-8
HEAT_TOLERANCE = 1.0e-7
COOLANT_TOLERANCE = 2.0e-9
MAXIMUM_ITERATIONS = 100
ANDERSON_DEPTH = 6
# Greases and seals are gone long before; a field beyond this is running away.
RUNAWAY_TEMPERATURE = 600.0
MIXING_BELOW = 0.5
MAXIMUM_RETREATS = 10
# A linear residual this small against the last change of the field costs no extra iteration of the loop.
LINEAR_PER_KELVIN = 1.0e-4
LOOSEST_LINEAR_TOLERANCE = 1.0e-3
#: Relative residual that a coupled solution may leave of its linear equations.
LINEAR_RESIDUAL_LIMIT = 1.0e-9

Progress = Callable[[str], None]
Beyond = Callable[[OperatingPoint, NDArray[np.float64], Mapping[str, float]], LoadChange]


@dataclass(frozen=True, slots=True)
class PreparedMachine:
    """A machine with mesh, operators and sorted loads, ready to be solved at any operating point."""

    spec: MachineSpec
    mesh: TaggedMesh
    operators: ThermalOperators
    builder: LoadsBuilder
    joint_conductance: Mapping[str, float]
    conductivity: Mapping[str, float]
    volumetric_capacity: Mapping[str, float]
    geometry_notes: tuple[str, ...] = ()
    timings: Mapping[str, float] = field(default_factory=dict)

    def field_state(self, unknowns: NDArray[np.float64], lumped: Mapping[str, float]) -> FieldState:
        """What the loads see of a field: the mean over each facet, and the lumped nodes."""
        facets = {
            surface: self.operators.facet_integral(unknowns, rows) / self.operators.facet_area[rows]
            for surface, rows in self.operators.surface_rows.items()
        }
        sides = {
            joint: tuple(
                float(
                    self.operators.facet_integral(unknowns, rows).sum()
                    / self.operators.facet_area[rows].sum()
                )
                for rows in self.operators.joint_rows[joint]
            )
            for joint in self.operators.joint_rows
            if not joint.endswith(":face")
        }
        return FieldState(facets, sides, lumped)

    def problem(self, loads: Loads) -> ConductionProblem:
        """Conduction problem of given loads."""
        films = tuple(
            Film(surface, film.coefficient, film.temperature, film.name)
            for surface, film in loads.films.items()
        )
        lumped = tuple(
            LumpedNode(node.name, tuple(node.connections.items()), node.capacity, node.heat)
            for node in loads.lumped
        )
        change = loads.change
        return ConductionProblem(
            self.operators,
            {part: value * change.factor(f"conductivity.{part}") for part, value in self.conductivity.items()}
            if change.coefficients
            else self.conductivity,
            films=films,
            joint_conductance={
                name: value * change.factor(f"joint.{name}") for name, value in self.joint_conductance.items()
            }
            if change.coefficients
            else self.joint_conductance,
            surface_heat=loads.surface_heat,
            nodal_heat=change.nodal_heat,
            capacity_scale=change.capacity_scale,
            lumped_nodes=lumped,
            volumetric_capacity=self.volumetric_capacity,
            adiabatic="rest",
        )


@dataclass(frozen=True, slots=True)
class CoupledState:
    """A converged fixed point: field, the loads that made it, and the coolant."""

    solution: ConductionSolution
    loads: Loads
    coolant: CoolantState | None
    iterations: int
    change: float


def prepare_machine(
    spec: MachineSpec, *, size_factor: float | None = None, progress: Progress = lambda stage: None
) -> PreparedMachine:
    """Mesh a machine and integrate what every solve shares.

    Parameters
    ----------
    spec : MachineSpec
    size_factor : float, optional
        In place of the machine's own, for mesh-refinement estimates.
    progress : callable
        Told each stage by name as it begins.
    """
    clock = Clock(progress)
    clock.begin("geometry")
    assembly = build_assembly(spec)
    clock.begin("mesh")
    mesh = build_mesh(
        assembly,
        preset=spec.mesh.preset,
        size_factor=spec.mesh.size_factor if size_factor is None else size_factor,
        sizes=spec.mesh.size,
    )
    clock.begin("assembly")
    operators = build_operators(mesh, spec.mesh.order)
    machine = machine_on_mesh(spec, mesh, operators)
    clock.end()
    return replace(machine, timings=clock.timings)


def machine_on_mesh(spec: MachineSpec, mesh: TaggedMesh, operators: ThermalOperators) -> PreparedMachine:
    """A machine on a mesh and operators that exist: its geometry must be the one that was meshed.

    Heat, films, flow, oil, joints and materials may differ from those of the
    machine that the mesh was made for.
    """
    groups = group_of_contacts(spec, mesh.joints)
    facet_area = {surface: operators.facet_areas(surface) for surface in mesh.surfaces}
    materials = {part: spec.part_material(part) for part in mesh.part_names}
    capacity_factor = spec.heat_capacity_factor.value
    return PreparedMachine(
        spec=spec,
        mesh=mesh,
        operators=operators,
        builder=LoadsBuilder(spec, mesh, facet_area, heat_model_of(spec)),
        joint_conductance={
            contact: np.inf if group.conductance == "perfect" else group.conductance.value
            for contact, group in groups.items()
        },
        conductivity={part: material.thermal_conductivity for part, material in materials.items()},
        volumetric_capacity={
            part: capacity_factor * material.volumetric_heat_capacity for part, material in materials.items()
        },
    )


def solve_coupled(
    machine: PreparedMachine,
    point: OperatingPoint,
    start: NDArray[np.float64] | None = None,
    *,
    beyond: Beyond | None = None,
) -> CoupledState:
    """Steady field at which heat, films and coolant are those of the field itself.

    A fixed-point iteration with Anderson mixing over the whole field; the map
    is nearly affine, so the mixing finds the fixed point in a few solves even
    where friction heat falls steeply with temperature. Where expansion changes
    the preload, it begins from the state without expansion.

    Parameters
    ----------
    machine : PreparedMachine
    point : OperatingPoint
    start : (n_unknowns,) ndarray, optional, [K]
    beyond : callable, optional
        Point, field and lumped temperatures to what physics beyond the
        machine's own does to its loads.

    Raises
    ------
    NoSteadyStateError
        The temperatures run away.
    ConvergenceError
        No fixed point within the iterations.

    Source: Walker & Ni (2011), SIAM J. Numer. Anal. 49, 1715-1735 (mixing).
    """
    operators = machine.operators
    cold = np.full(operators.n_unknowns, point.ambient_temperature)
    unknowns = cold if start is None else start
    lumped: dict[str, float] = {}
    mixing = _AndersonMixing(ANDERSON_DEPTH)
    solution: ConductionSolution | None = None
    heat_before = np.inf
    change = np.inf
    follows_preload = machine.spec.heat.thermal_preload and machine.spec.heat.model != "table"
    assembled: dict[str, float] = {}
    if follows_preload:
        loads, _ = machine.builder.at(point, machine.field_state(cold, {}))
        assembled = {name: heat.preload for name, heat in loads.bearing_heat.items()}
        if start is None:
            # Cold grease makes heat that would carry the loop past the fixed point.
            first = solve_coupled(without_expansion(machine), point, beyond=beyond)
            solution, unknowns = first.solution, first.solution.temperature
            lumped = dict(
                zip(solution.problem.lumped_names, solution.lumped_temperature.tolist(), strict=True)
            )
    given: NDArray[np.float64] | None = None
    mixed = unknowns
    names: tuple[str, ...] = ()
    retreats = 0
    for iteration in range(1, MAXIMUM_ITERATIONS + 1):
        try:
            physics = NO_CHANGE if beyond is None else beyond(point, unknowns, lumped)
            loads, coolant = machine.builder.at(point, machine.field_state(unknowns, lumped), physics)
        except (NoEquilibriumError, OutOfValidityError) as error:
            if follows_preload and (given is not None or start is None):
                raise _no_steady_state(machine, point, str(error)) from error
            if given is None or retreats == MAXIMUM_RETREATS:
                raise
            # Cold grease makes more heat than the machine will ever see: go half the way back.
            retreats += 1
            mixing = _AndersonMixing(ANDERSON_DEPTH)
            mixed = 0.5 * (given + mixed)
            unknowns, lumped = _split(mixed, names, operators.n_unknowns)
            continue
        solution = solve_steady(
            machine.problem(loads),
            guess=solution,
            preconditioner=None if solution is None else solution.preconditioner,
            relative_tolerance=_linear_tolerance(change),
        )
        hottest = float(solution.temperature.max())
        preload = {name: heat.preload for name, heat in loads.bearing_heat.items()}
        if not np.isfinite(hottest) or hottest > RUNAWAY_TEMPERATURE:
            raise _no_steady_state(
                machine, point, f"{loads.total_heat:.0f} W would heat it over {hottest - 273.15:.0f} °C."
            )
        if follows_preload and preload_runs_away(preload, assembled):
            worst = max(preload, key=lambda name: preload[name] / assembled[name])
            raise _no_steady_state(
                machine,
                point,
                f"the preload of {worst} passes {preload[worst]:.0f} N, from {assembled[worst]:.0f} N cold.",
            )
        change = float(np.abs(solution.temperature - unknowns).max())
        heat = loads.total_heat
        settled = abs(heat - heat_before) <= HEAT_TOLERANCE * max(abs(heat), 1.0e-12)
        settled = settled and coolant_mismatch(machine, solution, coolant) <= COOLANT_TOLERANCE
        settled = settled and solution.residual <= LINEAR_RESIDUAL_LIMIT
        if settled and change < FIELD_TOLERANCE * max(1.0, hottest - point.coldest):
            return CoupledState(solution, loads, coolant, iteration, change)
        heat_before = heat
        names = solution.problem.lumped_names
        found = np.concatenate([solution.temperature, solution.lumped_temperature])
        given = np.concatenate([unknowns, [lumped.get(name, point.ambient_temperature) for name in names]])
        # Far from the fixed point, heat that grows with temperature must be followed as the machine warms.
        if (follows_preload or beyond is not None) and change > MIXING_BELOW:
            mixed = given + RELAXATION * (found - given)
        else:
            mixed = mixing.next(given, found)
        unknowns, lumped = _split(mixed, names, operators.n_unknowns)
    raise ConvergenceError(
        machine.spec.name,
        f"field and loads still change by {change:.2g} K after {MAXIMUM_ITERATIONS} iterations.",
        "Friction heat may rise with temperature faster than it is carried away; lower speed or preload.",
    )


def without_expansion(machine: PreparedMachine) -> PreparedMachine:
    """The same machine with bearings that keep the size of assembly."""
    heat = machine.spec.heat.model_copy(update={"thermal_preload": False})
    spec = machine.spec.model_copy(update={"heat": heat})
    return machine_on_mesh(spec, machine.mesh, machine.operators)


def _split(
    vector: NDArray[np.float64], names: tuple[str, ...], n_unknowns: int
) -> tuple[NDArray[np.float64], dict[str, float]]:
    """Temperatures of the mesh and of the lumped nodes by name."""
    return vector[:n_unknowns], dict(zip(names, vector[n_unknowns:].tolist(), strict=True))


def coolant_mismatch(
    machine: PreparedMachine, solution: ConductionSolution, coolant: CoolantState | None
) -> float:
    """Heat that the walls give less the oil's enthalpy rise, relative to all heat moved."""
    if coolant is None:
        return 0.0
    march = coolant.march.march
    given = sum(solution.balance.films[surface] for surface in machine.builder.cells.surfaces)
    taken = march.enthalpy_rise - float(march.pumping_heat.sum())
    moved = float(np.abs(march.heat).sum() + np.abs(march.pumping_heat).sum())
    return abs(given - taken) / max(moved, 1.0e-12)


def _linear_tolerance(change: float) -> float:
    """Relative residual worth solving to when the loads last moved the field by ``change`` K."""
    return float(np.clip(LINEAR_PER_KELVIN * change, RELATIVE_TOLERANCE, LOOSEST_LINEAR_TOLERANCE))


def _no_steady_state(machine: PreparedMachine, point: OperatingPoint, reason: str) -> NoSteadyStateError:
    """The error of a runaway, with the speed up to which the machine has an equilibrium."""
    rpm = point.speed * 30.0 / np.pi
    advice = "Lower the speed or the preload, or cool more."
    if machine.spec.heat.thermal_preload:
        limit = highest_stable_speed(machine, point) * 30.0 / np.pi
        advice = f"A thermal equilibrium exists up to about {limit:.0f} rpm. {advice}"
    return NoSteadyStateError(machine.spec.name, f"no thermal equilibrium at {rpm:.0f} rpm: {reason}", advice)


class _AndersonMixing:
    """Combines past iterates so that their residuals cancel in the least-squares sense."""

    def __init__(self, depth: int) -> None:
        self.depth = depth
        self.inputs: list[NDArray[np.float64]] = []
        self.outputs: list[NDArray[np.float64]] = []

    def next(self, given: NDArray[np.float64], mapped: NDArray[np.float64]) -> NDArray[np.float64]:
        self.inputs = [*self.inputs, given][-self.depth - 1 :]
        self.outputs = [*self.outputs, mapped][-self.depth - 1 :]
        if len(self.inputs) == 1:
            return mapped
        residuals = np.array([out - into for into, out in zip(self.inputs, self.outputs, strict=True)])
        steps = np.diff(residuals, axis=0)
        weights, *_ = np.linalg.lstsq(steps.T, residuals[-1], rcond=1.0e-10)
        return mapped - np.diff(np.array(self.outputs), axis=0).T @ weights


class Clock:
    """Seconds of each stage; tells the progress callback as stages begin."""

    def __init__(self, progress: Progress) -> None:
        self.progress = progress
        self.timings: dict[str, float] = {}
        self._stage = ""
        self._since = 0.0

    def begin(self, stage: str) -> None:
        """End the stage before and start this one."""
        self.end()
        self._stage, self._since = stage, time.perf_counter()
        self.progress(stage)

    def end(self) -> None:
        """End the stage that runs."""
        if self._stage:
            self.timings[self._stage] = time.perf_counter() - self._since
        self._stage = ""
