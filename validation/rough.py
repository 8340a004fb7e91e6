"""Machines that differ from their definition by what drawings and mounting leave open.

Shapes come from a pool of finite-volume models with deviating dimensions
(:class:`validation.machine.Deviation`); what hangs on the machine, the air about it, balls and the shape of
the heat over speed are drawn for every case.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from . import machine as m
from .laws import ExtraMass, Law, scale_groups
from .reduction import ReducedSpindle, load_reduced
from .stepping import Moment

TOOL_J_KG_K = 470.0
# The upper half of the outside, weighed by how far up it looks, m².
UPPER_AREA = 0.12
TOPS = ("housing_middle_top", "housing_front_top", "housing_rear_top")
# Within 0.02 K of the finer grid of :func:`validation.reduction.load_reduced`, at an eighth of its cost.
GRID = {"sectors": 16, "size": 150, "draws": 4}
# Standard deviation of a wave of the heat over speed, and of what is drawn of the mounting, zeros counted.
SHAPE, TOOL_KG, BRACKET_W_K, TOP_K, BALL = 0.03, 1.4, 0.55, 1.2, 0.1


def maybe(rng: np.random.Generator, share: float, value: float) -> float:
    """A value in a share of the draws, else zero."""
    return value if rng.random() < share else 0.0


def draw_deviation(rng: np.random.Generator) -> m.Deviation:
    """Dimensions as a drawing's tolerances and a milled channel leave them."""
    film = [float(np.clip(rng.normal(0.0, s), -0.15, 0.15)) for s in (0.06, 0.07, 0.07)]
    probes = [(1e-3 * rng.uniform(0.0, 1.3), 1e-3 * rng.uniform(-1.3, 1.3)) for _ in m.PROBES]
    return m.Deviation(
        maybe(rng, 0.7, rng.uniform(-0.03, 0.03)),
        maybe(rng, 0.7, 1e-3 * rng.uniform(-1.5, 1.5)),
        maybe(rng, 0.6, 1e-3 * rng.uniform(-2.5, 2.5)),
        tuple(film),
        tuple(probes),
    )


def deviating_machine(seed: int, number: int, cache: Path | None) -> tuple[m.Deviation, ReducedSpindle]:
    """One of the pool: its shape and its reduced model, built once (a minute) and kept."""
    deviation = draw_deviation(np.random.default_rng([seed, 7_000 + number]))
    return deviation, load_reduced(cache, **GRID, deviation=deviation)


@dataclass(slots=True)
class AsMounted(Law):
    """Additions to a machine and deviations of its laws from the definition.

    ``tool_kg`` at the nose; ``bracket`` from the flange to the rear body, W/K; ``top`` excess of the air
    above, K; ``ball`` relative growth of the balls' conductance to 3000 rpm; ``shape`` of the heat over speed
    by set: amplitudes and phases of sines over the range of speeds.
    """

    tool_kg: float = 0.0
    bracket: float = 0.0
    top: float = 0.0
    ball: float = 0.0
    shape: dict[str, tuple[tuple[float, float], ...]] = field(default_factory=dict)
    tool: ExtraMass | None = field(default=None, init=False, repr=False)

    def start(self, model: ReducedSpindle) -> None:
        """Forget the run before."""
        self.memory.clear()
        capacity = TOOL_J_KG_K * self.tool_kg
        self.tool = ExtraMass("nose", capacity, 6.0 * self.tool_kg) if capacity else None

    def factor(self, where: str, speed: float) -> float:
        """Heat of a set over its table's at a speed."""
        turns = np.pi * speed / 4500.0
        waves = self.shape.get(where, ())
        return 1.0 + sum(a * float(np.sin((k + 1) * turns + phase)) for k, (a, phase) in enumerate(waves))

    def act(self, moment: Moment) -> None:
        """Change the moment."""
        for i, bearing in enumerate(m.BEARINGS):
            moment.bearing[i] *= self.factor(bearing[0], moment.speed)
        if self.ball:
            more = 1.0 + self.ball * moment.speed / 3000.0
            scale_groups(moment, tuple(f"balls:{b}" for b in m.BEARINGS), more)
        if self.bracket:
            watts = self.bracket * (moment.at("housing_rear_top") - moment.at("flange_rim"))
            moment.add_heat("flange_rim", watts)
            moment.add_heat("housing_rear_top", -watts)
        if self.top:
            watts = m.OUTSIDE_FILM * UPPER_AREA * self.top
            for place in TOPS:
                moment.add_heat(place, watts / len(TOPS))
            moment.add_heat("housing_middle_bottom", -watts)
        if self.tool:
            self.tool.act(moment)

    def answer(self, deviation: m.Deviation) -> dict[str, object]:
        """Mounting and shape in the form of the answers."""
        return {
            "od": deviation.outer,
            "depth_mm": 1e3 * deviation.depth,
            "shift_mm": 1e3 * deviation.shift,
            "film": list(deviation.film),
            "probes_mm": [[1e3 * a, 1e3 * b] for a, b in deviation.probes],
            "tool_kg": self.tool_kg,
            "bracket_W_K": self.bracket,
            "top_K": self.top,
            "ball": self.ball,
            "shape": {k: [list(pair) for pair in v] for k, v in self.shape.items()},
        }


def draw_mounting(rng: np.random.Generator) -> AsMounted:
    """Draw the additions to one machine, and the shape of its heat over speed."""

    def waves() -> tuple[tuple[float, float], ...]:
        return tuple((float(rng.normal(0.0, SHAPE)), float(rng.uniform(0.0, 2.0 * np.pi))) for _ in range(2))

    return AsMounted(
        maybe(rng, 0.4, rng.uniform(0.8, 3.5)),
        maybe(rng, 0.4, rng.uniform(0.4, 1.3)),
        maybe(rng, 0.5, rng.uniform(0.8, 2.5)),
        maybe(rng, 0.5, rng.uniform(0.08, 0.2)),
        {"F": waves(), "R": waves()} if rng.random() < 0.85 else {},
    )


def what_is_open() -> tuple[Callable[[float], Law], ...]:
    """Mounting and shapes of the heat as directions with one standard deviation each.

    An effect that these and the uncertain parameters take up cannot be known from the readings of a machine
    of which nothing else is told.
    """

    def wave(where: str, turns: int, phase: float) -> Callable[[float], Law]:
        still = ((0.0, 0.0),) * (turns - 1)
        size = SHAPE / np.sqrt(2.0)
        return lambda x: AsMounted(shape={where: (*still, (size * x, phase))})

    waves = [wave(w, turns, phase) for w in "FR" for turns in (1, 2) for phase in (0.0, np.pi / 2.0)]
    return (
        *waves,
        lambda x: AsMounted(tool_kg=TOOL_KG * x),
        lambda x: AsMounted(bracket=BRACKET_W_K * x),
        lambda x: AsMounted(top=TOP_K * x),
        lambda x: AsMounted(ball=BALL * x),
    )


def draw_channels(rng: np.random.Generator) -> tuple[int, ...]:
    """Channels recorded: all in two of three cases, else two or three probes, at times with the oil."""
    if rng.random() < 2.0 / 3.0:
        return tuple(range(6))
    probes = sorted(int(k) for k in rng.choice(5, int(rng.integers(2, 4)), replace=False))
    return (*probes, *((5,) if rng.random() < 0.5 else ()))
