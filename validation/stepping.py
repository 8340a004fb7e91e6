"""The reduced spindle through a load cycle, with whatever an effect changes on the way."""

from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dgetrf, dgetrs

from . import machine as m
from .oil import channel_film
from .reduction import ReducedSpindle, conductance

HEAT_SPEEDS = np.arange(0.0, 4501.0, 500.0)
_TABLE_F12 = (0, 15, 35, 60, 88, 120, 155, 192, 232, 274)
_TABLE_F3 = (0, 14, 31, 54, 80, 108, 140, 174, 209, 247)
_TABLE_R = (0, 8, 19, 33, 48, 66, 85, 105, 127, 150)
HEAT_TABLE = {"F1": _TABLE_F12, "F2": _TABLE_F12, "F3": _TABLE_F3, "R1": _TABLE_R, "R2": _TABLE_R}
THRUST_SLOPE = {"F1": 0.10, "F2": 0.10, "F3": -0.04, "R1": 0.0, "R2": 0.0}
_GAMMA = 1.0 - np.sqrt(0.5)
REBUILD = 0.01

# 1 sigma of the logarithm; the split's is of the share itself.
PRIORS = {
    "heat_F": 0.10,
    "heat_R": 0.10,
    "film": 0.15,
    "ji": 0.30,
    "jo_F": 0.40,
    "jo_R": 0.40,
    "jax": 0.30,
    "out": 0.30,
    "flg": 0.50,
    "shaft_end": 0.30,
    "gap": 0.30,
    "ball": 0.30,
    "split": 0.05,
    "cap": 0.03,
}


def draw_as_built(rng: np.random.Generator) -> dict[str, float]:
    """One machine from the priors, cut at 2 sigma."""
    draws = {name: float(np.clip(rng.standard_normal(), -2.0, 2.0)) * s for name, s in PRIORS.items()}
    return {name: x if name == "split" else float(np.exp(x)) for name, x in draws.items()}


def nominal_machine() -> dict[str, float]:
    """Every factor 1, the split's change 0."""
    return {name: 0.0 if name == "split" else 1.0 for name in PRIORS}


@dataclass(frozen=True, slots=True)
class Drive:
    """What drives the machine, on a uniform step: (n,) arrays, rpm, N, °C, s."""

    time: NDArray[np.float64]
    speed: NDArray[np.float64]
    thrust: NDArray[np.float64]
    ambient: NDArray[np.float64]
    coolant_in: NDArray[np.float64]

    @property
    def step(self) -> float:
        """Time step, s."""
        return float(self.time[1] - self.time[0])

    def every(self, number: int) -> "Drive":
        """Keep one step of ``number``."""
        return replace(self, **{f: getattr(self, f)[::number] for f in self.__slots__})


@dataclass(slots=True)
class Moment:
    """State that effects see and what they may change during one step.

    Read: time, step, speed, thrust, ``read(name)`` (a temperature of the model) and ``at(place)``.
    Change: ``ambient``, ``coolant_in``, ``frame`` (surrounding of the flange's back), ``bearing``
    (factor on each bearing's heat), ``share`` (added inner share), ``heat`` (W by place), ``group``
    (factor on joints and films by group number), ``film``, ``flow``.
    """

    model: ReducedSpindle
    state: NDArray[np.float64]
    time: float
    step: float
    speed: float
    thrust: float
    ambient: float
    coolant_in: float
    frame: float
    bearing: NDArray[np.float64] = field(default_factory=lambda: np.ones(5))
    share: NDArray[np.float64] = field(default_factory=lambda: np.zeros(5))
    heat: dict[str, float] = field(default_factory=dict)
    group: NDArray[np.float64] | None = None
    film: float = 1.0
    flow: float = 1.0

    def read(self, name: str) -> float:
        """Temperature of a reading, °C."""
        return float(self.model.readings[self.model.reading_names.index(name)] @ self.state)

    def at(self, place: str) -> float:
        """Mean temperature where a source's heat enters, °C."""
        return float(self.model.sources[self.model.source_names.index(place)] @ self.state)

    def add_heat(self, place: str, watts: float) -> None:
        """Put heat at a place."""
        self.heat[place] = self.heat.get(place, 0.0) + watts


