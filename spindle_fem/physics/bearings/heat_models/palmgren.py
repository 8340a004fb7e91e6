"""Palmgren's catalogue formula: a viscous and a load-dependent moment."""

from __future__ import annotations

import math

from spindle_fem.errors import SpecError
from spindle_fem.physics.bearings.bearing_geometry import BearingGeometry
from spindle_fem.physics.bearings.bearing_state import BearingHeat
from spindle_fem.physics.bearings.catalogue_friction import (
    FrictionMoment,
    static_equivalent_load,
    static_load_rating,
)
from spindle_fem.physics.bearings.heat_model import (
    HeatInputs,
    HeatOptions,
    RollerHeatInputs,
    friction_model,
)
from spindle_fem.physics.bearings.heat_models import HEAT_MODELS
from spindle_fem.physics.bearings.roller_bearing import RollerGeometry


def of_rollers(inputs: RollerHeatInputs, options: HeatOptions) -> BearingHeat:
    """Palmgren's moments of roller bearings."""
    moment = palmgren_roller_moment(
        inputs.geometry,
        inputs.speed,
        inputs.kinematic_viscosity,
        inputs.states.driving_load,
        lubrication_factor=options.palmgren_f0_rollers,
    )
    return moment.heat("palmgren", inputs.speed, inputs.geometry)


@HEAT_MODELS.register
@friction_model(rollers=of_rollers)
def palmgren(inputs: HeatInputs, options: HeatOptions) -> BearingHeat:
    """Heat of the moments M_0 (``viscous``) and M_1 (``load``), and of a contact seal."""
    moment = palmgren_moment(
        inputs.geometry,
        inputs.speed,
        inputs.kinematic_viscosity,
        inputs.axial_force,
        inputs.radial_force,
        lubrication_factor=options.palmgren_f0,
    )
    return moment.heat("palmgren", inputs.speed, inputs.geometry)


def palmgren_moment(
    geometry: BearingGeometry,
    speed: float,
    kinematic_viscosity: float,
    axial_load: float,
    radial_load: float = 0.0,
    *,
    lubrication_factor: float = 2.0,
) -> FrictionMoment:
    """Friction moment after Palmgren: ``viscous`` (M_0) and ``load`` (M_1).

    Parameters
    ----------
    speed : float, [rad/s]
    kinematic_viscosity : float, [m²/s]
    axial_load, radial_load : float, [N]
    lubrication_factor : float
        f_0: grease about 2 (fresh fill up to 4), oil-air about 1.7.

    Source: Harris & Kotzalas, vol. 1; Palmgren (1959).
    """
    pitch = geometry.pitch_diameter * 1e3
    viscous = _viscous_moment(geometry.pitch_diameter, speed, kinematic_viscosity, lubrication_factor)
    axial, radial = abs(axial_load), abs(radial_load)
    ratio = static_equivalent_load(geometry, axial, radial) / static_load_rating(geometry)
    kind, tangent = geometry.catalogue, math.tan(geometry.contact_angle)
    axial_factor = kind.palmgren_axial_factor
    if axial_factor is None:
        axial_factor = 0.9 / tangent if tangent > 0.0 else 0.0
    driving = max(axial_factor * axial - 0.1 * radial, radial)
    factor = kind.palmgren_load_factor(geometry.contact_angle)
    load = factor * ratio**kind.palmgren_load_exponent * driving * pitch
    return FrictionMoment({"viscous": viscous, "load": load * 1e-3})


def palmgren_roller_moment(
    geometry: RollerGeometry,
    speed: float,
    kinematic_viscosity: float,
    driving_load: float,
    *,
    lubrication_factor: float | None = None,
) -> FrictionMoment:
    """Friction moment of a roller bearing after Palmgren: ``viscous`` (M_0, of every row) and ``load`` (M_1).

    Parameters
    ----------
    speed : float, [rad/s]
    kinematic_viscosity : float, [m²/s]
    driving_load : float, [N]
        Radial load, or what stands for it (``RollerStates.driving_load``).
    lubrication_factor : float, optional
        f_0 of a row, in the place of the bearing's own.

    Source: Harris & Kotzalas, vol. 1; Palmgren (1959); f_0 and f_1 of a row are those of the kind.

    f_1 P d_m:

    >>> rollers = RollerGeometry(9e-3, 8e-3, 27, 91e-3, rows=2)
    >>> round(palmgren_roller_moment(rollers, 0.0, 20e-6, 1000.0).total * 1e3, 2)
    18.2
    """
    kind, given = geometry.catalogue, lubrication_factor or geometry.palmgren_lubrication_factor
    factor = kind.palmgren_lubrication_factor if given is None else given
    viscous = _viscous_moment(geometry.pitch_diameter, speed, kinematic_viscosity, factor)
    load = kind.palmgren_load_factor * abs(driving_load) * geometry.pitch_diameter
    return FrictionMoment({"viscous": geometry.rows * viscous, "load": load})


def _viscous_moment(pitch: float, speed: float, kinematic_viscosity: float, factor: float) -> float:
    """M_0, N m, of a row with a pitch diameter [m] at a speed [rad/s]; 0 at rest."""
    if not factor > 0.0:
        raise SpecError("palmgren_f0", f"it is {factor:g}.", "It must be above 0.")
    product = kinematic_viscosity * 1e6 * abs(speed) * 30.0 / math.pi
    rate = 1e-7 * product ** (2.0 / 3.0) if product >= 2000.0 else 160e-7
    return rate * factor * (pitch * 1e3) ** 3 * 1e-3 if speed else 0.0
