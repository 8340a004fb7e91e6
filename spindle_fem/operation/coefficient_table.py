"""Values of every coefficient of a machine at an operating point, and the parameters that scale each."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.definition.uncertain_parameters import uncertain_parameters
from spindle_fem.errors import SpecError, did_you_mean
from spindle_fem.machine.view.machine_names import coefficient_groups
from spindle_fem.model.mesh.thermal_operators import ThermalOperators
from spindle_fem.operation.coefficients import ball_row_capacity, linear_coefficients, material_capacities
from spindle_fem.operation.operating_point import OperatingPoint

INNER_SHARE = "heat.inner_share"


@dataclass(frozen=True, slots=True)
class CoefficientTable:
    """The coefficients of one machine and what scales each.

    Attributes
    ----------
    gap_radii : mapping of gap to (float, float), [m]
        Mean radius of the turning side and of what faces it.
    groups : mapping of coefficient to tuple of str
        Names whose factors multiply it: its own, and that of its group.
    names : tuple of str
        Every name that a factor may have.
    """

    spec: MachineSpec
    contacts: tuple[str, ...]
    gap_radii: Mapping[str, tuple[float, float]]
    groups: Mapping[str, tuple[str, ...]]
    names: tuple[str, ...]

    def base(self, point: OperatingPoint) -> dict[str, float]:
        """Every coefficient at an operating point, SI; only films and gaps depend on it.

        Raises
        ------
        SpecError
            A bearing whose ball row follows its contacts: its conductance changes with load and speed.
        """
        for group in self.spec.bearing_set:
            if group.ball_row.kind != "constant":
                raise SpecError(
                    f"bearing_set.{group.name}.ball_row",
                    f'kind "{group.ball_row.kind}" has no constant conductance for the reduced model.',
                    'Give kind = "constant" with a conductance.',
                )
        return linear_coefficients(self.spec, point, self.contacts, self.gap_radii)

    def capacities(self) -> dict[str, float]:
        """Volumetric capacity of every material [J/(m³·K)] and capacity of every ball row [J/K]."""
        values = {f"capacity.{name}": value for name, value in material_capacities(self.spec).items()}
        for group, bearing in self.spec.bearings:
            values[f"capacity.{bearing.name}.balls"] = ball_row_capacity(self.spec, group, bearing)
        return values

    def heat_groups(self, bearing: str) -> tuple[str, ...]:
        """Names whose factors multiply a bearing's friction heat."""
        owner = next(group.name for group, item in self.spec.bearings if item.name == bearing)
        return (f"heat.{bearing}", f"heat.{owner}")

    def targets(self, parameter: str) -> tuple[str, ...]:
        """Factors that a parameter acts on: a shared factor's targets, or its own name.

        Raises
        ------
        SpecError
            The machine has no such parameter.
        """
        shared = {factor.name: factor.applies_to for factor in self.spec.factor}
        targets = shared.get(parameter, (parameter,))
        for target in targets:
            if target not in self.names:
                raise SpecError(
                    parameter,
                    "is no parameter of this machine.",
                    did_you_mean(parameter, [*shared, *self.names]),
                )
        return targets

    def factors(self, parameters: Mapping[str, float]) -> dict[str, float]:
        """Factor of every name that parameters touch."""
        found: dict[str, float] = {}
        for name, value in parameters.items():
            for target in self.targets(name):
                found[target] = found.get(target, 1.0) * value
        return found

    def scale(self, coefficient: str, factors: Mapping[str, float]) -> float:
        """Product of the factors on one coefficient."""
        return float(np.prod([factors.get(name, 1.0) for name in self.groups[coefficient]]))


def build_coefficient_table(
    spec: MachineSpec,
    contacts: Iterable[str],
    gap_radii: Mapping[str, tuple[float, float]],
) -> CoefficientTable:
    """Coefficients of a machine whose contacts and gaps are known."""
    names = tuple(contacts)
    groups = coefficient_groups(spec, names)
    known = dict.fromkeys(name for entry in groups.values() for name in entry)
    for group, bearing in spec.bearings:
        known |= dict.fromkeys((f"heat.{bearing.name}", f"heat.{group.name}"))
    return CoefficientTable(spec, names, dict(gap_radii), groups, (*known, INNER_SHARE))


def gap_radii_of(spec: MachineSpec, operators: ThermalOperators) -> dict[str, tuple[float, float]]:
    """Mean radii of both sides of every gap, m."""
    mesh = operators.mesh

    def mean_radius(surfaces: tuple[str, ...]) -> float:
        centres = np.concatenate([mesh.points[mesh.surfaces[name][:, :3]].mean(axis=1) for name in surfaces])
        areas = np.concatenate([operators.facet_areas(name) for name in surfaces])
        return float(areas @ np.hypot(centres[:, 0], centres[:, 1]) / areas.sum())

    return {gap.name: (mean_radius((gap.rotating,)), mean_radius(tuple(gap.standing))) for gap in spec.gap}


def free_parameters(spec: MachineSpec) -> dict[str, float]:
    """1 σ of the logarithm of every uncertain parameter, by name."""
    return {item.name: item.sigma_log for item in uncertain_parameters(spec)}
