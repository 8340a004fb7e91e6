"""Distribution of the friction heat of a bearing: both rings and the balls."""

from __future__ import annotations

from spindle_fem.definition.machine_spec import Heat

#: Bodies that take up the heat, in the order of every array over them.
BODIES = ("inner", "outer", "balls")


def heat_shares(heat: Heat, inner_factor: float = 1.0) -> dict[str, float]:
    """Share of a bearing's heat that each of ``BODIES`` takes up; they sum to 1.

    Parameters
    ----------
    heat : Heat
        Table of the definition.
    inner_factor : float
        On the inner ring's share of what both rings take.
    """
    rings = 1.0 - heat.ball_share
    inner = heat.inner_share.value * inner_factor
    return {"inner": inner * rings, "outer": (1.0 - inner) * rings, "balls": heat.ball_share}


def heat_share_slopes(heat: Heat, inner_factor: float = 1.0) -> dict[str, float]:
    """Derivative of :func:`heat_shares` to the logarithm of the inner ring's share."""
    moved = (1.0 - heat.ball_share) * heat.inner_share.value * inner_factor
    return {"inner": moved, "outer": -moved, "balls": 0.0}
