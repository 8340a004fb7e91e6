"""An operating point held against what its machine can take, before anything is solved."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

from spindle_fem.definition.bearing_types import RollerBearingType
from spindle_fem.definition.lubrication_tables import LubricationFilm
from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.definition.stream_films import StreamFilm
from spindle_fem.errors import SpecError, raise_all
from spindle_fem.operation.circuits import stream_fluid
from spindle_fem.operation.radial_loads import radial_loads
from spindle_fem.physics.bearings.bearing_kinds import BEARING_KINDS
from spindle_fem.physics.bearings.highest_speed import too_fast
from spindle_fem.physics.coolant.properties import coolant_by_name
from spindle_fem.units import ZERO_CELSIUS_K
from spindle_fem.validity import PLAUSIBLE_KELVIN, CodedWarning, fold_warnings


def require_possible_operation(spec: MachineSpec) -> None:
    """Refuse what no such machine runs at.

    Raises
    ------
    SpecError or FaultsError
        A speed that no rolling bearing of these diameters reaches, air that no sensor on a machine reads, a
        coolant beyond its known properties.
    """
    raise_all(spec.name, list(_faults(spec)))


def require_possible_speeds(spec: MachineSpec, speeds: Iterable[float], where: str) -> None:
    """Refuse speeds [rad/s] that no rolling bearing of the machine reaches; ``where`` names what gave them.

    Raises
    ------
    SpecError
    """
    for speed in speeds:
        reason = too_fast(spec, speed)
        if reason is not None:
            raise SpecError(where, f"{speed * 30.0 / math.pi:.0f} rpm.", reason)


def require_seated_balls(spec: MachineSpec) -> None:
    """Refuse ball bearings that nothing presses on as the machine turns.

    All of a set may face one way, or thrust towards the nose may be more than the spring of a set.

    Raises
    ------
    SpecError or FaultsError
    """
    # A definition with other faults may lack tables.
    if spec.heat is None or spec.heat.model == "table" or spec.operation is None or not spec.operation.speed:
        return
    across, faults = radial_loads(spec), []
    for group in spec.bearing_set:
        if not group.faces_one_way:
            force = spec.axial_load(group, spec.operation.thrust)
            if group.is_sprung and force < -group.preload:
                what = f"{group.preload:g} N of its spring are lifted off by {-force:g} N towards the nose."
                fix = f"Allowed: above {-force:g} N, or less thrust (operation.thrust)."
                faults.append(SpecError(f"bearing_set.{group.name}.preload", what, fix))
            continue
        takes = group.bearing[0].takes_thrust
        force = spec.axial_load(group, spec.operation.thrust)
        if across[group.name] == 0.0 and not (force if takes == "towards_rear" else -force) > 0.0:
            what = (
                f'its bearings all take thrust "{takes}", and nothing presses them on: thrust and springs '
                f"of other sets leave {force:g} N."
            )
            fix = (
                "Allowed: bearings of both directions with a preload, or the springs of a set that faces the "
                'other way (preload_kind = "spring").'
            )
            faults.append(SpecError(f"bearing_set.{group.name}.preload", what, fix))
    raise_all(spec.name, faults)


def lost_to_air(spec: MachineSpec) -> tuple[CodedWarning, ...]:
    """Warning of a machine whose standing surfaces all lose no heat to its surroundings."""
    standing = {part.name for part in spec.part if not part.rotating}
    cooled = {
        name
        for film in spec.film
        if not (film.kind == "constant" and film.coefficient.value == 0.0)
        for name in film.surface
    }
    if any(surface.name in cooled and surface.part in standing for surface in spec.surface):
        return ()
    text = (
        "No surface of a standing part loses heat by a [[film]]: all of it leaves by coolants and rotating "
        'parts. surroundings = "workshop" gives the outer surfaces one.'
    )
    return (CodedWarning("no_heat_to_air", text),)


def operation_warnings(spec: MachineSpec, speed: float) -> tuple[CodedWarning, ...]:
    """Warnings of a load that no heat follows and of a speed [rad/s] outside the machine's range."""
    return (*_unused_load(spec), *_outside_range(spec, speed))


