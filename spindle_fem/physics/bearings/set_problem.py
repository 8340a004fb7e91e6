"""Build a set, or several side by side, as one ball system with its load, and find its state at rest."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from spindle_fem.bracketed_root import bracketed_root
from spindle_fem.errors import NoEquilibriumError, SpecError
from spindle_fem.physics.bearings.ball_system import BallSystem, build_ball_rows, join_rows
from spindle_fem.physics.bearings.bearing_geometry import BearingGeometry
from spindle_fem.physics.bearings.fits import FitTemperatures, mounted_state, mounted_states, seated_rings
from spindle_fem.physics.bearings.hertz import mean_load_constant
from spindle_fem.physics.bearings.mounting import (
    BearingSet,
    BearingTemperatures,
    ExternalLoad,
    MountedBearing,
    SetTemperatures,
    rotation_growth,
)
from spindle_fem.physics.bearings.preload import tandem_approach
from spindle_fem.physics.bearings.race_control import static_evaluation
from spindle_fem.physics.bearings.rings import RingLaw
from spindle_fem.physics.bearings.seat_contact import SeatedLaw

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class SetProblem:
    """Ball rows of every bearing, joined, with the load on the displacements.

    ``ball_load`` is the size of the largest ball load at rest, N; ``spring``
    adds the floating outer rings as the last displacement, as does a rigid set
    whose loop gives way, which a spring then holds; ``ring_growth`` is
    where the raceways of bearings with fits are looked for, m.
    """

    bearing_set: BearingSet
    rows: list[dict[str, FloatArray]]
    system: BallSystem
    load: FloatArray
    spring: bool
    ball_load: float
    ring_growth: FloatArray


def build_problem(
    bearing_set: BearingSet, speed: float, external: ExternalLoad, temperatures: SetTemperatures
) -> SetProblem:
    """The balls of a set at a speed (rad/s), a load and temperatures."""
    approaches = bearing_set.assembly_approaches()
    middle = float(np.mean([bearing.axial_position for bearing in bearing_set.bearings]))
    shaft_rise = temperatures.shaft - temperatures.assembly
    housing_rise = temperatures.housing - temperatures.assembly
    elastic, growths = _elastic_law(bearing_set, temperatures, speed, external)
    rows, laws = [], []
    for bearing, heat, approach in zip(bearing_set.bearings, temperatures.bearings, approaches, strict=True):
        geometry, sign = bearing.geometry, bearing.orientation
        position = bearing.axial_position - middle
        offset = sign * geometry.ball_diameter * math.sin(geometry.contact_angle)
        inner_place = position + (geometry.groove_curvature_inner - 0.5) * offset
        outer_place = position - (geometry.groove_curvature_outer - 0.5) * offset
        thermal = sign * (
            bearing_set.shaft_expansion * inner_place * shaft_rise
            - bearing_set.housing_expansion * outer_place * housing_rise
        )
        single = external.is_axial
        count = geometry.ball_count
        azimuth = np.zeros(1) if single else 2.0 * np.pi * np.arange(count) / count
        if elastic is None:
            law, growth = _ring_law(bearing_set, bearing, heat, temperatures, speed, external)
            laws.append(law)
            if law is not None:
                growths.append(growth)
        rows.append(
            build_ball_rows(
                geometry, azimuth, float(count) if single else 1.0,
                ring_rise=(heat.inner_ring - temperatures.assembly, heat.outer_ring - temperatures.assembly),
                ball_rise=heat.ball - temperatures.assembly,
                radial_growth=rotation_growth(geometry, speed, bearing_set.shaft_bore_diameter)
                if elastic is None and law is None else 0.0,
                axial_offset=approach + thermal,
                place=(sign, position),
            )
            | {"azimuth": azimuth}
        )  # fmt: skip
    columns = [0] if external.is_axial else [0, 1, 2, 3, 4]
    system = join_rows(
        [{k: v for k, v in row.items() if k != "azimuth"} for row in rows], columns,
        laws if elastic is None else elastic,
    )  # fmt: skip
    load = np.array([external.thrust, external.radial, 0.0, external.moment, 0.0])[columns]
    load = np.append(load, np.zeros(len(growths)))
    spring = bearing_set.preload_kind == "spring" and bearing_set.has_counter_bearings
    gives = not spring and bearing_set.loop_stiffness is not None and bearing_set.has_counter_bearings
    if spring or gives:
        sides = np.repeat([b.orientation for b in bearing_set.bearings], [len(row["weight"]) for row in rows])
        floating = (sides < 0).astype(float)[:, None]
        system = replace(
            system, axial_map=np.hstack([system.axial_map, floating]),
            radial_map=np.hstack([system.radial_map, np.zeros_like(floating)]),
        )  # fmt: skip
        load = np.append(load, bearing_set.preload)
    if gives:
        # What is beyond the preload of assembly presses the loop together.
        held = np.zeros(len(load))
        held[-1] = bearing_set.loop_stiffness
        system = replace(system, stiffness=held)
    return SetProblem(
        bearing_set, rows, system, load, spring, _ball_load(bearing_set, external), np.array(growths)
    )


def _share(bearing_set: BearingSet, bearing: MountedBearing, external: ExternalLoad) -> float:
    """Axial force of a bearing at assembly, N; that of the thrust in a set without preload."""
    beside = sum(1 for other in bearing_set.bearings if other.orientation == bearing.orientation)
    return (bearing_set.preload or abs(external.thrust)) / beside


def _centrifugal(geometry: BearingGeometry, speed: float) -> float:
    """Force of all balls on the outer ring, N; they orbit as in pure rolling."""
    orbital = 0.5 * speed * (1.0 - geometry.diameter_ratio * math.cos(geometry.contact_angle))
    return 0.5 * geometry.ball_count * geometry.ball_mass * geometry.pitch_diameter * orbital**2


def _elastic_law(
    bearing_set: BearingSet, temperatures: SetTemperatures, speed: float, external: ExternalLoad
) -> tuple[SeatedLaw | None, list[float]]:
    """Elastic bodies under the rings of a set as a law, and initial guesses of the growths (m)."""
    seats = bearing_set.seats
    if seats is None:
        return None, []
    thermal = temperatures.shifts
    if thermal is None:
        raise SpecError(
            "temperatures.shifts", "elastic bodies carry the rings.", "Give what temperature does to them."
        )
    # the balls' rows have the raceways of rings that grow by their own temperature
    own = [
        bearing.geometry.thermal_expansion
        * np.array([heat.inner_ring - temperatures.assembly, heat.outer_ring - temperatures.assembly])
        for bearing, heat in zip(bearing_set.bearings, temperatures.bearings, strict=True)
    ]
    thermal = thermal - np.pad(np.array(own) * seats.raceway_radius, ((0, 0), (2, 0)))
    beyond = np.array([_centrifugal(bearing.geometry, speed) for bearing in bearing_set.bearings])
    law = seats.law(thermal, speed, beyond)
    shares = tuple(_share(bearing_set, bearing, external) for bearing in bearing_set.bearings)
    geometries = tuple(bearing.geometry for bearing in bearing_set.bearings)
    radial = [state.radial_force for state in mounted_states(geometries, seats, shares)]
    return law, law.growth(np.array(radial)).tolist()


def _ring_law(
    bearing_set: BearingSet,
    bearing: MountedBearing,
    heat: BearingTemperatures,
    temperatures: SetTemperatures,
    speed: float,
    external: ExternalLoad,
) -> tuple[RingLaw | None, float]:
    """Compliance of the rings of a bearing, and an initial guess of the growth (m); None for rigid rings."""
    if bearing.fits is None:
        return None, 0.0
    rise = FitTemperatures(
        *(
            kelvin - temperatures.assembly
            for kelvin in (
                heat.inner_ring,
                heat.outer_ring,
                temperatures.shaft if heat.shaft_seat is None else heat.shaft_seat,
                temperatures.housing if heat.housing_seat is None else heat.housing_seat,
            )
        )
    )
    geometry = bearing.geometry
    law = seated_rings(geometry, bearing.fits).law(rise, speed, _centrifugal(geometry, speed))
    force = _share(bearing_set, bearing, external)
    radial = mounted_state(geometry, bearing.fits, force).radial_force if force > 0.0 else 0.0
    return law, law.growth(radial)


def _ball_load(bearing_set: BearingSet, external: ExternalLoad) -> float:
    """Size of the largest ball load at rest, N."""
    geometry = bearing_set.bearings[0].geometry
    sine = max(math.sin(geometry.contact_angle), 0.1)
    axial = (bearing_set.preload + abs(external.thrust)) / (geometry.ball_count * sine)
    radial = 5.0 * abs(external.radial) / geometry.ball_count
    tilting = 5.0 * abs(external.moment) / (geometry.ball_count * 0.5 * geometry.pitch_diameter * sine)
    return max(axial, radial, tilting)


def side_by_side(problems: Sequence[SetProblem]) -> BallSystem:
    """Balls of several problems as one system, each with displacements of its own."""
    systems = [problem.system for problem in problems]
    widths = [system.axial_map.shape[1] for system in systems]
    firsts = np.concatenate([[0], np.cumsum(widths)[:-1]])
    arrays = {
        name: np.concatenate([getattr(system, name) for system in systems])
        for name in BallSystem.__slots__
        if name not in ("axial_map", "radial_map", "smoothing", "rings", "stiffness")
    }
    maps = {
        name: scipy.linalg.block_diag(*(getattr(system, name) for system in systems))
        for name in ("axial_map", "radial_map")
    }
    rings = None
    seated = [(first, s.rings) for first, s in zip(firsts, systems, strict=True) if s.rings is not None]
    if seated:
        rings = type(seated[0][1]).joined(seated)
    held = None
    if any(system.stiffness is not None for system in systems):
        held = np.concatenate(
            [
                np.zeros(w) if s.stiffness is None else s.stiffness
                for w, s in zip(widths, systems, strict=True)
            ]
        )
    return BallSystem(**arrays, **maps, rings=rings, stiffness=held)


def start_displacement(problem: SetProblem, where: str) -> FloatArray:
    """Displacements at rest under the axial part of the load."""
    system, load = problem.system, problem.load
    displacement = _unloaded(problem)
    axial = problem.spring or not problem.bearing_set.has_counter_bearings

    def approach_of(side: int, force: float) -> float:
        group = [b.geometry for b in problem.bearing_set.bearings if b.orientation == side]
        return tandem_approach(tuple(group), force) if len(group) else 0.0

    if axial:
        side = 1 if not problem.spring else None
        if problem.spring:
            front = problem.bearing_set.preload + load[0]
            if front < 0.0:
                raise NoEquilibriumError(
                    where, f"thrust {load[0]:g} N lifts the set off its spring of "
                    f"{problem.bearing_set.preload:g} N.", "Raise the preload or lower the thrust.",
                )  # fmt: skip
            offsets = system.start[:, 0] - _free_axial(problem)
            sides = _row_sides(problem)
            displacement[0] = approach_of(1, front) - float(offsets[sides > 0].mean())
            rear = approach_of(-1, problem.bearing_set.preload) - float(offsets[sides < 0].mean())
            displacement[-1] = rear + displacement[0]
        else:
            side = problem.bearing_set.bearings[0].orientation
            if side * load[0] < 0.0:
                raise NoEquilibriumError(
                    where, f"thrust {load[0]:g} N unloads bearings that all face the other way.",
                    "Turn the thrust round, or add a counter bearing.",
                )  # fmt: skip
            group = tuple(b.geometry for b in problem.bearing_set.bearings)
            alpha_free = load[0] == 0.0 and problem.ball_load > 0.0
            approach = -group[0].curvature_centre_distance * math.sin(group[0].contact_angle)
            displacement[0] = side * (approach if alpha_free else tandem_approach(group, abs(load[0])))
    else:
        displacement[0] = _balanced_shift(problem, load[0], where)
    if len(problem.rows[0]["weight"]) > 1 and load[1] != 0.0:
        geometry = problem.bearing_set.bearings[0].geometry
        count = float(system.weight.sum())
        share = 4.37 * abs(load[1]) / (count * math.cos(geometry.contact_angle))
        guess = (share / mean_load_constant(geometry)) ** (2.0 / 3.0)
        loosened = 0.0 if load[0] or problem.bearing_set.preload else 1.0
        displacement[1] = math.copysign(guess * (loosened or 0.3), load[1])
    return displacement


def _unloaded(problem: SetProblem) -> FloatArray:
    """No motion of the shaft; raceways grown as expected."""
    displacement = np.zeros(problem.system.axial_map.shape[1])
    if problem.system.rings is not None:
        displacement[problem.system.rings.columns] = problem.ring_growth
    return displacement


def _free_axial(problem: SetProblem) -> FloatArray:
    """BD sin α_0 of every row, m."""
    values = [b.geometry.curvature_centre_distance * math.sin(b.geometry.contact_angle)
              for b in problem.bearing_set.bearings]  # fmt: skip
    return np.repeat(values, [len(row["weight"]) for row in problem.rows])


def _row_sides(problem: SetProblem) -> NDArray[np.int64]:
    sides = [bearing.orientation for bearing in problem.bearing_set.bearings]
    return np.repeat(sides, [len(row["weight"]) for row in problem.rows])


def _balanced_shift(problem: SetProblem, thrust: float, where: str) -> float:
    """Shaft displacement of a rigid set that balances the thrust at rest, m."""
    system, base = problem.system, _unloaded(problem)
    direction = np.zeros_like(base)
    direction[0] = 1.0

    def excess(shift: float) -> float:
        axial, radial = system.groove_distances(base + direction * shift)
        force = static_evaluation(system, axial, radial).ring_force[:, 0]
        return float(system.axial_map[:, 0] @ (system.weight * force)) - thrust

    if excess(0.0) == 0.0:
        return 0.0
    reach = 1e-6
    largest = 20.0 * float(np.max(system.rest_length))
    while excess(-reach) * excess(reach) > 0.0:
        reach *= 2.0
        if reach > largest:
            raise NoEquilibriumError(
                where, f"thrust {thrust:g} N is more than the set can carry.", "Lower the thrust."
            )
    return bracketed_root(excess, -reach, reach, absolute=1e-15, relative=1e-13)
