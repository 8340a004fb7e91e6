"""Friction heat of a bearing, term by term, at the named levels (eqs 24-26 and what they leave out).

``paper``: sliding in both contacts and the balls' drag. ``full`` adds the
hydrodynamic rolling resistance (Houpert), material hysteresis, cage and seal.
``palmgren`` and ``skf`` are the catalogue formulas beside it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from spindle_fem.errors import SpecError, did_you_mean
from spindle_fem.physics.bearings.ball_system import BallSystem
from spindle_fem.physics.bearings.bearing_geometry import BearingGeometry
from spindle_fem.physics.bearings.bearing_state import BearingHeat
from spindle_fem.physics.bearings.catalogue_friction import boundary_diameters, palmgren_moment, skf_moment
from spindle_fem.physics.bearings.hertz import INNER, OUTER
from spindle_fem.physics.bearings.lubricant_film import film_groups, inlet_shear_factor, replenishment_factor
from spindle_fem.physics.bearings.traction import ContactPatch, LubricantState, TractionIntegrals

FloatArray = NDArray[np.float64]
HeatLevel = Literal["paper", "full", "palmgren", "skf"]
HEAT_LEVELS: tuple[str, ...] = get_args(HeatLevel)


@dataclass(frozen=True, slots=True)
class CageGuidance:
    """A cage that runs on a ring's land: Petroff shear of a film.

    Attributes
    ----------
    land_diameter, land_width, clearance : float, [m]
        ``clearance`` is radial.
    land : {"inner", "outer"}
        Ring that guides it.
    """

    land_diameter: float
    land_width: float
    clearance: float
    land: Literal["inner", "outer"] = "outer"

    def __post_init__(self) -> None:
        for key in ("land_diameter", "land_width", "clearance"):
            if not getattr(self, key) > 0.0:
                raise SpecError(f"cage.{key}", f"it is {getattr(self, key):g} m.", "It must be above 0.")

    def power(self, viscosity: float, speed: float, orbital: float) -> float:
        """Heat of the guiding land, P = η π w d³ ω_rel²/(4c), W."""
        relative = speed - orbital if self.land == "inner" else orbital
        shear = viscosity * math.pi * self.land_width * self.land_diameter**3 * relative**2
        return shear / (4.0 * self.clearance)


@dataclass(frozen=True, slots=True)
class ContactSeal:
    """A rubbing seal of constant friction moment (K_S1 d_s^β + K_S2 of a catalogue).

    Attributes
    ----------
    moment : float, [N m]
    """

    moment: float

    def __post_init__(self) -> None:
        if not self.moment >= 0.0:
            raise SpecError("seal.moment", f"it is {self.moment:g} N m.", "It must not be negative.")


@dataclass(frozen=True, slots=True)
class HeatOptions:
    """Which heat model, and the numbers that only it needs.

    Attributes
    ----------
    level : {"full", "paper", "palmgren", "skf"}
    rolling_surfaces : {2, 1}
        Houpert's rolling force acts on both surfaces of a contact: power
        2 F_R u. Some papers count one.
    hysteresis_loss : float, [-]
        Share of the elastic work lost in a load cycle of hard steel.
    palmgren_f0, skf_friction_ehl, skf_friction_boundary : float
    cage : CageGuidance or None
    seal : ContactSeal or None
    """

    level: HeatLevel = "full"
    rolling_surfaces: int = 2
    hysteresis_loss: float = 0.01
    palmgren_f0: float = 2.0
    skf_friction_ehl: float = 0.04
    skf_friction_boundary: float = 0.15
    cage: CageGuidance | None = None
    seal: ContactSeal | None = None

    def __post_init__(self) -> None:
        if self.level not in HEAT_LEVELS:
            raise SpecError(
                "heat.model", f"{self.level!r} is unknown.", did_you_mean(str(self.level), HEAT_LEVELS)
            )
        if self.rolling_surfaces not in (1, 2):
            raise SpecError("heat.rolling_surfaces", f"it is {self.rolling_surfaces}.", "Allowed: 1, 2.")
        if not 0.0 <= self.hysteresis_loss <= 0.1:
            raise SpecError("heat.hysteresis_loss", f"it is {self.hysteresis_loss:g}.", "Allowed: 0 to 0.1.")


@dataclass(frozen=True, slots=True, eq=False)
class HeatInputs:
    """What a bearing's equilibrium hands to the heat models.

    ``system``, ``patch``, ``traction`` and ``lubricant`` hold this bearing's
    balls only; ``orbital`` and ``drag`` are (n,).
    """

    geometry: BearingGeometry
    system: BallSystem
    patch: ContactPatch
    traction: TractionIntegrals
    lubricant: LubricantState
    orbital: FloatArray
    drag: FloatArray
    speed: float
    kinematic_viscosity: float
    axial_force: float
    radial_force: float


def rolling_resistance_houpert(
    reduced_modulus: FloatArray,
    radius: FloatArray,
    ellipticity: FloatArray,
    speed_group: FloatArray,
    material_group: FloatArray,
    load_group: FloatArray,
) -> FloatArray:
    """Hydrodynamic rolling force of one contact on each of its surfaces, N.

    F_R = 2.86 E' R_x² κ^0.348 G^0.022 U^0.66 W^0.47; flooded, elastohydrodynamic.

    Source: Houpert (1987), Trans. ASME J. Tribol. 109.
    """
    groups = ellipticity**0.348 * material_group**0.022 * speed_group**0.66 * load_group**0.47
    return 2.86 * reduced_modulus * radius**2 * groups


def hysteresis_force(load: FloatArray, semi_minor: FloatArray, radius: FloatArray, loss: float) -> FloatArray:
    """Rolling force of one contact from elastic hysteresis, (3/16) λ Q b/R_x, N.

    Source: Johnson, Contact Mechanics (1985), section 9.2.
    """
    return 3.0 / 16.0 * loss * load * semi_minor / radius


def bearing_heat(inputs: HeatInputs, options: HeatOptions) -> BearingHeat:
    """Heat of one bearing at the level that ``options`` names.

    Returns
    -------
    BearingHeat
        With all terms 0 at rest.
    """
    if options.level in ("palmgren", "skf"):
        return _catalogue_heat(inputs, options)
    weight = inputs.system.weight
    per_contact = {
        "sliding": inputs.traction.power_rolling,
        "transverse": inputs.traction.power_across,
    }
    terms = {}
    for label in ("sliding", "transverse"):
        for side, ring in ((INNER, "inner"), (OUTER, "outer")):
            terms[f"{ring}_{label}"] = float(per_contact[label][:, side] @ weight)
    drag_power = 0.5 * inputs.geometry.pitch_diameter * inputs.orbital * inputs.drag
    terms["ball_drag"] = float(drag_power @ weight)
    if options.level == "full":
        rolling, hysteresis = _rolling_powers(inputs, options)
        per_contact |= {"rolling": rolling, "hysteresis": hysteresis}
        for label, power in (("rolling", rolling), ("hysteresis", hysteresis)):
            for side, ring in ((INNER, "inner"), (OUTER, "outer")):
                terms[f"{ring}_{label}"] = float(power[:, side] @ weight)
        orbital = float(np.average(inputs.orbital, weights=weight))
        viscosity = float(inputs.lubricant.viscosity[0])
        terms["cage"] = 0.0 if options.cage is None else options.cage.power(viscosity, inputs.speed, orbital)
        terms["seal"] = 0.0 if options.seal is None else options.seal.moment * inputs.speed
    return BearingHeat(options.level, terms, per_contact)


def _rolling_powers(inputs: HeatInputs, options: HeatOptions) -> tuple[FloatArray, FloatArray]:
    patch, lubricant = inputs.patch, inputs.lubricant
    speed = inputs.traction.entrainment_speed
    modulus = (2.0 / inputs.system.compliance)[:, None]
    groups = film_groups(
        lubricant.viscosity[:, None], speed, patch.load, modulus, patch.rolling_radius,
        lubricant.pressure_viscosity[:, None],
    )  # fmt: skip
    force = rolling_resistance_houpert(modulus, patch.rolling_radius, patch.ellipticity, *groups)
    bore, outer = boundary_diameters(inputs.geometry)
    reduction = float(
        inlet_shear_factor(inputs.speed, inputs.geometry.pitch_diameter, inputs.kinematic_viscosity)
    )
    reduction *= float(replenishment_factor(inputs.speed, bore, outer, inputs.kinematic_viscosity))
    lossy = hysteresis_force(patch.load, patch.semi_minor, patch.rolling_radius, options.hysteresis_loss)
    return options.rolling_surfaces * reduction * force * speed, lossy * speed


def _catalogue_heat(inputs: HeatInputs, options: HeatOptions) -> BearingHeat:
    arguments = (
        inputs.geometry, inputs.speed, inputs.kinematic_viscosity, inputs.axial_force, inputs.radial_force,
    )  # fmt: skip
    if options.level == "palmgren":
        moment = palmgren_moment(*arguments, lubrication_factor=options.palmgren_f0)
    else:
        moment = skf_moment(
            *arguments, friction_ehl=options.skf_friction_ehl, friction_boundary=options.skf_friction_boundary
        )
    terms = {name: part * inputs.speed for name, part in moment.parts.items()}
    if options.seal is not None:
        terms["seal"] = options.seal.moment * inputs.speed
    return BearingHeat(options.level, terms, {})
