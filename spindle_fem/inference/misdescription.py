"""Directions in which a machine may differ from its definition, beside its uncertain parameters.

Each has a prior width and moves what every channel reads along a fixed column, to first order. Within a fit
it is one more Gaussian number: calibration narrows it, and what it can explain is no evidence of missing
physics.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.effects.framework.effect import Reported
from spindle_fem.inference.coordinate_names import MISDESCRIBED_IN_PREFIX, MISDESCRIBED_PREFIX

Array = NDArray[np.float64]

# What a clock delays.
EVERY_CHANNEL = "*"


@dataclass(frozen=True, slots=True)
class Change:
    """Changes in one recording per unit of a misdescription, at fixed temperatures of the machine.

    Attributes
    ----------
    start, end : (G, r) ndarray or None, [W]
        Loads on the model's unknowns at both ends of every step: a change ``dK`` of the conduction matrix is
        ``-states[:-1] @ dK`` and ``-states[1:] @ dK``; None where there are none.
    direct : (G + 1, c) ndarray or None, [K]
        What the channels read beside that.
    """

    start: Array | None = None
    end: Array | None = None
    direct: Array | None = None


@runtime_checkable
class Redefinable(Protocol):
    """What changes a number of the definition, by far as well, so that the machine can be made anew."""

    def quantity(self, spec: MachineSpec) -> Reported | None:
        """The number as the definition has it; None where no single key does."""

    def redefined(self, spec: MachineSpec, value: float) -> MachineSpec:
        """The machine with that number changed by what a fit to first order found."""


@runtime_checkable
class Factored(Redefinable, Protocol):
    """A number of the definition that the model takes as a factor, by far as well."""

    @property
    def parameter(self) -> str:
        """The model's name of the factor."""

    def of_factor(self, factor: float) -> float:
        """What :meth:`redefined` takes where the number is larger by a factor."""


@dataclass(frozen=True, slots=True)
class Misdescription:
    """One direction of misdescription.

    Attributes
    ----------
    name : str
        Unique for a machine: ``heat_shape.front.1``, ``housing.outer_diameter``.
    key : str
        Key of the definition that would be corrected; words where there is none.
    unit : str
    sigma : float
        One standard deviation of the prior, in ``unit``; the mean is zero: as the definition says.
    statement : str
        What it is, as a report says it, with what the width rests on.
    change : callable
        Takes the :class:`spindle_fem.inference.candidate_response.BaseRun` of a recording. A function of a
        module or a frozen dataclass, as other processes get it too.
        May have a method ``corrected(spec, value)``: the machine with the definition put right; and, where it
        is a number of the definition whose far values are another machine, be :class:`Redefinable`.
    recording : int or None
        The only recording that it concerns; None for the machine itself.
    of_sensor : bool
        Whether it is what is read that differs, not the machine: far off it is an effect of the catalogue,
        no wrong definition.
    delays : str
        Channel that it makes late, or ``EVERY_CHANNEL``, where it does so; of a channel, by much that is an
        effect of the catalogue.
    stands_for : int
        Values of the definition that it changes together.
    """

    name: str
    key: str
    unit: str
    sigma: float
    statement: str
    change: Callable[[Any], Change]
    recording: int | None = None
    of_sensor: bool = False
    delays: str = ""
    stands_for: int = 1

    @property
    def coordinate(self) -> str:
        """Name among the free numbers of a fit."""
        if self.recording is None:
            return MISDESCRIBED_PREFIX + self.name
        return f"{MISDESCRIBED_IN_PREFIX}{self.recording}.{self.name}"

    def amount(self, fitted: float) -> float:
        """How far it goes where a fit has its coordinate at a value."""
        return fitted

    def between(self, given: float, found: float) -> float:
        """How far a number of the definition goes from one value to another, as the prior's width counts.

        Of a share in its logarithm: a quarter is as far off as four times.
        """
        return found - given if self.unit else float(np.log(found / given))

    def told(self, departure: float) -> float:
        """A departure that :meth:`between` gives, as it is told: in the unit, or as a share."""
        return departure if self.unit else float(np.expm1(departure))


def delays_in(number: int, directions: Sequence[Misdescription]) -> dict[str, str]:
    """Of each direction that is a delay in a recording its coordinate, and the channel that it makes late."""
    return {i.coordinate: i.delays for i in directions if i.delays and i.recording in (None, number)}
