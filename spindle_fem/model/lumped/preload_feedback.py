"""Steady state of a machine's network while expansion changes the preload, and with it the heat.

The loop starts from the state without expansion, so that cold grease does not
carry it past the fixed point, and creeps up while the preload grows.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from spindle_fem.errors import ConvergenceError, NoEquilibriumError, NoSteadyStateError, OutOfValidityError
from spindle_fem.operation.bearing_heat import (
    LARGEST_PRELOAD_RATIO,
    BearingTemperatures,
    HeatModel,
    preload_runs_away,
)
from spindle_fem.operation.operating_point import OperatingPoint

Array = NDArray[np.float64]
Around = Mapping[str, BearingTemperatures]
RELAXATION = 0.4
# Changes below this many kelvin are extrapolated, larger ones followed.
MIXING_BELOW = 1.0
MIXING_DEPTH = 5
TOLERANCE = 1.0e-7
ROUNDS = 150
# From below, steps towards a fixed point shrink; this many growing ones in a row lead to none.
GROWING_STEPS = 5
SPEED_TOLERANCE = 0.01


def settle(
    point: OperatingPoint,
    heat_model: HeatModel,
    response: Callable[[OperatingPoint, Around], tuple[Around, Mapping[str, float]]],
    start: Around,
    name: str,
) -> Around:
    """Bearing temperatures that the heat at those temperatures makes.

    Parameters
    ----------
    point : OperatingPoint
    heat_model : HeatModel
        With expansion.
    response : callable
        Bearing temperatures of the machine with heat and contacts at given bearing temperatures,
        and the preloads (N) there.
    start : mapping of bearing to BearingTemperatures
        Without expansion.
    name : str
        Of the machine, for messages.

    Raises
    ------
    NoSteadyStateError
        The preload passes five times that of assembly, the loop diverges, or no equilibrium of the
        balls is left.
    ConvergenceError
    """
    cold = {name: BearingTemperatures(*(point.ambient_temperature,) * 5) for name in start}
    assembled = {name: heat.preload for name, heat in heat_model(point, cold)[0].items()}
    given, inputs, outputs = _vector(start), [], []
    before, growing = np.inf, 0
    for _ in range(ROUNDS):
        around = _named(given, start)
        try:
            answer, preload = response(point, around)
            if preload_runs_away(preload, assembled):
                worst = max(preload, key=lambda key: preload[key] / assembled[key])
                raise _none_at(
                    point, name,
                    f"the preload of {worst} passes {LARGEST_PRELOAD_RATIO:g} times the "
                    f"{assembled[worst]:.0f} N of assembly.",
                )  # fmt: skip
            found = _vector(answer)
        except (NoEquilibriumError, OutOfValidityError) as error:
            raise _none_at(point, name, str(error)) from error
        change = float(np.abs(found - given).max())
        if change < TOLERANCE:
            return around
        growing = growing + 1 if before < change else 0
        before = change
        if growing >= GROWING_STEPS and change > MIXING_BELOW:
            raise _none_at(
                point, name, "heat grows faster with the preload than the machine carries it away."
            )
        if change > MIXING_BELOW:
            inputs, outputs = [], []
            given = given + RELAXATION * (found - given)
        else:
            inputs, outputs = [*inputs, given][-MIXING_DEPTH:], [*outputs, found][-MIXING_DEPTH:]
            given = _mixed(inputs, outputs)
    raise ConvergenceError(
        name,
        f"heat and preload of the bearings still follow a change of {change:.2g} K.",
        "Friction heat may rise with temperature faster than the machine can carry it away.",
    )


def highest_settling_speed(highest: float, settles: Callable[[float], bool]) -> float:
    """Largest speed (rad/s) below ``highest`` at which ``settles`` still holds, to a hundredth."""
    low, high = 0.0, highest
    while high - low > SPEED_TOLERANCE * highest:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if settles(middle) else (low, middle)
    return low


def with_limit(error: NoSteadyStateError, limit: float) -> NoSteadyStateError:
    """The same error, saying up to which speed (rad/s) there is an equilibrium."""
    begins = f"A thermal equilibrium exists up to about {limit * 30.0 / np.pi:.0f} rpm."
    return NoSteadyStateError(error.where, error.what, f"{begins} {error.how_to_fix}")


def _none_at(point: OperatingPoint, name: str, reason: str) -> NoSteadyStateError:
    rpm = point.speed * 30.0 / np.pi
    return NoSteadyStateError(
        name,
        f"no thermal equilibrium at {rpm:.0f} rpm: {reason}",
        "Lower the speed or the preload, or cool more.",
    )


def _mixed(inputs: list[Array], outputs: list[Array]) -> Array:
    """Anderson's combination of past iterates (Walker & Ni 2011)."""
    if len(inputs) == 1:
        return outputs[-1]
    residuals = np.array(outputs) - np.array(inputs)
    weights, *_ = np.linalg.lstsq(np.diff(residuals, axis=0).T, residuals[-1], rcond=1.0e-10)
    return outputs[-1] - np.diff(np.array(outputs), axis=0).T @ weights


def _vector(around: Around) -> Array:
    rows = [[getattr(item, key) for key in BearingTemperatures.__slots__] for item in around.values()]
    return np.array(rows).ravel()


def _named(values: Array, like: Around) -> dict[str, BearingTemperatures]:
    rows = values.reshape(len(like), -1).tolist()
    return {name: BearingTemperatures(*row) for name, row in zip(like, rows, strict=True)}
