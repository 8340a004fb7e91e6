"""Bearing sets of a machine as assembled: rings, balls, seats; whether fit and preload go together."""

from __future__ import annotations

import math
from typing import Literal

from spindle_fem.definition.bearing_seats import seat_diameter
from spindle_fem.definition.bearing_types import BallBearingType, Cage
from spindle_fem.definition.machine_spec import BearingSet, MachineSpec, RollerBearingType
from spindle_fem.definition.solid_tables import Material, SetBearing
from spindle_fem.errors import SpecError
from spindle_fem.physics.bearings import mounting
from spindle_fem.physics.bearings.bearing_geometry import STEEL_EXPANSION, BearingGeometry
from spindle_fem.physics.bearings.cage_guidance import CageGuidance
from spindle_fem.physics.bearings.fits import FitTemperatures, RingFits, mounted_state, seated_rings
from spindle_fem.physics.bearings.heat_model import friction_model_names
from spindle_fem.physics.bearings.hertz import (
    INNER,
    STATIC_PRESSURE,
    bearing_contact_constants,
    maximum_pressure,
)
from spindle_fem.physics.bearings.rings import SeatMaterial
from spindle_fem.physics.bearings.roller_bearing import RollerGeometry
from spindle_fem.physics.bearings.roller_set import RollerSet

_ORIENTATION = {"towards_rear": 1, "towards_nose": -1}


def assembled_set(spec: MachineSpec, group: BearingSet) -> mounting.BearingSet | RollerSet:
    """A set of a machine for the laws of its bearings.

    Raises
    ------
    SpecError
        A fit that leaves no play for the preload, or a preload that the balls do not bear.
    """
    kind = spec.bearing_types[group.bearing_type]
    if isinstance(kind, RollerBearingType):
        return _roller_set(spec, group, kind)
    mounted = mounting.BearingSet(
        bearings=tuple(
            mounting.MountedBearing(
                bearing.name,
                ball_geometry(spec, spec.bearing_types[group.type_name(bearing)]),
                _ORIENTATION[bearing.takes_thrust],
                0.5 * (bearing.z[0] + bearing.z[1]),
                _ring_fits(spec, group, bearing),
            )
            for bearing in group.bearing
        ),
        # Springs on bearings that all face one way are a load on them.
        preload=0.0 if group.spring_force else group.preload,
        assembled_force=_force_on_tandem(spec, group),
        preload_kind="spring" if group.is_sprung else "rigid",
        loop_stiffness=_loop_stiffness(spec, group),
        shaft_expansion=_seat_expansion(spec, group, "inner"),
        housing_expansion=_seat_expansion(spec, group, "outer"),
        shaft_bore_diameter=_shaft_bore(spec, group),
        raceway_roughness=kind.roughness_raceway,
        ball_roughness=kind.roughness_ball,
    )
    if group.fit is not None:
        _require_holding(group, mounted)
    return mounted


def _force_on_tandem(spec: MachineSpec, group: BearingSet) -> float:
    """What seats bearings that all face one way, N: springs, its own or another set's, or else the thrust."""
    if not group.faces_one_way:
        return 0.0
    thrust = spec.operation.thrust if spec.operation else 0.0
    return abs(spec.axial_load(group, 0.0) or spec.axial_load(group, thrust))


def _loop_stiffness(spec: MachineSpec, group: BearingSet) -> float | None:
    """Of what lies between the two sides of a set, N/m; None where nothing gives way."""
    if group.preload_kind != "elastic":
        return None
    # Checks of definitions do without finite elements.
    from spindle_fem.model.elastic.preload_loop import loop_stiffness

    found = loop_stiffness(spec, group)
    return found if math.isfinite(found) else None


def ball_geometry(spec: MachineSpec, kind: BallBearingType) -> BearingGeometry:
    """A type of ball bearing for the laws of its balls, of the machine's materials."""
    rings, balls = spec.materials[kind.ring_material], spec.materials[kind.ball_material]
    hybrid = kind.ball_material != kind.ring_material
    return BearingGeometry(
        ball_diameter=kind.ball_diameter,
        ball_count=kind.ball_count,
        pitch_diameter=kind.pitch,
        contact_angle=kind.contact_angle,
        groove_curvature_inner=kind.groove_curvature_inner,
        groove_curvature_outer=kind.groove_curvature_outer,
        young_modulus=kind.young_modulus,
        poisson_ratio=kind.poisson_ratio,
        density=balls.density,
        ball_young_modulus=balls.young_modulus if hybrid else None,
        ball_poisson_ratio=balls.poisson_ratio if hybrid else None,
        ring_density=rings.density,
        thermal_expansion=rings.thermal_expansion,
        ball_thermal_expansion=balls.thermal_expansion,
        bore_diameter=kind.bore_diameter,
        outer_diameter=kind.outer_diameter,
        width=kind.width,
        static_load_rating=kind.basic_static_load,
        kind=kind.kind,
        seal_moment=kind.seal_moment,
        cage=_cage(kind.cage),
    )


def require_known_friction(spec: MachineSpec) -> None:
    """Refuse a heat model that does not know the kinds of bearing of a machine.

    Raises
    ------
    SpecError
    """
    types = (spec.bearing_types[group.type_name(bearing)] for group, bearing in spec.bearings)
    known = friction_model_names(rollers=True)
    model = spec.heat.model
    if model not in (*known, "table") and any(isinstance(kind, RollerBearingType) for kind in types):
        what = f'"{model}" knows ball bearings only, and this machine has roller bearings.'
        raise SpecError("heat.model", what, f"Allowed: {', '.join((*known, 'table'))}.")


