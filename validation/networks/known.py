"""Identifiability in a network case: fits of the file's own linear network, with and without effects.

The machine as its file has it (no second masses, constant conductances, exponent 5/3, the room at one level
where it is not recorded, inputs as logged) is fitted to noise-free readings, priors included, on a coarser
step; then with simple effects beside, linear first and the best few by Gauss-Newton.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .conceal import Concealed, Lie, both_ways
from .scene import NOMINAL_EXPONENT, SPREAD_90, Owner, Run, held
from .truth import NOTHING, Array, Change, Network, Source, Work, march

COARSE = 900
UNREAD_START_K = 6.0
ROUNDS, STEP = 8, 0.02


@dataclass(frozen=True, slots=True)
class Mimic:
    """A simple effect with one amplitude, zero for none; ``make`` gives a change of the machine or a lie."""

    effect: str
    components: tuple[str, ...]
    make: Callable[[float], Change | Lie]
    small: float
    one_sided: bool = False
    start: float = 0.0


class Coarse:
    """One run on the coarse step: heat per unit gain, surroundings, target readings."""

    def __init__(self, owner: Owner, run: Run) -> None:
        network, every = owner.machine.network, max(1, run.time.size // COARSE)
        size = run.time.size // every
        self.every, self.step = every, every * owner.row_s

        def mean(values: Array) -> Array:
            return values[: size * every].reshape(size, every, *values.shape[1:]).mean(axis=1)

        self.mean = mean
        self.heat = {}
        for s in network.sources:
            exponent = s.exponent if s.exponent == 1.0 else NOMINAL_EXPONENT
            watts = mean((held(run.logged[s.input]) / s.reference) ** exponent)
            # One more value than there are steps: the last instant's own heat is never used.
            self.heat[s.name] = np.append(watts, watts[-1])
        edges = np.arange(size + 1) * every
        self.surroundings = {
            name: np.interp(edges, np.arange(run.time.size) + 0.5 * owner.means, run.logged[name])
            for name in network.boundaries
        }
        self.time = (np.arange(size) + 0.5) * self.step
        self.target = mean(run.truth)
        self.start = run.start
        self.size = size


class Study:
    """Fits of one case; ``runs`` the diagnosed one first, then perhaps the calibration."""

    def __init__(self, owner: Owner, runs: list[Run], total_K: Array) -> None:
        self.owner, self.network = owner, owner.machine.network
        self.runs = [Coarse(owner, run) for run in runs]
        self.noise = total_K
        self.names = list(owner.estimates)
        self.room = not owner.room_recorded
        nodes = self.network.nodes
        self.at = [nodes.index(n) for n in owner.channels]
        self.count = len(self.names) + self.room + len(self.runs) * len(nodes)
        # Built-in start of the fits: the truth's own parameters.
        true = {f"capacity.{k}": v for k, v in self.network.capacity.items()}
        true |= {f"conductance.{k}": v for k, v in self.network.conductance.items()}
        true |= {f"gain.{s.name}": s.gain for s in self.network.sources}
        known = owner.estimates
        x = [np.log(true[k] / known[k].value) / known[k].sigma for k in self.names]
        if self.room:
            centre, sigma = self._room_prior()
            x.append((self.runs[0].surroundings[owner.machine.room].mean() - centre) / sigma)
        self.true = np.append(x, np.zeros(self.count - len(x)))

    def _room_prior(self) -> tuple[float, float]:
        low, high = self.owner.room_range
        return 0.5 * (low + high), (high - low) / (2.0 * SPREAD_90)

    def readings(self, x: Array, which: int, change: Change = NOTHING, lies: tuple[Lie, ...] = ()) -> Array:
        """(n, channels) what the file's network reads in a run."""
        run, known, nodes = self.runs[which], self.owner.estimates, self.network.nodes
        value = {k: known[k].value * np.exp(known[k].sigma * x[i]) for i, k in enumerate(self.names)}
        network = Network(
            {n: value[f"capacity.{n}"] for n in nodes},
            {link: value[f"conductance.{link}"] for link in self.network.conductance},
            self.network.boundaries,
            (),
        )
        surroundings = run.surroundings
        if self.room:
            centre, sigma = self._room_prior()
            level = centre + sigma * x[len(self.names)]
            surroundings = surroundings | {self.owner.machine.room: np.full(run.size + 1, level)}
        offset = len(self.names) + self.room + which * len(nodes)
        beside = x[offset : offset + len(nodes)]
        start = np.empty(len(nodes))
        first = run.start[self.at]
        for i in range(len(nodes)):
            read = i in self.at
            start[i] = (run.start[i] if read else first.mean()) + beside[i] * (
                self.noise[self.at.index(i)] if read else UNREAD_START_K
            )
        heat = {
            name: value[f"gain.{name}"] * shape * change.gain.get(name, 1.0)
            for name, shape in run.heat.items()
        }
        out = march(network, Work(run.step, {}, surroundings), change, start, heat)
        out = (0.5 * (out[1:] + out[:-1]))[:, self.at]
        for lie in lies:
            k = self.owner.channels.index(lie.channel)
            around = surroundings[self.owner.machine.room][1:]
            out[:, k] = lie.applied(run.time, out[:, k], around)
        return out

    def residual(self, x: Array, acting: tuple[Change | Lie, ...] = ()) -> Array:
        """Weighted misfit of all runs, one after the other; effects act on the diagnosed run only."""
        change = NOTHING
        for one in acting:
            change = change.beside(one) if isinstance(one, Change) else change
        lies = tuple(one for one in acting if isinstance(one, Lie))
        parts = []
        for which, run in enumerate(self.runs):
            seen = self.readings(x, which, *((change, lies) if which == 0 else ()))
            parts.append(((run.target - seen) / self.noise).ravel())
        return np.concatenate(parts)

    def fit(
        self, start: Array, mimic: Mimic | None = None, acting: tuple[Change | Lie, ...] = ()
    ) -> tuple[Array, Array]:
        """Parameters (and the mimic's amplitude last), and the misfit left, by damped Gauss-Newton."""
        x = start if mimic is None else np.append(start, mimic.start or mimic.small * mimic.one_sided)

        def left(at: Array) -> Array:
            if mimic is None:
                return self.residual(at, acting)
            amplitude = max(at[-1], 0.0) if mimic.one_sided else at[-1]
            more = () if amplitude == 0.0 else (mimic.make(amplitude),)
            return self.residual(at[:-1], (*acting, *more))

        prior = np.ones(x.size)
        prior[self.count :] = 0.0
        now = left(x)
        cost = float(now @ now + prior @ x**2)
        damping = 1e-3
        for _ in range(ROUNDS):
            columns = np.empty((now.size, x.size))
            for k in range(x.size):
                moved = x.copy()
                moved[k] += (step := STEP if k < self.count else mimic.small)
                columns[:, k] = (left(moved) - now) / step
            normal, gradient = columns.T @ columns + np.diag(prior), columns.T @ now + prior * x
            for _ in range(6):
                step = -np.linalg.solve(normal + damping * np.diag(np.diag(normal) + 1e-12), gradient)
                there = x + np.clip(step, -3.0, 3.0) if mimic is None else x + step
                try:
                    trial = left(there)
                    after = float(trial @ trial + prior @ there**2)
                except (ArithmeticError, np.linalg.LinAlgError):
                    after = np.inf
                if after < cost:
                    break
                damping *= 8.0
            else:
                return x, now
            gain, x, now, cost, damping = cost - after, there, trial, after, damping / 5.0
            if gain < 1e-3 * cost:
                break
        return x, now

    def diagnosed(self, left: Array) -> Array:
        """(channels,) rms over the total noise on the diagnosed run."""
        run = self.runs[0]
        return np.sqrt((left[: run.target.size].reshape(run.size, -1) ** 2).mean(axis=0))

    def table(self, mimics: list[Mimic], x: Array, left: Array, best: int) -> list[tuple[Mimic, Array]]:
        """Mimics by how well they explain what is left; the first few refitted, the others to first order."""
        prior = np.eye(self.count)
        columns = np.empty((left.size, self.count))
        for k in range(self.count):
            moved = x.copy()
            moved[k] += STEP
            columns[:, k] = (self.residual(moved) - left) / STEP
        q, _ = np.linalg.qr(np.vstack([columns, prior]))
        aim = np.concatenate([left, x])
        aim = aim - q @ (q.T @ aim)
        rows = []
        for mimic in mimics:
            try:
                column = (self.residual(x, (mimic.make(mimic.small),)) - left) / mimic.small
            except ArithmeticError:
                continue
            column = np.append(column, np.zeros(self.count))
            apart = column - q @ (q.T @ column)
            size = float(apart @ apart)
            gain = -float(apart @ aim) / size if size > 1e-12 * float(column @ column) + 1e-30 else 0.0
            gain = max(gain, 0.0) if mimic.one_sided else gain
            rows.append((mimic, aim + gain * apart))
        rows.sort(key=lambda row: float(row[1] @ row[1]))
        out = []
        for mimic, rest in rows[:best]:
            _, through = self.fit(x, mimic)
            out.append(
                (mimic, min(self.diagnosed(through), self.diagnosed(rest), key=lambda v: float(v @ v)))
            )
        out += [(mimic, self.diagnosed(rest)) for mimic, rest in rows[best:]]
        return sorted(out, key=lambda row: float(row[1] @ row[1]))


