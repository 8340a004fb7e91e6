"""What rows and gaps leave open of a machine that is followed: when inputs changed, what happened in gaps.

To first order each is one unknown number with a known spread, and what a deviation of it does to the machine
is carried from piece to piece of a recording.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from spindle_fem.inference.candidate_response import BaseRun
from spindle_fem.inference.gap_misdescriptions import has_unread, unread_heat
from spindle_fem.inference.recording_gaps import (
    TIMES,
    WARMTH,
    Hidden,
    hidden_forcing,
    jump_forcing,
    weights_of_earlier,
)

Array = NDArray[np.float64]

# Friction within a gap, one standard deviation as a share of the highest: the machine may have stood as well
# as run. A diagnosis, which reads on beyond the gap, expects less of it.
STOOD_OR_RAN = 1.0


def opened_by_rows(
    base: BaseRun, jumps: Sequence[tuple[int, float, float]], hidden: Sequence[Hidden]
) -> tuple[Array, Array]:
    """What rows and gaps of a piece leave open of a machine with geometry.

    Parameters
    ----------
    jumps : sequence of n (int, float, float)
        As :func:`unseen_jumps` gives them: each moment is as likely anywhere between its bounds.
    hidden : sequence of m Hidden

    Returns
    -------
    expected : (G, r) ndarray, [K]
        Change of the states in each step that is expected.
    opened : (G, r, n + m) ndarray, [K]
        By a standard deviation of each number.
    """
    steps, size = len(base.run.drive.steps), base.predictor.fast.model.size
    least, most = np.array([item[1:] for item in jumps]).reshape(-1, 2).T
    earlier = jump_forcing(base.run, base.states, jumps).reshape(steps, size, len(jumps), TIMES)
    weights, slopes = weights_of_earlier(most, 0.5 * (least + most))
    slopes = slopes * ((most - least) / np.sqrt(12.0))[:, None]
    spread = [item.sigma if item.what in WARMTH else max(item.sigma, STOOD_OR_RAN) for item in hidden]
    within = hidden_forcing(base.run, base.predictor.fast, hidden) * spread
    fresh = np.concatenate((np.einsum("grnt,nt->grn", earlier, slopes), within), axis=2)
    return np.einsum("grnt,nt->gr", earlier, weights), fresh


def opened_by_gaps(base: BaseRun, earlier: Sequence[Array]) -> Array:
    """What gaps of a piece leave open of a network: the heat of its sources, (G, r, n) K.

    Parameters
    ----------
    earlier : sequence of n (s,) ndarray, [W]
        Heat of the sources in the steps before.
    """
    found = []
    if has_unread(base.predictor.recordings[0]):
        before = np.reshape(earlier, (len(earlier), base.run.friction_start.shape[1]))
        found = list(unread_heat(base.predictor, 0, base.run, before))
    loads = np.zeros((len(base.run.drive.steps), base.predictor.fast.model.size, len(found)))
    for index, item in enumerate(found):
        loads[:, :, index] = item.sigma * item.change(base).start
    return base.forcing(loads, loads)


def carried_on(base: BaseRun, begun: Array, expected: Array, opened: Array) -> tuple[Array, Array]:
    """Changes over a piece by what it and earlier ones leave open.

    Parameters
    ----------
    base : BaseRun
        Of the piece.
    begun : (r, 1 + e) ndarray, [K]
        Changes of the states at the start of the piece: what is expected of all that was open, then a
        standard deviation of each.
    expected, opened
        As :func:`opened_by_rows` gives them.

    Returns
    -------
    channels : (G + 1, c, 1 + e + n) ndarray, [K]
    states : (r, 1 + e + n) ndarray, [K]
        At the end of the piece.
    """
    steps, size = opened.shape[:2]
    forcing = np.zeros((steps, size, begun.shape[1] + opened.shape[2]))
    forcing[:, :, 0] = expected
    forcing[:, :, begun.shape[1] :] = opened
    start = np.zeros((1, *forcing.shape[1:]))
    start[0, :, : begun.shape[1]] = begun
    states = base.run.tangents(forcing, base.tracks, start=start)
    return base.outputs(states), states[-1]