class Effect(Protocol):
    """Anything that changes the machine during a step."""

    def start(self, model: ReducedSpindle) -> None:
        """Forget the run before."""

    def act(self, moment: Moment) -> None:
        """Change the moment."""


def group_parameter(name: str) -> str | None:
    """As-built factor that scales a group of faces."""
    kind, _, rest = name.partition(":")
    if kind == "seat":
        return "ji" if rest.startswith("shaft|") else ("jo_F" if rest[0] in "Ff" else "jo_R")
    return {
        "axial": "jax",
        "outside": "out",
        "flange_back": "flg",
        "nose_end": "shaft_end",
        "drive_end": "shaft_end",
        "gap": "gap",
        "balls": "ball",
        "labyrinth": None,
    }[kind]


def shaft_end_film(speed: float, diameter: float) -> float:
    """Film of a turning shaft end, W/(m² K)."""
    reynolds = (speed * np.pi / 30.0) * diameter**2 / (2.0 * 1.55e-5)
    return max(10.0, 0.133 * reynolds ** (2.0 / 3.0) * 0.71 ** (1.0 / 3.0) * 0.026 / diameter)


_TABLE = np.array([HEAT_TABLE[b] for b in m.BEARINGS], dtype=float)
_SLOPES = np.array([THRUST_SLOPE[b] for b in m.BEARINGS])


def bearing_heat(speed: float, thrust: float) -> NDArray[np.float64]:
    """Nominal heat of the five bearings, W.

    >>> bearing_heat(3000.0, 1750.0).tolist()
    [155.0, 155.0, 140.0, 85.0, 85.0]
    """
    row = min(int(speed / 500.0), HEAT_SPEEDS.size - 2)
    share = speed / 500.0 - row
    watts = (1.0 - share) * _TABLE[:, row] + share * _TABLE[:, row + 1]
    return watts * (1.0 + _SLOPES * (thrust / 1750.0 - 1.0))


