"""SKF's catalogue formula: a rolling and a sliding moment."""

from __future__ import annotations

import math

from spindle_fem.physics.bearings.bearing_geometry import STEEL_DENSITY, BearingGeometry
from spindle_fem.physics.bearings.bearing_state import BearingHeat
from spindle_fem.physics.bearings.catalogue_friction import (
    FrictionMoment,
    boundary_diameters,
    roller_boundary,
    static_load_rating,
)
from spindle_fem.physics.bearings.heat_model import (
    HeatInputs,
    HeatOptions,
    RollerHeatInputs,
    friction_model,
)
from spindle_fem.physics.bearings.heat_models import HEAT_MODELS
from spindle_fem.physics.bearings.lubricant_film import inlet_shear_factor, replenishment_factor
from spindle_fem.physics.bearings.roller_bearing import RollerGeometry


def of_rollers(inputs: RollerHeatInputs, options: HeatOptions) -> BearingHeat:
    """SKF moments of roller bearings, whose full-film coefficient is that of their kind."""
    moment = skf_roller_moment(
        inputs.geometry,
        inputs.speed,
        inputs.kinematic_viscosity,
        inputs.states.driving_load,
        friction_boundary=options.skf_friction_boundary,
        replenishment=options.skf_replenishment,
    )
    return moment.heat("skf", inputs.speed, inputs.geometry)


@HEAT_MODELS.register
@friction_model(needs_boundary=True, rollers=of_rollers)
def skf(inputs: HeatInputs, options: HeatOptions) -> BearingHeat:
    """Heat of the ``rolling`` and ``sliding`` moments, and of a contact seal."""
    moment = skf_moment(
        inputs.geometry,
        inputs.speed,
        inputs.kinematic_viscosity,
        inputs.axial_force,
        inputs.radial_force,
        friction_ehl=options.skf_friction_ehl,
        friction_boundary=options.skf_friction_boundary,
        replenishment=options.skf_replenishment,
    )
    return moment.heat("skf", inputs.speed, inputs.geometry)


def skf_moment(
    geometry: BearingGeometry,
    speed: float,
    kinematic_viscosity: float,
    axial_load: float,
    radial_load: float = 0.0,
    *,
    friction_ehl: float = 0.04,
    friction_boundary: float = 0.15,
    replenishment: float = 6.0e-8,
) -> FrictionMoment:
    """Friction moment of the SKF model: ``rolling`` and ``sliding`` (no contact seal, no oil bath).

    Parameters
    ----------
    speed : float, [rad/s]
    kinematic_viscosity : float, [m²/s]
    axial_load, radial_load : float, [N]
    friction_ehl : float
        Full-film friction coefficient: 0.05 mineral, 0.04 synthetic.
    friction_boundary : float
        0.12-0.15.
    replenishment : float
        K_rs: 6e-8 for grease and oil-air, 3e-8 for oil baths and jets.

    The constants are those of the bearing's kind; what centrifugal force adds goes with the balls'
    density, 0.41 of that of steel for silicon nitride.

    Source: SKF rolling bearings catalogue (2013), SKF general catalogue 6000 (2006).
    """
    bore, outer = boundary_diameters(geometry)
    mean = 0.5 * (bore + outer) * 1e3
    rpm = abs(speed) * 30.0 / math.pi
    viscosity = kinematic_viscosity * 1e6
    axial, radial = abs(axial_load), abs(radial_load)
    share = _groove_moments if geometry.catalogue.skf_groove is not None else _angular_moments
    rolling, sliding = share(geometry, mean, rpm, axial, radial)
    reduction = float(inlet_shear_factor(speed, mean * 1e-3, kinematic_viscosity)) * float(
        replenishment_factor(
            speed,
            bore,
            outer,
            kinematic_viscosity,
            constant=replenishment,
            geometry_constant=geometry.catalogue.skf_replenishment,
        )
    )
    coefficient = _sliding_coefficient(rpm * viscosity, mean, friction_ehl, friction_boundary)
    return FrictionMoment(
        {
            "rolling": reduction * rolling * (viscosity * rpm) ** 0.6 * 1e-3,
            "sliding": coefficient * sliding * 1e-3,
        }
    )


