"""Laws of the concealed effects, richer than simple terms.

Each class is one physical effect with its parameters; the same class with its smooth onset, lag
and exponent at their plain values serves as a mimic when asking what else could explain a
recording. Temperatures °C, times s, heat W.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field

import numpy as np

from . import machine as m
from .reduction import ReducedSpindle
from .stepping import Moment, group_parameter

SETS = {"F": (0, 1, 2), "R": (3, 4), "all": (0, 1, 2, 3, 4)} | {b: (i,) for i, b in enumerate(m.BEARINGS)}


def _soft(x: float, width: float) -> float:
    """Smooth positive part."""
    y = x / width
    return width * (y if y > 30 else float(np.log1p(np.exp(y))))


def _step(x: float) -> float:
    return float(1.0 / (1.0 + np.exp(-np.clip(x, -40, 40))))


@dataclass(slots=True)
class Lag:
    """First-order delay of a value; the first value passes."""

    constant: float
    value: float | None = None

    def follow(self, target: float, step: float) -> float:
        """Move towards the target by one step."""
        if self.value is None or self.constant <= 0.0:
            self.value = target
        else:
            self.value += (target - self.value) * (1.0 - np.exp(-step / self.constant))
        return self.value


@dataclass(slots=True)
class Law(ABC):
    """Base: forgets its memory at the start of a run."""

    memory: dict[str, object] = field(default_factory=dict, init=False, repr=False)

    def start(self, model: ReducedSpindle) -> None:
        """Forget the run before."""
        self.memory.clear()

    def lag(self, key: str, constant: float) -> Lag:
        """Delay kept under a key."""
        return self.memory.setdefault(key, Lag(constant))

    @abstractmethod
    def act(self, moment: Moment) -> None:
        """Change the moment."""


@dataclass(slots=True)
class HeatScale(Law):
    """Heat of some bearings times a factor."""

    where: str
    factor: float

    def act(self, moment: Moment) -> None:
        """Change the moment."""
        moment.bearing[list(SETS[self.where])] *= self.factor


@dataclass(slots=True)
class HeatShape(Law):
    """Heat of some bearings off by a share over speed, a cosine of ``turns`` half waves up to ``highest``."""

    where: str
    share: float
    turns: int
    highest: float

    def act(self, moment: Moment) -> None:
        """Change the moment."""
        phase = np.pi * self.turns * abs(moment.speed) / self.highest
        moment.bearing[list(SETS[self.where])] *= 1.0 + self.share * np.cos(phase)


@dataclass(slots=True)
class HeatSplit(Law):
    """Share of the inner ring changed."""

    where: str
    change: float

    def act(self, moment: Moment) -> None:
        """Change the moment."""
        moment.share[list(SETS[self.where])] += self.change


@dataclass(slots=True)
class ThermalPreload(Law):
    """Friction grows with the excess of the inner over the outer ring, smooth, delayed, saturating."""

    where: str
    amplitude: float
    width: float = 0.2
    exponent: float = 1.0
    delay: float = 0.0
    onset: float = 0.0

    def act(self, moment: Moment) -> None:
        """Change the moment."""
        for i in SETS[self.where]:
            b = m.BEARINGS[i]
            excess = moment.read(f"mean:{b}.inner") - moment.read(f"mean:{b}.outer") - self.onset
            push = (
                self.amplitude * (_soft(excess, self.width) ** self.exponent) * 5.0 ** (1.0 - self.exponent)
            )
            push = self.lag(b, self.delay).follow(push, moment.step)
            moment.bearing[i] *= 1.0 + 2.5 * np.tanh(push / 2.5)


@dataclass(slots=True)
class ViscosityHeat(Law):
    """Friction falls with the grease's temperature; amplitude per kelvin at the reference."""

    where: str
    amplitude: float
    reference: float = 25.0
    curvature: float = 0.0
    floor: float = 0.0

    def act(self, moment: Moment) -> None:
        """Change the moment."""
        for i in SETS[self.where]:
            b = m.BEARINGS[i]
            rings = 0.5 * (moment.read(f"mean:{b}.inner") + moment.read(f"mean:{b}.outer"))
            rise = 0.7 * rings + 0.3 * moment.read(f"{b}.balls") - self.reference
            fall = self.amplitude * rise * (1.0 - self.curvature * rise)
            factor = np.exp(-1.2 * np.tanh(fall / 1.2))
            moment.bearing[i] *= self.floor + (1.0 - self.floor) * factor


@dataclass(slots=True)
class Churning(Law):
    """Extra friction that wears off with the running time and partly comes back at rest."""

    where: str
    amplitude: float
    decay: float
    stretch: float = 1.0
    recovery: float = 0.0

    def act(self, moment: Moment) -> None:
        """Change the moment."""
        run_time = self.memory.get("run", 0.0)
        if moment.speed > 0:
            run_time += moment.step * (moment.speed / 3000.0 if self.stretch != 1.0 else 1.0)
        elif self.recovery > 0.0:
            run_time *= np.exp(-moment.step / self.recovery)
        self.memory["run"] = run_time
        extra = self.amplitude * np.exp(-((run_time / self.decay) ** self.stretch))
        moment.bearing[list(SETS[self.where])] *= 1.0 + extra