class Stepper:
    """Operators of one as-built machine, and the pieces a step needs."""

    def __init__(self, model: ReducedSpindle, as_built: dict[str, float]) -> None:
        self.model = model
        self.as_built = as_built
        kinds = [group_parameter(name) for name in model.groups]
        self.kinds = kinds
        self.base = model.nominal * np.array([as_built[k] if k else 1.0 for k in kinds])
        self.index = {name: i for i, name in enumerate(model.groups)}
        self.inner = np.array([model.sources[model.source_names.index(f"{b}.inner")] for b in m.BEARINGS])
        self.outer = np.array([model.sources[model.source_names.index(f"{b}.outer")] for b in m.BEARINGS])
        self.heat_factor = np.array([as_built["heat_F"]] * 3 + [as_built["heat_R"]] * 2)

    def coefficients(self, moment: Moment) -> NDArray[np.float64]:
        """Coefficient of every group at this moment."""
        h = self.base.copy()
        i = self.index
        built = self.as_built
        h[i["gap"]] = built["gap"] * (8.0 + 12.0 * (moment.speed / 3000.0) ** 0.75)
        h[i["nose_end"]] = built["shaft_end"] * shaft_end_film(moment.speed, 0.18)
        h[i["drive_end"]] = built["shaft_end"] * shaft_end_film(moment.speed, 0.11)
        return h if moment.group is None else h * moment.group

    def load(
        self, moment: Moment, used: NDArray[np.float64], coolant_load: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Right-hand side of the reduced balance."""
        surrounding = np.full(used.size, moment.ambient)
        surrounding[self.index["flange_back"]] = moment.frame
        force = (used * surrounding) @ self.model.loads + coolant_load * moment.coolant_in
        watts = bearing_heat(moment.speed, moment.thrust) * self.heat_factor * moment.bearing
        share = 0.5 + self.as_built["split"] + moment.share
        force += (watts * share) @ self.inner + (watts * (1.0 - share)) @ self.outer
        for place, value in moment.heat.items():
            force += value * self.model.sources[self.model.source_names.index(place)]
        return force


@dataclass(slots=True)
class Path:
    """What a run leaves: (n, m) states, (n, 6) true readings of the probes and the outlet."""

    time: NDArray[np.float64]
    states: NDArray[np.float64]
    readings: NDArray[np.float64]


class _Solver:
    """Keeps the factors until a coefficient has moved by more than `REBUILD`.

    ``shared`` may hold factors from other runs of the same machine with the same step.
    """

    def __init__(self, stepper: Stepper, step: float, shared: dict[bytes, tuple]) -> None:
        self.stepper, self.step, self.shared = stepper, step, shared
        self.used: NDArray[np.float64] | None = None
        self.gamma = _GAMMA * step / stepper.as_built["cap"]

    def prepare(self, used: NDArray[np.float64], film: float, capacity: float) -> None:
        """Bring matrix, factors and coolant terms to these coefficients."""
        # Steps of 0.3 % in film and flow, so that equal oil gives equal factors.
        level = (round(np.log(film) / 3e-3), round(np.log(capacity) / 3e-3))
        if (
            self.used is not None
            and level == self.level
            and not (np.abs(used - self.used) > REBUILD * self.used).any()
        ):
            return
        self.used, self.level = used.copy(), level
        key = used.tobytes() + repr(level).encode()
        if key not in self.shared:
            model = self.stepper.model
            coolant = model.coolant_terms(*np.exp(3e-3 * np.array(level)))
            matrix = np.tensordot(used, model.matrices, axes=1) + model.conduction + coolant[0]
            factors, pivots, failed = dgetrf(np.eye(model.size) + self.gamma * matrix)
            if failed:
                raise np.linalg.LinAlgError(f"reduced step matrix is singular at pivot {failed}")
            if len(self.shared) > 150:
                self.shared.clear()
            self.shared[key] = (matrix, factors, pivots, coolant)
        self.matrix, self.factors, self.pivots, self.coolant = self.shared[key]

    def remainder(self, used: NDArray[np.float64], state: NDArray[np.float64]) -> NDArray[np.float64] | float:
        """What coefficients that moved too little for new factors still change."""
        change = used - self.used
        which = np.flatnonzero(np.abs(change) > 1e-5 * self.used)
        if which.size == 0:
            return 0.0
        return -change[which] @ (self.stepper.model.matrices[which] @ state)

    def advance(self, state: NDArray[np.float64], force: NDArray[np.float64]) -> NDArray[np.float64]:
        """Alexander's two-stage L-stable step of second order."""
        first = dgetrs(self.factors, self.pivots, state + self.gamma * force)[0]
        rate = force - self.matrix @ first
        whole = self.gamma / _GAMMA
        second = state + (1.0 - _GAMMA) * whole * rate + self.gamma * force
        return dgetrs(self.factors, self.pivots, second)[0]


def run(
    model: ReducedSpindle,
    drive: Drive,
    as_built: dict[str, float],
    effects: tuple[Effect, ...] = (),
    shared: dict[bytes, tuple] | None = None,
) -> Path:
    """Step the machine through a load cycle; every temperature starts at the first ambient value.

    ``shared`` keeps factors between runs of one machine at one step.
    """
    stepper = Stepper(model, as_built)
    solver = _Solver(stepper, drive.step, {} if shared is None else shared)
    probes = model.readings[[model.reading_names.index(p) for p in m.PROBES]]
    n = drive.time.size
    state = drive.ambient[0] * model.uniform
    states = np.empty((n, model.size))
    readings = np.empty((n, 6))
    for effect in effects:
        effect.start(model)
    for k in range(n):
        moment = Moment(
            model,
            state,
            drive.time[k],
            drive.step,
            drive.speed[k],
            drive.thrust[k],
            drive.ambient[k],
            drive.coolant_in[k],
            drive.ambient[k],
        )
        for effect in effects:
            effect.act(moment)
        film, capacity, _ = channel_film(moment.coolant_in, moment.flow)
        film = float(film) * as_built["film"] * moment.film
        used = conductance(stepper.coefficients(moment), model.series)
        solver.prepare(used, film, float(capacity))
        _, coolant_load, row, factor = solver.coolant
        rise = row @ state + factor * moment.coolant_in
        states[k] = state
        readings[k, :5] = probes @ state
        readings[k, 5] = moment.coolant_in + rise * moment.flow if k else drive.coolant_in[0]
        force = stepper.load(moment, used, coolant_load) + solver.remainder(used, state)
        state = solver.advance(state, force)
    return Path(drive.time, states, readings)
