"""Effects to conceal in a network, drawn by family, with the words and sets that its answer needs."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy.signal import lfilter

from ..concealed_effect import KINDS
from ..sensor_errors import first_order
from .scene import Owner
from .truth import NOTHING, Array, Change
from .work import log_uniform, stretches


def kind_of(effect: str) -> str:
    """Kind of an effect of the catalogue."""
    return KINDS.get(effect, "missing_physics")


@dataclass(frozen=True, slots=True)
class Lie:
    """Error of one channel: an effect's id and its size (and onset, s)."""

    effect: str
    channel: str
    size: float
    onset: float = 0.0

    def applied(self, time: Array, reading: Array, around: Array) -> Array:
        """(n,) what the channel reads instead."""
        if self.effect == "sensor_offset":
            return reading + self.size
        if self.effect == "sensor_gain":
            return 20.0 + self.size * (reading - 20.0)
        if self.effect == "sensor_drift":
            return reading + self.size * time / 3600.0
        if self.effect == "clock_shift":
            return np.interp(time - self.size, time, reading)
        if self.effect == "sensor_detached":
            apart = self.size * (time >= self.onset)
            return reading + apart * (around - reading)
        return first_order(time, reading, max(self.size, 1e-3))


@dataclass(frozen=True, slots=True)
class Concealed:
    """One concealed effect and its answer.

    ``shape`` (n,) is what is on by step of the work, for effects with intervals; ``also`` are other effects
    at the same places that count as right; ``most`` of one effect that may share in it.
    """

    effect: str
    component: str
    acceptable: list[str]
    statement: str
    change: Change = NOTHING
    lie: Lie | None = None
    parameters: dict[str, tuple[float, str]] = field(default_factory=dict)
    intervals: list[list[float]] | None = None
    follows: str | None = None
    form: dict[str, object] = field(default_factory=dict)
    shape: Array | None = None
    also: tuple[str, ...] = ()
    most: int = 1


@dataclass(slots=True)
class Scene:
    """Basis on which an effect is drawn: the machine, its random numbers, how strong."""

    owner: Owner
    rng: np.random.Generator
    strength: float

    @property
    def work(self):
        """Inputs of the machine."""
        return self.owner.machine.work

    @property
    def start(self) -> int:
        """First step of the recording."""
        return self.owner.machine.lead

    @property
    def network(self):
        """The true network."""
        return self.owner.machine.network

    @property
    def seconds(self) -> Array:
        """(n,) time from the recording's start, s; negative before it."""
        return self.work.time - self.start * self.work.step

    def usual_heat(self) -> float:
        """Mean heat of the largest source, W."""
        watts = [
            s.gain * ((self.work.inputs[s.input] / s.reference) ** s.exponent).mean()
            for s in self.network.sources
        ]
        return float(max(watts))

    def warm_node(self) -> str:
        """A node, most often one that is read."""
        read = self.rng.random() < 0.8
        return str(self.rng.choice(self.owner.channels if read else self.network.nodes))


def both_ways(link: str) -> list[str]:
    """Names of a link and of the node that it cools.

    >>> both_ways("oil|room")
    ['oil|room', 'room|oil', 'oil']
    """
    a, b = link.split("|")
    return [link, f"{b}|{a}", a]


def _gate(s: Scene) -> tuple[str | None, Array]:
    """An input that is zero a good part of the time, and when it is."""
    for name in s.rng.permutation(list(s.work.inputs)):
        zero = s.work.inputs[name] <= 0
        if 0.25 < zero[s.start :].mean() < 0.9:
            return str(name), zero
    return None, np.ones(s.work.time.size, dtype=bool)


