"""Oil lubrication of a bearing: what a kind of it says about drag, friction and the heat that flows away."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from spindle_fem.correlation import Array, correlation
from spindle_fem.physics.coolant.properties import Coolant
from spindle_fem.physics.coolant.streams import StreamAnswer


@dataclass(frozen=True, slots=True)
class BearingStream:
    """Oil, or air with its oil, that enters one bearing.

    Attributes
    ----------
    oil : Coolant
    oil_flow, air_flow : float, [m³/s]
        Air at 20 °C and 1.013 bar; 0 without air.
    inlet_temperature : float, [K]
    speed : float, [rad/s]
    pitch_diameter, element_diameter, inner_diameter, outer_diameter : float, [m]
        The last two of the annulus between the rings.
    axial_cosine : float, [-]
        Of the contact angle.
    on_balls : bool
        Or on rollers.
    """

    oil: Coolant
    oil_flow: float
    air_flow: float
    inlet_temperature: float
    speed: float
    pitch_diameter: float
    element_diameter: float
    axial_cosine: float
    inner_diameter: float
    outer_diameter: float
    on_balls: bool = True

    @property
    def rpm(self) -> float:
        """Speed of the shaft, [1/min]."""
        return abs(self.speed) * 30.0 / math.pi

    @property
    def passage(self) -> float:
        """Free section between the rings, elements and cage left out, [m²]."""
        return 0.25 * math.pi * (self.outer_diameter**2 - self.inner_diameter**2)

    @property
    def relative_size(self) -> float:
        """Element diameter times the cosine of the contact angle over the pitch diameter, [-]."""
        return self.element_diameter * self.axial_cosine / self.pitch_diameter

    @property
    def cage_velocity(self) -> float:
        """Of the cage at the pitch diameter, [m/s]."""
        return 0.25 * abs(self.speed) * (1.0 - self.relative_size) * self.pitch_diameter

    @property
    def spin_velocity(self) -> float:
        """Of an element's surface about its own axis, past what turns with the cage, [m/s]."""
        return 0.25 * abs(self.speed) * (1.0 - self.relative_size**2) * self.pitch_diameter


@dataclass(frozen=True, slots=True)
class LubricationKind:
    """A way to bring oil to a bearing.

    Attributes
    ----------
    ball_factor, roller_factor : float, [-]
        Palmgren's f_0 of a row of angular-contact balls and of cylindrical rollers with a cage.
    replenishment : float, [-]
        K_rs of the catalogue's starvation factor.
    fill : callable
        :class:`BearingStream` to the share of the balls' path that oil fills.
    film : callable
        :class:`BearingStream` to the films of both raceways and of the rolling elements.
    churns : bool
        Whether more oil is about than the contacts need: their inlets are flooded, and it drags, which the
        catalogue formula ``skf`` adds from a diagram.
    """

    ball_factor: float
    roller_factor: float
    replenishment: float
    fill: Callable[[BearingStream], float]
    film: Callable[[BearingStream], StreamAnswer]
    churns: bool


# Beyond a sixth of the path the drag of balls is no longer that of a thin mixture.
MOST_FILL = 0.15


@correlation(
    how_to_fix="Give lubrication.path_fill.",
    flow=(300.0, 8500.0),
    speed=(10.0e3, 28.0e3),
    pitch=(50.0, 200.0),
)
def path_fill_parker(flow: Array, speed: Array, pitch: Array) -> Array:
    """Share of the space between the rings that oil fills when it flows through.

    Parameters
    ----------
    flow : (n,) array_like, [cm³/min]
    speed : (n,) array_like, [1/min]
    pitch : (n,) array_like, [mm]

    Source: Parker (1984), NASA Technical Paper 2275: 10⁵ W^0.37/(n d_m^1.7); 35 and 120 mm bore (their range
    of flow and speed). Taken as cited: a few per cent at those flows.

    >>> float(path_fill_parker(7600.0, 20.0e3, 155.0).round(3))
    0.026
    """
    return 1.0e5 * flow**0.37 / (speed * pitch**1.7)