@dataclass(slots=True)
class Starvation(Law):
    """Friction changes above a speed, over a width, after a while."""

    where: str
    amplitude: float
    onset: float
    width: float = 60.0
    delay: float = 0.0
    growth: float = 0.0

    def act(self, moment: Moment) -> None:
        """Change the moment."""
        over = _step((moment.speed - self.onset) / self.width)
        over *= 1.0 + self.growth * max(0.0, moment.speed - self.onset) / 1000.0
        over = self.lag("on", self.delay).follow(over, moment.step)
        moment.bearing[list(SETS[self.where])] *= max(0.2, 1.0 + self.amplitude * over)


@dataclass(slots=True)
class SpeedHeat(Law):
    """Heat at places growing with a power of speed, delayed: lips, windage, drives."""

    places: tuple[tuple[str, float], ...]
    heat: float
    reference: float
    exponent: float
    delay: float = 0.0
    wear: float = 0.0
    load_share: float = 0.0

    def act(self, moment: Moment) -> None:
        """Change the moment."""
        watts = self.heat * (moment.speed / self.reference) ** self.exponent if moment.speed > 0 else 0.0
        watts *= 1.0 + self.load_share * (moment.thrust / 1750.0 - 1.0)
        if self.wear > 0.0:
            watts *= 1.0 + 0.4 * np.exp(-moment.time / self.wear)
        watts = self.lag("heat", self.delay).follow(watts, moment.step)
        for place, share in self.places:
            moment.add_heat(place, watts * share)


@dataclass(slots=True)
class LoadHeat(Law):
    """Heat at a place that follows the thrust; outside the catalogue."""

    place: str
    heat: float
    exponent: float = 1.0
    while_turning: bool = False

    def act(self, moment: Moment) -> None:
        """Change the moment."""
        watts = self.heat * (moment.thrust / 1750.0) ** self.exponent if moment.thrust > 0 else 0.0
        moment.add_heat(self.place, watts * (moment.speed > 0 or not self.while_turning))


@dataclass(slots=True)
class BrakeHeat(Law):
    """Heat at a place from every change of speed; outside the catalogue."""

    place: str
    heat: float

    def act(self, moment: Moment) -> None:
        """Change the moment."""
        before = self.memory.get("speed", 0.0)
        self.memory["speed"] = moment.speed
        kick = abs(moment.speed**2 - before**2) / 3000.0**2
        # An energy, whatever the step: what 600 s of the heat would be for a change to 3000 rpm.
        power = self.heat * 600.0 * kick / moment.step
        moment.add_heat(self.place, self.lag("heat", 400.0).follow(power, moment.step))


@dataclass(slots=True)
class GroupFactor(Law):
    """Joints or films times a constant factor."""

    names: tuple[str, ...]
    factor: float

    def act(self, moment: Moment) -> None:
        """Change the moment."""
        scale_groups(moment, self.names, self.factor)


def scale_groups(moment: Moment, names: tuple[str, ...], factor: float) -> None:
    """Multiply the factor of some groups."""
    if moment.group is None:
        moment.group = np.ones(len(moment.model.groups))
    for name in names:
        moment.group[moment.model.groups.index(name)] *= factor


def outer_seats(model: ReducedSpindle, where: str) -> tuple[str, ...]:
    """Groups of the outer seats of a set (with its spacer) or of one bearing."""
    if where in ("F", "R"):
        return tuple(n for n in model.groups if group_parameter(n) == f"jo_{where}")
    return (f"seat:{where}.outer|housing",)


@dataclass(slots=True)
class GapClosure(Law):
    """Outer seats conduct badly until the ring, warmer than the housing, has closed the gap."""

    where: str
    low: float
    onset: float
    width: float
    delay: float = 0.0

    def act(self, moment: Moment) -> None:
        """Change the moment."""
        for i in SETS[self.where]:
            b = m.BEARINGS[i]
            excess = moment.read(f"mean:{b}.outer") - moment.read("mean:housing")
            share = self.lag(b, self.delay).follow(_step((excess - self.onset) / self.width), moment.step)
            scale_groups(moment, (f"seat:{b}.outer|housing",), self.low + (1.0 - self.low) * share)


@dataclass(slots=True)
class MountSink(Law):
    """Flange's frame away from the ambient temperature, for good or building up."""

    difference: float
    build_up: float = 0.0
    constant: float = 1.0

    def act(self, moment: Moment) -> None:
        """Change the moment."""
        grown = 1.0 - np.exp(-moment.time / self.build_up) if self.build_up > 0 else 1.0
        moment.frame += self.difference * (self.constant + (1.0 - self.constant) * grown)