def _on_coarse_steps(study: Study, values: Array) -> Array:
    """Values by step of the work, as means over the coarse steps of the diagnosed run, (n + 1,)."""
    machine, run = study.owner.machine, study.runs[0]
    fine = values[machine.lead :]
    rows = fine[: fine.size // machine.row * machine.row].reshape(-1, machine.row).mean(axis=1)
    means = run.mean(rows)
    return np.append(means, means[-1])


def own_mimic(study: Study, effects: list[Concealed]) -> Mimic:
    """The truth itself, all of it so many times as strong; one lie at most."""
    change = NOTHING
    for effect in effects:
        change = change.beside(effect.change)

    def coarse(part: dict) -> dict:
        return {k: _on_coarse_steps(study, v) if np.ndim(v) else v for k, v in part.items()}

    heat, factor, gain = (coarse(part) for part in (change.heat, change.factor, change.gain))

    def make(a: float) -> Change:
        return Change(
            {k: a * v for k, v in heat.items()},
            {k: v**a for k, v in factor.items()},
            {k: (a * p, scale) for k, (p, scale) in change.law.items()},
            {},
            tuple((node, a * c, a * g) for node, c, g in change.mass),
            {k: v**a for k, v in gain.items()},
        )

    return Mimic("truth", (), make, 0.05, True, 1.0)


def _heat_shapes(study: Study, concealed: Concealed | None) -> list[tuple[str, Array]]:
    """Possible courses of heat in intervals: the true one, or all through, or half of it."""
    run = study.runs[0]
    if concealed is not None and concealed.shape is not None:
        return [("as it is", _on_coarse_steps(study, concealed.shape))]
    half = (np.arange(run.size + 1) > run.size / 2).astype(float)
    return [("all through", np.ones(run.size + 1)), ("second half", half)]


def mimics_of(study: Study, concealed: Concealed | None, calibrated: bool) -> list[Mimic]:
    """Simple effects of every place."""
    network, out = study.network, []
    heat = max(
        known.value * study.runs[0].heat[key.removeprefix("gain.")].mean()
        for key, known in study.owner.estimates.items()
        if key.startswith("gain.")
    )

    def add(effect: str, places: tuple[str, ...], make, small: float, one_sided: bool = False) -> None:
        out.append(Mimic(effect, places, make, small, one_sided))

    for _, shape in _heat_shapes(study, concealed):
        for node in network.nodes:
            add(
                "unrecorded_heat_source",
                (node,),
                lambda a, n=node, w=shape: Change(heat={n: a * heat * w}),
                0.05,
                True,
            )
        for link in network.cooled():
            add(
                "unrecorded_cooling",
                (link.split("|")[0], *both_ways(link)[:2]),
                lambda a, k=link, w=shape: Change(factor={k: np.exp(np.clip(a, -4, 4) * w)}),
                0.05,
            )
    for link in network.cooled():
        add(
            "natural_convection",
            (link, link.split("|")[0], "housing"),
            lambda a, k=link: Change(law={k: (min(a, 0.8), 25.0)}),
            0.05,
            True,
        )
        add(
            "radiation",
            (link, link.split("|")[0], "housing"),
            lambda a, k=link: Change(rise={k: min(a, 4.0) * 0.005}),
            0.05,
            True,
        )
    for s in network.sources:
        if s.unit == "rpm":
            add("seal_friction", (s.node, "shaft", s.name), _seal(study, s, heat), 0.05, True)
    if calibrated:
        for link in network.conductance:
            add(
                "joint_conductance",
                tuple(both_ways(link)[:2]),
                lambda a, k=link: Change(factor={k: np.exp(np.clip(a, -4, 4))}),
                0.05,
            )
        for s in network.sources:
            add(
                "heat_scale",
                (s.node, s.name, s.input),
                lambda a, k=s.name: Change(gain={k: np.exp(np.clip(a, -4, 4))}),
                0.05,
            )
        for node, capacity in network.capacity.items():
            add("heat_capacity", (node,), _mass(study, node, capacity), 0.05, True)
    span = study.runs[0].time[-1]
    sizes = {
        "sensor_drift": (lambda a: a * 3600.0 / span, 0.2, False),
        "clock_shift": (lambda a: a * 0.002 * span, 0.2, False),
        "sensor_lag": (lambda a: a * 0.002 * span, 0.2, True),
    }
    if calibrated:
        sizes |= {
            "sensor_offset": (lambda a: a, 0.1, False),
            "sensor_gain": (lambda a: 1.0 + 0.1 * a, 0.1, False),
        }
    for effect, (size, small, one_sided) in sizes.items():
        for channel in study.owner.channels:
            add(effect, (channel,), lambda a, e=effect, c=channel, f=size: Lie(e, c, f(a)), small, one_sided)
    return out


def _seal(study: Study, source: Source, heat: float) -> Callable[[float], Change]:
    shape = study.runs[0].heat[source.name] ** (1.0 / NOMINAL_EXPONENT)
    return lambda a: Change(heat={source.node: a * heat * shape / max(shape.mean(), 1e-9)})


def _mass(study: Study, node: str, capacity: float) -> Callable[[float], Change]:
    fast = 3.0 * study.runs[0].step
    return lambda a: Change(mass=((node, a * capacity, a * capacity / fast),))