def _cage(given: Cage | None) -> CageGuidance | None:
    if given is None:
        return None
    return CageGuidance(given.land_diameter, given.land_width, given.clearance, given.land)


def _roller_set(spec: MachineSpec, group: BearingSet, kind: RollerBearingType) -> RollerSet:
    rings, rollers = spec.materials[kind.ring_material], spec.materials[kind.roller_material]
    hybrid = kind.roller_material != kind.ring_material
    geometry = RollerGeometry(
        roller_diameter=kind.roller_diameter,
        roller_length=kind.roller_length,
        roller_count=kind.roller_count,
        pitch_diameter=kind.pitch,
        rows=kind.rows,
        radial_clearance=kind.radial_clearance,
        young_modulus=kind.young_modulus,
        poisson_ratio=kind.poisson_ratio,
        roller_young_modulus=rollers.young_modulus if hybrid else kind.young_modulus,
        roller_poisson_ratio=rollers.poisson_ratio if hybrid else kind.poisson_ratio,
        density=rollers.density,
        ring_density=rings.density,
        thermal_expansion=rings.thermal_expansion,
        roller_thermal_expansion=rollers.thermal_expansion,
        bore_diameter=kind.bore_diameter,
        outer_diameter=kind.outer_diameter,
        palmgren_lubrication_factor=kind.palmgren_f0,
        kind=kind.kind,
        seal_moment=kind.seal_moment,
    )
    return RollerSet(
        names=tuple(bearing.name for bearing in group.bearing),
        geometry=geometry,
        shaft_bore_diameter=_shaft_bore(spec, group),
        raceway_roughness=kind.roughness_raceway,
        roller_roughness=kind.roughness_roller,
    )


def _require_holding(group: BearingSet, mounted: mounting.BearingSet) -> None:
    """Axial preload needs play in the fitted bearing, and balls that bear it."""
    sides = [bearing.orientation for bearing in mounted.bearings]
    for bearing in mounted.bearings:
        geometry, fits = bearing.geometry, bearing.fits
        play = geometry.curvature_centre_distance * (1.0 - math.cos(geometry.contact_angle))
        closed = seated_rings(geometry, fits).state(0.0, FitTemperatures())
        nearer = closed.inner_growth - closed.outer_growth
        if nearer >= play:
            key = "inner_interference" if closed.inner_growth > 0.5 * nearer else "outer_clearance"
            raise SpecError(
                f"bearing_set.{group.name}.fit.{key}",
                f"the fits bring the raceways of {bearing.name} {2.0e6 * nearer:.0f} µm together, all of the "
                f"play of the bearing ({2.0e6 * play:.0f} µm on the diameter).",
                "Give looser fits: preload along the axis needs play.",
            )
        if not group.preload > 0.0:
            continue
        state = mounted_state(geometry, fits, group.preload / sides.count(bearing.orientation))
        contact = bearing_contact_constants(geometry, state.contact_angle, INNER)
        size = state.ball_load ** (1.0 / 3.0)
        pressure = float(
            maximum_pressure(state.ball_load, contact.semi_major * size, contact.semi_minor * size)
        )
        if pressure > STATIC_PRESSURE:
            raise SpecError(
                f"bearing_set.{group.name}.preload",
                f"it presses the balls of {bearing.name} on with {pressure * 1e-9:.2f} GPa.",
                f"Allowed: contact pressure up to {STATIC_PRESSURE * 1e-9:g} GPa (ISO 76).",
            )


def _ring_fits(spec: MachineSpec, group: BearingSet, bearing: SetBearing) -> RingFits | None:
    """Seats of one bearing's rings; None where the set has no fit."""
    if group.fit is None:
        return None
    kind = spec.bearing_types[group.type_name(bearing)]
    shaft, shaft_bore = seat_diameter(spec, kind, bearing, "inner")
    housing, wall = seat_diameter(spec, kind, bearing, "outer")
    own = group.fit.housing_outer_diameter
    return RingFits(
        inner_interference=group.fit.inner_interference,
        outer_clearance=group.fit.outer_clearance,
        housing_outer_diameter=wall if own is None else own,
        shaft_bore_diameter=shaft_bore,
        inner_ring_outer_diameter=kind.inner_ring_outer_diameter,
        outer_ring_inner_diameter=kind.outer_ring_inner_diameter,
        ring_density=spec.materials[kind.ring_material].density,
        shaft=_seat_material(spec.part_material(shaft)),
        housing=_seat_material(spec.part_material(housing)),
    )


def _seat_material(material: Material) -> SeatMaterial:
    return SeatMaterial(
        material.young_modulus, material.poisson_ratio, material.density, material.thermal_expansion
    )


def _seat_expansion(spec: MachineSpec, group: BearingSet, side: Literal["inner", "outer"]) -> float:
    """Thermal expansion of what carries the set, 1/K; steel's where its rings sit on no part."""
    first = group.bearing[0]
    seat = seat_diameter(spec, spec.bearing_types[group.type_name(first)], first, side)
    return STEEL_EXPANSION if seat is None else spec.part_material(seat[0]).thermal_expansion


def _shaft_bore(spec: MachineSpec, group: BearingSet) -> float | None:
    """Bore of the rotating part that carries the set; None under a solid shaft."""
    first = group.bearing[0]
    seat = seat_diameter(spec, spec.bearing_types[group.type_name(first)], first, "inner")
    return None if seat is None else seat[1] or None
