"""Means of the temperature field over the named places of a machine, as vectors over its unknowns."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.machine.view.place_names import ACROSS, UP, ringed_probes, sided_names
from spindle_fem.model.mesh.thermal_operators import ThermalOperators
from spindle_fem.operation.machine_loads import LoadsBuilder
from spindle_fem.operation.probe_places import around_places, harmonics, near_places

Array = NDArray[np.float64]


class MachineOnMesh(Protocol):
    """What places need of a prepared machine."""

    @property
    def spec(self) -> MachineSpec:
        """Its definition."""

    @property
    def operators(self) -> ThermalOperators:
        """Its mesh, integrated."""

    @property
    def builder(self) -> LoadsBuilder:
        """What knows its ball rows."""


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
    z = mesh.points[: operators.n_unknowns, 2]

    def padded(vector: Array) -> Array:
        return np.concatenate((vector, np.zeros(size - len(vector)))) / vector.sum()

    sided = dict.fromkeys(sided_names(spec))

    for index, part in enumerate(mesh.part_names):
        own = np.where(operators.part_of_unknown == index, operators.part_load, 0.0)
        yield part, padded(own)
        for segment in next((p.segment for p in spec.part if p.name == part), ()):
            inside = (z >= segment.z[0] - 1e-9) & (z <= segment.z[1] + 1e-9)
            vector = np.where(inside, own, 0.0)
            # Quadratic corner functions integrate to less than zero: a thin slice may have no volume left.
            if vector.sum() > 1e-3 * own.sum():
                name = f"{part}.{segment.name}"
                yield name, padded(vector)
                if name in sided:
                    sided[name] = vector / vector.sum()
    for surface, rows in operators.surface_rows.items():
        if not surface.endswith(".adiabatic"):
            yield surface, padded(operators.facet_vector(np.ones(rows.stop - rows.start), rows))
    for contact, sides in operators.joint_rows.items():
        if not contact.endswith(":face"):
            for number, rows in enumerate(sides):
                vector = operators.facet_vector(np.ones(rows.stop - rows.start), rows)
                yield f"{contact}@{number}", padded(vector)
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
