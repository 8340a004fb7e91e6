"""Ducts: what flows through one, its film and its pressure loss."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from spindle_fem.correlation import Array, correlation
from spindle_fem.physics.coolant.channel_section import ChannelSection
from spindle_fem.physics.coolant.duct_friction import friction_factor_channel, friction_faults
from spindle_fem.physics.coolant.properties import Coolant, CoolantProperties
from spindle_fem.physics.coolant.transition import critical_reynolds_schmidt, transition_weight
from spindle_fem.validity import POSITIVE, require_range

# Reynolds numbers between which a straight duct turns turbulent (Gnielinski 2013).
LAMINAR_TO, TURBULENT_FROM = 2300.0, 4000.0


@dataclass(frozen=True, slots=True)
class DuctShape:
    """Measures of a duct as a definition gives them; a kind asks for those that it needs.

    Attributes
    ----------
    diameter, outer_diameter : float, [m]
        Of the walls that are drawn; the outer one of an annulus only.
    length : float, [m]
        Of the drawn wall along the axis.
    width, depth : float or None, [m]
        Of a groove.
    number : int
        Grooves or bores side by side, or starts of a helix.
    passes : int
        Bores one after another that the coolant flows through.
    turns : float or None
        Of a helix.
    bore_diameter : float or None, [m]
        Of an axial bore.
    covered : bool
        The cover of grooves is a drawn wall too.
    """

    diameter: float
    length: float
    outer_diameter: float | None = None
    width: float | None = None
    depth: float | None = None
    number: int = 1
    passes: int = 1
    turns: float | None = None
    bore_diameter: float | None = None
    covered: bool = False

    @property
    def groove_wall(self) -> float:
        """Wetted width that a groove's floor stands for, m; with sides, half of which a cover takes.

        Lands that touch the cover conduct the heat of their sides to both.
        """
        return self.width + (1.0 if self.covered else 2.0) * self.depth


@dataclass(frozen=True, slots=True)
class DuctSection:
    """A section that does not change along a duct.

    Attributes
    ----------
    area, perimeter : float, [m²], [m]
        Free section and its wetted perimeter.
    laminar_nusselt : float, [-]
        Developed, walls of one temperature, on the hydraulic diameter.
    laminar_friction : float, [-]
        Darcy friction factor times Reynolds number.
    paths : int
        Ducts in parallel that share the flow evenly.
    path_length : float or None, [m]
        Of each; that of the drawn wall where None.
    wetted_ratio : float, [-]
        Wetted surface that the drawn walls stand for, over theirs; the same of floor and cover.
    turn_loss : float, [-]
        Loss coefficients of the turns of a path, together.
    helix : ChannelSection or None
        The same duct wound on a cylinder.
    turning_diameter : float or None, [m]
        Of the inner wall of an annulus, which may turn.
    """

    area: float
    perimeter: float
    laminar_nusselt: float
    laminar_friction: float
    paths: int = 1
    path_length: float | None = None
    wetted_ratio: float = 1.0
    turn_loss: float = 0.0
    helix: ChannelSection | None = None
    turning_diameter: float | None = None

    @property
    def hydraulic_diameter(self) -> float:
        """Four times area over perimeter, [m]."""
        return 4.0 * self.area / self.perimeter


@dataclass(frozen=True, slots=True)
class DuctFlow:
    """Flow through a duct, properties at its inlet.

    Attributes
    ----------
    length : float, [m]
        Of the drawn wall.
    volume_flow, inlet_temperature : float, [m³/s], [K]
        Of all paths together; where it enters.
    speed : float, [rad/s]
        Of a wall that turns.

    Raises
    ------
    OutOfValidityError
        A length or flow that is not positive, a temperature outside the coolant's range.
    """

    section: DuctSection
    length: float
    coolant: Coolant
    volume_flow: float
    inlet_temperature: float
    speed: float = 0.0

    def __post_init__(self) -> None:
        require_range(
            "duct",
            length=(self.length, *POSITIVE),
            volume_flow=(self.volume_flow, *POSITIVE),
            how_to_fix="Give SI values; the coolant must flow.",
        )

    @property
    def properties(self) -> CoolantProperties:
        """Properties of the coolant at the inlet."""
        return self.coolant.properties(self.inlet_temperature)

    @property
    def velocity(self) -> float:
        """Mean over the section, [m/s]."""
        return self.volume_flow / self.section.paths / self.section.area

    @property
    def reynolds(self) -> float:
        """Reynolds number on the hydraulic diameter, [-]."""
        return self.velocity * self.section.hydraulic_diameter / float(self.properties.kinematic_viscosity)

    @property
    def prandtl(self) -> float:
        """Prandtl number of the coolant, [-]."""
        return float(self.properties.prandtl)

    @property
    def slenderness(self) -> float:
        """Length over hydraulic diameter, [-]."""
        return (self.section.path_length or self.length) / self.section.hydraulic_diameter

    @property
    def critical_reynolds(self) -> float:
        """Reynolds number at which laminar flow ends, [-]; in a helix later."""
        if self.section.helix is None:
            return LAMINAR_TO
        return float(critical_reynolds_schmidt(self.section.helix.curvature_ratio, extrapolate=True))

    @property
    def turbulent_share(self) -> float:
        """0 in laminar, 1 in turbulent flow, linear in Re between."""
        if self.section.helix is None:
            return float(turbulent_share(self.reynolds))
        return 1.0 - float(transition_weight(self.reynolds, self.critical_reynolds))

    @property
    def regime(self) -> str:
        """Laminar, transition or turbulent."""
        share = self.turbulent_share
        return "laminar" if share <= 0.0 else "turbulent" if share >= 1.0 else "transition"

    @property
    def capacity_rate(self) -> float:
        """Mass flow times heat capacity, [W/K]."""
        return float(self.properties.density * self.properties.specific_heat_capacity) * self.volume_flow

    @property
    def pressure_drop(self) -> float:
        """Friction along the duct and its turns without what is before and after it, [Pa]."""
        head = 0.5 * float(self.properties.density) * self.velocity**2
        return (self._friction_factor() * self.slenderness + self.section.turn_loss) * head

    def _friction_factor(self) -> float:
        """Darcy friction factor of the duct, [-]; that of the channel in a helix."""
        if self.section.helix is not None:
            return float(friction_factor_channel(self.reynolds, self.section.helix, self.critical_reynolds))
        laminar = self.section.laminar_friction / min(self.reynolds, LAMINAR_TO)
        smooth = float(friction_factor_smooth(max(self.reynolds, TURBULENT_FROM), extrapolate=True))
        return laminar + self.turbulent_share * (smooth - laminar)

    @property
    def friction_faults(self) -> tuple[str, ...]:
        """How the flow through a helix leaves the range of its friction."""
        helix = self.section.helix
        if helix is None:
            return ()
        curved = critical_reynolds_schmidt.faults(curvature_ratio=helix.curvature_ratio)
        return (*curved, *friction_faults(self.reynolds, helix, self.critical_reynolds))


@dataclass(frozen=True, slots=True)
class DuctFilm:
    """Result of a film law: Nusselt number on the hydraulic diameter, source, violations of its range."""

    nusselt: float
    source: str
    faults: tuple[str, ...]


def turbulent_share(reynolds: ArrayLike) -> Array:
    """0 in laminar, 1 in turbulent flow of a straight duct, linear in Re [-] between."""
    return np.clip((np.asarray(reynolds, float) - LAMINAR_TO) / (TURBULENT_FROM - LAMINAR_TO), 0.0, 1.0)


@correlation(how_to_fix="Let the duct choose by its regime.", reynolds=(4.0e3, 1.0e6))
def friction_factor_smooth(reynolds: Array) -> Array:
    """Darcy friction factor of turbulent flow in a smooth duct.

    Parameters
    ----------
    reynolds : (n,) array_like, [-]
        On the hydraulic diameter.

    Source: Konakov (1946), as Gnielinski (2013), Int. J. Heat Mass Transfer 63, 134–140, takes it.

    >>> float(friction_factor_smooth(1.0e4).round(5))
    0.03078
    """
    return (1.8 * np.log10(reynolds) - 1.5) ** -2
