"""Draw channels at random that a design study may request."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from spindle_fem.errors import FaultsError
from spindle_fem.machine.geometry.assembly import AssemblyGeometry, assemble
from spindle_fem.machine.geometry.channel_geometry import ChannelDefinition
from spindle_fem.machine.geometry.part_shapes import PartGeometry, SurfaceDefinition

# Range of each dimension, m; turns, starts and hand are drawn from lists.
DEPTH_RANGE = (5.0e-3, 30.0e-3)
WIDTH_RANGE = (6.0e-3, 20.0e-3)
PITCH_RANGE = (14.0e-3, 40.0e-3)
TURNS = (1, 8)
STARTS = (1, 2)
HANDS = ("right", "left")


def draw_channels(base: ChannelDefinition, seed: int) -> Iterator[ChannelDefinition]:
    """Endless channels from the design space, valid or not.

    The front edge stays where ``base`` has it, so ``z_start`` moves with the width.

    Parameters
    ----------
    base : ChannelDefinition
        Part, inner radius, front edge and ports.
    seed : int

    Yields
    ------
    ChannelDefinition
    """
    generator = np.random.default_rng(seed)
    front_edge = base.z_start - 0.5 * base.width
    while True:
        width = generator.uniform(*WIDTH_RANGE)
        yield replace(
            base,
            depth=generator.uniform(*DEPTH_RANGE),
            width=width,
            pitch=generator.uniform(*PITCH_RANGE),
            turns=float(generator.integers(TURNS[0], TURNS[1] + 1)),
            starts=int(generator.choice(STARTS)),
            hand=str(generator.choice(HANDS)),
            z_start=front_edge + 0.5 * width,
        )


def draw_valid_designs(
    parts: Sequence[PartGeometry],
    base: ChannelDefinition,
    number: int,
    seed: int,
    surfaces: Sequence[SurfaceDefinition] = (),
) -> Iterator[AssemblyGeometry]:
    """Assemblies with the first ``number`` channels of a seed that fit.

    Parameters
    ----------
    parts : sequence of PartGeometry
    base : ChannelDefinition
    number, seed : int
    surfaces : sequence of SurfaceDefinition, optional

    Yields
    ------
    AssemblyGeometry
    """
    channels = draw_channels(base, seed)
    found = 0
    while found < number:
        try:
            assembly = assemble(parts, surfaces, next(channels))
        except FaultsError:
            continue
        found += 1
        yield assembly
