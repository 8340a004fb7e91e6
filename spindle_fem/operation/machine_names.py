"""What a fast model of a machine would call things, known before there is a mesh."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.machine.geometry.assembly import build_assembly
from spindle_fem.machine.geometry.faces import MeridianEdge
from spindle_fem.operation.coefficients import CoefficientTable, build_coefficient_table
from spindle_fem.operation.probe_places import ACROSS, AROUND, NEAR, UP, ringed_probes, sided_names
from spindle_fem.units import Uncertain


@dataclass(frozen=True, slots=True)
class MachineNames:
    """Names of a :class:`spindle_fem.model.reduced.fast_model.FastModel` and of its reduced model in one.

    Attributes
    ----------
    spec : MachineSpec
    place_names : tuple of str
        Also slices of parts that a coarse mesh may be unable to tell apart.
    fluid_names : tuple of str
        Coefficients that are films.
    bearings, channels : tuple of str
    table : CoefficientTable
    """

    spec: MachineSpec
    place_names: tuple[str, ...]
    fluid_names: tuple[str, ...]
    bearings: tuple[str, ...]
    channels: tuple[str, ...]
    table: CoefficientTable

    @classmethod
    def of(cls, spec: MachineSpec) -> MachineNames:
        """Names of a machine whose parts fit together."""
        assembly = build_assembly(spec)
        contacts = assembly.joint_names
        bearings = tuple(bearing.name for _, bearing in spec.bearings)
        places = [
            *assembly.part_names,
            *(f"{part.name}.{segment.name}" for part in spec.part for segment in part.segment),
            *(name for name in assembly.surface_names if not name.endswith(".adiabatic")),
            *(f"{name}@{side}" for name in contacts if not name.endswith(":face") for side in (0, 1)),
            *(f"{name}.balls" for name in bearings),
            *(NEAR + probe.name for probe in spec.probe if probe.kind == "point"),
            *(AROUND + probe.name for probe in ringed_probes(spec)),
            *(prefix + name for name in sided_names(spec) for prefix in (UP, ACROSS)),
        ]
        edges = assembly.edges
        radii = {
            gap.name: (_mean_radius(edges, (gap.rotating,)), _mean_radius(edges, gap.standing))
            for gap in spec.gap
        }
        return cls(
            spec,
            tuple(places),
            tuple(f"film.{surface}" for film in spec.film for surface in film.surface),
            bearings,
            tuple(probe.name for probe in spec.probe),
            build_coefficient_table(_with_constant_rows(spec), contacts, radii),
        )

    @property
    def model(self) -> MachineNames:
        """The names of the reduced model."""
        return self


def _mean_radius(edges: Iterable[MeridianEdge], surfaces: Iterable[str]) -> float:
    """Of surfaces of revolution, by area, m."""
    wanted = set(surfaces)
    own = [edge for edge in edges if edge.name in wanted]
    radius = np.array([0.5 * (edge.r[0] + edge.r[1]) for edge in own])
    length = np.array([np.hypot(edge.r[1] - edge.r[0], edge.z[1] - edge.z[0]) for edge in own])
    return float(np.average(radius, weights=radius * length))


def _with_constant_rows(spec: MachineSpec) -> MachineSpec:
    """Ball rows with any constant conductance: names do not depend on its value."""
    sets = [
        group.model_copy(
            update={
                "ball_row": group.ball_row.model_copy(
                    update={"kind": "constant", "conductance": Uncertain(1.0)}
                )
            }
        )
        for group in spec.bearing_set
    ]
    return spec.model_copy(update={"bearing_set": tuple(sets)})
