"""An owner's knowledge and records of a machine: estimates, sensors, a logger's habits."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from .families import Machine
from .truth import Array, Change, Work, march

NOMINAL_EXPONENT = 5.0 / 3.0
SPREAD_90 = 1.645


@dataclass(frozen=True, slots=True)
class Estimate:
    """A positive quantity as the file gives it: median and 1 sigma of its logarithm, or 90 % limits of it."""

    value: float
    sigma: float
    as_range: bool

    def text(self, unit: str) -> str:
        """Value in the form of a machine definition."""
        if self.as_range:
            low, high = (self.value * np.exp(k * SPREAD_90 * self.sigma) for k in (-1, 1))
            return f'{{low = "{low:.3g} {unit}", high = "{high:.3g} {unit}"}}'
        return f'{{value = "{self.value:.3g} {unit}", sigma_rel = {self.sigma:.2g}}}'


@dataclass(frozen=True, slots=True)
class Sensor:
    """Errors of one channel: white and slow, K and s; a step of rounding, K; mean of whole degrees or not."""

    white_K: float
    slow_K: float
    slow_s: float
    rounding_K: float
    whole_degree: bool

    @property
    def total_K(self) -> float:
        """All of it, rounding's too."""
        return float(np.sqrt(self.white_K**2 + self.slow_K**2 + self.rounding_K**2 / 12.0))


@dataclass(frozen=True, slots=True)
class Owner:
    """A machine's file and its recording habits; ``structure`` is what the file lacks for good."""

    machine: Machine
    estimates: dict[str, Estimate]
    structure: Change
    lacks: dict[str, object]
    sensors: dict[str, Sensor]
    room_recorded: bool
    room_range: tuple[float, float]
    means: bool
    coarse: dict[str, int]

    @property
    def channels(self) -> tuple[str, ...]:
        """Nodes with a sensor."""
        return tuple(self.sensors)

    @property
    def row_s(self) -> float:
        """Time between rows, s."""
        return self.machine.row * self.machine.work.step


@dataclass(slots=True)
class Run:
    """One run of the true machine: (rows,) starts of rows, true readings, and what was logged of inputs.

    ``index`` of a row's first step; ``logged`` holds nan where the logger wrote nothing; ``start`` are the
    nodes' temperatures at the first row.
    """

    work: Work
    time: Array
    truth: Array
    logged: dict[str, Array]
    start: Array
    covariates: dict[str, Array] = field(default_factory=dict)


def draw_owner(rng: np.random.Generator, machine: Machine, calibrated: bool) -> Owner:
    """Draw the content of the file, what it lacks and how the machine is recorded."""
    network = machine.network
    plain: dict[str, float] = {f"capacity.{k}": v for k, v in network.capacity.items()}
    plain |= {f"conductance.{k}": v for k, v in network.conductance.items()}
    plain |= {f"gain.{s.name}": s.gain for s in network.sources}
    estimates = {}
    for key, true in plain.items():
        sigma = (
            rng.uniform(0.2, 0.5) if key.startswith("gain") and "speed" not in key else rng.uniform(0.35, 0.9)
        )
        off = float(np.clip(rng.standard_normal(), -2.0, 2.0))
        estimates[key] = Estimate(true * np.exp(-sigma * off), sigma, bool(rng.random() < 0.5))
    node = str(rng.choice(network.nodes))
    span = machine.work.step * (machine.work.time.size - machine.lead)
    mass = network.capacity[node] * rng.uniform(0.06, 0.14)
    constant = float(np.clip(span * 10 ** rng.uniform(-4.0, -2.5), 3.0 * machine.work.step, 600.0))
    slope = float(rng.choice([-1, 1, 1]) * rng.uniform(4e-4, 1.5e-3))
    structure = Change(rise=dict.fromkeys(network.conductance, slope), mass=((node, mass, mass / constant),))
    quiet = [n for n in machine.may_be_unread if len(network.nodes) > 2]
    unread = str(rng.choice(quiet)) if quiet and rng.random() < 0.35 else None
    white, slow = float(rng.choice([0.12, 0.16, 0.25, 0.4])), rng.uniform(0.04, 0.16)
    whole = bool(machine.family != "motor" and rng.random() < 0.3)
    slow_s = float(np.clip(span * 10 ** rng.uniform(-2.3, -1.3), 120.0, 15_000.0))
    rounding = float(rng.choice([0.01, 0.05, 0.1]))
    sensors = {
        n: Sensor(
            0.19 if whole else white * rng.uniform(0.8, 1.1),
            slow * rng.uniform(0.6, 1.2),
            slow_s,
            0.125 if whole else rounding,
            whole,
        )
        for n in network.nodes
        if n != unread
    }
    recorded = bool(rng.random() < {"tool": 0.25, "hydraulic": 0.4}.get(machine.family, 0.75))
    around = machine.work.surroundings[machine.room]
    centre, half = float(around.mean()), rng.uniform(3.0, 5.0)
    centre += float(np.clip(rng.standard_normal(), -1.5, 1.5)) * half / SPREAD_90
    coarse = {i: int(rng.choice([2, 3, 5])) for i in machine.work.inputs if rng.random() < 0.35}
    lacks: dict[str, object] = {
        "extra_mass": {"node": node, "capacity": round(mass, 2), "time_constant_s": round(constant, 2)},
        "conductance_per_K": round(slope, 5),
        "exponent_for_5_3": 1.6,
        "ambient_peak_to_peak_K": round(float(np.ptp(around)), 3),
        "sensorless": unread,
    }
    means = bool(rng.random() < 0.5)
    return Owner(
        machine, estimates, structure, lacks, sensors, recorded, (centre - half, centre + half), means, coarse
    )


