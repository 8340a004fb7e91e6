"""Content of a measurement plan, as stored in ``plan.json``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from spindle_fem.effects.framework.effect import place_words
from spindle_fem.inference.measurement_plan import (
    INTERVALS,
    LARGEST_MULTIPLE,
    Hypothetical,
    MeasurementPlan,
    Option,
)
from spindle_fem.inference.planned_test import Sensor
from spindle_fem.inference.told_apart import FALSE_ALARM, POWER
from spindle_fem.units import MICROMETRES

SCHEMA = "spindle-fem/plan/1"
# Effects that are listed for one, those that read most like it first.
MOST_LISTED = 3
# A sensor or a test that brings less than this, bits on the mean of all pairs, is not worth it.
WORTH = 0.005


def plan_content(
    plan: MeasurementPlan,
    sensors: Sequence[Sensor],
    test: str,
    inputs: Mapping[str, tuple[float, str]],
    compared: float,
    notes: Sequence[str],
) -> dict[str, Any]:
    """Everything that is written of a plan.

    Parameters
    ----------
    test : str
        In words.
    inputs : mapping of str to (float, str)
        At full load of a standard test, SI or °C, and their units.
    compared : float, [s]
        Length of the tests compared with it.
    """
    items, separation, comparable = plan.hypotheticals, plan.separation, plan.comparable
    recording = plan.machine.recordings[0]
    best_sensor = plan.sensors_in_turn[0] if plan.sensors_in_turn else None
    best_test = plan.tests[0] if plan.tests else None
    pairs = [
        _pair(plan, first, second)
        for first in range(len(items))
        for second in range(len(items))
        if comparable[first, second]
    ]
    return {
        "schema": SCHEMA,
        "machine": plan.machine.name,
        "sensors": [
            {"name": item.name, "probe": item.probe}
            | ({"noise_um": MICROMETRES * item.noise} if item.displaced else {"noise_K": item.noise})
            for item in sensors
        ],
        "test": {
            "description": test,
            "length_s": float(np.ptp(recording.times)),
            "interval_s": float(np.median(np.diff(recording.times))),
            "inputs": [
                {"name": name, "value": value, "unit": unit} for name, (value, unit) in inputs.items()
            ],
        },
        "power": POWER,
        "false_alarm": FALSE_ALARM,
        "intervals": len(INTERVALS),
        "pairs": pairs,
        "detectable": [
            {"effect": item.effect, "component": item.component}
            | _stated(item, float(separation.seen_from[index]))
            for index, item in enumerate(items)
        ],
        "best_next_sensor": None
        if best_sensor is None
        else {"name": best_sensor.name, "place": best_sensor.words},
        "best_test": None if best_test is None else {"description": best_test.name, "length_s": compared},
        "told": {"effects": len(items), "seen": plan.asked.seen, "told_from_all": plan.asked.separated},
        "expected_information_bit": plan.asked.information,
        "further_sensors": [_option(item, plan.asked) for item in plan.further_sensors],
        "sensors_in_turn": [_option(item, plan.asked) for item in plan.sensors_in_turn],
        "tests": [_option(item, plan.asked) for item in plan.tests],
        "not_simulated": [{"description": name, "reason": why} for name, why in plan.not_simulated],
        "summary": summary(plan, sensors, compared),
        "notes": [*plan.machine.notes, *notes],
    }


def _pair(plan: MeasurementPlan, first: int, second: int) -> dict[str, Any]:
    one, other = plan.hypotheticals[first], plan.hypotheticals[second]
    size = float(plan.separation.told_from[first, second])
    return {
        "first": {"effect": one.effect, "component": one.component},
        "second": {"effect": other.effect, "component": other.component},
        "told_apart": size <= 1.0,
        "information_bit": _rounded(plan.separation.information[first, second]),
        **{key: value for key, value in _stated(one, size).items() if key in ("from_size", "unit")},
    }


def _stated(item: Hypothetical, multiple: float) -> dict[str, Any]:
    """A size in the effect's own parameter, the usual one, and the unit of both."""
    usual, found = item.size(1.0), item.size(multiple)
    return {
        "from_size": None if found is None else {found[0]: _rounded(found[1])},
        "usual_size": None if usual is None else {usual[0]: _rounded(usual[1])},
        "unit": "" if usual is None else usual[2],
        "multiple": multiple if multiple <= LARGEST_MULTIPLE else None,
        "at_usual_size": multiple <= 1.0,
    }


def _rounded(value: float) -> float:
    return float(f"{value:.4g}")


def _option(item: Option, now: Option) -> dict[str, Any]:
    return {
        "name": item.name,
        "words": item.words,
        "detail": item.detail,
        "information_bit": item.information,
        "gain_bit": item.information - now.information,
        "seen": item.seen,
        "told_from_all": item.separated,
    }


def words_of(item: Hypothetical) -> str:
    """An effect and its place in a sentence."""
    return f"{item.effect.replace('_', ' ')} at {place_words(item.component)}"


def confused_with(plan: MeasurementPlan, index: int) -> list[int]:
    """Effects indistinguishable from one at its usual size, the likeliest first."""
    apart = plan.separation.told_from[index]
    found = [j for j in range(len(apart)) if plan.comparable[index, j] and not apart[j] <= 1.0]
    return sorted(found, key=lambda j: plan.separation.information[index, j])


def summary(plan: MeasurementPlan, sensors: Sequence[Sensor], compared: float) -> list[str]:
    """Conclusions in sentences; ``compared`` as :func:`plan_content` takes it."""
    items, now = plan.hypotheticals, plan.asked
    names = [item.name for item in sensors]
    shown = ", ".join(names[:-1]) + f" and {names[-1]}" if len(names) > 1 else names[0]
    found = [
        f"With {shown}, this test shows {now.seen} of {len(items)} effects at their usual size, and tells "
        f"{now.separated} of these from every other effect."
    ]
    seen = [i for i in range(len(items)) if plan.separation.seen_from[i] <= 1.0]
    doubtful = sorted(
        ((i, confused_with(plan, i)) for i in seen), key=lambda pair: (-items[pair[0]].weight, pair[0])
    )
    doubtful = [(i, others) for i, others in doubtful if others]
    for index, others in doubtful[:MOST_LISTED]:
        named = [words_of(items[j]) for j in others[:MOST_LISTED]]
        more = f" and {len(others) - len(named)} more" if len(others) > len(named) else ""
        found.append(f"It cannot tell {words_of(items[index])} from {'; '.join(named)}{more}.")
    if plan.sensors_in_turn:
        best = plan.sensors_in_turn[0]
        if best.information - now.information >= WORTH:
            found.append(
                f"The sensor to add: {best.words}. With it {best.seen} effects are seen and "
                f"{best.separated} told from every other."
            )
        else:
            found.append("No further sensor would tell much more in this test.")
    if plan.tests:
        best = plan.tests[0]
        if best.information - now.information >= WORTH:
            found.append(
                f"A test that tells more with the same sensors: {best.name}: on the mean of all pairs "
                f"{best.information:.2f} bit instead of {now.information:.2f}; {best.seen} effects are seen, "
                f"{best.separated} told from every other."
            )
        else:
            found.append(f"No other test of {compared / 3600.0:.3g} h tells more with these sensors.")
    return found
