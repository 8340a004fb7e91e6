"""Identifiability: the effect after a re-fit of the machine, and what else would explain it.

The machine's uncertain parameters are fitted (priors, calibration run and diagnosed run, the noise
with its slow part) to the noise-free effect; then once more with each of a list of simple effects.
Linear first, for all of them; the best few by Gauss-Newton steps through the model itself.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular

from . import laws, machine
from .cycles import Plan
from .laws import Law
from .recorder import Noise
from .reduction import ReducedSpindle
from .sensor_errors import Sensor
from .stepping import PRIORS, run

EVERY = 6
# Fits through the model: rounds at most, the gain in chi squared that is the last, the shortest step.
MOST_ROUNDS, CONVERGED, SHORTEST = 20, 0.2, 0.05


# Effects that can only add: heat, mass, films and friction that grow, a reading that lags or nears the air's.
ONE_SIDED = frozenset(
    {
        "seal_friction",
        "windage",
        "drive_heat",
        "unrecorded_heat_source",
        "thermal_preload",
        "viscosity_heat",
        "grease_churning",
        "heat_capacity",
        "radiation",
        "natural_convection",
        "shaft_convection",
        "coolant_bypass",
        "sensor_lag",
        "sensor_detached",
    }
)


@dataclass(frozen=True, slots=True)
class Mimic:
    """A simple effect with one amplitude; zero is none."""

    effect: str
    component: str
    form: str
    make: Callable[[float], Law | Sensor]
    small: float

    @property
    def least(self) -> float:
        """Amplitude that it has at least."""
        return 0.0 if self.effect in ONE_SIDED else -np.inf


def _bearing_mimics() -> list[Mimic]:
    out = []
    names = {"F": "front_bearings", "R": "rear_bearings"}
    for w in ("F", "R", *machine.BEARINGS):
        place = names.get(w, w)
        out.append(Mimic("heat_scale", place, "", lambda a, w=w: laws.HeatScale(w, float(np.exp(a))), 0.03))
    for w, place in names.items():
        out.append(Mimic("heat_split", place, "", lambda a, w=w: laws.HeatSplit(w, a), 0.02))
        for delay in (0.0, 600.0):
            out.append(
                Mimic(
                    "thermal_preload",
                    place,
                    f"lag{delay:.0f}",
                    lambda a, w=w, d=delay: laws.ThermalPreload(w, a, delay=d),
                    0.004,
                )
            )
        out.append(Mimic("viscosity_heat", place, "", lambda a, w=w: laws.ViscosityHeat(w, a), 0.001))
        for tau in (600.0, 1500.0, 4000.0):
            out.append(
                Mimic(
                    "grease_churning",
                    place,
                    f"tau{tau:.0f}",
                    lambda a, w=w, t=tau: laws.Churning(w, a, t),
                    0.03,
                )
            )
        for n in (1400.0, 2000.0, 2600.0, 3300.0):
            out.append(
                Mimic("starvation", place, f"n{n:.0f}", lambda a, w=w, n=n: laws.Starvation(w, a, n), 0.03)
            )
        for onset in (3.0, 8.0):
            out.append(
                Mimic(
                    "gap_closure",
                    place,
                    f"on{onset:.0f}",
                    lambda a, w=w, o=onset: laws.GapClosure(w, float(np.exp(-abs(a))), o, 0.3 * o),
                    0.05,
                )
            )
    return out


def machine_mimics(model: ReducedSpindle, plan: Plan) -> list[Mimic]:
    """Simple effects of the machine."""
    out = _bearing_mimics()

    def joint(place: str, names: tuple[str, ...]) -> None:
        out.append(
            Mimic("joint_conductance", place, "", lambda a: laws.GroupFactor(names, float(np.exp(a))), 0.05)
        )

    joint("flange", ("flange_back",))
    for w in machine.BEARINGS:
        joint(w, laws.outer_seats(model, w))
    joint("front_bearings", laws.outer_seats(model, "F"))
    joint("rear_bearings", laws.outer_seats(model, "R"))
    total = float(plan.drive.time[-1])

    def add(effect: str, place: str, form: str, make: Callable[[float], Law], small: float) -> None:
        out.append(Mimic(effect, place, form, make, small))

    # Exponents and delays from end to end of what is drawn: a seal and a drive at one end may be alike.
    for place, where in (("nose", "nose"), ("drive_end", "drive_lip")):
        for exponent, wear in ((0.9, 0.0), (1.0, 0.0), (1.1, 0.0), (1.0, 4000.0)):
            add(
                "seal_friction",
                place,
                f"power{exponent}wear{wear:.0f}",
                lambda a, p=where, e=exponent, w=wear: laws.SpeedHeat(((p, 1.0),), a, 1000.0, e, wear=w),
                2.0,
            )
    add("windage", "shaft", "", lambda a: laws.SpeedHeat((("shaft_gap", 1.0),), a, 4500.0, 3.0), 10.0)
    for exponent in (0.95, 1.2, 1.45):
        for delay in (100.0, 300.0, 900.0):
            add(
                "drive_heat",
                "drive_end",
                f"power{exponent}lag{delay:.0f}",
                lambda a, e=exponent, d=delay: laws.SpeedHeat((("drive_end", 1.0),), a, 3000.0, e, d),
                5.0,
            )
    add("mount_sink", "flange", "", lambda a: laws.MountSink(a), 1.0)
    add("shaft_convection", "shaft", "", lambda a: laws.ShaftConvection(a), 0.1)
    add("radiation", "housing", "", lambda a: laws.OutsideFilm(a, "radiation"), 0.1)
    add("natural_convection", "housing", "", lambda a: laws.OutsideFilm(a, "natural"), 0.3)
    add("coolant_film", "channel", "fouling", lambda a: laws.Fouling(float(np.exp(a))), 0.05)
    add("coolant_bypass", "channel", "", lambda a: laws.Bypass(float(np.clip(a, -0.5, 0.95))), 0.05)
    if plan.oil != "constant":
        for re in (320.0, 420.0, 550.0, 700.0):
            add(
                "coolant_film",
                "channel",
                f"Re{re:.0f}",
                lambda a, r=re: laws.FilmTransition(max(a, -0.95), r, 40.0),
                0.05,
            )
    add("ambient_drift", "ambient", "ramp", lambda a: laws.RoomDrift(a, "ramp", total=total), 1.0)
    for at in (0.3, 0.45, 0.6):
        add("ambient_drift", "ambient", f"jump{at}", lambda a, x=at: laws.RoomDrift(a, "jump", x, total), 1.0)
        add("ambient_drift", "ambient", f"hump{at}", lambda a, x=at: laws.RoomDrift(a, "hump", x, total), 1.0)
    for place in ("flange", "housing_front_top", "housing_rear_top", "nose", "drive_end"):
        add(
            "heat_capacity",
            place.split("_")[0] if place != "drive_end" else place,
            "",
            lambda a, p=place: laws.ExtraMass(p, max(a, 1.0), 0.02 * max(a, 1.0)),
            500.0,
        )
    for place, (start, end) in (
        (p, s)
        for p in (
            "housing_middle_top",
            "housing_rear_top",
            "housing_front_top",
            "flange",
            "drive_end",
            "nose",
            "shaft_middle",
        )
        for s in ((0.0, 1.1), (0.5, 1.1))
    ):
        span = ((start * total, end * total, 1.0),)
        add(
            "unrecorded_heat_source",
            place,
            f"{start}-{end}",
            lambda a, p=place, s=span: laws.Intervals(p, a, s, 200.0),
            5.0,
        )
    return out


def sensor_mimics() -> list[Mimic]:
    """Simple lies of every channel."""
    sizes = {
        "sensor_offset": (0.1, lambda a: a),
        "sensor_gain": (0.01, lambda a: 1.0 + a),
        "sensor_lag": (60.0, lambda a: max(a, 1.0)),
        "sensor_drift": (0.03, lambda a: a),
        "sensor_detached": (0.02, lambda a: a),
        "clock_shift": (60.0, lambda a: a),
    }
    return [
        Mimic(kind, name, "", lambda a, k=kind, c=c, f=f: Sensor(k, c, f(a)), small)
        for kind, (small, f) in sizes.items()
        for c, name in enumerate(machine.CHANNELS)
    ]


def perturbed(as_built: dict[str, float], name: str, change: float) -> dict[str, float]:
    """As-built values with one moved by ``change`` prior sigmas."""
    moved = dict(as_built)
    step = change * PRIORS[name]
    moved[name] = moved[name] + step if name == "split" else moved[name] * float(np.exp(step))
    return moved


class Study:
    """Fits of one case; responses are every ``EVERY`` steps of the drive.

    ``always`` acts in every run; ``channels`` are those that are recorded; ``earlier`` what the calibrations
    truly read, if this model would read something else. ``loose`` makes, from sizes in standard
    deviations, laws by which the machine may differ from what is stated of it.
    """

    def __init__(
        self,
        model: ReducedSpindle,
        plan: Plan,
        calibration: Plan | None,
        as_built: dict[str, float],
        noise: Noise,
        always: tuple[Law, ...] = (),
        channels: tuple[int, ...] = tuple(range(6)),
        loose: tuple[Callable[[float], Law], ...] = (),
    ) -> None:
        self.model, self.plan, self.as_built, self.noise = model, plan, as_built, noise
        self.always, self.channels, self.loose = always, list(channels), loose
        self.shared: dict[bytes, tuple] = {}
        self.left = np.zeros(0)
        self.drives = [p.drive.every(EVERY) for p in (plan, calibration) if p is not None]
        self.plain = [run(model, d, as_built, always).readings for d in self.drives]
        self.earlier = self.plain[1:]
        self.whiteners = [self._whitener(d.time) for d in self.drives]
        self.names = list(PRIORS)
        self.offset = np.log([1.0 if n == "split" else as_built[n] for n in self.names]) / list(
            PRIORS.values()
        )
        self.offset[self.names.index("split")] = as_built["split"] / PRIORS["split"]
        columns = []
        for name in self.names:
            moved = perturbed(as_built, name, 0.1)
            columns.append(
                self._stack(
                    [
                        run(model, d, moved, always).readings - p
                        for d, p in zip(self.drives, self.plain, strict=True)
                    ]
                )
            )
        for make in loose:
            runs = [run(model, d, as_built, (*always, make(0.1))).readings for d in self.drives]
            columns.append(self._stack([r - p for r, p in zip(runs, self.plain, strict=True)]))
        self.offset = np.concatenate([self.offset, np.zeros(len(loose))])
        self.jacobian = np.stack(columns, axis=1) / 0.1
        self.white = self._whiten(self.jacobian)
        self.q, self.r = np.linalg.qr(np.vstack([self.white, np.eye(self.offset.size)]))
        prior = np.concatenate([np.zeros(self.white.shape[0]), -self.offset])
        rest = prior - self.q @ (self.q.T @ prior)
        self._null = float(rest @ rest)

    def _whitener(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        # About three samples a minute share the white noise.
        apart = np.abs(time[:, None] - time[None, :])
        white = self.noise.white_K**2 / 3.0 * np.eye(time.size)
        return cholesky(white + self.noise.slow_K**2 * np.exp(-apart / self.noise.slow_s), lower=True)

    def _stack(self, parts: list[NDArray[np.float64]]) -> NDArray[np.float64]:
        return np.concatenate([p[:, self.channels].T.ravel() for p in parts])

    def _whiten(self, block: NDArray[np.float64]) -> NDArray[np.float64]:
        out, at = np.empty_like(block), 0
        for factor in self.whiteners:
            n = factor.shape[0]
            for _ in self.channels:
                out[at : at + n] = solve_triangular(
                    factor, block[at : at + n], lower=True, check_finite=False
                )
                at += n
        return out

    def diagnosed_only(self, readings: NDArray[np.float64]) -> NDArray[np.float64]:
        """Change of the diagnosed run, none of the calibration, stacked."""
        rest = [np.zeros_like(p) for p in self.plain[1:]]
        return self._stack([readings - self.plain[0], *rest])

    def simulate(
        self, effects: list[Law | Sensor], as_built: dict[str, float] | None = None
    ) -> NDArray[np.float64]:
        """Readings of the diagnosed run with effects."""
        drive = self.drives[0]
        machine_effects = tuple(e for e in effects if isinstance(e, Law))
        shared = self.shared if as_built is None else None
        acting = (*self.always, *machine_effects)
        path = run(self.model, drive, as_built or self.as_built, acting, shared)
        readings = path.readings
        for sensor in (e for e in effects if isinstance(e, Sensor)):
            readings = sensor.apply(drive.time, readings, drive.ambient)
        return readings

    def ratio(self, left: NDArray[np.float64]) -> float:
        """Rms of the most affected channel over the noise."""
        return float(self.by_channel(left).max() / self.noise.total_K)

    def by_channel(self, left: NDArray[np.float64]) -> NDArray[np.float64]:
        """(channels,) rms on the diagnosed run, K."""
        number, n = len(self.channels), self.drives[0].time.size
        return np.sqrt((left[: number * n].reshape(number, n) ** 2).mean(axis=1))

    def solve(
        self, change: NDArray[np.float64], extra: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], float]:
        """Fit parameters and the extra columns (n, k); returns the solution and chi squared."""
        count = self.offset.size
        b = np.concatenate([self._whiten(change[:, None])[:, 0], -self.offset])
        rest = b - self.q @ (self.q.T @ b)
        amplitudes = np.zeros(extra.shape[1])
        target = b
        if amplitudes.size:
            white = np.vstack([self._whiten(extra), np.zeros((count, amplitudes.size))])
            apart = white - self.q @ (self.q.T @ white)
            scale = np.maximum(np.linalg.norm(apart, axis=0), 1e-9 * np.linalg.norm(white, axis=0) + 1e-30)
            amplitudes = np.linalg.lstsq(apart / scale, rest, rcond=1e-9)[0] / scale
            rest = rest - apart @ amplitudes
            target = b - white @ amplitudes
        parameters = solve_triangular(self.r, self.q.T @ target)
        # The cost of the priors for the true machine itself is not due to the effect.
        return np.concatenate([parameters, amplitudes]), max(0.0, float(rest @ rest) - self._null)

    def fit_linear(self, change: NDArray[np.float64], extra: NDArray[np.float64]) -> tuple[float, float]:
        """Ratio and chi squared left after a linear fit."""
        solution, chi2 = self.solve(change, extra)
        columns = np.column_stack([self.jacobian, extra]) if extra.size else self.jacobian
        return self.ratio(change - columns @ solution), chi2

    def fit_mimic(
        self,
        change: NDArray[np.float64],
        mimic: Mimic,
        column: NDArray[np.float64],
        beside: NDArray[np.float64] | None = None,
    ) -> tuple[float, float]:
        """Fit a mimic, its amplitude within its limits, beside other columns (n, k)."""
        kept = np.empty((change.size, 0)) if beside is None else beside
        extra = np.column_stack([kept, column])
        solution, _ = self.solve(change, extra)
        return self.fit_linear(change, extra if solution[-1] >= mimic.least else kept)

    def mimic_column(self, mimic: Mimic, beside: list[Law | Sensor]) -> NDArray[np.float64]:
        """Change by a small amplitude of a mimic, per unit of amplitude."""
        without = self.simulate(beside) if beside else self.plain[0]
        return self._stack(
            [
                (self.simulate([*beside, mimic.make(mimic.small)]) - without) / mimic.small,
                *[np.zeros_like(p) for p in self.plain[1:]],
            ]
        )

    def fit_through_model(
        self, truth: NDArray[np.float64], mimic: Mimic | None, column: NDArray[np.float64]
    ) -> tuple[float, float]:
        """Gauss-Newton through the model itself with the Jacobian of the true machine kept.

        What the best of it leaves stays in ``left``.
        """
        count = self.offset.size
        position = np.zeros(count + (mimic is not None))
        best = (np.inf, np.inf)
        reach = np.ones_like(position)
        anchor, step, anchor_change = position, np.zeros_like(position), np.zeros(0)
        for _ in range(MOST_ROUNDS):
            if mimic is not None:
                position[-1] = max(position[-1], mimic.least)
            built = dict(self.as_built)
            for name, x in zip(self.names, position, strict=False):
                built = perturbed(built, name, float(np.clip(x, -8, 8)))
            moved = position[len(self.names) : count]
            off = tuple(make(float(x)) for make, x in zip(self.loose, moved, strict=True))
            effects = [mimic.make(position[-1])] if mimic is not None else []
            guess = [self.simulate([*off, *effects], built if position.any() else None)]
            guess += [run(self.model, d, built, (*self.always, *off)).readings for d in self.drives[1:]]
            change = self._stack(
                [truth - guess[0], *[p - g for p, g in zip(self.earlier, guess[1:], strict=True)]]
            )
            chi2 = np.inf
            if np.isfinite(change).all():
                rest = self._whiten(change[:, None])[:, 0]
                pull = position[:count] + self.offset
                chi2 = max(0.0, float(rest @ rest + pull @ pull) - self._null)
            if not chi2 < best[1]:
                reach *= 0.4
                if reach.max() < SHORTEST:
                    break
                position = anchor + reach * step
                continue
            gain = best[1] - chi2
            best, anchor, anchor_change = (self.ratio(change), chi2), position.copy(), change
            self.left = change
            if gain < CONVERGED:
                break
            saved = self.offset
            self.offset = saved + anchor[:count]
            step, _ = self.solve(
                anchor_change, column[:, None] if mimic is not None else np.empty((change.size, 0))
            )
            self.offset = saved
            # A step that had to be shortened may be long again where the next one starts.
            reach = np.minimum(1.0, 2.0 * reach)
            position = anchor + reach * step
        return best
