"""Effects concealed in machines of the meridian model, and what hangs on such machines for good."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.signal import lfilter

from ..concealed_effect import Concealed
from ..stepping import Drive
from .definition import value
from .run import Array, Moment, Plant

NOSE, DRIVE = "shaft.nose_end", "shaft.drive_end"


@dataclass(slots=True)
class Acting:
    """An effect as something that acts on a moment, with a memory that a run begins without."""

    act: Callable[[Moment, dict], None]
    memory: dict = field(default_factory=dict)

    def start(self) -> None:
        """Forget the run before."""
        self.memory.clear()

    def __call__(self, moment: Moment) -> None:
        """Change the moment."""
        self.act(moment, self.memory)


def lagged(memory: dict, target: float, constant: float, step: float) -> float:
    """First-order delay kept in a memory; the first value passes."""
    held = memory.get("lag", target)
    memory["lag"] = held + (target - held) * -np.expm1(-step / max(constant, 1e-3))
    return memory["lag"]


def body(moment: Moment, memory: dict, place: str, capacity: float, conductance: float) -> None:
    """A body that hangs on a place takes and gives heat."""
    here = moment.at(place)
    held = memory.get(place, here)
    taken = (here - held) * -np.expm1(-conductance * moment.step / capacity)
    moment.add(place, -capacity * taken / moment.step)
    memory[place] = held + taken


@dataclass(slots=True)
class Mounted:
    """Additions to a machine's definition: a tool, balls that conduct with speed, heat's other shape."""

    tool_J_K: float = 0.0
    ball: float = 0.0
    waves: tuple[tuple[float, float], ...] = ()
    reach: float = 4000.0
    memory: dict = field(default_factory=dict)

    def start(self) -> None:
        """Forget the run before."""
        self.memory.clear()

    def __call__(self, moment: Moment) -> None:
        """Change the moment."""
        turns = np.pi * moment.speed / self.reach
        shape = 1.0 + sum(a * np.sin((k + 1) * turns + phase) for k, (a, phase) in enumerate(self.waves))
        for group, bearings in moment.plant.sets.items():
            moment.warm(bearings, float(shape))
            if self.ball:
                moment.scale(f"balls:{group}", 1.0 + self.ball * moment.speed / self.reach)
        if self.tool_J_K:
            body(moment, self.memory, NOSE, self.tool_J_K, self.tool_J_K / 300.0)


@dataclass(slots=True)
class Lie:
    """Error of one channel."""

    kind: str
    channel: int
    size: float

    def apply(self, time: Array, readings: Array) -> Array:
        """(n, probes) readings with the lie."""
        out = readings.copy()
        y = readings[:, self.channel]
        if self.kind == "sensor_offset":
            y = y + self.size
        elif self.kind == "sensor_gain":
            y = 20.0 + self.size * (y - 20.0)
        elif self.kind == "sensor_drift":
            y = y + self.size * time / 3600.0
        elif self.kind == "clock_shift":
            y = np.interp(time - self.size, time, y)
        else:
            keep = np.exp(-(time[1] - time[0]) / max(self.size, 1e-3))
            y = lfilter([1.0 - keep], [1.0, -keep], y, zi=[keep * y[0]])[0]
        out[:, self.channel] = y
        return out


LIES = {
    "sensor_offset": ("offset", "K", 1.0),
    "sensor_gain": ("gain", "", 0.08),
    "sensor_lag": ("time_constant", "s", 700.0),
    "sensor_drift": ("rate", "K/h", 0.5),
    "clock_shift": ("shift", "s", 500.0),
}


@dataclass(frozen=True, slots=True)
class Scene:
    """Basis on which an effect is drawn."""

    rng: np.random.Generator
    plant: Plant
    drive: Drive
    channels: tuple[int, ...]
    strength: float

    def sign(self) -> float:
        """Plus or minus one."""
        return float(self.rng.choice([-1.0, 1.0]))

    def bearings(self) -> tuple[str, list[str], list[str]]:
        """Name of a set's component, its bearings, and the components that count as right."""
        name = str(self.rng.choice(list(self.plant.sets)))
        rings = self.plant.sets[name]
        return f"{name}_bearings", rings, [*rings, f"{name}_bearings"]

    def watts(self) -> float:
        """Heat of all bearings at the highest speed of the run, W."""
        return sum(self.plant.bearing_heat(float(self.drive.speed.max()), 0.0).values())


