"""Families of machines known as networks only: their structure and their work.

Each draws the true machine; :mod:`validation.networks.scene` writes down what an owner would estimate of it.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import lfilter

from .truth import Network, Source, Work, march
from .work import DAY, levels, log_uniform, parts, room, shifts

EXPONENT = 1.6
EARLIER = 0.6  # length of the earlier recording to that of the later


@dataclass(frozen=True, slots=True)
class Machine:
    """One true machine, its work and how it is logged.

    ``work`` begins ``lead`` steps before the recording, ``earlier`` so long before an earlier one of the same
    machine. ``row`` steps make a row of the logger.
    ``may_be_unread`` are nodes that can go without a sensor; ``units`` of inputs and covariates.
    """

    family: str
    title: str
    network: Network
    work: Work
    earlier: Work
    lead: int
    row: int
    may_be_unread: tuple[str, ...]
    units: dict[str, str]
    room: str


def _length(rng: np.random.Generator, row: float, days: tuple[float, float]) -> tuple[float, int, int]:
    """Step, s, all steps, and those that go before each of the two recordings."""
    step = row / 3.0 if row > 5.0 else row
    total = log_uniform(rng, *days) * DAY
    lead = round(total * float(rng.choice([0.0, 0.15, 0.3])) / step)
    return step, round((1.0 + EARLIER) * total / step) + 2 * lead, lead


def _heated(network: Network, work: Work, rise: float) -> Network:
    """The network with gains such that the hottest node's rise is this much, K, nearly always."""
    room_only = {name: np.zeros_like(v) for name, v in work.surroundings.items()}
    warm = march(network, replace(work, surroundings=room_only))
    factor = rise / max(np.quantile(warm, 0.97, axis=0).max(), 1e-9)
    return replace(network, sources=tuple(replace(s, gain=s.gain * factor) for s in network.sources))


def _pick(rng: np.random.Generator, table: dict[str, tuple[float, float]]) -> dict[str, float]:
    return {name: log_uniform(rng, *limits) for name, limits in table.items()}


def _kept(rng: np.random.Generator, network: Network, optional: tuple[str, ...]) -> Network:
    """The network without some of its optional nodes."""
    out = {name for name in optional if rng.random() < 0.45}
    links = {k: v for k, v in network.conductance.items() if not out & set(k.split("|"))}
    return replace(
        network,
        capacity={k: v for k, v in network.capacity.items() if k not in out},
        conductance=links,
        sources=tuple(s for s in network.sources if s.node not in out),
    )


def _percent(rng: np.random.Generator, number: int, step: float, on: np.ndarray | float = 1.0) -> np.ndarray:
    """A covariate in percent that keeps a level for minutes to an hour."""
    return np.round(100.0 * levels(rng, number, (400.0 / step, 5000.0 / step), 0.35) * on, 1)


def _smooth(values: np.ndarray, step: float, constant: float) -> np.ndarray:
    keep = np.exp(-step / constant)
    return lfilter([1.0 - keep], [1.0, -keep], values)