def _angular_moments(
    geometry: BearingGeometry, mean: float, rpm: float, axial: float, radial: float
) -> tuple[float, float]:
    """G_rr and G_sl of an angular-contact bearing of a mean diameter [mm]."""
    (r1, r2, r3), (s1, s2, s3) = geometry.catalogue.skf_rolling, geometry.catalogue.skf_sliding
    inertia = geometry.density / STEEL_DENSITY * mean**4 * rpm**2
    rolling = r1 * mean**1.97 * (radial + r3 * inertia + r2 * axial) ** 0.54
    third = 4.0 / 3.0
    return rolling, s1 * mean**0.26 * ((radial + s3 * inertia) ** third + s2 * axial**third)


def _groove_moments(
    geometry: BearingGeometry, mean: float, rpm: float, axial: float, radial: float
) -> tuple[float, float]:
    """G_rr and G_sl of a deep-groove bearing, whose contact angle under thrust follows from its C0."""
    r1, r2, s1, s2 = geometry.catalogue.skf_groove
    if axial == 0.0:
        return r1 * mean**1.96 * radial**0.54, s1 * mean**-0.26 * radial ** (5.0 / 3.0)
    sine = math.sin(math.radians(24.6 * (axial / static_load_rating(geometry)) ** 0.24))
    rolling = r1 * mean**1.96 * (radial + r2 / sine * axial) ** 0.54
    return rolling, s1 * mean**-0.145 * (radial**5 + s2 * mean**1.5 / sine * axial**4) ** (1.0 / 3.0)


def skf_roller_moment(
    geometry: RollerGeometry,
    speed: float,
    kinematic_viscosity: float,
    driving_load: float,
    *,
    friction_boundary: float = 0.15,
    replenishment: float = 6.0e-8,
) -> FrictionMoment:
    """Friction moment of cylindrical rollers by the SKF model: ``rolling`` and ``sliding``.

    Every row counts as a bearing of its own under its share of the load: the
    catalogue has no constants of double rows with cage.

    Parameters
    ----------
    speed : float, [rad/s]
    kinematic_viscosity : float, [m²/s]
    driving_load : float, [N]
        Radial load, or its equivalent (``RollerStates.driving_load``).
    friction_boundary : float
        0.12-0.15.
    replenishment : float
        K_rs: 6e-8 for grease and oil-air, 3e-8 for oil baths and jets.

    Source: SKF rolling bearings catalogue (2013): G_rr = R1 d_m^2.41 F_r^0.31, G_sl = S2 d_m F_r without
    axial load.
    """
    kind = geometry.catalogue
    bore, outer = roller_boundary(geometry)
    mean = 0.5 * (bore + outer) * 1e3
    rpm = abs(speed) * 30.0 / math.pi
    viscosity = kinematic_viscosity * 1e6
    share = abs(driving_load) / geometry.rows
    reduction = float(inlet_shear_factor(speed, mean * 1e-3, kinematic_viscosity)) * float(
        replenishment_factor(
            speed,
            bore,
            outer,
            kinematic_viscosity,
            constant=replenishment,
            geometry_constant=kind.skf_replenishment,
        )
    )
    rolling = kind.skf_rolling * mean**2.41 * share**0.31
    sliding = kind.skf_sliding * mean * share
    coefficient = _sliding_coefficient(rpm * viscosity, mean, kind.skf_friction_ehl, friction_boundary)
    return FrictionMoment(
        {
            "rolling": geometry.rows * reduction * rolling * (viscosity * rpm) ** 0.6 * 1e-3,
            "sliding": geometry.rows * coefficient * sliding * 1e-3,
        }
    )


def _sliding_coefficient(product: float, mean: float, full_film: float, boundary: float) -> float:
    """Friction coefficient between boundary and full film at ν n [mm²/s rpm] and a mean diameter [mm]."""
    share = math.exp(-2.6e-8 * product**1.4 * mean)
    return share * boundary + (1.0 - share) * full_film