def flooded_fill(stream: BearingStream) -> float:
    """Parker's share, at most ``MOST_FILL``; 0 at rest, where nothing drags."""
    return min(MOST_FILL, _parker(stream))


def _parker(stream: BearingStream) -> float:
    if stream.rpm == 0.0:
        return 0.0
    flow, pitch = 6.0e7 * stream.oil_flow, 1.0e3 * stream.pitch_diameter
    return float(path_fill_parker(flow, stream.rpm, pitch, extrapolate=True))


# Balls and rollers are smaller than half the pitch diameter.
@correlation(prandtl=(0.5, 1.0e4), relative_size=(0.0, 0.5))
def film_harris(
    speed: Array,
    kinematic_viscosity: Array,
    thermal_conductivity: Array,
    prandtl: Array,
    relative_size: Array,
) -> Array:
    """Coefficient between oil and the raceways of a bearing whose inner ring turns, W/(m²·K).

    Parameters
    ----------
    speed : (n,) array_like, [1/min]
    kinematic_viscosity : (n,) array_like, [m²/s]
    thermal_conductivity : (n,) array_like, [W/(m·K)]
    prandtl, relative_size : (n,) array_like, [-]
        The latter is the element diameter times the cosine of the contact angle over the pitch diameter.

    Source: Crecelius & Pirvics (1976), as Harris & Kotzalas, Rolling Bearing Analysis, take it: laminar
    flow along a plate at the speed of the cage. The mean film of a plate as long as the pitch diameter
    (0.664 Re^(1/2) Pr^(1/3)) is 9 % higher, as the tests hold.

    >>> float(film_harris(10.0e3, 1.0e-5, 0.13, 150.0, 0.1).round(0))
    2043.0
    """
    stirring = np.sqrt(speed / kinematic_viscosity * (1.0 - relative_size))
    return 0.0986 * stirring * thermal_conductivity * np.cbrt(prandtl)


def oil_film(stream: BearingStream) -> StreamAnswer:
    """Films and heat capacity of oil that flows through a bearing.

    At rest the film of a slit that the oil just seeps through (Nu = 7.54 on twice its height). Rolling
    elements have that of the raceways, as Crecelius & Pirvics take it: they turn in a mixture with air, and a
    sphere in oil alone would have some three times as much.
    """
    oil = stream.oil.properties(stream.inlet_temperature)
    viscosity, conductivity = float(oil.kinematic_viscosity), float(oil.thermal_conductivity)
    still = 7.541 * conductivity / (stream.outer_diameter - stream.inner_diameter)
    prandtl = float(oil.prandtl)
    turning = film_harris(
        stream.rpm, viscosity, conductivity, prandtl, stream.relative_size, extrapolate=True
    )
    velocity = stream.cage_velocity
    coefficient = max(still, float(turning))
    faults = list(film_harris.faults(prandtl=prandtl))
    if stream.rpm:
        pitch = 1.0e3 * stream.pitch_diameter
        faults += path_fill_parker.faults(flow=6.0e7 * stream.oil_flow, speed=stream.rpm, pitch=pitch)
        if _parker(stream) > MOST_FILL:
            faults.append(f"oil fills {_parker(stream):.2f} of the path, {MOST_FILL:g} is taken")
    return StreamAnswer(
        coefficient=coefficient,
        capacity_rate=float(oil.density * oil.specific_heat_capacity) * stream.oil_flow,
        volume_flow=stream.oil_flow,
        reynolds=velocity * stream.pitch_diameter / viscosity,
        prandtl=prandtl,
        velocity=velocity,
        regime="laminar",
        pressure_drop=0.0,
        source="Harris & Kotzalas",
        faults=tuple(faults),
        element_coefficient=coefficient,
    )
