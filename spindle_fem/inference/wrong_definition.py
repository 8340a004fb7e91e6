"""Whether the definition itself is wrong in one direction, by more than its prior allows.

A misdescription is small by its prior. Where one direction explains a recording far beyond that, and better
than any effect does, its prior is given up and everything is fitted again: what is off is the definition.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc, ndtr, ndtri

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.effects.framework.effect import Reported, quantity
from spindle_fem.inference import tuned
from spindle_fem.inference.belief import Belief
from spindle_fem.inference.calibration import LEARNED_BELOW
from spindle_fem.inference.freed_priors import Freed, without_prior
from spindle_fem.inference.hypothesis import Hypothesis
from spindle_fem.inference.hypothesis_fit import Fit, Problem
from spindle_fem.inference.misdescription import Misdescription, Redefinable
from spindle_fem.inference.opened_machine import DiagnosedMachine
from spindle_fem.inference.predictor import Predictor
from spindle_fem.inference.prepared_problem import known_before
from spindle_fem.inference.set_odds import tempered
from spindle_fem.inference.uncertain_numbers import UncertainNumber, uncertain_numbers
from spindle_fem.inference.verdict import PRIOR_SIGMAS, Judgement
from spindle_fem.units import NORMAL_90_PERCENT

Array = NDArray[np.float64]

# Distance from a bound at which a coordinate is held by it, in deviations of its prior.
AT_BOUND = 0.05
# Effects beside which a wrong definition is looked for, at most.
MOST_BESIDE = 2


@dataclass(frozen=True, slots=True)
class Rival:
    """Another number of a definition that would explain its recordings nearly as well.

    Attributes
    ----------
    given, value : Reported
        As the definition has it, and as it would be instead.
    """

    direction: Misdescription
    given: Reported
    value: Reported

    @property
    def statement(self) -> str:
        """In words."""
        return f"{self.direction.key}, {quantity(self.value)} for {quantity(self.given)}"


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
    by_interval : bool
        Whether its interval says so, whatever else there may be.
    limit : float
        Departure, in widths of the prior, beyond which a definition is not as it says; its interval lies
        beyond ``PRIOR_SIGMAS``.
    rivals : tuple of Rival
        Likeliest first.
    """

    direction: Misdescription
    belief: Belief
    value: float
    log_gain: float
    log_prior: float
    p_value: float
    told: float = 0.0
    by_calibration: bool = False
    by_interval: bool = False
    limit: float = PRIOR_SIGMAS
    rivals: tuple[Rival, ...] = ()

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
    wrong : tuple of WrongDirection
        Where, each as it was found.
    """

    given: MachineSpec
    wrong: tuple[WrongDirection, ...]


def defined_number(item: Misdescription, spec: Any, value: float = 0.0) -> Reported | None:
    """The number of a direction's key in a definition changed by a value; None where no key has it."""
    change = item.change
    if not isinstance(change, Redefinable) or change.quantity(spec) is None:
        return None
    return change.quantity(change.redefined(spec, value))


def departure(item: Misdescription, machine: DiagnosedMachine, value: float) -> float:
    """How far a machine is from its definition as it was given, as a direction of this value counts."""
    before, after = defined_number(item, machine.given), defined_number(item, machine.spec, value)
    return value if before is None or after is None else item.between(before.value, after.value)


def wrong_direction(
    freed: Freed, problem: Problem, null: Fit, trials: int, coarseness: float = 1.0
) -> WrongDirection | None:
    """The direction whose prior had best be given up; None where there are no directions.

    An offset of the prior's mean in one direction, itself normal and many times as wide, lowers the cost of
    a fit. Its complexity is that of ``h``, what is left of the prior's curvature there once everything else
    follows.

    Parameters
    ----------
    freed : Freed
        About that fit.
    null : Fit
        With nothing missing or beside effects, of that problem.
    trials : int
        Candidates that might explain the recording instead: each as likely beforehand as one direction.
    """
    if not freed.items:
        return None
    gains = _gains(freed, problem, null, trials, coarseness)
    best = int(np.argmax(gains))
    level = float(chdtrc(1, freed.misfit[best] / (coarseness * tuned.CHANCE_DIVISOR)))
    item, value = freed.items[best], freed.items[best].sigma * float(freed.position[best])
    belief, p_value = without_prior(problem.belief, freed.rows[best]), _of_any(level, len(gains))
    log_prior = float(_log_priors(freed, trials)[best])
    return WrongDirection(item, belief, value, float(gains[best]), log_prior, p_value)


def _gains(freed: Freed, problem: Problem, null: Fit, trials: int, coarseness: float = 1.0) -> Array:
    """What data become likelier by without the prior of each direction, complexity and priors included."""
    size = len(problem.belief.coordinates)
    precision = problem.belief.root.T @ problem.belief.root
    left = np.diag(precision - precision @ null.covariance[:size, :size] @ precision)[freed.rows]
    complexity = 0.5 * np.log1p(freed.widths**2 * np.maximum(left, 0.0))
    counted = 0.5 * freed.misfit / (coarseness * tuned.GAIN_DIVISOR)
    return counted - complexity + _log_priors(freed, trials)