def tool(rng: np.random.Generator) -> Machine:
    """Draw a machine tool in production."""
    step, n, lead = _length(rng, float(rng.choice([30.0, 60.0])), (7.5, 13.0))
    time = step * np.arange(n)
    on = shifts(rng, time)
    main, milling, load = parts(rng, step, on)
    drive = _smooth(60.0 * (main > 0) * rng.uniform(0.2, 1.0, n), step, 60.0)
    inputs = {
        "main_speed": np.round(main * rng.uniform(2500.0, 5000.0), 1),
        "main_load": np.round(100.0 * load * (0.6 + 0.4 * main), 1),
        "milling_speed": np.round(milling * rng.uniform(3000.0, 8000.0), 1),
        "x_load": np.round(drive, 1),
    }
    capacity = _pick(
        rng,
        {
            "main_spindle": (1.5e4, 6e4),
            "headstock": (1.5e5, 6e5),
            "milling_spindle": (4e3, 2e4),
            "x_drive": (3e3, 2e4),
            "coolant_tank": (1e5, 6e5),
        },
    )
    conductance = _pick(
        rng,
        {
            "main_spindle|headstock": (15, 100),
            "headstock|room": (15, 150),
            "main_spindle|room": (2, 8),
            "milling_spindle|room": (3, 15),
            "x_drive|room": (2, 8),
            "headstock|coolant_tank": (3, 15),
            "coolant_tank|room": (20, 100),
        },
    )
    sources = (
        Source("main_spindle", "main_speed", rng.uniform(50, 120), EXPONENT, 1000.0, "rpm"),
        Source("main_spindle", "main_load", rng.uniform(150, 500), 1.0, 100.0, "percent"),
        Source("milling_spindle", "milling_speed", rng.uniform(8, 40), EXPONENT, 1000.0, "rpm"),
        Source("x_drive", "x_load", rng.uniform(60, 200), 1.0, 100.0, "percent"),
    )
    network = _kept(
        rng,
        Network(capacity, conductance, ("room",), sources),
        ("milling_spindle", "x_drive", "coolant_tank"),
    )
    covariates = {
        "chuck_pump_percent": _percent(rng, n, step, on),
        "mist_percent": _percent(rng, n, step, on * (load > 0)),
    }
    title = "A machine tool in production: spindle, headstock and what is near."
    return _machine(rng, "tool", title, network, inputs, covariates, (step, lead))


def hydraulic(rng: np.random.Generator) -> Machine:
    """Draw a hydraulic circuit."""
    step, n, lead = _length(rng, float(rng.choice([30.0, 60.0])), (0.8, 3.0))
    on = shifts(rng, step * np.arange(n)) | (rng.random() < 0.5)
    power = rng.uniform(2500.0, 6000.0) * levels(rng, n, (500.0 / step, 6000.0 / step), 0.3) * on
    capacity = _pick(
        rng, {"oil": (5e4, 2e5), "block": (9e3, 3e4), "cylinder": (7e3, 2.5e4), "tank_wall": (1e4, 4e4)}
    )
    conductance = _pick(
        rng,
        {
            "oil|block": (30, 150),
            "oil|room": (30, 90),
            "block|room": (4, 10),
            "block|cylinder": (15, 60),
            "cylinder|room": (5, 14),
            "oil|tank_wall": (50, 200),
            "tank_wall|room": (10, 40),
        },
    )
    sources = (Source("oil", "pump_power", 0.5), Source("block", "pump_power", rng.uniform(0.05, 0.2)))
    network = _kept(rng, Network(capacity, conductance, ("room",), sources), ("tank_wall", "cylinder"))
    bar = power / 40.0 * (1.0 + 0.2 * rng.standard_normal(n))
    covariates = {"pressure_bar": np.round(bar, 1), "filter_percent": _percent(rng, n, step)}
    title = "A hydraulic circuit: oil, valve block and what they heat."
    return _machine(
        rng, "hydraulic", title, network, {"pump_power": np.round(power, 1)}, covariates, (step, lead)
    )