@dataclass(slots=True)
class ShaftConvection(Law):
    """Ends of the shaft lose more as it turns faster."""

    amplitude: float
    exponent: float = 1.0

    def act(self, moment: Moment) -> None:
        """Change the moment."""
        factor = max(0.05, 1.0 + self.amplitude * (moment.speed / 3000.0) ** self.exponent)
        scale_groups(moment, ("nose_end", "drive_end"), factor)


_ZONES = {
    "outside:cover": "mean:cover",
    "outside:flange": "mean:housing",
    "outside:front": "mean:housing",
    "outside:middle": "mean:housing",
    "outside:rear": "mean:housing",
}


@dataclass(slots=True)
class OutsideFilm(Law):
    """Outside film that grows with the difference (natural convection) or like radiation."""

    added: float
    kind: str
    exponent: float = 0.33

    def act(self, moment: Moment) -> None:
        """Change the moment."""
        for group, reading in _ZONES.items():
            surface = moment.read(reading)
            if self.kind == "radiation":
                a, s = moment.ambient + 273.15, surface + 273.15
                extra = self.added * 5.67e-8 * (a * a + s * s) * (a + s)
            else:
                extra = self.added * abs(surface - moment.ambient) ** self.exponent
            scale_groups(moment, (group,), max(0.05, 1.0 + extra / m.OUTSIDE_FILM))


@dataclass(slots=True)
class Fouling(Law):
    """Channel film times a factor that may have grown during the run."""

    factor: float
    growth: float = 0.0

    def act(self, moment: Moment) -> None:
        """Change the moment."""
        moment.film *= self.factor * (1.0 - self.growth * moment.time / 20_000.0)


@dataclass(slots=True)
class FilmTransition(Law):
    """Channel film rises beyond a Reynolds number."""

    amplitude: float
    reynolds: float
    width: float

    def act(self, moment: Moment) -> None:
        """Change the moment."""
        from .oil import channel_film

        reynolds = float(channel_film(moment.coolant_in, moment.flow)[2])
        moment.film *= 1.0 + self.amplitude * _step((reynolds - self.reynolds) / self.width)


@dataclass(slots=True)
class Bypass(Law):
    """Part of the flow misses the channel and joins the rest before the outlet's probe."""

    fraction: float

    def act(self, moment: Moment) -> None:
        """Change the moment."""
        moment.flow *= 1.0 - self.fraction


@dataclass(slots=True)
class Wave(Law):
    """Oil inlet swings about what was recorded: a skewed, wandering saw."""

    amplitude: float
    period: float
    phase: float = 0.0
    skew: float = 0.5
    wander: tuple[float, ...] = ()

    def act(self, moment: Moment) -> None:
        """Change the moment."""
        turns = moment.time / self.period + self.phase
        if self.wander:
            turns += float(np.interp(moment.time, np.linspace(0, 22_000, len(self.wander)), self.wander))
        x = turns % 1.0
        saw = x / self.skew if x < self.skew else (1.0 - x) / (1.0 - self.skew)
        shape = np.sin(2 * np.pi * turns) if self.skew == 0.5 else -np.cos(np.pi * saw)
        moment.coolant_in += self.amplitude * shape


@dataclass(slots=True)
class RoomDrift(Law):
    """True room minus recorded room: ramp, jump or hump."""

    amplitude: float
    shape: str
    at: float = 0.5
    total: float = 20_000.0

    def act(self, moment: Moment) -> None:
        """Change the moment."""
        x = moment.time / self.total
        if self.shape == "ramp":
            rise = x
        elif self.shape == "jump":
            rise = (1.0 - np.exp(-(x - self.at) * self.total / 900.0)) if x > self.at else 0.0
        else:
            rise = np.exp(-0.5 * ((x - self.at) / 0.16) ** 2)
        moment.ambient += self.amplitude * rise
        moment.frame += self.amplitude * rise


@dataclass(slots=True)
class ExtraMass(Law):
    """A body of some heat capacity that hangs on a place."""

    place: str
    capacity: float
    conductance: float

    def act(self, moment: Moment) -> None:
        """Change the moment."""
        here = moment.at(self.place)
        body = self.memory.get("body", here)
        # Exact for a place that keeps its temperature over the step: small bodies follow within it.
        taken = (here - body) * -np.expm1(-self.conductance * moment.step / self.capacity)
        moment.add_heat(self.place, -self.capacity * taken / moment.step)
        self.memory["body"] = body + taken


@dataclass(slots=True)
class Intervals(Law):
    """Heat (or with a conductance, loss to the room) at a place while it is on."""

    place: str
    watts: float
    intervals: tuple[tuple[float, float, float], ...]
    delay: float = 0.0
    conductance: float = 0.0

    def level(self, time: float) -> float:
        """Level at a time, before the delay."""
        return sum(level for start, end, level in self.intervals if start <= time < end)

    def act(self, moment: Moment) -> None:
        """Change the moment."""
        level = self.lag("on", self.delay).follow(self.level(moment.time), moment.step)
        watts = self.watts * level
        if self.conductance:
            watts -= self.conductance * level * (moment.at(self.place) - moment.ambient)
        moment.add_heat(self.place, watts)
