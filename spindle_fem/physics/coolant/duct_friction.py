"""Friction, pressure drop and pumping power of a helical rectangular channel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spindle_fem.correlation import Array, correlation
from spindle_fem.physics.coolant.channel_section import ChannelSection
from spindle_fem.physics.coolant.properties import CoolantProperties
from spindle_fem.physics.coolant.transition import TURBULENT_FROM_REYNOLDS, transition_weight
from spindle_fem.validity import NOT_NEGATIVE, POSITIVE, CodedWarning, range_fault, require_range

_HOW_TO_FIX = "Let coolant.duct_friction.channel_pressure_drop choose the correlation."
_INCH_M = 0.0254


@correlation(how_to_fix="Give the short over the long side.", aspect_ratio=(0.0, 1.0))
def fanning_reynolds_rectangle(aspect_ratio: Array) -> Array:
    """Fanning friction factor times Reynolds number, laminar, straight rectangular duct.

    Developed flow, on the hydraulic diameter.

    Parameters
    ----------
    aspect_ratio : (n,) array_like, [-]
        Short over long side: 0 (slit) to 1 (square).

    Source: Shah & London (1978), Laminar Flow Forced Convection in Ducts, eq. 341.

    >>> float(fanning_reynolds_rectangle(10.0 / 12.0).round(2))
    14.33
    """
    a = aspect_ratio
    return 24.0 * (1.0 + a * (-1.3553 + a * (1.9467 + a * (-1.7012 + a * (0.9564 - 0.2537 * a)))))


@correlation(how_to_fix=_HOW_TO_FIX, dean=(0.0, 2000.0))
def friction_factor_curved_laminar(dean: Array) -> Array:
    """Laminar friction factor of a curved duct over that of the straight one; 1 up to De = 11.6.

    Parameters
    ----------
    dean : (n,) array_like, [-]
        Re √(D_h/D_c). Mishra & Gupta (1979) give the same within 2 % up to 3000.

    Source: White (1929), Proc. R. Soc. A 123, 645–663.

    >>> friction_factor_curved_laminar([10.0, 64.0, 1000.0]).round(3).tolist()
    [1.0, 1.334, 3.64]
    """
    reduced = (11.6 / np.maximum(dean, 11.6)) ** 0.45
    return 1.0 / (1.0 - (1.0 - reduced) ** (1.0 / 0.45))


@correlation(how_to_fix=_HOW_TO_FIX, reynolds=(4500.0, 1.0e5), curvature_ratio=(0.0, 0.2))
def friction_factor_helical_turbulent(reynolds: Array, curvature_ratio: Array) -> Array:
    """Darcy friction factor of turbulent, isothermal flow in a smooth helical coil.

    Parameters
    ----------
    reynolds : (n,) array_like, [-]
    curvature_ratio : (n,) array_like, [-]
        Hydraulic over coil diameter; 0 is a straight duct (Blasius).

    Source: Mishra & Gupta (1979), Ind. Eng. Chem. Process Des. Dev. 18,
    130–137; as used by Gnielinski (1986).

    >>> float(friction_factor_helical_turbulent(2.2e4, 0.05).round(5))
    0.03269
    """
    return 0.3164 * reynolds**-0.25 + 0.03 * np.sqrt(curvature_ratio)


def friction_factor_channel(
    reynolds: ArrayLike, section: ChannelSection, critical_reynolds: float
) -> NDArray[np.float64]:
    """Darcy friction factor of the channel in every regime, without a jump.

    Laminar rectangle with White's curvature factor up to the critical Reynolds
    number, the turbulent coil from 2.2e4, linear in Re between.

    Parameters
    ----------
    reynolds : (n,) array_like, [-]
        On the hydraulic diameter.
    critical_reynolds : float, [-]

    Returns
    -------
    (n,) ndarray, [-]

    Raises
    ------
    OutOfValidityError
        Reynolds number not positive.
    """
    re = np.asarray(reynolds, float)
    require_range(
        "friction_factor_channel",
        reynolds=(re, *POSITIVE),
        how_to_fix="The coolant must flow.",
    )

    def laminar(value: NDArray[np.float64]) -> NDArray[np.float64]:
        curved = friction_factor_curved_laminar(value * np.sqrt(section.curvature_ratio), extrapolate=True)
        return 4.0 * fanning_reynolds_rectangle(section.aspect_ratio) / value * curved

    def turbulent(value: NDArray[np.float64]) -> NDArray[np.float64]:
        return friction_factor_helical_turbulent(value, section.curvature_ratio, extrapolate=True)

    weight = transition_weight(re, critical_reynolds)
    return weight * laminar(np.minimum(re, critical_reynolds)) + (1.0 - weight) * turbulent(
        np.maximum(re, TURBULENT_FROM_REYNOLDS)
    )


def port_loss_coefficient(
    reynolds: ArrayLike, diameter: float, length_to_diameter: float, *, outlet: bool
) -> NDArray[np.float64]:
    """Loss of a drilled radial port and its turn into the channel.

    Sharp-edged entry or exit, friction along the drilling and one square
    turn, in velocity heads of the port.

    Parameters
    ----------
    reynolds : (n,) array_like, [-]
        On the port diameter.
    diameter : float, [m]
    length_to_diameter : float, [-]
    outlet : bool
        Whether the coolant leaves through it.

    Returns
    -------
    (n,) ndarray, [-]

    Raises
    ------
    OutOfValidityError
        Reynolds number or diameter not positive.

    Range: a few tens of per cent at Re of some hundred. Friction along the
    drilling is Hagen–Poiseuille below Re 2300, Blasius above 4000, linear between.

    Source: two-constant method, Hooper (1981), Chem. Eng. 24 August, 96–100:
    square turn 1000/Re + 1.15 (1 + 1 inch/D), entry 160/Re + 0.5, exit 1.

    >>> float(port_loss_coefficient(409.0, 0.010, 9.1, outlet=False).round(2))
    8.83
    """
    re = np.asarray(reynolds, float)
    require_range(
        "port_loss_coefficient",
        reynolds=(re, *POSITIVE),
        diameter=(diameter, *POSITIVE),
        length_to_diameter=(length_to_diameter, *NOT_NEGATIVE),
        how_to_fix="Give SI values; the coolant must flow.",
    )
    weight = np.clip((4000.0 - re) / (4000.0 - 2300.0), 0.0, 1.0)
    pipe = weight * 64.0 / np.minimum(re, 2300.0) + (1.0 - weight) * 0.3164 * np.maximum(re, 4000.0) ** -0.25
    turn = 1000.0 / re + 1.15 * (1.0 + _INCH_M / diameter)
    end = np.ones_like(re) if outlet else 160.0 / re + 0.5
    return turn + end + pipe * length_to_diameter


@dataclass(frozen=True, slots=True)
class PressureDrop:
    """Pressure drop of the coolant and the heat it makes.

    Attributes
    ----------
    channel : float, [Pa]
    ports : float, [Pa]
    total : float, [Pa]
    pumping_power : float, [W]
        Total drop times volume flow, all starts; ends as heat in the coolant.
    channel_power : float, [W]
        The part that is dissipated along the channel.
    friction_factor : float, [-]
        Darcy, of the channel.
    reynolds : float, [-]
        On the hydraulic diameter.
    """

    channel: float
    ports: float
    total: float
    pumping_power: float
    channel_power: float
    friction_factor: float
    reynolds: float
    warnings: tuple[CodedWarning, ...]


def channel_pressure_drop(
    section: ChannelSection,
    volume_flow: float,
    properties: CoolantProperties,
    critical_reynolds: float,
    *,
    port_diameter: float | None = None,
    port_length: float = 0.0,
) -> PressureDrop:
    """Pressure drop from inlet to outlet port and the pumping power.

    Parameters
    ----------
    volume_flow : float, [m³/s]
        Total, all starts.
    properties : CoolantProperties
        Scalar, at the mean bulk temperature.
    critical_reynolds : float, [-]
        For example ``critical_reynolds_schmidt(section.curvature_ratio)``.
    port_diameter : float or None, [m]
        None leaves the ports out.
    port_length : float, [m]
        Length of each drilling.

    Raises
    ------
    OutOfValidityError
        No flow.
    """
    require_range(
        "channel_pressure_drop",
        volume_flow=(volume_flow, *POSITIVE),
        how_to_fix="Set coolant.flow above 0.",
    )
    velocity = section.velocity(volume_flow)
    density = float(properties.density)
    viscosity = float(properties.kinematic_viscosity)
    reynolds = velocity * section.hydraulic_diameter / viscosity
    factor = float(friction_factor_channel(reynolds, section, critical_reynolds))
    dynamic_pressure = 0.5 * density * velocity**2
    channel = factor * section.length / section.hydraulic_diameter * dynamic_pressure

    ports = 0.0
    if port_diameter is not None:
        port_velocity = volume_flow / section.starts / (0.25 * np.pi * port_diameter**2)
        port_reynolds = port_velocity * port_diameter / viscosity
        slenderness = port_length / port_diameter
        coefficient = sum(
            float(port_loss_coefficient(port_reynolds, port_diameter, slenderness, outlet=outlet))
            for outlet in (False, True)
        )
        ports = coefficient * 0.5 * density * port_velocity**2

    total = channel + ports
    return PressureDrop(
        channel=channel,
        ports=ports,
        total=total,
        pumping_power=total * volume_flow,
        channel_power=channel * volume_flow,
        friction_factor=factor,
        reynolds=reynolds,
        warnings=tuple(
            CodedWarning("coolant_friction_extrapolated", f"Friction of the channel: {fault}.")
            for fault in friction_faults(reynolds, section, critical_reynolds)
        ),
    )


def friction_faults(reynolds: float, section: ChannelSection, critical_reynolds: float) -> tuple[str, ...]:
    """How a flow leaves the range of :func:`friction_factor_channel`, if it does."""
    if reynolds <= critical_reynolds:
        dean = reynolds * np.sqrt(section.curvature_ratio)
        fault = range_fault("Dean number", dean, *friction_factor_curved_laminar.ranges["dean"])
    else:
        fault = range_fault(
            "Reynolds number", reynolds, 0.0, friction_factor_helical_turbulent.ranges["reynolds"][1]
        )
    return (fault,) if fault else ()
