"""Means of the temperature field over the named places of a machine, as vectors over its unknowns."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.machine_spec import AnnulusSegment, MachineSpec
from spindle_fem.errors import SpecError
from spindle_fem.machine.view.place_names import ACROSS, UP, growth_names, ringed_probes, sided_names
from spindle_fem.model.elastic.machine_growth import GrowthModel
from spindle_fem.model.mesh.thermal_operators import ThermalOperators
from spindle_fem.operation.machine_loads import LoadsBuilder
from spindle_fem.operation.probe_places import around_places, harmonics, near_places

Array = NDArray[np.float64]


class MachineOnMesh(Protocol):
    """Interface of a prepared machine that places need."""

    @property
    def spec(self) -> MachineSpec:
        """Definition of the machine."""

    @property
    def operators(self) -> ThermalOperators:
        """Its mesh, integrated."""

    @property
    def builder(self) -> LoadsBuilder:
        """Builder that has the ball rows."""


def named_places(machine: MachineOnMesh, lumped: tuple[str, ...], size: int) -> Iterator[tuple[str, Array]]:
    """Every named place of a machine with the weights of its mean; also the load of 1 W spread over it.

    Parameters
    ----------
    lumped : tuple of str
        Lumped nodes, whose unknowns follow those of the mesh.
    size : int
        Unknowns, lumped nodes included.

    Yields
    ------
    str, (size,) ndarray
        Parts, segments, surfaces, seats (``<contact>@0``, ``@1``), ball rows, and the
        neighbourhoods of point probes. The weights sum to 1; of first harmonics, to 0.
    """
    spec, operators = machine.spec, machine.operators
    mesh = operators.mesh

    def padded(vector: Array) -> Array:
        return np.concatenate((vector, np.zeros(size - len(vector)))) / vector.sum()

    sided = dict.fromkeys(sided_names(spec))

    for part in mesh.part_names:
        own = _part_load(operators, part)
        yield part, padded(own)
        for segment in next((p.segment for p in spec.part if p.name == part), ()):
            vector = _segment_load(operators, own, segment)
            if vector is not None:
                name = f"{part}.{segment.name}"
                yield name, padded(vector)
                if name in sided:
                    sided[name] = vector / vector.sum()
    for surface, rows in operators.surface_rows.items():
        if not surface.endswith(".adiabatic"):
            yield surface, padded(_surface_load(operators, rows))
    for contact, sides in operators.joint_rows.items():
        if not contact.endswith(":face"):
            for number, rows in enumerate(sides):
                yield f"{contact}@{number}", padded(_surface_load(operators, rows))
    for _, bearing in spec.bearings:
        nodes = [
            operators.n_unknowns + lumped.index(node) for node in machine.builder.ball_nodes(bearing.name)
        ]
        vector = np.zeros(size)
        vector[nodes] = 1.0 / len(nodes)
        yield f"{bearing.name}.balls", vector
    for name, near in near_places(operators, [probe for probe in spec.probe if probe.kind == "point"]):
        yield name, padded(near)
    for name, ring in around_places(operators, ringed_probes(spec)):
        yield name, padded(ring)
    for name, mean in sided.items():
        if mean is not None:
            for prefix, harmonic in zip((UP, ACROSS), harmonics(operators, mean), strict=True):
                yield prefix + name, np.concatenate((harmonic, np.zeros(size - len(harmonic))))


def growth_places(growth: GrowthModel, size: int) -> Iterator[tuple[str, Array]]:
    """Every seat of bearings with fits on shaft and housing, with weights of the temperature of its growth.

    That is the one at which the body, as warm all over, grows as far there; the weights sum to 1, and some
    are negative.

    Parameters
    ----------
    size : int
        As of :func:`named_places`.

    Yields
    ------
    str, (size,) ndarray
    """
    names = growth_names(growth.spec)
    for ring, rows in zip(growth.rings, growth.seat_rows, strict=True):
        if ring.seat.bearing in names:
            name = names[ring.seat.bearing][0 if ring.seat.is_inner else 1]
            yield name, np.concatenate((rows / rows.sum(), np.zeros(size - len(rows))))


def place_load(spec: MachineSpec, operators: ThermalOperators, place: str) -> Array:
    """Load of 1 W spread over a part, a ring, a segment ``part.segment`` or a surface, (n_unknowns,).

    Raises
    ------
    SpecError
        A segment too thin for the mesh to resolve.
    """
    if place in operators.surface_rows:
        found = _surface_load(operators, operators.surface_rows[place])
    elif place in operators.mesh.part_names:
        found = _part_load(operators, place)
    else:
        part, _, name = place.partition(".")
        segment = next(s for p in spec.part if p.name == part for s in p.segment if s.name == name)
        found = _segment_load(operators, _part_load(operators, part), segment)
        if found is None:
            raise SpecError(
                place, "is too thin for this mesh.", "Take a finer mesh.preset, or the whole part."
            )
    return found / found.sum()


def _part_load(operators: ThermalOperators, part: str) -> Array:
    own = operators.part_of_unknown == operators.mesh.part_names.index(part)
    return np.where(own, operators.part_load, 0.0)


def _segment_load(operators: ThermalOperators, part_load: Array, segment: AnnulusSegment) -> Array | None:
    """Share of a part's load between a segment's ends; None if the mesh cannot resolve it."""
    z = operators.mesh.points[: operators.n_unknowns, 2]
    inside = (z >= segment.z[0] - 1e-9) & (z <= segment.z[1] + 1e-9)
    vector = np.where(inside, part_load, 0.0)
    # Quadratic corner functions integrate to less than zero: a thin slice may have no volume left.
    return vector if vector.sum() > 1e-3 * part_load.sum() else None


def _surface_load(operators: ThermalOperators, rows: slice) -> Array:
    return operators.facet_vector(np.ones(rows.stop - rows.start), rows)
