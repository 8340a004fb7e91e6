"""Ways to operate a machine for some hours, as stages of constant inputs: tests that could be run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from spindle_fem.effects.framework.laws import RPM

MINUTE = 60.0
# A held level lasts as long as a spindle needs to come near its steady state, s; standstill before it.
HOLD = 60.0 * MINUTE
REST = 10.0 * MINUTE
# Change of the room's or the coolant's temperature that a workshop can make, K.
TEMPERATURE_STEP = 5.0
# Share of the oil's flow that a throttled pump leaves.
THROTTLED = 0.7
Stage = tuple[float, Mapping[str, float]]


@dataclass(frozen=True, slots=True)
class Schedule:
    """A test: what is held for how long.

    Attributes
    ----------
    name : str
        In plain words.
    quantity : str
        What is varied.
    effort : int
        0: as it runs anyway; 1: a test of its own; 2: one that needs more than the control panel.
    stages : tuple of (float, mapping of str to float)
        Length [s], and inputs (SI) that differ from the usual ones.
    """

    name: str
    quantity: str
    effort: int
    stages: tuple[Stage, ...]

    @property
    def length(self) -> float:
        """Length of all stages, [s]."""
        return sum(length for length, _ in self.stages)


def _plain(name: str) -> str:
    return name.replace("_", " ")


def _minutes(seconds: float) -> str:
    return f"{seconds / MINUTE:.0f} min"


def geometry_schedules(
    usual: Mapping[str, float], high: float, *, has_channel: bool, length: float | None = None
) -> list[Schedule]:
    """Tests of a machine with geometry: speed, cool-down, thrust, coolant and room temperature, coolant flow.

    Parameters
    ----------
    usual : mapping of str to float
        Every input, SI.
    high : float, [rad/s]
        Highest speed.
    length : float, optional, [s]
        Of every test; by default a level is held for an hour.
    """
    levels = [round(share * high / RPM, -2) * RPM or high for share in (1.0 / 3.0, 2.0 / 3.0, 1.0)]
    middle = levels[1]
    rpm = [f"{level / RPM:.0f}" for level in levels]

    def hold_of(number: float) -> float:
        return HOLD if length is None else length / number

    rest = REST / HOLD
    hold = hold_of(3.0 + rest)
    cooling = 1.5 * hold_of(3.0)
    found = [
        Schedule(
            f"speed holds of {_minutes(hold)} at {', '.join(rpm)} rpm",
            "speed",
            1,
            ((rest * hold, {"speed": 0.0}), *((hold, {"speed": level}) for level in levels)),
        ),
        Schedule(
            f"{_minutes(cooling)} at {rpm[-1]} rpm, then {_minutes(cooling)} cool-down at standstill",
            "speed",
            1,
            ((cooling, {"speed": levels[-1]}), (cooling, {"speed": 0.0})),
        ),
    ]
    hold = hold_of(2.0)
    if usual["thrust"] > 0.0:
        thrusts = [0.5 * usual["thrust"], 1.5 * usual["thrust"]]
        found.append(
            Schedule(
                f"{rpm[1]} rpm held, thrust {thrusts[0]:.0f} N then {thrusts[1]:.0f} N, "
                f"{_minutes(hold)} each",
                "thrust",
                1,
                tuple((hold, {"speed": middle, "thrust": value}) for value in thrusts),
            )
        )
    if has_channel and usual["coolant_flow"] > 0.0:
        warm = usual["coolant_inlet"] + TEMPERATURE_STEP
        part = hold_of(3.0)
        found += [
            Schedule(
                f"{rpm[1]} rpm held, coolant temperature +{TEMPERATURE_STEP:.0f} K after {_minutes(part)}, "
                f"−{TEMPERATURE_STEP:.0f} K after {_minutes(2.0 * part)}",
                "coolant inlet temperature",
                1,
                (
                    (part, {"speed": middle}),
                    (part, {"speed": middle, "coolant_inlet": warm}),
                    (part, {"speed": middle, "coolant_inlet": warm - 2.0 * TEMPERATURE_STEP}),
                ),
            ),
            Schedule(
                f"{rpm[1]} rpm held, coolant flow reduced to {100.0 * THROTTLED:.0f} % "
                f"after {_minutes(hold)}",
                "coolant flow",
                1,
                (
                    (hold, {"speed": middle}),
                    (hold, {"speed": middle, "coolant_flow": THROTTLED * usual["coolant_flow"]}),
                ),
            ),
        ]
    part = hold_of(3.0)
    room = usual["ambient"] + TEMPERATURE_STEP
    found.append(
        Schedule(
            f"{rpm[1]} rpm held, the room {TEMPERATURE_STEP:.0f} K warmer after {_minutes(part)}",
            "ambient temperature",
            2,
            ((part, {"speed": middle}), (2.0 * part, {"speed": middle, "ambient": room})),
        )
    )
    return found


def network_schedules(ranges: Mapping[str, tuple[float, float]], hold: float) -> list[Schedule]:
    """Every input of a network that can vary: half its range, the highest, then the lowest.

    Parameters
    ----------
    ranges : mapping of str to (float, float)
        Lowest and highest value of every input, SI.
    hold : float, [s]
        Of each level.
    """
    return [
        Schedule(
            f"{_plain(name)} at half its range, highest, lowest, {_minutes(hold)} each",
            _plain(name),
            1,
            tuple((hold, {name: level}) for level in (0.5 * (low + high), high, low)),
        )
        for name, (low, high) in ranges.items()
        if high - low > 1e-9 * max(abs(high), 1.0)
    ]


def standard_schedules(
    usual: Mapping[str, float], driven: Sequence[str], length: float
) -> dict[str, Schedule]:
    """Standard tests of a given length, available for every machine: heat-up, steps, cool-down.

    Parameters
    ----------
    usual : mapping of str to float
        Inputs at full load, SI.
    driven : sequence of str
        Those of them that heat the machine; the others stay.

    >>> tests = standard_schedules({"speed": 300.0, "ambient": 293.0}, ["speed"], 3600.0)
    >>> [stage[1]["speed"] for stage in tests["steps"].stages], tests["cool_down"].stages[1]
    ([0.0, 100.0, 200.0, 300.0], (1800.0, {'speed': 0.0}))
    """

    def at(share: float) -> dict[str, float]:
        return {name: round(share * usual[name], 9) for name in driven}

    rest = REST / HOLD
    hold = length / (3.0 + rest)
    steps = ((rest * hold, at(0.0)), *((hold, at(third / 3.0)) for third in (1.0, 2.0, 3.0)))
    half = 0.5 * length
    words = " and ".join(_plain(name) for name in driven) if len(driven) < 3 else "load"
    return {
        "heat_up": Schedule(f"{_minutes(length)} from rest at full {words}", words, 1, ((length, at(1.0)),)),
        "steps": Schedule(f"{words} at a third, two thirds and all, {_minutes(hold)} each", words, 1, steps),
        "cool_down": Schedule(
            f"{_minutes(half)} at full {words}, then {_minutes(half)} at rest",
            words,
            1,
            ((half, at(1.0)), (half, at(0.0))),
        ),
    }
