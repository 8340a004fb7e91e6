"""How far the full model confirms what a set explains on the fast one, and what its probability is then."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spindle_fem.inference import tuned
from spindle_fem.inference.findings import channel_noise
from spindle_fem.inference.predictor import Predictor
from spindle_fem.inference.robust_size import huber
from spindle_fem.inference.verdict import unexplained_share

Array = NDArray[np.float64]

# Share of a change that a mesh with linear temperatures may be off by, even where its temperatures are not:
# four effects on two machines were off by 1 to 3 %, one of them on the machine's own mesh by 0.1 %.
LINEAR_SHARE = 0.03
# Share of a set's probability that a full model leaves where it is said to confirm the set.
CONFIRMED = 0.95


def left_by_both(
    predictor: Predictor,
    fast: Mapping[str, Sequence[Array]],
    full: Mapping[str, Sequence[Array]],
    least_share: float = 0.0,
) -> tuple[float, float]:
    """What a set leaves of fitted readings over their errors: on the fast model, and as the full one has it.

    The full model's mesh reads apart from the fast model with and without the set: what it says of the set is
    the change from without it, in the place of the fast model's. Errors are the sensor's noise, the slow
    error expected of it, and of the change as large a share as both models are apart of the readings' rise
    without the set: no mesh tells a change better than it tells temperatures.

    Parameters
    ----------
    fast, full : mapping of ``before`` and ``after`` to (N, c) ndarray of each recording, [K]
        Predictions at the stamps, without the set and with it.
    least_share : float
        Of a change, that the mesh may be off by at least.
    """
    ratios: dict[str, list[float]] = {"fast": [], "full": []}
    for number, recording in enumerate(predictor.recordings):
        for channel in range(recording.temperature_count):
            rows = recording.usable[:, channel] & predictor.use[number]
            if not rows.any():
                continue
            reading = recording.temperature[rows, channel]
            (before, after), (mesh_before, mesh_after) = (
                [model[when][number][rows, channel] for when in ("before", "after")] for model in (fast, full)
            )
            rise = np.sqrt(np.mean((before - before[0]) ** 2))
            share = np.sqrt(np.mean((mesh_before - before) ** 2)) / max(rise, tuned.EXPECTED_SLOW_SIGMA)
            share, change = max(share, least_share), mesh_after - mesh_before
            sensor = np.hypot(channel_noise(predictor, recording, channel), tuned.EXPECTED_SLOW_SIGMA)
            error = np.hypot(sensor, share * change)
            for name, predicted in (("fast", after), ("full", before + change)):
                ratios[name].append(float(np.mean(huber((reading - predicted) / error))))
    left = [float(np.sqrt(np.mean(found))) if found else 0.0 for found in ratios.values()]
    return left[0], left[1]


def confirmed_share(fast: float, full: float) -> float:
    """Share of a set's probability that is left by what both models leave of the readings.

    What a set leaves says how probable something else is (:func:`unexplained_share`), on either model.

    >>> [round(confirmed_share(1.0, full), 2) for full in (0.8, 1.2, 2.0)]
    [1.0, 0.96, 0.5]
    """
    return min(1.0, (1.0 - unexplained_share(full)) / (1.0 - unexplained_share(fast)))


def with_confirmation(content: dict[str, Any]) -> dict[str, Any]:
    """``diagnosis.json`` with the probability of the set as far as the full model confirms it.

    Where the full model has the set leave more than twice the errors, the verdict is ``unexplained``.
    """
    full = content["fit"]["full_model"]
    if not content["findings"] or full.get("left") is None:
        return content
    kept = confirmed_share(**full["left"])
    stated = content["set_probability"]
    found = content | {
        "set_probability": kept * stated,
        "something_else_probability": content["something_else_probability"] + (1.0 - kept) * stated,
        "findings": [item | {"probability": kept * item["probability"]} for item in content["findings"]],
    }
    if full["left"]["full"] > tuned.MOST_LEFT >= full["left"]["fast"]:
        reason = (
            f"the full model does not confirm what comes nearest: with it the readings are "
            f"{full['left']['full']:.1f} times as far off as the errors expected, {full['left']['fast']:.1f} "
            "times on the fast model"
        )
        found |= {"verdict": "unexplained", "reason": " ".join(filter(None, (content["reason"], reason)))}
    return found
