"""Directions in which a machine may differ from its definition, and what each does to the readings.

A provider is a function that takes a :class:`Predictor` and yields the directions it knows of; a new one is
added to ``PROVIDERS``. What a direction does is worked out once, about one run of each recording, by the
model itself.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from spindle_fem.effects.framework.effect import Candidate
from spindle_fem.inference.candidate_response import BaseRun
from spindle_fem.inference.coolant_misdescriptions import coolant_misdescriptions
from spindle_fem.inference.coordinate_names import NO_VALUES
from spindle_fem.inference.gap_misdescriptions import gap_misdescriptions
from spindle_fem.inference.growth_misdescriptions import growth_misdescriptions
from spindle_fem.inference.heat_misdescriptions import heat_misdescriptions
from spindle_fem.inference.misdescription import Misdescription
from spindle_fem.inference.mounting_misdescriptions import mounting_misdescriptions
from spindle_fem.inference.network_misdescriptions import network_misdescriptions
from spindle_fem.inference.prediction import late_channels
from spindle_fem.inference.predictor import Predictor
from spindle_fem.inference.structural_misdescriptions import structural_misdescriptions

Array = NDArray[np.float64]
Provider = Callable[[Predictor], Iterable[Misdescription]]

PROVIDERS: tuple[Provider, ...] = (
    heat_misdescriptions,
    coolant_misdescriptions,
    structural_misdescriptions,
    mounting_misdescriptions,
    growth_misdescriptions,
    network_misdescriptions,
    gap_misdescriptions,
)


def misdescriptions_of(predictor: Predictor) -> tuple[Misdescription, ...]:
    """Every direction of a machine on its recordings; the same and in one order for the same machine."""
    return tuple(item for provider in PROVIDERS for item in provider(predictor))


def with_misdescriptions(
    predictor: Predictor,
    directions: Sequence[Misdescription],
    values: Mapping[str, float] = NO_VALUES,
    candidates: Sequence[Candidate] = (),
) -> Predictor:
    """Add columns of the directions, about runs with the given values, to a predictor.

    Parameters
    ----------
    values, candidates
        As :meth:`Predictor.predict` takes them.
    """
    columns = columns_about(predictor, directions, values, candidates)
    return predictor.misdescribed_by(directions, columns, (dict(values), tuple(candidates)))


def columns_about(
    predictor: Predictor,
    directions: Sequence[Misdescription],
    values: Mapping[str, float],
    candidates: Sequence[Candidate],
) -> dict[tuple[int, str], Array]:
    """What directions do about runs with the given values, as :meth:`Predictor.misdescribed_by` takes it.

    A delay of a channel does nothing where a candidate gives it one, as :func:`late_channels` has it.
    """
    columns = {}
    for number in range(len(predictor.recordings)):
        late = late_channels(candidates, number)
        acting = [i for i in directions if i.recording in (None, number) and i.delays not in late]
        if acting:
            found, _ = direction_columns(BaseRun(predictor, number, values, candidates), acting)
            columns |= {(number, item.coordinate): found[:, :, i] for i, item in enumerate(acting)}
    return columns


def direction_columns(base: BaseRun, directions: Sequence[Misdescription]) -> tuple[Array, Array]:
    """Changes per unit of each direction.

    Returns
    -------
    (G + 1, c, n) ndarray
        Of every channel, K over the direction's unit.
    (G + 1, r, n) ndarray
        Of the states.
    """
    changes = [item.change(base) for item in directions]
    steps, size = len(base.drive.steps), base.predictor.fast.model.size
    start, end = (np.zeros((steps, size, len(changes))) for _ in range(2))
    for index, change in enumerate(changes):
        if change.start is not None:
            start[:, :, index] = change.start
        if change.end is not None:
            end[:, :, index] = change.end
    states = base.state_changes(start, end)
    channels = base.outputs(states)
    for index, change in enumerate(changes):
        if change.direct is not None:
            channels[:, :, index] += change.direct
    return channels, states
