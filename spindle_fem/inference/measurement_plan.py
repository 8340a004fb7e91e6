"""Effects that the sensors of a machine and a test could distinguish, before anything is measured.

Every effect of the catalogue at every place is given its usual size on the
model of the planned test; what the machine's uncertain numbers, the probes'
places and the noise leave of it is held against nothing missing and against
every other effect (:mod:`spindle_fem.inference.told_apart`). The same numbers
choose one more sensor and another test.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from spindle_fem.effects.framework.effect import Candidate
from spindle_fem.effects.framework.machine_view import MachineView
from spindle_fem.effects.registry import INSTANTS, candidates_for, catalogue, effect_of, interval_effects
from spindle_fem.inference import tuned
from spindle_fem.inference.candidate_response import BaseRun, Variant, variants_of
from spindle_fem.inference.coordinate_names import NO_VALUES
from spindle_fem.inference.diagnosis import overlapping_components
from spindle_fem.inference.further_tests import (
    FURTHER_DISPLACEMENT,
    FURTHER_SLOW,
    Place,
    network_places,
    reachable_places,
    unread_displacements,
)
from spindle_fem.inference.growth_misdescriptions import EXPANSION_SIGMA
from spindle_fem.inference.heldout import heldout_stamps
from spindle_fem.inference.hypothesis_fit import NOT_SIMULATED, Problem, candidate_coordinates
from spindle_fem.inference.misdescription_columns import (
    direction_columns,
    misdescriptions_of,
    with_misdescriptions,
)
from spindle_fem.inference.opened_machine import DiagnosedMachine
from spindle_fem.inference.predictor import Predictor
from spindle_fem.inference.prepared_problem import calibrate
from spindle_fem.inference.reading_noise import Whitener
from spindle_fem.inference.schedules import Schedule
from spindle_fem.inference.screening import amplitude_spread, amplitude_value, is_one_sided, log_priors
from spindle_fem.inference.search_basis import smaller_predictors
from spindle_fem.inference.told_apart import ChannelProducts, EffectForms, Separation

Array = NDArray[np.float64]
Progress = Callable[[str], None]

# Intervals of unrecorded heat or cooling that represent all others, as shares of the test.
INTERVALS = ((0.0, 1.0), (0.05, 0.35), (0.2, 0.5), (0.35, 0.65), (0.5, 0.8), (0.65, 0.95), (0.4, 0.95))
# Prior of nothing missing over that of one effect.
NOTHING = tuned.NUMBER_PRIOR[0] / tuned.NUMBER_PRIOR[1]
# Sizes beyond this multiple of the usual one are not reported: first-order responses do not cover them.
LARGEST_MULTIPLE = 5.0
# Further sensors that are chosen one after another.
SENSORS_ADDED = 3


@dataclass(frozen=True, slots=True)
class Hypothetical:
    """One effect at one place, in all its forms.

    Attributes
    ----------
    main : Variant
        Its likeliest form, in whose size the others are expressed.
    weight : float
        Prior, of all effects at all places together 1.
    """

    effect: str
    component: str
    main: Variant
    weight: float

    def reported(self, multiple: float) -> tuple[str, float, str]:
        """Parameter, value and unit that a finding states at a multiple of the usual size."""
        candidate = self.main.candidate
        full, half = (
            effect_of(self.effect).report(
                candidate, self.main.values(amplitude_value(self.main, factor * multiple))
            )
            for factor in (1.0, 0.5)
        )
        # The first that follows the size: of a swing the amplitude, not the period.
        name = next((n for n, item in full.items() if item.value != half[n].value), next(iter(full)))
        return name, full[name].value, full[name].unit

    def size(self, multiple: float) -> tuple[str, float, str] | None:
        """Size as parameter name, value and unit; None beyond the possible range."""
        candidate = self.main.candidate
        item = candidate.parameters[candidate.amplitude]
        limit = item.high if candidate.reference > candidate.null else item.low
        if multiple > LARGEST_MULTIPLE or amplitude_value(self.main, multiple) == limit:
            return None
        return self.reported(multiple)


@dataclass(frozen=True, slots=True)
class Option:
    """One further sensor, or one other test.

    Attributes
    ----------
    information : float
        Mean over all pairs, bits.
    seen, separated : int
        Effects seen at their usual size, and those of them distinguishable from every other.
    """

    name: str
    words: str
    information: float
    seen: int
    separated: int
    detail: str = ""


@dataclass(frozen=True)
class MeasurementPlan:
    """Predicted information of a test with some sensors.

    Attributes
    ----------
    machine : DiagnosedMachine
        On the test first, then on those compared with it.
    separation : Separation
        For the requested sensors and test.
    further_sensors : tuple of Option
        Each place with the existing sensors, the most informative first.
    sensors_in_turn : tuple of Option
        The most informative place, then the most informative beside it, and so on.
    tests : tuple of Option
        All tests with the existing sensors, the most informative first; ``detail`` is what is varied.
    not_simulated : tuple of (str, str)
        Tests that could not be, and why.
    """

    machine: DiagnosedMachine
    hypotheticals: tuple[Hypothetical, ...]
    separation: Separation
    asked: Option
    further_sensors: tuple[Option, ...]
    sensors_in_turn: tuple[Option, ...]
    tests: tuple[Option, ...]
    not_simulated: tuple[tuple[str, str], ...] = ()

    @cached_property
    def comparable(self) -> NDArray[np.bool_]:
        """Pairs that are different effects, or places that a decision distinguishes, (k, k)."""
        return comparable_pairs(self.hypotheticals, self.machine.view)


def comparable_pairs(items: Sequence[Hypothetical], view: MachineView) -> NDArray[np.bool_]:
    """Pairs of which a diagnosis may name one and not mean the other, (k, k)."""
    overlapping = overlapping_components(view)
    return np.array(
        [
            [
                one.effect != other.effect
                or (
                    one.component != other.component
                    and other.component not in overlapping.get(one.component, ())
                )
                for other in items
            ]
            for one in items
        ]
    )


def plan_measurement(
    machine: DiagnosedMachine,
    schedules: Sequence[Schedule],
    *,
    asked: str,
    progress: Progress = lambda stage: None,
) -> MeasurementPlan:
    """Predict the information of a test and its sensors, and which sensor or test would add most.

    Parameters
    ----------
    machine : DiagnosedMachine
        With the requested test first, then one recording of every schedule.
    asked : str
        The requested test, in words.
    """
    masks = [~heldout_stamps(item)[0] for item in machine.recordings]
    predictor = Predictor(machine.fast, machine.recordings, masks, machine.effects)
    earlier = Predictor(machine.fast, machine.calibration, effects=machine.effects)
    directions = misdescriptions_of(predictor)
    predictor = with_misdescriptions(predictor, directions)
    earlier = with_misdescriptions(earlier, misdescriptions_of(earlier)) if machine.calibration else None
    calibrated = calibrate(earlier, predictor)
    candidates = candidates_for(machine.view)
    places = _places(machine, predictor)
    progress("plan: basis")
    small, *_ = smaller_predictors(predictor, machine.view, candidates, [place.name for place in places])
    problem = Problem(small, calibrated.belief, calibrated.slow, small.observations)
    laws = variants_of(candidates)

    def variants_in(number: int) -> list[Variant]:
        # Tests that are compared may be shorter than the asked one: moments are shares of each.
        duration = float(np.ptp(machine.recordings[number].times))
        own = [_begun_within(law, duration / machine.view.duration) for law in laws]
        return own + variants_of(_interval_candidates(machine.view, duration))

    variants = variants_in(0)
    forms, hypotheticals = _forms(variants)
    progress(f"plan: {asked}")
    acting = [item for item in directions if item.recording in (None, 0)]
    _, states = direction_columns(BaseRun(predictor, 0, NO_VALUES), acting)
    at_places = _means(predictor, places) @ states
    moved = {item.coordinate: at_places[:, :, index] for index, item in enumerate(acting)}
    products = _products(problem, 0, variants, places, moved)
    read = list(range(len(machine.recordings[0].temperature_names)))
    beside = {place.name: len(read) + index for index, place in enumerate(places)}
    weights = np.array([item.weight for item in hypotheticals])
    comparable = comparable_pairs(hypotheticals, machine.view)

    def judged(own: ChannelProducts, channels: Sequence[int], name: str, words: str, detail: str) -> Option:
        separation = forms.judged(own.gram(channels))
        seen, apart = separation.seen_from <= 1.0, (separation.told_from <= 1.0) | ~comparable
        information = separation.mean_information(weights, NOTHING)
        return Option(
            name, words, information, int(seen.sum()), int((seen & apart.all(axis=1)).sum()), detail
        )

    def with_one_more(channels: Sequence[int], left: Sequence[Place]) -> list[Option]:
        found = [
            judged(products, [*channels, beside[place.name]], place.name, place.words, place.component)
            for place in left
        ]
        return sorted(found, key=lambda item: -item.information)

    separation = forms.judged(products.gram(read))
    now = judged(products, read, "asked", asked, "")
    progress("plan: further sensors")
    further = with_one_more(read, places)
    in_turn, chosen, left = further[:1], [*read], list(places)
    while in_turn and len(in_turn) < SENSORS_ADDED:
        chosen.append(beside[in_turn[-1].name])
        left = [place for place in left if place.name != in_turn[-1].name]
        in_turn += with_one_more(chosen, left)[:1]
        if not left:
            break
    tests, failed = [], []
    for number, schedule in enumerate(schedules, 1):
        progress(f"plan: {schedule.name}")
        try:
            own = _products(problem, number, variants_in(number))
        except NOT_SIMULATED as error:
            failed.append((schedule.name, str(error)))
            continue
        tests.append(judged(own, read, schedule.name, schedule.name, schedule.quantity))
    return MeasurementPlan(
        machine,
        hypotheticals,
        separation,
        now,
        tuple(further),
        tuple(in_turn),
        tuple(sorted(tests, key=lambda item: -item.information)),
        tuple(failed),
    )


def _begun_within(law: Variant, share: float) -> Variant:
    """A law whose instants are a share of what they are in the longest test."""
    moved = {
        name: share * law.shape.get(name, item.value)
        for name, item in law.candidate.parameters.items()
        if item.name in INSTANTS
    }
    return replace(law, shape={**law.shape, **moved}) if moved else law


def _interval_candidates(view: MachineView, duration: float) -> list[Candidate]:
    """Unrecorded heat and cooling over the representative intervals, at every spot."""
    return [
        effect.over(view, spot, [(first * duration, last * duration)])
        for effect in interval_effects()
        for spot in effect.places(view)
        for first, last in INTERVALS
    ]


def _places(machine: DiagnosedMachine, predictor: Predictor) -> tuple[Place, ...]:
    """Places for a further sensor: probes that are not read, other places, unread displacement sensors."""
    model, read = predictor.fast.model, predictor.recordings[0].probes
    if machine.is_network:
        return network_places(model.place_names, read)
    unread = [
        Place(probe.name, f"probe {probe.name} of the definition", probe.part, True)
        for probe in machine.spec.probe
        if probe.name in model.probe_names and probe.name not in read
    ]
    reachable = reachable_places(predictor.fast.spec, model.place_names)
    return (*unread, *reachable, *unread_displacements(machine.spec, read))


def _forms(variants: Sequence[Variant]) -> tuple[EffectForms, tuple[Hypothetical, ...]]:
    """Variants grouped as forms of one effect at one place, with the probability of each."""
    effects = catalogue()
    priors = np.exp(log_priors(variants, {name: effect.prior_weight for name, effect in effects.items()}))
    priors *= np.array([variant.candidate.likelihood for variant in variants])
    keys = list(dict.fromkeys(variant.key for variant in variants))
    owner = np.array([keys.index(variant.key) for variant in variants])
    # Intervals move their ends: those of one spot are shapes of one law.
    laws = [(*variant.key, variant.candidate.form) for variant in variants]
    known = list(dict.fromkeys(laws))
    forms = EffectForms(
        owner,
        np.array([known.index(law) for law in laws]),
        np.array([len(candidate_coordinates(variant.candidate)) for variant in variants]),
        np.array([amplitude_spread(variant) for variant in variants]),
        np.array([is_one_sided(variant) > 0.0 for variant in variants]),
        priors,
    )
    found = []
    for index, key in enumerate(keys):
        rows = np.flatnonzero(owner == index)
        main = variants[int(rows[np.argmax([variants[row].candidate.likelihood for row in rows])])]
        found.append(Hypothetical(*key, main, float(priors[rows].sum() / priors.sum())))
    return forms, tuple(found)


def _means(predictor: Predictor, places: Sequence[Place]) -> Array:
    """Weights of the model's unknowns in the reading of a sensor at each place, (k, r)."""
    model = predictor.fast.model
    rows = [
        model.probes[model.probe_names.index(place.name)] if place.is_probe else model.place(place.name)
        for place in places
    ]
    return np.array(rows).reshape(-1, model.size)


