"""The paper's terms with rolling resistance, material hysteresis, cage and seal."""

from __future__ import annotations

import numpy as np

from spindle_fem.physics.bearings.bearing_state import BearingHeat
from spindle_fem.physics.bearings.catalogue_friction import boundary_diameters
from spindle_fem.physics.bearings.heat_model import (
    FloatArray,
    HeatInputs,
    HeatOptions,
    friction_model,
    ring_terms,
)
from spindle_fem.physics.bearings.heat_models import HEAT_MODELS
from spindle_fem.physics.bearings.heat_models.paper import paper
from spindle_fem.physics.bearings.lubricant_film import film_groups, inlet_shear_factor, replenishment_factor


@HEAT_MODELS.register
@friction_model(ball_attitude="equilibrium", needs_boundary=True, counts_cage=True)
def full(inputs: HeatInputs, options: HeatOptions) -> BearingHeat:
    """Heat terms of the paper plus hydrodynamic rolling resistance, hysteresis, cage and seal."""
    sliding = paper(inputs, options)
    rolling, hysteresis = _rolling_powers(inputs, options)
    rolling_contacts = {"rolling": rolling, "hysteresis": hysteresis}
    terms = {**sliding.terms, **ring_terms(inputs, rolling_contacts)}
    orbital = float(np.average(inputs.orbital, weights=inputs.system.weight))
    viscosity = float(inputs.lubricant.viscosity[0])
    cage = inputs.geometry.cage
    terms["cage"] = 0.0 if cage is None else cage.power(viscosity, inputs.speed, orbital)
    terms["seal"] = (inputs.geometry.seal_moment or 0.0) * inputs.speed
    return BearingHeat("full", terms, {**sliding.per_contact, **rolling_contacts})


def rolling_resistance_houpert(
    reduced_modulus: FloatArray,
    radius: FloatArray,
    ellipticity: FloatArray,
    speed_group: FloatArray,
    material_group: FloatArray,
    load_group: FloatArray,
) -> FloatArray:
    """Hydrodynamic rolling force of one contact on each of its surfaces, N.

    F_R = 2.86 E' R_x² κ^0.348 G^0.022 U^0.66 W^0.47; elastohydrodynamic, for inlets that are starved a
    little by the word of Bălan, Houpert and others (2015), who measured 2.3 to 2.9 times as much near that
    regime and eight to ten times as much where contacts stay rigid (light loads). In a spindle's bearing it
    is half to two thirds of :func:`rolling_resistance_flooded`, as of an inlet that begins two to four half
    widths before the contact.

    Source: Houpert (1987), Trans. ASME J. Tribol. 109.
    """
    groups = ellipticity**0.348 * material_group**0.022 * speed_group**0.66 * load_group**0.47
    return 2.86 * reduced_modulus * radius**2 * groups


def rolling_resistance_flooded(
    reduced_modulus: FloatArray,
    radius: FloatArray,
    semi_major: FloatArray,
    speed_group: FloatArray,
    material_group: FloatArray,
    load_group: FloatArray,
) -> FloatArray:
    """Hydrodynamic rolling force of one long contact on each of its surfaces with oil all around, N.

    F_R = 4.318 (2 a R_x/α) (G U)^0.658 W'^0.0126, W' the load group of a line as long as the contact.

    Range: elastohydrodynamic, isothermal, contacts several times as long as wide (no flow aside).

    Source: Goksem & Hargreaves (1978), J. Lubr. Technol. 100, 346-352, as a bearing maker's open program
    (class GoksemAihara) has its constants.

    Outer contact of a 71928 under 1137 N at 3000 rpm; its inlet integrated has 0.238 N:

    >>> force = rolling_resistance_flooded(226.4e9, 7.744e-3, 0.8142e-3, 1.527e-10, 4075.0, 1.032e-5)
    >>> round(float(force), 3)
    0.22
    """
    length = 2.0 * np.asarray(semi_major)
    along = np.divide(load_group * radius, length, out=np.zeros_like(length), where=length > 0.0)
    line = (material_group * speed_group) ** 0.658 * along**0.0126
    return 4.318 * length * radius * reduced_modulus / material_group * line


def hysteresis_force(load: FloatArray, semi_minor: FloatArray, radius: FloatArray, loss: float) -> FloatArray:
    """Rolling force of one contact from elastic hysteresis, (3/16) λ Q b/R_x, N.

    Source: Johnson, Contact Mechanics (1985), section 9.2.
    """
    return 3.0 / 16.0 * loss * load * semi_minor / radius


def _rolling_powers(inputs: HeatInputs, options: HeatOptions) -> tuple[FloatArray, FloatArray]:
    patch, lubricant = inputs.patch, inputs.lubricant
    speed = inputs.traction.entrainment_speed
    modulus = (2.0 / inputs.system.compliance)[:, None]
    groups = film_groups(
        lubricant.viscosity[:, None], speed, patch.load, modulus, patch.rolling_radius,
        lubricant.pressure_viscosity[:, None],
    )  # fmt: skip
    if options.flooded:
        force = rolling_resistance_flooded(modulus, patch.rolling_radius, patch.semi_major, *groups)
    else:
        force = rolling_resistance_houpert(modulus, patch.rolling_radius, patch.ellipticity, *groups)
    bore, outer = boundary_diameters(inputs.geometry)
    reduction = float(
        inlet_shear_factor(inputs.speed, inputs.geometry.pitch_diameter, inputs.kinematic_viscosity)
    )
    reduction *= float(
        replenishment_factor(
            inputs.speed,
            bore,
            outer,
            inputs.kinematic_viscosity,
            constant=options.skf_replenishment,
            geometry_constant=inputs.geometry.catalogue.skf_replenishment,
        )
    )
    lossy = hysteresis_force(patch.load, patch.semi_minor, patch.rolling_radius, options.hysteresis_loss)
    return options.rolling_surfaces * reduction * force * speed, lossy * speed
