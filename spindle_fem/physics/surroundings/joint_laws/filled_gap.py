"""Gas, grease or oil between two surfaces at a distance (Yovanovich)."""

from __future__ import annotations

from spindle_fem.correlation import Array
from spindle_fem.physics.surroundings.joint_law import joint_law
from spindle_fem.physics.surroundings.joint_laws import JOINT_LAWS
from spindle_fem.validity import NOT_NEGATIVE, POSITIVE


@JOINT_LAWS.register
@joint_law(
    units={"separation": "m", "filler_conductivity": "W/m/K", "rarefaction_length": "m"},
    how_to_fix="Give metres.",
    derived=lambda separation, rarefaction_length, **_: {"heat_path": separation + rarefaction_length},
    separation=NOT_NEGATIVE,
    rarefaction_length=NOT_NEGATIVE,
    heat_path=POSITIVE,
)
def gap_conductance(
    separation: Array, filler_conductivity: Array = 0.026, rarefaction_length: Array = 0.37e-6
) -> Array:
    """Conductance of the gas, grease or oil between two surfaces, W/(m²·K).

    Parameters
    ----------
    separation : (n,) array_like, [m]
        Mean distance of the surfaces.
    filler_conductivity : (n,) array_like, [W/(m·K)]
        Air by default.
    rarefaction_length : (n,) array_like, [m]
        Temperature jump of a gas at both walls, about six mean free paths
        for air at 1 bar; 0 for a liquid.

    Source: Yovanovich (1986), AIAA-86-1164: h = k_g/(Y + M).

    >>> float(gap_conductance(5.0e-6).round(0))
    4842.0
    """
    return filler_conductivity / (separation + rarefaction_length)
