"""A network as it truly is, and its temperatures: exact modal steps, what is nonlinear by iteration.

Shares nothing with ``spindle_fem``: the heat balance ``C dT/dt = -G T + q`` is solved in the modes of the
mean network, exactly for heat held over a step and for surroundings linear between steps. Conductances
that change (with temperature, time or a law) put their difference into ``q``, iterated over the whole run.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

Array = NDArray[np.float64]
REFERENCE_DEGC = 30.0
CONVERGED_K, MOST_SWEEPS = 1e-4, 60


@dataclass(frozen=True, slots=True)
class Source:
    """Heat ``gain · (input / reference)^exponent`` into a node, W."""

    node: str
    input: str
    gain: float
    exponent: float = 1.0
    reference: float = 1.0
    unit: str = "W"

    @property
    def name(self) -> str:
        """Node and input."""
        return f"{self.node}.{self.input}"


@dataclass(frozen=True, slots=True)
class Network:
    """Heat capacities, J/K; conductances by ``a|b``, W/K; surroundings; sources."""

    capacity: dict[str, float]
    conductance: dict[str, float]
    boundaries: tuple[str, ...]
    sources: tuple[Source, ...]

    @property
    def nodes(self) -> tuple[str, ...]:
        """Names of the nodes."""
        return tuple(self.capacity)

    def cooled(self) -> list[str]:
        """Links to a surrounding."""
        return [link for link in self.conductance if link.split("|")[1] in self.boundaries]


@dataclass(frozen=True, slots=True)
class Work:
    """Inputs of a machine, on a uniform step, s: (n,) arrays by name; °C, W, rpm or percent."""

    step: float
    inputs: dict[str, Array]
    surroundings: dict[str, Array]
    covariates: dict[str, Array] = field(default_factory=dict)

    @property
    def time(self) -> Array:
        """(n,) seconds from the start."""
        return self.step * np.arange(next(iter(self.surroundings.values())).size)

    def part(self, start: int, stop: int | None = None) -> "Work":
        """Some of the steps."""
        parts = (self.inputs, self.surroundings, self.covariates)
        return Work(self.step, *({k: v[start:stop] for k, v in part.items()} for part in parts))


@dataclass(frozen=True, slots=True)
class Change:
    """Differences from the plain network.

    ``heat`` W by node; ``factor`` by link, constant or (n,); ``law`` by link: exponent and difference, K, at
    which the conductance is the plain one; ``rise`` by link: relative growth per K of mean temperature;
    ``mass``: node, J/K, W/K to it; ``gain`` factors by source.
    """

    heat: dict[str, Array] = field(default_factory=dict)
    factor: dict[str, Array | float] = field(default_factory=dict)
    law: dict[str, tuple[float, float]] = field(default_factory=dict)
    rise: dict[str, float] = field(default_factory=dict)
    mass: tuple[tuple[str, float, float], ...] = ()
    gain: dict[str, Array | float] = field(default_factory=dict)

    def beside(self, other: "Change") -> "Change":
        """Both changes."""

        def merged(first: dict, second: dict, join) -> dict:
            return first | {k: join(first[k], v) if k in first else v for k, v in second.items()}

        return Change(
            merged(self.heat, other.heat, np.add),
            merged(self.factor, other.factor, np.multiply),
            self.law | other.law,
            merged(self.rise, other.rise, np.add),
            self.mass + other.mass,
            merged(self.gain, other.gain, np.multiply),
        )


NOTHING = Change()


def source_heat(network: Network, work: Work, change: Change = NOTHING) -> dict[str, Array]:
    """Heat of every source, W, by its name."""
    return {
        s.name: s.gain * change.gain.get(s.name, 1.0) * (work.inputs[s.input] / s.reference) ** s.exponent
        for s in network.sources
    }


class _Modes:
    """Modes of one linear network and its exact steps."""

    def __init__(self, capacity: Array, matrix: Array, step: float) -> None:
        self.scale = 1.0 / np.sqrt(capacity)
        rates, self.shapes = np.linalg.eigh(self.scale[:, None] * matrix * self.scale)
        x = np.maximum(rates, 0.0) * step
        small = np.maximum(x, 1e-4)
        self.keep = np.exp(-x)
        self.held = step * np.where(x < 1e-4, 1.0 - x / 2.0, -np.expm1(-small) / small)
        self.late = step * np.where(x < 1e-4, 0.5 - x / 6.0, (small + np.expm1(-small)) / small**2)

    def run(self, start: Array, held: Array, linear: Array) -> Array:
        """(n, nodes) temperatures from heat held over steps and heat linear in between."""
        into = self.scale[:, None] * self.shapes
        f, u = linear @ into, held @ into
        kicks = (self.held - self.late) * f[:-1] + self.late * f[1:] + self.held * u[:-1]
        state = (start / self.scale) @ self.shapes
        out = np.empty_like(f)
        out[0] = state
        for mode, keep in enumerate(self.keep):
            out[1:, mode] = lfilter([1.0], [1.0, -keep], kicks[:, mode], zi=[keep * state[mode]])[0]
        return out @ self.shapes.T * self.scale


def march(
    network: Network,
    work: Work,
    change: Change = NOTHING,
    start: Array | None = None,
    heat: dict[str, Array] | None = None,
) -> Array:
    """(n, nodes) temperatures, °C; without ``start`` from the first surroundings' mean.

    ``heat`` by source replaces that from the inputs. Extra masses start at their node's temperature.

    Raises
    ------
    ArithmeticError
        The iteration of what is nonlinear does not settle.
    """
    names = [*network.nodes, *(f"mass of {node}" for node, _, _ in change.mass)]
    at = {name: i for i, name in enumerate(names)}
    capacity = np.array([*network.capacity.values(), *(c for _, c, _ in change.mass)])
    links = [(*k.split("|"), v, k) for k, v in network.conductance.items()]
    links += [(node, f"mass of {node}", g, "") for node, _, g in change.mass]
    n, count = work.time.size, len(names)
    matrix, linear, held = np.zeros((count, count)), np.zeros((n, count)), np.zeros((n, count))
    varying = []
    for a, b, plain, key in links:
        factor = change.factor.get(key, 1.0)
        mean = plain * 0.5 * (np.min(factor) + np.max(factor))
        i, j = at[a], at.get(b)
        matrix[i, i] += mean
        if j is None:
            linear[:, i] += mean * work.surroundings[b]
        else:
            matrix[j, j] += mean
            matrix[i, j] -= mean
            matrix[j, i] -= mean
        if key in change.law or change.rise.get(key) or np.ndim(factor):
            varying.append((i, j, b, plain * factor, mean, change.law.get(key), change.rise.get(key, 0.0)))
    for source, watts in (heat or source_heat(network, work, change)).items():
        held[:, at[source.split(".")[0]]] += watts
    for node, watts in change.heat.items():
        held[:, at[node]] += watts
    if start is None:
        start = np.full(len(network.nodes), np.mean([v[0] for v in work.surroundings.values()]))
    start = np.append(start, [start[at[node]] for node, _, _ in change.mass])
    modes = _Modes(capacity, matrix, work.step)
    out = modes.run(start, held, linear)
    for _ in range(MOST_SWEEPS if varying else 0):
        rest = linear.copy()
        for i, j, boundary, plain, mean, law, rise in varying:
            other = work.surroundings[boundary] if j is None else out[:, j]
            difference = out[:, i] - other
            now = plain * (1.0 + rise * (0.5 * (out[:, i] + other) - REFERENCE_DEGC))
            if law:
                now = now * np.clip(np.abs(difference) / law[1], 0.02, 3.0) ** law[0]
            flow = (now - mean) * difference
            rest[:, i] -= flow
            if j is not None:
                rest[:, j] += flow
        before, out = out, modes.run(start, held, rest)
        if np.abs(out - before).max() < CONVERGED_K:
            break
    else:
        if varying:
            raise ArithmeticError("the nonlinear conductances do not settle")
    return out[:, : len(network.nodes)]