def _growth(readings: Array, places: Sequence[Place], read: int) -> Array:
    """What other coefficients of expansion do to displacement sensors among the places, (G + 1, c, d) µm.

    Of each by itself, for a normal coordinate of unit width.

    Parameters
    ----------
    readings : (G + 1, k) ndarray
        Of the places, which follow ``read`` channels.
    """
    grown = [index for index, place in enumerate(places) if place.displaced]
    found = np.zeros((len(readings), read + len(places), len(grown)))
    for column, index in enumerate(grown):
        found[:, read + index, column] = EXPANSION_SIGMA * (readings[:, index] - readings[0, index])
    return found


def _products(
    problem: Problem,
    number: int,
    variants: Sequence[Variant],
    places: Sequence[Place] = (),
    moved: Mapping[str, Array] = NO_VALUES,
) -> ChannelProducts:
    """Answers of the sensors of one test, then of places, whitened.

    Parameters
    ----------
    moved : mapping of coordinate to (G + 1, k) ndarray
        What directions in which the machine may differ do at the places.
    """
    predictor, belief = problem.predictor, problem.belief
    means, read = _means(predictor, places), len(predictor.columns[number])
    values = {c.name: c.at(u) for c, u in zip(belief.coordinates, belief.mean, strict=True)}
    predicted = predictor.predict(number, values, (), [c.name for c in belief.coordinates])
    scale = np.array([c.sigma for c in belief.coordinates])
    slopes = np.concatenate((predicted.sensitivity, predicted.slopes_at(means)), axis=1)
    for index, coordinate in enumerate(belief.coordinates):
        if coordinate.name in moved:
            slopes[:, read:, index] += moved[coordinate.name]
    slopes = np.concatenate((slopes * scale, _growth(predicted.states @ means.T, places, read)), axis=2)
    answers = BaseRun(predictor, number, values, places=means).responses(variants)
    own = [
        (item, white)
        for item, white in zip(problem.observations, problem.whiteners, strict=True)
        if item.recording == number
    ]
    # A further sensor reads as often as the others, with the usual noise of what it reads.
    first, recording = own[0][0], predictor.recordings[number]
    noise = float(np.median(recording.sigma[: recording.temperature_count]))
    usual = {
        False: Whitener(replace(first.bins, white=noise), problem.slow),
        True: Whitener(replace(first.bins, white=FURTHER_DISPLACEMENT, key=-1), FURTHER_SLOW),
    }
    own += [(replace(first, channel=read + i), usual[place.displaced]) for i, place in enumerate(places)]
    return ChannelProducts.of(
        block_diag(belief.root.T @ belief.root, np.eye(slopes.shape[2] - len(scale))),
        [white(item.at(slopes[:, item.channel])) for item, white in own],
        [white(item.at(answers[:, item.channel])) for item, white in own],
    )