def switching(s: Scene) -> tuple[Array, list[list[float]], str | None]:
    """Levels by step, 0 while off, in tens to hundreds of intervals; these; the input that gates them."""
    gate, zero = _gate(s) if s.rng.random() < 0.5 else (None, np.ones(s.work.time.size, dtype=bool))
    step, total = s.work.step, s.seconds[-1]
    shortest = max(3.0 * s.owner.row_s, 45.0)
    number = log_uniform(s.rng, 15, 120)
    share = s.rng.uniform(0.12, 0.4)
    mean = max(share * total / number, 1.5 * shortest)
    level = np.zeros(s.work.time.size)
    two = s.rng.random() < 0.2
    bursts = s.rng.random() < 0.35 and mean > 8.0 * shortest
    at = s.start
    while at < level.size:
        at += max(1, round(s.rng.exponential(mean * (1.0 - share) / share) / step))
        long = max(shortest, s.rng.exponential(mean)) / step
        stop = at + max(1, round(long))
        level[at:stop] = 0.5 if two and s.rng.random() < 0.5 else 1.0
        if bursts and s.rng.random() < 0.5:
            period = max(3, round(s.rng.uniform(3.0, 6.0) * shortest / step))
            level[at:stop][(np.arange(len(level[at:stop])) % period) < max(1, period // 5)] = 0.0
        at = stop
    if gate:
        leak = np.zeros(level.size, dtype=bool)
        for part in stretches(s.rng, level.size, 4 * mean / step, 30 * mean / step):
            leak[part] = s.rng.random() < 0.12
        level *= zero | leak
    spans = []
    edges = np.flatnonzero(np.diff(np.concatenate([[0.0], level > 0, [0.0]])))
    for first, last in edges.reshape(-1, 2):
        if (last - first) * step < min(shortest, 120.0):
            level[first:last] = 0.0
        else:
            spans.append([float(s.seconds[first]), float(s.seconds[first] + (last - first) * step)])
    return level, spans, gate


def _gated(gate: str | None) -> str:
    return f", mostly while {gate} is zero, but not always then" if gate else ""


def hidden_heat(s: Scene) -> Concealed:
    """Heat that no channel records, on and off."""
    node = s.warm_node()
    level, spans, gate = switching(s)
    watts = s.usual_heat() * s.rng.uniform(0.5, 2.0) * s.strength
    mean = watts * level[level > 0].mean() if spans else 0.0
    near = [node, *(x for k in s.network.conductance for x in k.split("|") if node in k.split("|"))]
    places = [node] if node in s.owner.sensors else [x for x in dict.fromkeys(near) if x in s.network.nodes]
    return Concealed(
        "unrecorded_heat_source",
        node,
        places,
        f"In {len(spans)} intervals {node} receives {mean:.0f} W that no channel records{_gated(gate)}.",
        Change(heat={node: watts * level}),
        parameters={"heat": (mean, "W")},
        intervals=spans,
        form={"type": "latent", "node": node, "heat": watts, "gate": gate},
        shape=level,
    )


def hidden_cooling(s: Scene) -> Concealed:
    """A conductance to a surrounding that is higher in intervals."""
    link = str(s.rng.choice(s.network.cooled()))
    level, spans, gate = switching(s)
    factor = float(np.exp(s.rng.uniform(0.6, 1.4) * s.strength))
    extra = (factor - 1.0) * s.network.conductance[link]
    mean = extra * (level[level > 0].mean() if spans else 0.0)
    return Concealed(
        "unrecorded_cooling",
        link,
        both_ways(link),
        f"In {len(spans)} intervals {link} conducts {mean:.3g} W/K more than as built{_gated(gate)}.",
        Change(factor={link: 1.0 + (factor - 1.0) * level}),
        parameters={"conductance": (mean, "W/K")},
        intervals=spans,
        form={"type": "latent", "link": link, "factor": factor, "gate": gate},
        shape=level,
    )


def _steps(s: Scene, other: float) -> tuple[Array, list[float], list[float], list[list[float]]]:
    """Levels by step, changing one to three times between 1 and another; times, levels, spans away from 1."""
    count = int(s.rng.choice([1, 2, 2, 3]))
    span = s.seconds[-1]
    cuts = np.sort(s.rng.uniform(0.12, 0.88, count))
    while count > 1 and np.diff(cuts).min() < 0.1:
        cuts = np.sort(s.rng.uniform(0.12, 0.88, count))
    times = [float(np.round(c * span / 10.0) * 10.0) for c in cuts]
    levels = [1.0, other, 1.0, other][: count + 1]
    by_step = np.array(levels)[np.searchsorted(times, s.seconds, side="right")]
    edges = [*times, float(span)]
    spans = [[edges[k], edges[k + 1]] for k in range(0, count, 2)]
    return by_step, times, levels, spans


def stepped_cooling(s: Scene) -> Concealed:
    """A conductance that steps at unknown times."""
    link = str(s.rng.choice(s.network.cooled() if s.rng.random() < 0.7 else list(s.network.conductance)))
    factor = float(np.exp(s.rng.choice([-1, 1]) * s.rng.uniform(0.5, 1.0) * s.strength))
    by_step, times, levels, spans = _steps(s, round(factor, 3))
    fine = both_ways(link)
    if link not in s.network.cooled():
        fine.append(link.split("|")[1])
    stairs = f"{', '.join(map(str, levels))}, changing at {', '.join(f'{t / 3600:.2f} h' for t in times)}"
    return Concealed(
        "unrecorded_cooling",
        link,
        fine,
        f"Conductance {link} is as built times {stairs}.",
        Change(factor={link: by_step}),
        intervals=spans,
        form={"type": "step", "link": link, "times": times, "levels": levels},
        shape=(by_step != 1.0).astype(float),
        also=("joint_conductance",),
        most=3,
    )


def stepped_heat(s: Scene) -> Concealed:
    """A source's heat that steps at unknown times."""
    source = s.rng.choice(np.array(s.network.sources, dtype=object))
    factor = float(np.exp(s.rng.choice([-1, 1, 1]) * s.rng.uniform(0.4, 0.9) * s.strength))
    by_step, times, levels, spans = _steps(s, round(factor, 3))
    stairs = f"{', '.join(map(str, levels))}, changing at {', '.join(f'{t / 3600:.2f} h' for t in times)}"
    return Concealed(
        "unrecorded_heat_source",
        source.node,
        [source.node, source.name, source.input],
        f"Heat of {source.name} is as built times {stairs}.",
        Change(gain={source.name: by_step}),
        intervals=spans,
        follows=source.input,
        form={"type": "step", "source": source.name, "times": times, "levels": levels},
        shape=(by_step != 1.0).astype(float),
        also=("heat_scale",),
        most=3,
    )


def changed_cooling(s: Scene) -> Concealed:
    """Links to the surroundings that conduct otherwise all through."""
    links = s.network.cooled()
    number = int(s.rng.integers(1, len(links) + 1))
    chosen = sorted(s.rng.choice(links, number, replace=False), key=links.index)
    factor = round(float(np.exp(s.rng.choice([-1, 1]) * s.rng.uniform(0.4, 0.9) * s.strength)), 3)
    return Concealed(
        "joint_conductance",
        str(chosen[0]),
        [name for link in chosen for name in both_ways(link)],
        f"All through, not in the calibration, {', '.join(chosen)}: {factor} times as built.",
        Change(factor=dict.fromkeys(map(str, chosen), factor)),
        parameters={"factor": (factor, "")},
        form={"type": "cool", "links": list(map(str, chosen)), "factor": factor},
        also=("unrecorded_cooling",),
        most=min(3, max(1, number)),
    )


def changed_joint(s: Scene) -> Concealed:
    """A link between two nodes that conducts otherwise all through."""
    inside = [k for k in s.network.conductance if k not in s.network.cooled()]
    link = str(s.rng.choice(inside))
    factor = round(float(np.exp(s.rng.choice([-1, 1]) * s.rng.uniform(0.6, 1.4) * s.strength)), 3)
    a, b = link.split("|")
    return Concealed(
        "joint_conductance",
        link,
        [link, f"{b}|{a}"],
        f"All through, not in the calibration, {link} conducts {factor} times as built.",
        Change(factor={link: factor}),
        parameters={"factor": (factor, "")},
        form={"type": "joint", "link": link, "factor": factor},
    )


def changed_heat(s: Scene) -> Concealed:
    """A source that heats otherwise all through."""
    source = s.rng.choice(np.array(s.network.sources, dtype=object))
    factor = round(float(np.exp(s.rng.choice([-1, 1]) * s.rng.uniform(0.25, 0.7) * s.strength)), 3)
    return Concealed(
        "heat_scale",
        source.node,
        [source.node, source.name, source.input],
        f"All through, not in the calibration, the heat of {source.name} is {factor} times as built.",
        Change(gain={source.name: factor}),
        parameters={"factor": (factor, "")},
        form={"type": "hscale", "source": source.name, "factor": factor},
    )


def follows_load(s: Scene) -> Concealed:
    """Heat that follows a recorded quantity that drives nothing, with a lag."""
    name = str(s.rng.choice([c for c in s.work.covariates if not c.startswith("pressure")]))
    node = s.warm_node()
    span = s.seconds[-1]
    lag = float(s.rng.choice([0.0, 1.0])) * log_uniform(s.rng, 0.002 * min(span, 2e5), 0.01 * min(span, 2e5))
    watts = s.usual_heat() * s.rng.uniform(0.5, 2.0) * s.strength
    shape = s.work.covariates[name] / 100.0
    if lag > 0.0:
        keep = np.exp(-s.work.step / lag)
        shape = lfilter([1.0 - keep], [1.0, -keep], shape)
    fine = [node]
    if node not in s.owner.sensors:
        fine += [
            x
            for k in s.network.conductance
            for x in k.split("|")
            if node in k.split("|") and x in s.owner.sensors
        ]
    return Concealed(
        "unrecorded_heat_source",
        node,
        list(dict.fromkeys(fine)),
        f"{node} receives heat that follows {name} with a lag of {lag:.0f} s, {watts:.0f} W at 100; "
        "the file has no such source.",
        Change(heat={node: watts * shape}),
        follows=name,
        form={"type": "lagcov", "node": node, "cov": name, "ref": 100, "tau": lag, "heat": watts},
        shape=shape,
        also=("drive_heat",),
    )


def missing_mass(s: Scene) -> Concealed:
    """A mass that hangs on a node."""
    node = s.warm_node()
    capacity = s.network.capacity[node] * s.rng.uniform(0.5, 2.0) * s.strength
    constant = log_uniform(s.rng, 2.0 * s.work.step, 12.0 * s.work.step)
    return Concealed(
        "heat_capacity",
        node,
        [node],
        f"A mass of {capacity:.4g} J/K is attached to {node} (time constant to it {constant:.0f} s); "
        "not in the calibration.",
        Change(mass=((node, capacity, capacity / constant),)),
        parameters={"capacity": (capacity, "J/K")},
        form={"type": "mass", "node": node, "capacity": capacity, "tau": constant},
    )


def grows_with_temperature(s: Scene) -> Concealed:
    """A film that grows with the difference, or radiation."""
    link = str(s.rng.choice(s.network.cooled()))
    near, far = link.split("|")
    exponent = float(np.clip(s.rng.uniform(0.25, 0.5) * s.strength, 0.15, 0.9))
    scale = s.rng.uniform(15.0, 40.0)
    return Concealed(
        "natural_convection",
        link,
        [*both_ways(link), "housing"],
        f"The conductance {link} grows with the temperature difference to the power {exponent:.2f} "
        f"(as built at {scale:.0f} K).",
        Change(law={link: (exponent, scale)}),
        form={"type": "natural", "link": link, "dT": scale, "p": exponent, "near": near, "far": far},
        also=("radiation",),
    )


def _lie(
    s: Scene, effect: str, size: float, words: str, parameter: tuple[str, str], onset: float = 0.0
) -> Concealed:
    node = str(s.rng.choice(s.owner.channels))
    name, unit = parameter
    form = {"type": effect.removeprefix("sensor_"), "probe": node, name: size}
    if onset:
        form["onset"] = onset
    return Concealed(
        effect,
        node,
        [node, f"{node}_degC"],
        f"The sensor {node} {words}",
        lie=Lie(effect, node, size, onset),
        parameters={name: (size, unit)},
        form=form,
    )


def slow_sensor(s: Scene) -> Concealed:
    """A sensor that lags."""
    size = log_uniform(s.rng, 0.003, 0.02) * min(s.seconds[-1], 1e5) * s.strength
    return _lie(s, "sensor_lag", size, f"lags by {size:.0f} s.", ("time_constant", "s"))


def lying_sensor(s: Scene) -> Concealed:
    """A sensor beside the truth, drifting, with a gain, or come off at a moment."""
    which = str(s.rng.choice(["offset", "drift", "gain", "detached"]))
    sign = float(s.rng.choice([-1.0, 1.0]))
    if which == "offset":
        size = sign * s.rng.uniform(1.0, 3.0) * s.strength
        words, parameter = f"reads {size:+.2f} K beside the truth, not in the calibration.", ("offset", "K")
    elif which == "drift":
        size = sign * s.rng.uniform(2.0, 6.0) * s.strength / (s.seconds[-1] / 3600.0)
        words, parameter = f"drifts by {size:+.3g} K/h.", ("rate", "K/h")
    elif which == "gain":
        size = 1.0 + sign * s.rng.uniform(0.08, 0.25) * s.strength
        words, parameter = f"has a gain of {size:.3f} about 20 °C.", ("gain", "")
    else:
        size = float(min(0.9, s.rng.uniform(0.3, 0.7) * s.strength))
        onset = float(round(s.rng.uniform(0.2, 0.8) * s.seconds[-1] / 10.0) * 10.0)
        words = f"comes off after {onset:.0f} s and reads {size:.2f} of the way to its surroundings."
        return _lie(s, "sensor_detached", size, words, ("share", ""), onset)
    return _lie(s, f"sensor_{which}", size, words, parameter)


# Family: what is drawn, and whether an earlier recording without it is needed to see it at all.
CONCEALED: dict[str, tuple[Callable[[Scene], Concealed], bool]] = {
    "hidden_heat": (hidden_heat, False),
    "hidden_cooling": (hidden_cooling, False),
    "stepped_cooling": (stepped_cooling, False),
    "stepped_heat": (stepped_heat, False),
    "changed_cooling": (changed_cooling, True),
    "changed_joint": (changed_joint, True),
    "changed_heat": (changed_heat, True),
    "follows_load": (follows_load, False),
    "missing_mass": (missing_mass, True),
    "slow_sensor": (slow_sensor, True),
    "lying_sensor": (lying_sensor, True),
    "grows_with_temperature": (grows_with_temperature, False),
}