def _log_priors(freed: Freed, trials: int) -> Array:
    """Of each direction among all of them and all effects, over none.

    What stands for several values of a definition is off only where all of them are.
    """
    one = np.log(tuned.NUMBER_PRIOR[1] / tuned.NUMBER_PRIOR[0]) - np.log(len(freed.items) + trials)
    return one - np.log([item.stands_for for item in freed.items])


def number_beyond_prior(
    problem: Problem, fit: Fit, numbers: Sequence[UncertainNumber]
) -> WrongDirection | None:
    """The number with a prior that a fit holds farthest beyond it; None where it holds none there.

    Its value is where the farthest number of a right definition is in one of a hundred machines, its interval
    by readings alone where its own prior hardly holds it. That needs no likelihood of what else there may be.
    """
    return _farthest(Freed.of(problem, fit, numbers), problem, fit)


def _farthest(freed: Freed, problem: Problem, fit: Fit) -> WrongDirection | None:
    """As :func:`number_beyond_prior`, of numbers whose fits are known."""
    if not freed.items:
        return None
    limit, widths = _limit_of(len(freed.items)), fit.stated_sigmas[freed.rows]
    told = np.maximum(widths**-2.0 - 1.0, 0.0)
    nearest = np.abs(freed.position) - NORMAL_90_PERCENT / np.sqrt(told + freed.widths**-2.0)
    far = np.abs(freed.position) > limit
    # Where readings hardly tell a number, first order sends it anywhere.
    nearest[~far | (widths >= LEARNED_BELOW)] = 0.0
    best = int(np.argmax(nearest))
    if nearest[best] <= PRIOR_SIGMAS:
        return None
    item, position = freed.items[best], float(freed.position[best])
    p_value = _of_any(2.0 * float(ndtr(-abs(position))), len(freed.items))
    belief = without_prior(problem.belief, freed.rows[best])
    value = item.sigma * position
    return WrongDirection(item, belief, value, 0.0, 0.0, p_value, by_interval=True, limit=limit)


def _limit_of(count: int) -> float:
    """Deviations beyond which the farthest of so many right numbers lies in one of a hundred machines."""
    return float(-ndtri(0.5 * -np.expm1(np.log1p(-tuned.SIGNIFICANT) / count)))


def numbers_far_off(fit: Fit, machine: DiagnosedMachine, wrong: Sequence[WrongDirection]) -> list[str]:
    """Values with a prior that a fit has farther off than a right definition would, in words.

    Those apart that are told to be wrong.
    """
    told, values = {item.direction.name for item in wrong}, fit.values
    numbers = [] if machine.is_network else list(uncertain_numbers(machine.spec))
    far = []
    for item in numbers:
        times = values[item.coordinate]
        deviations = item.amount(times) / item.sigma
        if item.name not in told and abs(deviations) > _limit_of(len(numbers)):
            far.append(
                f"The fit has {item.key} {times:.2g} times as large as the definition, {abs(deviations):.1f} "
                "deviations of its prior off: check it"
            )
    return far


def _of_any(level: float, count: int) -> float:
    """Probability that any of so many happens, each of which does with a probability."""
    return float(-np.expm1(count * np.log1p(-min(level, 1.0 - 1e-16))))


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
        freed = Freed.of(problem, fit, directions)
        wrong = wrong_direction(freed, problem, fit, trials, coarseness)
        if wrong is None or score + wrong.log_gain <= most:
            continue
        wrong = wrong_direction(freed.fitted(problem, fit), problem, fit, trials, coarseness)
        if score + wrong.log_gain <= most:
            continue
        if size and not (wrong.is_beyond_chance and defined_number(wrong.direction, spec) is not None):
            continue
        most, found = score + wrong.log_gain, wrong
    return found


def suspected_of_calibration(
    problem: Problem, fit: Fit, directions: Sequence[Misdescription], machine: DiagnosedMachine
) -> WrongDirection | None:
    """The number of the definition that a machine's own calibration holds beyond its prior; None else.

    Nothing is missing there, so that no effect could explain it instead. Of a machine that was made anew
    what was put right is settled.
    """
    settled = set() if machine.redefined is None else {i.direction.name for i in machine.redefined.wrong}
    numbers = [item for item in uncertain_numbers(machine.spec) if item.name not in settled]
    every = [item for item in (*directions, *numbers) if item.name not in settled]
    told = [item for item in every if defined_number(item, machine.spec) is not None]
    # What is held at its bound would go further: first order undervalues it, and others stand in for it.
    held = [item for item in told if _is_held(problem, fit, item)]
    freed = Freed.of(problem, fit, every).fitted(problem, fit)
    wrong = wrong_direction(freed.only(held) if held else freed, problem, fit, 0)
    if wrong is not None and wrong.direction in told:
        # One of those that may be told: the others count for nothing.
        wrong = wrong_direction(freed.only(held or told), problem, fit, 0)
    if wrong is None or wrong.direction not in told or not wrong.is_beyond_chance:
        wrong = _farthest(freed.only(numbers), problem, fit)
    else:
        wrong = replace(wrong, rivals=_rivals(wrong, freed.only(told), problem, fit, machine.spec))
    return None if wrong is None else replace(wrong, by_calibration=True)