def draw(effect: str, s: Scene) -> Concealed:
    """Draw an effect of the catalogue."""
    top = float(s.drive.speed.max())
    if effect in LIES:
        name, unit, usual = LIES[effect]
        size = usual * s.rng.uniform(0.6, 1.5) * s.strength
        size *= s.sign() if effect in ("sensor_offset", "sensor_gain", "sensor_drift") else 1.0
        size = 1.0 + size if effect == "sensor_gain" else size
        channel = int(s.rng.choice(s.channels))
        probe = list(s.plant.model.probes)[channel]
        lie = Lie(effect, channel, size)
        return Concealed(effect, probe, [probe], size, sensor=lie, parameters={name: (size, unit)})
    if effect in ("heat_scale", "viscosity_heat", "thermal_preload", "starvation"):
        return _friction(effect, s, top)
    if effect == "joint_conductance":
        set_name = str(s.rng.choice(list(s.plant.sets)))
        factor = float(np.exp(-s.rng.uniform(0.8, 1.6) * s.strength))
        act = Acting(lambda m, _: m.scale(f"joint:outer_ring_seats:{set_name}", factor))
        rings = s.plant.sets[set_name]
        fine = [f"{set_name}_bearings", *rings]
        return Concealed(effect, fine[0], fine, factor, act, parameters={"factor": (factor, "")})
    if effect == "mount_sink":
        size = s.sign() * s.rng.uniform(3.0, 9.0) * s.strength

        def sink(m: Moment, _: dict) -> None:
            m.frame += size

        told = {"temperature_above_ambient": (size, "K")}
        return Concealed(effect, "flange", ["flange"], size, Acting(sink), parameters=told)
    if effect == "ambient_drift":
        size, total = s.sign() * s.rng.uniform(3.0, 8.0) * s.strength, float(s.drive.time[-1])

        def drift(m: Moment, _: dict) -> None:
            m.ambient += size * m.time / total
            m.frame += size * m.time / total

        return Concealed(effect, "ambient", ["ambient", "flange", "housing"], size, Acting(drift))
    if effect == "heat_capacity":
        size = float(s.plant.model.capacity.sum()) * s.rng.uniform(0.08, 0.25) * s.strength
        act = Acting(lambda m, memory: body(m, memory, "housing.flange_back", size, size / 400.0))
        return Concealed(
            effect, "flange", ["flange", "housing"], size, act, parameters={"capacity": (size, "J/K")}
        )
    if effect == "unrecorded_heat_source":
        return _intervals(s)
    return _turning(effect, s)


def _friction(effect: str, s: Scene, top: float) -> Concealed:
    component, rings, fine = s.bearings()
    told: dict[str, tuple[float, str]] = {}
    if effect == "heat_scale":
        size = float(np.exp(s.sign() * s.rng.uniform(0.25, 0.5) * s.strength))
        told = {"factor": (size, "")}
        act = Acting(lambda m, _: m.warm(rings, size))
    elif effect == "viscosity_heat":
        size = s.rng.uniform(0.01, 0.03) * s.strength

        def viscous(m: Moment, _: dict) -> None:
            for b in rings:
                m.warm([b], float(np.exp(-size * (m.at(f"{b}.outer") - 25.0))))

        act = Acting(viscous)
    elif effect == "thermal_preload":
        size = s.rng.uniform(0.04, 0.12) * s.strength

        def preload(m: Moment, memory: dict) -> None:
            more = np.mean([max(0.0, m.at(f"{b}.inner") - m.at(f"{b}.outer")) for b in rings])
            m.warm(rings, min(3.0, 1.0 + size * lagged(memory, float(more), 300.0, m.step)))

        act = Acting(preload)
    else:
        size, onset = s.rng.uniform(0.3, 0.7) * s.strength, top * s.rng.uniform(0.45, 0.7)
        told = {"onset_speed": (onset, "rpm")}

        def starve(m: Moment, memory: dict) -> None:
            over = 1.0 / (1.0 + np.exp(-np.clip((m.speed - onset) / (0.03 * top), -40.0, 40.0)))
            m.warm(rings, 1.0 + size * lagged(memory, float(over), 300.0, m.step))

        act = Acting(starve)
    return Concealed(effect, component, fine, size, act, parameters=told)


