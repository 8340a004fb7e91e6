"""A machine made ready for the full model: mesh, integrals, sorted loads, conduction problem."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.machine.geometry.assembly import build_assembly
from spindle_fem.machine.meshing.build_mesh import build_mesh
from spindle_fem.machine.meshing.tagged_mesh import TaggedMesh
from spindle_fem.model.elastic.machine_growth import GrowthModel
from spindle_fem.model.mesh.conduction_problem import ConductionProblem, Film, LumpedLink, LumpedNode
from spindle_fem.model.mesh.kernels.compile import begin_compiling
from spindle_fem.model.mesh.mesh_operators import ThermalOperators, build_operators
from spindle_fem.operation.bearing_heat import (
    BearingMechanics,
    at_assembly_size,
    grows,
    heat_model_of,
)
from spindle_fem.operation.coefficients import joint_conductances
from spindle_fem.operation.loads import Loads
from spindle_fem.operation.machine_loads import FieldState, LoadsBuilder
from spindle_fem.operation.named_places import place_load
from spindle_fem.operation.seat_joints import SeatJoints
from spindle_fem.operation.source_terms import SOURCE_PREFIX

Progress = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class PreparedMachine:
    """A machine with mesh, operators and sorted loads, ready to be solved at any operating point.

    ``growth`` is there where preload follows the fits; ``source_spread`` is the load of 1 W of each
    heat source, (n_unknowns,).
    """

    spec: MachineSpec
    mesh: TaggedMesh
    operators: ThermalOperators
    builder: LoadsBuilder
    joint_conductance: Mapping[str, float]
    conductivity: Mapping[str, float]
    volumetric_capacity: Mapping[str, float]
    geometry_notes: tuple[str, ...] = ()
    growth: GrowthModel | None = None
    source_spread: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    timings: Mapping[str, float] = field(default_factory=dict)

    def field_state(self, unknowns: NDArray[np.float64], lumped: Mapping[str, float]) -> FieldState:
        """Quantities of a field that the loads need: the mean over each facet, and the lumped nodes."""
        operators = self.operators
        area = operators.facet_area
        integral = operators.facet_integral(unknowns, slice(0, len(area)))
        mean = integral / area
        facets = {surface: mean[rows] for surface, rows in operators.surface_rows.items()}
        sides = {
            joint: tuple(float(integral[rows].sum() / area[rows].sum()) for rows in both)
            for joint, both in operators.joint_rows.items()
            if not joint.endswith(":face")
        }
        shifts = {} if self.growth is None else self.growth.shifts(unknowns)
        return FieldState(facets, sides, lumped, shifts)

    def _links(self, loads: Loads) -> Iterator[LumpedLink]:
        """Films of streams on rows of balls, node by node."""
        for row in self.spec.wetted_rows:
            film = loads.films[row]
            conductance = (film.coefficient * self.builder.facet_area[row]).tolist()
            nodes = self.builder.ball_nodes(row.removesuffix(".balls"))
            for node, value, fluid in zip(nodes, conductance, film.temperature.tolist(), strict=True):
                yield LumpedLink(node, value, temperature=fluid, name=film.name)

    def problem(self, loads: Loads, like: ConductionProblem | None = None) -> ConductionProblem:
        """Conduction problem of given loads; ``like`` is one of other loads, whose names it shares."""
        films = tuple(
            Film(surface, film.coefficient, film.temperature, film.name)
            for surface, film in loads.films.items()
            if surface in self.operators.surface_rows
        )
        lumped = tuple(
            LumpedNode(node.name, tuple(node.connections.items()), node.capacity, node.heat)
            for node in loads.lumped
        )
        change = loads.change
        conductivity, joints = self.conductivity, self.joint_conductance
        if change.coefficients:
            conductivity = {
                p: value * change.factor(f"conductivity.{p}") for p, value in conductivity.items()
            }
            joints = {name: value * change.factor(f"joint.{name}") for name, value in joints.items()}
        sources = {
            SOURCE_PREFIX + name: heat * self.source_spread[name] for name, heat in loads.source_heat.items()
        }
        made = partial(
            ConductionProblem,
            self.operators,
            volumetric_capacity=self.volumetric_capacity,
            adiabatic="rest",
        )
        return (made if like is None else like.altered)(
            conductivity=conductivity,
            films=films,
            joint_conductance=joints,
            surface_heat=loads.surface_heat,
            nodal_heat={**change.nodal_heat, **sources},
            capacity_scale=change.capacity_scale,
            lumped_nodes=lumped,
            lumped_links=tuple(self._links(loads)),
        )


def prepare_machine(
    spec: MachineSpec, *, size_factor: float | None = None, progress: Progress = lambda stage: None
) -> PreparedMachine:
    """Mesh a machine and integrate what every solve shares.

    Parameters
    ----------
    size_factor : float, optional
        In place of the machine's own, for mesh-refinement estimates.
    progress : callable
        Called with the name of each stage as it begins.
    """
    clock = Clock(progress)
    clock.begin("geometry")
    kernels = begin_compiling()
    assembly = build_assembly(spec)
    clock.begin("mesh")
    mesh = build_mesh(
        assembly,
        preset=spec.mesh.preset,
        size_factor=spec.mesh.size_factor if size_factor is None else size_factor,
        sizes=spec.mesh.size,
    )
    clock.begin("assembly")
    kernels["elements"]()
    operators = build_operators(mesh, spec.mesh.order)
    machine = machine_on_mesh(spec, mesh, operators)
    kernels["steady"]()
    clock.end()
    return replace(machine, timings=clock.timings)


def machine_on_mesh(spec: MachineSpec, mesh: TaggedMesh, operators: ThermalOperators) -> PreparedMachine:
    """A machine on a mesh and operators that exist: its geometry must be the one that was meshed.

    Heat, films, flow, oil, joints and materials may differ from those of the
    machine that the mesh was made for.
    """
    facet_area = {surface: operators.facet_areas(surface) for surface in mesh.surfaces}
    materials = {part: spec.part_material(part) for part in mesh.part_names}
    capacity_factor = spec.heat_capacity_factor.value
    growth = seat_joints = None
    heat_model = heat_model_of(spec)
    if grows(spec):
        growth = GrowthModel(spec, mesh, operators.order)
        heat_model = BearingMechanics(spec, growth.seating.of_sets(spec))
        seat_joints = SeatJoints(spec, mesh.joints, heat_model.assembled_seats())
    return PreparedMachine(
        spec=spec,
        mesh=mesh,
        operators=operators,
        builder=LoadsBuilder(spec, mesh, facet_area, heat_model, seat_joints),
        growth=growth,
        joint_conductance=joint_conductances(spec, mesh.joints),
        conductivity={part: material.thermal_conductivity for part, material in materials.items()},
        volumetric_capacity={
            part: capacity_factor * material.volumetric_heat_capacity for part, material in materials.items()
        },
        source_spread={source.name: place_load(spec, operators, source.place) for source in spec.source},
    )


def without_expansion(machine: PreparedMachine) -> PreparedMachine:
    """The machine with bearings that keep their size at assembly."""
    return machine_on_mesh(at_assembly_size(machine.spec), machine.mesh, machine.operators)


class Clock:
    """Seconds of each stage; calls the progress callback as stages begin."""

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