def _rivals(
    wrong: WrongDirection, freed: Freed, problem: Problem, fit: Fit, spec: MachineSpec
) -> tuple[Rival, ...]:
    """Numbers that explain a calibration, and are no twenty times less likely to be what is wrong."""
    gains = _gains(freed, problem, fit, 0)
    found = []
    for k in np.argsort(-gains):
        item, value = freed.items[k], freed.items[k].sigma * float(freed.position[k])
        if gains[k] <= max(0.0, wrong.log_gain - tuned.LEAST_HELDOUT_GAIN):
            break
        if item is not wrong.direction:
            found.append(Rival(item, defined_number(item, spec), defined_number(item, spec, value)))
    return tuple(found)


def _is_held(problem: Problem, fit: Fit, item: Misdescription) -> bool:
    """Whether a direction lies at one of its bounds in a fit."""
    own = next((k for k, c in enumerate(problem.belief.coordinates) if c.name == item.coordinate), None)
    if own is None:
        return False
    coordinate, position = problem.belief.coordinates[own], fit.position[own]
    return min(position - coordinate.low, coordinate.high - position) < AT_BOUND


def known_of(predictor: Predictor, redefined: Redefined | None) -> Belief:
    """Belief before any recording, the priors given up of the numbers in which a definition was put right.

    What is left of each is about the value that was given, not about the one that is tried.
    """
    belief = known_before(predictor)
    if redefined is None:
        return belief
    names, mean = [c.name for c in belief.coordinates], belief.mean.copy()
    for item in (wrong.direction for wrong in redefined.wrong):
        row = names.index(item.coordinate)
        belief = without_prior(belief, row)
        given, tried = (defined_number(item, spec).value for spec in (redefined.given, predictor.fast.spec))
        mean[row] = item.between(tried, given) / item.sigma
    return replace(belief, mean=mean, begin=belief.start)


def wrong_definition_words(wrong: Sequence[WrongDirection], machine: DiagnosedMachine, fit: Fit) -> str:
    """Where a definition is wrong, and by how much in a fit."""
    told = [f"{item.direction.key}: {_amount(item, machine, fit)}" for item in wrong]
    instead = [rival.statement for item in wrong for rival in item.rivals]
    beside = f"; nearly as well explained by {', or by '.join(instead)}" if instead else ""
    return f"the definition is off at {', and at '.join(told)}{beside}"


def _amount(wrong: WrongDirection, machine: DiagnosedMachine, fit: Fit) -> str:
    item = wrong.direction
    value = item.amount(fit.values[item.coordinate])
    before, after = defined_number(item, machine.given), defined_number(item, machine.spec, value)
    if before is None or after is None:
        return f"{item.statement}, by {f'{value:.3g} {item.unit}'.strip()}"
    told_by = "calibration" if wrong.by_calibration else "recording"
    return f"it says {quantity(before)}, the {told_by} {quantity(after)}"


def stated_sigmas(fit: Fit, without_prior: Collection[str]) -> Array:
    """:attr:`Fit.stated_sigmas`, of coordinates whose prior is given up wider."""
    wider = [tuned.WRONG_WIDENING if c.name in without_prior else 1.0 for c in fit.coordinates]
    return wider * fit.stated_sigmas


def with_wrong_definition(
    judgement: Judgement, wrong: Sequence[WrongDirection], machine: DiagnosedMachine
) -> Judgement:
    """A judgement with parameters that are off, by its definition, unless physics is missing beside them."""
    if judgement.verdict not in ("consistent", "sensor"):
        return judgement
    reason = judgement.reason
    if judgement.verdict == "consistent":
        reason = wrong_definition_words(wrong, machine, judgement.chosen.fit)
    p_value = min(judgement.p_value, *(item.p_value for item in wrong))
    return replace(judgement, verdict="parameter", p_value=p_value, reason=reason)


def is_beyond_prior(wrong: WrongDirection, machine: DiagnosedMachine, fit: Fit) -> bool:
    """Whether the whole interval of a direction, as it is stated, is where its prior hardly holds it."""
    item = wrong.direction
    values = (
        fit.values[item.coordinate],
        *fit.interval(item.coordinate, NORMAL_90_PERCENT, stated_sigmas(fit, {item.coordinate})),
    )
    far = [departure(item, machine, item.amount(value)) / item.sigma for value in values]
    within = min(np.abs(far)) <= PRIOR_SIGMAS or np.ptp(np.sign(far)) > 0.0
    return abs(far[0]) > wrong.limit and not within
