"""Whether the definition itself is wrong in one direction, by more than its prior allows.

A misdescription is small by its prior. Where one direction explains a recording far beyond that, and better
than any effect does, its prior is given up and everything is fitted again: what is off is the definition.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.effects.framework.effect import Reported, quantity
from spindle_fem.inference import tuned
from spindle_fem.inference.belief import THETA_BOUND, Belief
from spindle_fem.inference.hypothesis import Hypothesis
from spindle_fem.inference.hypothesis_fit import Fit, Problem
from spindle_fem.inference.linearised_fit import Box, LinearProblem, bounded_minimum
from spindle_fem.inference.misdescription import Misdescription, Redefinable
from spindle_fem.inference.opened_machine import DiagnosedMachine
from spindle_fem.inference.set_odds import tempered
from spindle_fem.inference.verdict import PRIOR_SIGMAS, Judgement

Array = NDArray[np.float64]

# Width of the prior of what is wrong, in standard deviations of the one that is given up.
WIDER = 10.0
# Effects beside which a wrong definition is looked for, at most.
MOST_BESIDE = 2


@dataclass(frozen=True, slots=True)
class WrongDirection:
    """A direction whose prior does not hold.

    Attributes
    ----------
    belief : Belief
        With that prior given up.
    value : float
        What is foreseen of it then, in its unit.
    log_gain : float
        What the data become likelier by, priors and the wider one's complexity included.
    log_prior : float
        Of one direction among all of them and all effects, over none.
    p_value : float
        Probability of so large a gain in any of the directions if the definition were right.
    told : float
        What held-out readings become likelier by, as a logarithm that counts.
    by_calibration : bool
        Whether the machine's own calibration says so.
    """

    direction: Misdescription
    belief: Belief
    value: float
    log_gain: float
    log_prior: float
    p_value: float
    told: float = 0.0
    by_calibration: bool = False

    @property
    def is_beyond_chance(self) -> bool:
        """Whether what fitted and held-out readings say together is twenty to one, as of a set of effects."""
        return self.log_gain + self.told >= tuned.LEAST_HELDOUT_GAIN and self.p_value <= tuned.SIGNIFICANT


@dataclass(frozen=True, slots=True)
class Redefined:
    """That a definition was put right, about which a machine is diagnosed anew.

    Attributes
    ----------
    given : MachineSpec
        As it was given.
    wrong : WrongDirection
        Where, as found of the given one.
    """

    given: MachineSpec
    wrong: WrongDirection


def defined_number(item: Misdescription, spec: Any, value: float = 0.0) -> Reported | None:
    """The number of a direction's key in a definition changed by a value; None where no key has it."""
    change = item.change
    if not isinstance(change, Redefinable) or change.quantity(spec) is None:
        return None
    return change.quantity(change.redefined(spec, value))


def departure(item: Misdescription, machine: DiagnosedMachine, value: float) -> float:
    """How far a machine is from its definition as it was given, in the unit of a direction of this value."""
    before, after = defined_number(item, machine.given), defined_number(item, machine.spec, value)
    if before is None or after is None:
        return value
    return after.value - before.value if item.unit else after.value / before.value - 1.0


def wrong_direction(
    problem: Problem, null: Fit, directions: Sequence[Misdescription], trials: int, coarseness: float = 1.0
) -> WrongDirection | None:
    """The direction whose prior had best be given up; None where there are no directions.

    An offset of the prior's mean in one direction, itself normal with the width ``WIDER``, lowers the cost of
    a fit with nothing missing, to first order in the coordinates and between their bounds. Its complexity is
    that of ``h``, what is left of the prior's curvature there once everything else follows.

    Parameters
    ----------
    null : Fit
        With nothing missing, of that problem.
    trials : int
        Candidates that might explain the recording instead: each as likely beforehand as one direction.
    """
    belief = problem.belief
    names = [c.name for c in belief.coordinates]
    owned = [
        item
        for item in directions
        if item.recording is None and not item.of_sensor and item.coordinate in names
    ]
    if not owned:
        return None
    rows = [names.index(item.coordinate) for item in owned]
    box = LinearProblem.about(problem, null).box
    settled, _ = _least(box)
    freed = [_least(_freed(box, belief, null, row)) for row in rows]
    misfit = np.array([settled - cost for cost, _ in freed])
    count = len(names)
    precision = belief.root.T @ belief.root
    left = np.diag(precision - precision @ null.covariance[:count, :count] @ precision)[rows]
    left = np.maximum(left, 0.0)
    prior = np.log(tuned.NUMBER_PRIOR[1] / tuned.NUMBER_PRIOR[0]) - np.log(len(owned) + trials)
    gains = 0.5 * misfit / (coarseness * tuned.GAIN_DIVISOR) - 0.5 * np.log1p(WIDER**2 * left) + prior
    best = int(np.argmax(gains))
    level = float(chdtrc(1, misfit[best] / (coarseness * tuned.CHANCE_DIVISOR)))
    p_value = float(-np.expm1(len(owned) * np.log1p(-min(level, 1.0 - 1e-16))))
    row = rows[best]
    value = owned[best].sigma * float(null.position[row] + freed[best][1][row])
    belief = without_prior(belief, row)
    return WrongDirection(owned[best], belief, value, float(gains[best]), float(prior), p_value)