def motor(rng: np.random.Generator) -> Machine:
    """Draw a small motor on a bench."""
    step, n, lead = _length(rng, float(rng.choice([1.0, 2.0])), (0.03, 0.09))
    power = np.round(rng.uniform(50, 120) * levels(rng, n, (60 / step, 900 / step), 0.2), 1)
    speed = np.round(4000.0 * levels(rng, n, (100 / step, 1200 / step), 0.3), 0)
    capacity = _pick(
        rng, {"winding": (60, 220), "body": (150, 600), "bench_plate": (500, 2000), "rotor": (60, 250)}
    )
    conductance = _pick(
        rng,
        {
            "winding|body": (1.0, 5.0),
            "winding|ambient": (0.1, 0.4),
            "body|ambient": (0.3, 2.0),
            "body|bench_plate": (0.3, 0.9),
            "bench_plate|ambient": (0.2, 1.0),
            "body|rotor": (0.2, 0.8),
            "rotor|ambient": (0.05, 0.2),
        },
    )
    sources = (
        Source("winding", "electrical_power", 0.6),
        Source("body", "speed", rng.uniform(2, 8), EXPONENT, 1000.0, "rpm"),
    )
    network = _kept(rng, Network(capacity, conductance, ("ambient",), sources), ("bench_plate", "rotor"))
    covariates = {"brake_percent": np.round(100.0 * levels(rng, n, (60 / step, 700 / step), 0.4), 1)}
    title = "A small motor on a bench, heated by its losses."
    inputs = {"electrical_power": power, "speed": speed}
    return _machine(rng, "motor", title, network, inputs, covariates, (step, lead))


def gearbox(rng: np.random.Generator) -> Machine:
    """Draw a gearbox with its motor on a frame."""
    step, n, lead = _length(rng, float(rng.choice([15.0, 30.0])), (0.4, 1.6))
    speed = np.round(3000.0 * levels(rng, n, (600 / step, 7000 / step), 0.2), 0)
    power = np.round(
        rng.uniform(4e3, 1.5e4) * levels(rng, n, (300 / step, 5000 / step), 0.1) * (speed > 0), 0
    )
    capacity = _pick(
        rng, {"oil": (8e3, 3e4), "housing": (4e4, 1.5e5), "motor": (1e4, 5e4), "frame": (5e4, 3e5)}
    )
    conductance = _pick(
        rng,
        {
            "oil|housing": (30, 200),
            "housing|room": (10, 40),
            "oil|room": (3, 14),
            "housing|motor": (5, 30),
            "motor|room": (4, 20),
            "housing|frame": (5, 40),
            "frame|room": (10, 60),
        },
    )
    sources = (
        Source("oil", "speed", rng.uniform(150, 400), EXPONENT, 1000.0, "rpm"),
        Source("oil", "shaft_power", rng.uniform(0.02, 0.05)),
        Source("motor", "shaft_power", rng.uniform(0.02, 0.05)),
    )
    network = _kept(rng, Network(capacity, conductance, ("room",), sources), ("motor", "frame"))
    covariates = {"oil_pump_percent": _percent(rng, n, step)}
    inputs = {"speed": speed, "shaft_power": power}
    title = "A gearbox on a frame, perhaps with its motor."
    return _machine(rng, "gearbox", title, network, inputs, covariates, (step, lead))


def cabinet(rng: np.random.Generator) -> Machine:
    """Draw an electronics cabinet."""
    step, n, lead = _length(rng, float(rng.choice([15.0, 30.0, 60.0])), (1.0, 4.0))
    on = np.where(shifts(rng, step * np.arange(n)), 1.0, rng.uniform(0.0, 0.4))
    power = np.round(rng.uniform(1500, 5000) * on * levels(rng, n, (200 / step, 9000 / step), 0.1), 1)
    capacity = _pick(
        rng, {"drive": (2e3, 8e3), "air": (1.5e3, 6e3), "enclosure": (1e4, 5e4), "supply": (2e3, 8e3)}
    )
    conductance = _pick(
        rng,
        {
            "drive|air": (6, 20),
            "air|enclosure": (10, 40),
            "enclosure|room": (5, 20),
            "air|room": (2, 10),
            "supply|air": (4, 15),
            "supply|enclosure": (2, 6),
        },
    )
    sources = (Source("drive", "drive_power", 0.04), Source("supply", "drive_power", rng.uniform(0.01, 0.03)))
    network = _kept(rng, Network(capacity, conductance, ("room",), sources), ("supply",))
    covariates = {"modules_percent": _percent(rng, n, step)}
    title = "An electronics cabinet."
    return _machine(rng, "cabinet", title, network, {"drive_power": power}, covariates, (step, lead))