def _outside_range(spec: MachineSpec, speed: float) -> tuple[CodedWarning, ...]:
    low, high = spec.operation.speed_range or (0.0, math.inf)
    # At rest every machine may stand.
    if not speed or low * (1.0 - 1e-9) <= speed <= high * (1.0 + 1e-9):
        return ()
    rpm = [value * 30.0 / math.pi for value in (speed, low, high)]
    text = f"{rpm[0]:.0f} rpm lie outside operation.speed_range, {rpm[1]:.0f} to {rpm[2]:.0f} rpm."
    return (CodedWarning("speed_outside_range", text),)


def _unused_load(spec: MachineSpec) -> tuple[CodedWarning, ...]:
    if spec.operation.load_torque is None or any(source.follows_torque for source in spec.source):
        return ()
    key = "torque" if spec.operation.power is None else "power"
    text = (
        f"operation.{key} has no user: no [[source]] follows the torque of the drive, by a copper_loss or "
        "by a table with torque."
    )
    return (CodedWarning("load_unused", text),)


def speeds_beyond_catalogues(spec: MachineSpec, speed: float) -> tuple[CodedWarning, ...]:
    """Warning of bearings that are faster at a speed [rad/s] than a catalogue allows single ones to be.

    Balls or rollers of another material than the rings' are left out: catalogues allow them more.
    """
    found = []
    rpm = speed * 30.0 / math.pi
    for group, bearing in spec.bearings:
        kind = spec.bearing_types[group.type_name(bearing)]
        rollers = isinstance(kind, RollerBearingType)
        limits = BEARING_KINDS[kind.kind].attainable_speeds
        if limits is None or (kind.roller_material if rollers else kind.ball_material) != kind.ring_material:
            continue
        lubricant = "grease" if group.lubrication is None else "oil"
        limit = limits.at(0.0 if rollers else kind.contact_angle, lubricant)
        reached = 1e3 * kind.pitch * rpm
        if reached > limit:
            text = (
                f"{bearing.name}: speed times pitch diameter is {reached / 1e6:.2f}e6 rpm mm; a catalogue "
                f"allows single bearings of its kind {limit / 1e6:.2f}e6 in {lubricant} ({limits.source})."
            )
            found.append(CodedWarning("speed_above_catalogue", text))
    return fold_warnings(found, {bearing.name for _, bearing in spec.bearings})


def _faults(spec: MachineSpec) -> Iterator[SpecError]:
    # A definition with other faults may lack tables.
    operation = spec.operation
    speeds = {"speed": [operation.speed], "speed_range": operation.speed_range or ()} if operation else {}
    for key, given in speeds.items():
        try:
            require_possible_speeds(spec, given, f"operation.{key}")
        except SpecError as fault:
            yield fault
    low, high = PLAUSIBLE_KELVIN
    if spec.operation and not low <= spec.operation.ambient_temperature <= high:
        yield SpecError(
            "operation.ambient_temperature",
            f"{spec.operation.ambient_temperature - ZERO_CELSIUS_K:.4g} °C.",
            f"No machine stands in air outside {low - ZERO_CELSIUS_K:.4g} to {high - ZERO_CELSIUS_K:.4g} °C; "
            "is the unit right?",
        )
    inlets = {}
    if spec.coolant is not None:
        inlets["coolant"] = coolant_by_name(spec.coolant.fluid), spec.coolant.inlet_temperature
    for film in spec.circuits:
        inlets[_table_of(spec, film)] = stream_fluid(film), film.inlet_temperature
    for table, (fluid, inlet) in inlets.items():
        low, high = fluid.lowest_temperature, fluid.highest_temperature
        if not low <= inlet <= high:
            yield SpecError(
                f"{table}.inlet_temperature",
                f"{inlet - ZERO_CELSIUS_K:.4g} °C.",
                f"Properties of {fluid.name} are known from {low - ZERO_CELSIUS_K:.4g} to "
                f"{high - ZERO_CELSIUS_K:.4g} °C.",
            )


def _table_of(spec: MachineSpec, film: StreamFilm) -> str:
    """Where a file writes a stream: streams through the bearings of one set are written once."""
    if not isinstance(film, LubricationFilm):
        return f"film.{film.name}"
    group = next(group for group, bearing in spec.bearings if bearing.name == film.bearing)
    return f"bearing_set.{group.name}.lubrication"