def suspected_direction(
    problem: Problem,
    hypotheses: Sequence[Hypothesis],
    directions: Sequence[Misdescription],
    trials: int,
    coarseness: float,
    spec: Any,
) -> WrongDirection | None:
    """The direction whose prior had best be given up, with nothing missing or beside likely effects.

    None unless that makes the recording likelier than any set does. Beside effects it must be a number of the
    definition, which can be tried.

    Parameters
    ----------
    hypotheses : sequence of Hypothesis
        Of that problem.
    spec : MachineSpec or NetworkMachineSpec
    """
    found, scores = None, tempered(hypotheses, coarseness)
    most = max(scores)
    likeliest: dict[int, tuple[float, Fit]] = {}
    for score, item in zip(scores, hypotheses, strict=True):
        size = len(item.fit.candidates)
        if size <= MOST_BESIDE and score > likeliest.get(size, (-np.inf, None))[0]:
            likeliest[size] = score, item.fit
    for size, (score, fit) in likeliest.items():
        wrong = wrong_direction(problem, fit, directions, trials, coarseness)
        if wrong is None or score + wrong.log_gain <= most:
            continue
        if size and not (wrong.is_beyond_chance and defined_number(wrong.direction, spec) is not None):
            continue
        most, found = score + wrong.log_gain, wrong
    return found


def suspected_of_calibration(
    problem: Problem, fit: Fit, directions: Sequence[Misdescription], spec: Any
) -> WrongDirection | None:
    """The number of the definition that a machine's own calibration holds beyond its prior; None else.

    Nothing is missing there, so that no effect could explain it instead.
    """
    wrong = wrong_direction(problem, fit, directions, 0)
    if wrong is None or not wrong.is_beyond_chance or defined_number(wrong.direction, spec) is None:
        return None
    return replace(wrong, by_calibration=True)


def _least(box: Box) -> tuple[float, Array]:
    """Least cost within a box, and the move to it."""
    move = bounded_minimum(box.hessian, box.downhill, box.low, box.high)
    return box.cost + float(move @ (box.hessian @ move)) - 2.0 * float(box.downhill @ move), move


def _freed(box: Box, belief: Belief, null: Fit, row: int) -> Box:
    """A box about a fit with the prior of one coordinate given up, as :func:`without_prior` has it."""
    precision = belief.root.T @ belief.root
    departure = null.position[: len(precision)] - belief.mean
    less = np.outer(precision[row], precision[row]) / (precision[row, row] + WIDER**-2)
    hessian, downhill = box.hessian.copy(), box.downhill.copy()
    hessian[: len(less), : len(less)] -= less
    downhill[: len(less)] += less @ departure
    low, high = box.low.copy(), box.high.copy()
    bound = THETA_BOUND * WIDER
    low[row], high[row] = -bound - null.position[row], bound - null.position[row]
    cost = box.cost - float(departure @ less @ departure)
    return replace(box, hessian=hessian, downhill=downhill, low=low, high=high, cost=cost)


def open_directions(
    directions: Sequence[Misdescription], redefined: Redefined | None
) -> tuple[Misdescription, ...]:
    """Directions, that in which the definition was put right ``WIDER`` times as wide."""
    name = None if redefined is None else redefined.wrong.direction.name
    return tuple(replace(i, sigma=WIDER * i.sigma) if i.name == name else i for i in directions)


def without_prior(belief: Belief, row: int) -> Belief:
    """The belief with another ``WIDER`` standard deviations of one coordinate, and bounds as much wider."""
    unit = np.zeros(len(belief.mean))
    unit[row] = WIDER
    covariance = np.linalg.inv(belief.root.T @ belief.root) + np.outer(unit, unit)
    precision = np.linalg.inv(covariance)
    root = np.linalg.cholesky(0.5 * (precision + precision.T)).T
    coordinates = list(belief.coordinates)
    bound = THETA_BOUND * WIDER
    coordinates[row] = replace(coordinates[row], low=-bound, high=bound)
    return replace(belief, coordinates=tuple(coordinates), root=root)


def wrong_definition_words(wrong: WrongDirection, machine: DiagnosedMachine, fit: Fit) -> str:
    """Where a definition is wrong, and by how much in a fit."""
    item, value = wrong.direction, fit.values[wrong.direction.coordinate]
    before, after = defined_number(item, machine.given), defined_number(item, machine.spec, value)
    if before is None or after is None:
        amount = f"{item.statement}, by {f'{value:.3g} {item.unit}'.strip()}"
    else:
        told_by = "calibration" if wrong.by_calibration else "recording"
        amount = f"it says {quantity(before)}, the {told_by} {quantity(after)}"
    return f"the definition is off at {item.key}: {amount}"


def with_wrong_definition(
    judgement: Judgement, wrong: WrongDirection, machine: DiagnosedMachine
) -> Judgement:
    """A judgement with a parameter that is off, by its definition, unless physics is missing beside it."""
    if judgement.verdict not in ("consistent", "sensor"):
        return judgement
    reason = judgement.reason
    if judgement.verdict == "consistent":
        reason = wrong_definition_words(wrong, machine, judgement.chosen.fit)
    return replace(
        judgement, verdict="parameter", p_value=min(judgement.p_value, wrong.p_value), reason=reason
    )


def is_beyond_prior(wrong: WrongDirection, machine: DiagnosedMachine, fit: Fit) -> bool:
    """Whether the direction of a fit is where its prior holds it with less than 1 %."""
    item = wrong.direction
    return abs(departure(item, machine, fit.values[item.coordinate])) > PRIOR_SIGMAS * item.sigma