def anything(rng: np.random.Generator) -> Machine:
    """Draw two to seven bodies joined at random, one or two surroundings."""
    step, n, lead = _length(rng, float(rng.choice([5.0, 10.0, 30.0])), (0.3, 5.0))
    total = step * (n - 2 * lead) / (1.0 + EARLIER)
    names = [f"body_{k + 1}" for k in range(int(rng.integers(2, 8)))]
    boundaries = ("room", "base") if rng.random() < 0.35 else ("room",)
    capacity = {name: log_uniform(rng, 3e3, 1e5) for name in names}
    conductance = {}

    def join(a: str, b: str, share: float) -> None:
        held = min(capacity[a], capacity.get(b, np.inf))
        conductance[f"{a}|{b}"] = share * held / log_uniform(rng, 0.002 * total, 0.06 * total)

    for k, name in enumerate(names[1:], 1):
        join(str(rng.choice(names[:k])), name, 1.0)
    for _ in range(int(rng.integers(0, max(1, len(names) - 1)))):
        a, b = sorted(rng.choice(len(names), 2, replace=False))
        if f"{names[a]}|{names[b]}" not in conductance:
            join(names[a], names[b], 0.4)
    outside = [name for name in names if rng.random() < 0.6] or names[:1]
    for name in outside:
        join(name, "room", 0.6)
    if len(boundaries) > 1:
        join(str(rng.choice(names)), "base", 0.6)
    inputs = {
        f"power_{k + 1}": np.round(
            log_uniform(rng, 200, 4000) * levels(rng, n, (0.004 * total / step, 0.06 * total / step), 0.3), 1
        )
        for k in range(int(rng.integers(1, min(3, len(names)) + 1)))
    }
    heated = rng.choice(names, len(inputs), replace=False)
    sources = tuple(
        Source(str(node), name, rng.uniform(0.2, 0.9)) for node, name in zip(heated, inputs, strict=True)
    )
    network = Network(capacity, conductance, boundaries, sources)
    covariates = {
        "auxiliary_percent": np.round(
            100 * levels(rng, n, (0.01 * total / step, 0.06 * total / step), 0.4), 1
        )
    }
    title = "Bodies that conduct to each other and to what surrounds them."
    return _machine(rng, "random", title, network, inputs, covariates, (step, lead))


def _machine(
    rng: np.random.Generator,
    family: str,
    title: str,
    network: Network,
    inputs: dict[str, np.ndarray],
    covariates: dict[str, np.ndarray],
    extent: tuple[float, int],
) -> Machine:
    """Add surroundings, scale the heat to what such machines reach, leave out what nothing drives."""
    step, lead = extent
    n = next(iter(inputs.values())).size
    time = step * np.arange(n)
    used = {s.input for s in network.sources}
    around = {name: room(rng, time, rng.uniform(1.0, 3.0)) for name in network.boundaries}
    if "base" in around:
        around["base"] = around["base"] + rng.uniform(-6.0, 6.0)
    work = Work(step, {k: v for k, v in inputs.items() if k in used}, around, covariates)
    network = _heated(network, work, rng.uniform(12.0, 45.0))
    first = round((n - 2 * lead) * EARLIER / (1.0 + EARLIER)) + lead
    units = {s.input: s.unit for s in network.sources}
    units |= {c: c.rsplit("_", 1)[1] for c in covariates}
    heated = {s.node for s in network.sources}
    quiet = tuple(node for node in network.nodes if node not in heated)
    row = 3 if step > 1.5 and family != "motor" else 1
    runs = work.part(first, n), work.part(0, first)
    return Machine(family, title, network, *runs, lead, row, quiet, units, network.boundaries[0])


FAMILIES: dict[str, Callable[[np.random.Generator], Machine]] = {
    "tool": tool,
    "hydraulic": hydraulic,
    "motor": motor,
    "gearbox": gearbox,
    "cabinet": cabinet,
    "random": anything,
}
