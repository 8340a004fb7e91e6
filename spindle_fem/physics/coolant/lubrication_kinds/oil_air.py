"""Drops of oil that compressed air drives along the feed: a thin film, and air that carries heat away."""

from __future__ import annotations

import math

import numpy as np

from spindle_fem.correlation import Array, correlation
from spindle_fem.physics.coolant.lubrication_kind import BearingStream, LubricationKind
from spindle_fem.physics.coolant.lubrication_kinds import LUBRICATION_KINDS
from spindle_fem.physics.coolant.streams import StreamAnswer

# Dry air at 20 °C and 1.013 bar (VDI Heat Atlas, section D2.2): kg/m³, J/(kg·K), W/(m·K), m²/s.
DENSITY, HEAT_CAPACITY, CONDUCTIVITY, VISCOSITY = 1.204, 1006.0, 0.0259, 1.506e-5
# Assumed: oil-air meters some hundredths of a cm³ a shot, nearly all of it in the films.
FILL = 0.002


@correlation(how_to_fix="Give lubrication.film_factor.", velocity=(0.0, 120.0))
def film_of_air(velocity: Array) -> Array:
    """Coefficient between the rings of a bearing and air that is blown through it, W/(m²·K).

    Parameters
    ----------
    velocity : (n,) array_like, [m/s]
        Of the air through the bearing and around with it, together.

    Source: Bossmanns & Tu (1999), Int. J. Mach. Tools Manuf. 39, 1345–1366, with the constants that
    they took from measured bearings.

    >>> float(film_of_air(50.0).round(0))
    132.0
    """
    return 9.7 + 5.33 * velocity**0.8


# Whitaker's ranges of both shapes lie within a factor of two; dry air is at the lower end of Prandtl numbers.
@correlation(how_to_fix="Give lubrication.film_factor.", reynolds=(3.5, 7.6e4), prandtl=(0.7, 300.0))
def nusselt_whitaker(reynolds: Array, prandtl: Array, at_rest: Array) -> Array:
    """Nusselt number of a sphere or a cylinder in a stream, on its diameter; properties of the stream.

    Parameters
    ----------
    reynolds : (n,) array_like, [-]
        On the diameter.
    prandtl : (n,) array_like, [-]
    at_rest : (n,) array_like, [-]
        2 of a sphere, 0 of a cylinder across the stream.

    Source: Whitaker (1972), AIChE Journal 18, 361-371, within 30 % of what was measured; viscosity at the
    wall taken as that of the stream.

    >>> float(nusselt_whitaker(1.0e4, 0.71, 2.0).round(1))
    61.2
    """
    return at_rest + (0.4 * np.sqrt(reynolds) + 0.06 * np.cbrt(reynolds) ** 2) * prandtl**0.4


def film(stream: BearingStream) -> StreamAnswer:
    """Film of the air through the free section and around with the cage.

    Air that goes around with the cage meets the rings at the cage's speed and the rolling elements, which
    turn about their own axes in it, at that of their surface.
    """
    through = stream.air_flow / stream.passage
    velocity = math.hypot(through, stream.cage_velocity)
    past = math.hypot(through, stream.spin_velocity) * stream.element_diameter / VISCOSITY
    prandtl = DENSITY * HEAT_CAPACITY * VISCOSITY / CONDUCTIVITY
    element = nusselt_whitaker(past, prandtl, 2.0 if stream.on_balls else 0.0, extrapolate=True)
    oil = stream.oil.properties(stream.inlet_temperature)
    rate = DENSITY * HEAT_CAPACITY * stream.air_flow
    rate += float(oil.density * oil.specific_heat_capacity) * stream.oil_flow
    width = stream.outer_diameter - stream.inner_diameter
    return StreamAnswer(
        coefficient=float(film_of_air(velocity, extrapolate=True)),
        capacity_rate=rate,
        volume_flow=stream.air_flow,
        reynolds=velocity * width / VISCOSITY,
        prandtl=prandtl,
        velocity=velocity,
        regime="turbulent",
        # One row as two sudden changes of section; the drop in nozzles and lines is not known.
        pressure_drop=1.5 * 0.5 * DENSITY * through**2,
        source="Bossmanns & Tu 1999, Whitaker 1972",
        faults=(
            *film_of_air.faults(velocity=np.float64(velocity)),
            *nusselt_whitaker.faults(reynolds=np.float64(past), prandtl=np.float64(prandtl)),
        ),
        element_coefficient=float(element) * CONDUCTIVITY / stream.element_diameter,
    )


LUBRICATION_KINDS.add(
    "oil_air",
    LubricationKind(
        # Palmgren's f_0 of oil mist by Harris & Kotzalas, rollers of light series; K_rs of oil-air by the SKF
        # catalogue (2013).
        ball_factor=1.7,
        roller_factor=1.5,
        replenishment=6.0e-8,
        fill=lambda stream: FILL,
        film=film,
        churns=False,
    ),
)