def _turning(effect: str, s: Scene) -> Concealed:
    """Heat that grows with speed: lip, air, drive."""
    place, component, fine, reference, power, name = {
        "seal_friction": ("shaft.labyrinth", "nose", ["nose", "shaft"], 1000.0, 1.0, "heat_per_1000rpm"),
        "windage": ("shaft.gap", "shaft", ["shaft"], 4500.0, 2.9, "heat_at_4500rpm"),
        "drive_heat": (DRIVE, "drive_end", ["drive_end"], 3000.0, 1.15, "heat_at_3000rpm"),
    }[effect]
    top = float(s.drive.speed.max())
    watts = 0.35 * s.watts() * s.rng.uniform(0.5, 1.5) * s.strength * (reference / top) ** power
    delay = 300.0 if effect == "drive_heat" else 0.0

    def turn(m: Moment, memory: dict) -> None:
        now = watts * (m.speed / reference) ** power if m.speed > 0 else 0.0
        m.add(place, lagged(memory, now, delay, m.step))

    return Concealed(effect, component, fine, watts, Acting(turn), parameters={name: (watts, "W")})


def _intervals(s: Scene) -> Concealed:
    place, component, fine = [
        (NOSE, "nose", ["nose", "shaft"]),
        (DRIVE, "drive_end", ["drive_end", "shaft"]),
        ("housing.flange_back", "flange", ["flange"]),
        ("housing.outside", "housing", ["housing", *s.plant.model.probes]),
    ][int(s.rng.integers(4))]
    total = float(s.drive.time[-1])
    cuts = np.round(np.sort(s.rng.uniform(0.1, 0.9, 2)) * total / 60.0) * 60.0
    start, end = float(cuts[0]), float(min(total, max(cuts[1], cuts[0] + 0.15 * total)))
    watts = 0.5 * s.watts() * s.rng.uniform(0.5, 1.5) * s.strength

    def heat(m: Moment, memory: dict) -> None:
        m.add(place, lagged(memory, watts * (start <= m.time < end), 120.0, m.step))

    return Concealed(
        "unrecorded_heat_source",
        component,
        fine,
        watts,
        Acting(heat),
        parameters={"heat": (watts, "W")},
        intervals=[[start, end]],
    )


PHYSICS = (
    "heat_scale", "viscosity_heat", "thermal_preload", "starvation", "joint_conductance", "mount_sink",
    "ambient_drift", "heat_capacity", "unrecorded_heat_source", "seal_friction", "windage", "drive_heat",
)  # fmt: skip
EFFECTS = (*PHYSICS, *LIES)


def deviating(tables: dict[str, Any], outer: float) -> dict[str, Any]:
    """The tables with the housing's outer diameters off by a relative amount, its surfaces with them."""
    out = {**tables, "part": [], "surface": []}
    radii = set()
    for part in tables["part"]:
        if part["name"] == "housing":
            radii = {0.5 * value(s["outer_diameter"]) for s in part["segment"]}
            segments = [
                s | {"outer_diameter": f"{1e3 * value(s['outer_diameter']) * (1.0 + outer):.6g} mm"}
                for s in part["segment"]
            ]
            part = part | {"segment": segments}
        out["part"].append(part)

    def moved(given: Any) -> Any:
        if isinstance(given, list):
            return [moved(x) for x in given]
        near = any(abs(value(given) - r) < 1e-6 for r in radii)
        return f"{1e3 * value(given) * (1.0 + outer):.6g} mm" if near else given

    for surface in tables["surface"]:
        if surface["part"] == "housing":
            where = [w | ({"r": moved(w["r"])} if "r" in w else {}) for w in surface["where"]]
            surface = surface | {"where": where}
        out["surface"].append(surface)
    # A probe on the skin stays there.
    out["probe"] = [p | {"r": moved(p["r"])} if p["part"] == "housing" else p for p in tables["probe"]]
    return out