def by_rows(values: Array, row: int, mean: bool) -> Array:
    """Means of each row's steps, or values at its start, (rows,)."""
    whole = values[: values.size // row * row].reshape(-1, row)
    return whole.mean(axis=1) if mean else whole[:, 0].copy()


def run_machine(owner: Owner, later: bool, change: Change | None = None) -> Run:
    """Run the true machine, with a concealed change if any; its channels' true temperatures by row."""
    machine = owner.machine
    whole = machine.work if later else machine.earlier
    acting = owner.structure if change is None else owner.structure.beside(change)
    temperatures = march(machine.network, whole, acting)[machine.lead :]
    work = whole.part(machine.lead)
    row, mean = machine.row, owner.means
    at = [machine.network.nodes.index(n) for n in owner.channels]
    truth = np.stack([by_rows(temperatures[:, i], row, mean) for i in at], axis=1)
    logged = {}
    for name, values in work.inputs.items():
        some = by_rows(values, row, mean)
        every = owner.coarse.get(name, 1)
        kept = np.full(some.size, np.nan)
        for start in range(0, some.size, every):
            kept[start] = some[start : start + every].mean() if mean else some[start]
        logged[name] = np.round(kept, 2)
    logged |= {name: by_rows(v, row, mean) for name, v in work.surroundings.items()}
    time = np.arange(truth.shape[0]) * owner.row_s
    covariates = {k: np.round(by_rows(v, row, mean), 1) for k, v in work.covariates.items()}
    return Run(work, time, truth, logged, temperatures[0], covariates)


def held(values: Array) -> Array:
    """Values with empty cells filled by the previous value."""
    at = np.maximum.accumulate(np.where(np.isfinite(values), np.arange(values.size), 0))
    return values[at]


def slow_error(rng: np.random.Generator, number: int, step: float, sensor: Sensor) -> Array:
    """One stationary first-order Gauss-Markov path, K."""
    keep = np.exp(-step / sensor.slow_s)
    first = rng.standard_normal()
    kicks = np.sqrt(1.0 - keep**2) * rng.standard_normal(number)
    path = lfilter([1.0], [1.0, -keep], kicks, zi=[keep * first])[0]
    return sensor.slow_K * path


def with_noise(rng: np.random.Generator, owner: Owner, truth: NDArray[np.float64]) -> Array:
    """(rows, channels) readings as a logger would have them."""
    out = np.empty_like(truth)
    for k, sensor in enumerate(owner.sensors.values()):
        slow = truth[:, k] + slow_error(rng, truth.shape[0], owner.row_s, sensor)
        if sensor.whole_degree:
            raw = slow[:, None] + 0.45 * rng.standard_normal((slow.size, 8))
            out[:, k] = np.round(raw).mean(axis=1)
        else:
            noisy = slow + sensor.white_K * rng.standard_normal(slow.size)
            out[:, k] = np.round(noisy / sensor.rounding_K) * sensor.rounding_K
    return out
