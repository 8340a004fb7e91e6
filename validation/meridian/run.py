"""A machine of the meridian model through a load cycle, with what an effect changes on the way."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

from ..stepping import Drive
from .definition import value
from .elements import Meridian

Array = NDArray[np.float64]
_GAMMA = 1.0 - np.sqrt(0.5)
SPLIT_SIGMA = 0.05


@dataclass(slots=True)
class Moment:
    """State that effects see and what they may change during one step.

    Read: time, step, speed, thrust, ``at(place)``. Change: ``ambient``, ``frame`` (surrounding of the
    flange's back), ``bearing`` (factor on a bearing's heat), ``share`` (added inner share), ``heat`` (W by
    place), ``factor`` (on a group's coefficient).
    """

    plant: "Plant"
    state: Array
    time: float
    step: float
    speed: float
    thrust: float
    ambient: float
    frame: float
    bearing: dict[str, float] = field(default_factory=dict)
    share: float = 0.0
    heat: dict[str, float] = field(default_factory=dict)
    factor: dict[str, float] = field(default_factory=dict)

    def at(self, place: str) -> float:
        """Mean temperature at a place, °C."""
        return float(self.plant.model.place[place] @ self.state)

    def add(self, place: str, watts: float) -> None:
        """Put heat at a place."""
        self.heat[place] = self.heat.get(place, 0.0) + watts

    def scale(self, group: str, factor: float) -> None:
        """Multiply a group's coefficient."""
        self.factor[group] = self.factor.get(group, 1.0) * factor

    def warm(self, bearings: Sequence[str], factor: float) -> None:
        """Multiply the heat of some bearings."""
        for b in bearings:
            self.bearing[b] = self.bearing.get(b, 1.0) * factor


Act = Callable[[Moment], None]


@dataclass(slots=True)
class Plant:
    """One machine: its model, its tables and their nominal coefficients."""

    model: Meridian
    tables: dict[str, Any]

    @property
    def sets(self) -> dict[str, list[str]]:
        """Bearings of every set."""
        return {s["name"]: [b["name"] for b in s["bearing"]] for s in self.tables["bearing_set"]}

    def priors(self) -> dict[str, float]:
        """1 sigma of the logarithm of every uncertain factor; of the share itself for ``split``."""
        out = {f"heat.{s['name']}": s["heat_factor"]["sigma_rel"] for s in self.tables["bearing_set"]}
        out["split"] = SPLIT_SIGMA
        for joint in self.tables["joint"]:
            out[f"joint:{joint['name']}"] = joint["conductance"]["sigma_rel"]
        for one in self.tables["film"]:
            if isinstance(one.get("coefficient"), dict):
                out[f"film:{one['name']}"] = one["coefficient"]["sigma_rel"]
        for gap in self.tables["gap"]:
            if isinstance(gap.get("factor"), dict):
                out[f"gap:{gap['name']}"] = gap["factor"]["sigma_rel"]
        for factor in self.tables["factor"]:
            out[factor["name"]] = factor["sigma_rel"]
        out["cap"] = self.tables["heat_capacity_factor"]["sigma_rel"]
        return out

    def nominal(self, speed: float) -> dict[str, float]:
        """Coefficient of every group at a speed, W/(m² K), balls W/K."""
        out = {}
        for one in self.tables["film"]:
            if "coefficient" in one:
                h = value(one["coefficient"])
            else:
                size = value(one["diameter"])
                reynolds = speed * np.pi / 30.0 * size**2 / (2.0 * 1.55e-5)
                h = 0.133 * reynolds ** (2.0 / 3.0) * 0.71 ** (1.0 / 3.0) * 0.026 / size
                h = max(value(one["minimum"]), h)
            out[f"film:{one['name']}"] = h
        for gap in self.tables["gap"]:
            h = value(gap["at_rest"])
            if "rise" in gap:
                turning = speed / value(gap["reference_speed"])
                h += value(gap["rise"]) * turning ** gap["exponent"]
            out[f"gap:{gap['name']}"] = h
        for one in self.tables["bearing_set"]:
            out[f"balls:{one['name']}"] = value(one["ball_row"]["conductance"])
        for joint in self.tables["joint"]:
            for group in self.model.exchange:
                if group.startswith(f"joint:{joint['name']}"):
                    out[group] = value(joint["conductance"])
        return out

    def as_built_factor(self, group: str, built: dict[str, float]) -> float:
        """Factor of a group on one machine."""
        shared = {f"film:{k}": "shaft_end_films" for k in ("nose_end", "drive_end")}
        shared |= {f"balls:{s}": "ball_conductance" for s in self.sets}
        key = shared.get(group) or ":".join(group.split(":")[:2])
        return built.get(key, 1.0)

    def bearing_heat(self, speed: float, thrust: float) -> dict[str, float]:
        """Nominal heat of every bearing, W."""
        table = self.tables["heat"]["table"]
        speeds = [value(n) for n in table["speed"]]
        more = thrust / value(table["reference_thrust"]) - 1.0
        slopes = table.get("thrust_coefficient", {})
        return {
            b: float(np.interp(speed, speeds, [value(w) for w in row])) * (1.0 + slopes.get(b, 0.0) * more)
            for b, row in table["heat"].items()
        }


def every(drive: Drive, number: int) -> Drive:
    """Every ``number``-th step."""
    return replace(drive, **{f: getattr(drive, f)[::number] for f in drive.__slots__})


def run(plant: Plant, drive: Drive, built: dict[str, float], acts: Sequence[Act] = ()) -> Array:
    """(n, probes) true readings, °C; everything starts at the first ambient temperature."""
    model, n = plant.model, drive.time.size
    probes = np.array(list(model.probes.values()))
    state = np.full(model.size, drive.ambient[0])
    out = np.empty((n, len(probes)))
    capacity = model.capacity * built["cap"]
    gamma = _GAMMA * drive.step
    factors: dict[tuple, tuple] = {}
    nominal, watts_at = lru_cache(plant.nominal), lru_cache(plant.bearing_heat)
    factor_of = {group: plant.as_built_factor(group, built) for group in nominal(0.0)}
    sources = {
        b: (built[f"heat.{name}"], model.place[f"{b}.inner"], model.place[f"{b}.outer"])
        for name, bearings in plant.sets.items()
        for b in bearings
    }
    for act in acts:
        if hasattr(act, "start"):
            act.start()
    for k in range(n):
        out[k] = probes @ state
        ambient = float(drive.ambient[k])
        moment = Moment(
            plant,
            state,
            float(drive.time[k]),
            drive.step,
            float(drive.speed[k]),
            float(drive.thrust[k]),
            ambient,
            ambient,
        )
        for act in acts:
            act(moment)
        coefficients = {
            g: h * factor_of[g] * moment.factor.get(g, 1.0) for g, h in nominal(moment.speed).items()
        }
        # Steps of half a per cent, so that slowly moving coefficients share their factors.
        key = tuple(round(np.log(h) / 5e-3) for h in coefficients.values())
        if key not in factors:
            if len(factors) > 60:
                factors.clear()
            matrix = model.conduction.copy()
            for group, level in zip(coefficients, key, strict=True):
                matrix = matrix + np.exp(5e-3 * level) * model.exchange[group][0]
            step_matrix = matrix * gamma
            step_matrix.setdiag(step_matrix.diagonal() + capacity)
            factors[key] = (matrix, splu(step_matrix.tocsc()))
        matrix, lu = factors[key]
        force = np.zeros(model.size)
        for group, level in zip(coefficients, key, strict=True):
            if group.startswith("film:"):
                around = moment.frame if group == "film:flange_back" else moment.ambient
                force += np.exp(5e-3 * level) * around * model.exchange[group][1]
        share = 0.5 + built["split"] + moment.share
        for b, watts in watts_at(moment.speed, moment.thrust).items():
            more, inner, outer = sources[b]
            force += watts * more * moment.bearing.get(b, 1.0) * (share * inner + (1.0 - share) * outer)
        for place, watts in moment.heat.items():
            force += watts * model.place[place]
        first = lu.solve(capacity * state + gamma * force)
        rate = force - matrix @ first
        state = lu.solve(capacity * state + (1.0 - _GAMMA) * drive.step * rate + gamma * force)
    return out


def draw_as_built(rng: np.random.Generator, plant: Plant) -> dict[str, float]:
    """Draw one machine from the priors, truncated at 2 sigma."""
    draws = {k: float(np.clip(rng.standard_normal(), -2.0, 2.0)) * s for k, s in plant.priors().items()}
    return {k: x if k == "split" else float(np.exp(x)) for k, x in draws.items()}
