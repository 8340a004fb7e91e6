"""What a definition gives with a prior, as numbers of it that may be wrong by more than the prior allows."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.definition.uncertain_parameters import (
    coefficient_value,
    uncertain_parameters,
    with_parameters,
)
from spindle_fem.effects.framework.effect import Reported
from spindle_fem.inference.misdescription import Change, Misdescription

# Factor on the heat capacities of all materials.
EVERY_CAPACITY = "heat_capacity_factor"
# Units as a report has them.
TOLD_IN = {"W/m**2/K": "W/(m²·K)"}


@dataclass(frozen=True, slots=True)
class Scaled:
    """Another value of an uncertain parameter, by a factor whose logarithm a fit finds.

    Attributes
    ----------
    parameter : str
    coefficient : str
        The first of those that it multiplies, whose value is told.
    """

    parameter: str
    coefficient: str

    def __call__(self, base: Any) -> Change:
        """Nothing beside what every fit follows by itself."""
        return Change()

    def quantity(self, spec: MachineSpec) -> Reported:
        """The first value that the parameter multiplies."""
        value, unit = coefficient_value(spec, self.coefficient)
        return Reported(value, TOLD_IN.get(unit, unit))

    def of_factor(self, factor: float) -> float:
        """Its logarithm."""
        return float(np.log(factor))

    def redefined(self, spec: MachineSpec, value: float) -> MachineSpec:
        """The machine with all values that the parameter multiplies changed by a factor."""
        return with_parameters(spec, {self.parameter: float(np.exp(value))})


@dataclass(frozen=True, slots=True)
class UncertainNumber(Misdescription):
    """An uncertain parameter as a direction, in the logarithm of its factor."""

    @property
    def coordinate(self) -> str:
        """The parameter is free in every fit."""
        return self.name

    def amount(self, fitted: float) -> float:
        """The logarithm of a fitted factor."""
        return float(np.log(fitted))


def uncertain_numbers(spec: MachineSpec) -> Iterator[UncertainNumber]:
    """Every uncertain parameter of a machine with geometry."""
    for item in uncertain_parameters(spec):
        keys = ", ".join(item.keys)
        change, statement = Scaled(item.name, item.applies_to[0]), f"share by which {keys} is larger"
        # The heat capacity of every material is multiplied by one.
        values = len(spec.materials) if item.name == EVERY_CAPACITY else len(item.keys)
        yield UncertainNumber(item.name, keys, "", item.sigma_log, statement, change, stands_for=values)
