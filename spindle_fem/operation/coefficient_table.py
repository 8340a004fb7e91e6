"""What every coefficient of a machine is at an operating point, and which parameters scale it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from spindle_fem.definition.machine_spec import MachineSpec, NaturalFilm
from spindle_fem.definition.uncertain_parameters import uncertain_parameters
from spindle_fem.errors import SpecError, did_you_mean
from spindle_fem.machine.view.machine_names import coefficient_groups
from spindle_fem.model.mesh.thermal_operators import ThermalOperators
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.operation.outside_films import film_coefficient, gap_coefficient

INNER_SHARE = "heat.inner_share"
# A natural film's constant part is taken where the wall is this much warmer than the air.
NATURAL_DIFFERENCE = 10.0


@dataclass(frozen=True, slots=True)
class CoefficientTable:
    """The coefficients of one machine and what scales each.

    Attributes
    ----------
    spec : MachineSpec
    contacts : tuple of str
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
        """Every coefficient at an operating point, SI; only films and gaps depend on it."""
        spec = self.spec
        values = {f"conductivity.{name}": item.thermal_conductivity for name, item in spec.materials.items()}
        conductance = {f"joint.{group.name}": group.conductance.value for group in spec.joint}
        values |= {f"joint.{name}": conductance[self.groups[f"joint.{name}"][1]] for name in self.contacts}
        for film in spec.film:
            fluid = point.ambient_temperature if film.temperature == "ambient" else film.temperature
            if isinstance(film, NaturalFilm):
                value = natural_reference(spec, film)
            else:
                value = float(film_coefficient(film, point, np.array([fluid]), fluid)[0][0])
            values |= {f"film.{surface}": value for surface in film.surface}
        for gap in spec.gap:
            values[f"gap.{gap.name}"] = gap_coefficient(gap, point, *self.gap_radii[gap.name])[0]
        for group, bearing in spec.bearings:
            for side in ("inner", "outer"):
                values[f"balls.{bearing.name}.{side}"] = group.ball_row.conductance.value
        return values

    def capacities(self) -> dict[str, float]:
        """Volumetric capacity of every material [J/(m³·K)] and capacity of every ball row [J/K]."""
        spec = self.spec
        factor = spec.heat_capacity_factor.value
        values = {
            f"capacity.{name}": factor * item.volumetric_heat_capacity
            for name, item in spec.materials.items()
        }
        for group, bearing in spec.bearings:
            kind = spec.bearing_types[group.bearing_type]
            volume = kind.ball_count * np.pi / 6.0 * kind.ball_diameter**3
            material = spec.materials[kind.ball_material]
            own = group.ball_row.capacity
            values[f"capacity.{bearing.name}.balls"] = factor * (
                own if own is not None else volume * material.volumetric_heat_capacity
            )
        return values

    def heat_groups(self, bearing: str) -> tuple[str, ...]:
        """Names whose factors multiply a bearing's friction heat."""
        owner = next(group.name for group, item in self.spec.bearings if item.name == bearing)
        return (f"heat.{bearing}", f"heat.{owner}")

    def targets(self, parameter: str) -> tuple[str, ...]:
        """Factors that a parameter stands for: a shared factor's, or its own name.

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
    """Coefficients of a machine whose contacts and gaps are known.

    Raises
    ------
    SpecError
        A bearing whose ball row follows its contacts: its conductance would
        change with load and speed.
    """
    names = tuple(contacts)
    for group in spec.bearing_set:
        if group.ball_row.kind != "constant":
            raise SpecError(
                f"bearing_set.{group.name}.ball_row",
                f'kind "{group.ball_row.kind}" has no constant conductance for the reduced model.',
                'Give kind = "constant" with a conductance.',
            )
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


def natural_reference(spec: MachineSpec, film: NaturalFilm) -> float:
    """What the operators hold of a natural film: its coefficient 10 K above the defined surroundings."""
    point = OperatingPoint.of(spec)
    fluid = point.ambient_temperature if film.temperature == "ambient" else film.temperature
    return float(film_coefficient(film, point, np.array([fluid + NATURAL_DIFFERENCE]), fluid)[0][0])
