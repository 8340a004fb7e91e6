"""Margin of a running machine to the end of its thermal equilibria, and contacts at risk of fatigue."""

from __future__ import annotations

import math

from spindle_fem.definition.machine_spec import Lubrication, MachineSpec
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.operation.sliding_rings import stuck_rings
from spindle_fem.results.thermal_result import BearingResult, Equilibrium
from spindle_fem.solvers.coupled_steady import CoupledState
from spindle_fem.solvers.preload_runaway import equilibria_above
from spindle_fem.solvers.prepared_machine import PreparedMachine
from spindle_fem.validity import CodedWarning

# Pa; contact pressure below which bearing steel does not tire (ISO 281:2007, 9.3.3.1).
FATIGUE_PRESSURE = 1.5e9
# Equilibria are followed up to this multiple of the running speed, or to the end of the machine's range.
SEARCHED_RANGE = 1.5


def equilibrium_of(
    machine: PreparedMachine,
    point: OperatingPoint,
    coupled: CoupledState,
    bearings: dict[str, BearingResult],
    *,
    search: bool,
) -> Equilibrium | None:
    """Preload, fold and limits of a solved state; None without preloaded bearings.

    Parameters
    ----------
    search : bool
        Whether to look for the fold: up to half as fast again, or to the end of the machine's range of
        speeds where that is further.
    """
    spec = machine.spec
    assembled = assembled_preloads(spec)
    if not assembled or not all(math.isfinite(bearings[name].preload) for name in assembled):
        return None
    fold = searched = None
    limits = _limits(spec, coupled, bearings)
    if search and spec.follows_preload and point.speed > 0.0:
        end = max(SEARCHED_RANGE * point.speed, *(spec.operation.speed_range or (0.0,)))
        branch = equilibria_above(machine, point, end, coupled.loads, coupled.solution)
        searched = branch.limit
        if branch.end == "fold":
            fold = branch.limit
            if branch.reason:
                limits.append(
                    f"The end at {fold * 30.0 / math.pi:.0f} rpm is that of films, oil and joints of this "
                    f"state: {branch.reason}"
                )
        elif branch.end == "refused":
            limits.append(
                f"From {branch.limit * 30.0 / math.pi:.0f} rpm on there is no state: {branch.reason}"
            )
    ratios = {name: bearings[name].preload / force for name, force in assembled.items()}
    return Equilibrium(spec.follows_preload, ratios, fold, searched, tuple(limits))


def assembled_preloads(spec: MachineSpec) -> dict[str, float]:
    """Axial force of every bearing of a preloaded set at assembly, N: those that face one way share it."""
    return {
        bearing.name: group.preload / sum(b.takes_thrust == bearing.takes_thrust for b in group.bearing)
        for group in spec.bearing_set
        if group.preload > 0.0
        for bearing in group.bearing
    }


def contact_warnings(coupled: CoupledState) -> list[CodedWarning]:
    """Contacts that tire, and inner rings that have come loose."""
    found = []
    for name, heat in coupled.loads.bearing_heat.items():
        if heat.contact_pressure > FATIGUE_PRESSURE:
            text = (
                f"{name}: contact pressure {heat.contact_pressure / 1e9:.2f} GPa, above the "
                f"{FATIGUE_PRESSURE / 1e9:g} GPa that bearing steel bears without tiring."
            )
            found.append(CodedWarning("contact_pressure", text))
        if heat.seat_pressure is not None and heat.seat_pressure[0] == 0.0:
            text = f"{name}: the inner ring has lost its interference on the shaft."
            found.append(CodedWarning("seat_loose", text))
    return found


def sliding_warnings(machine: PreparedMachine, coupled: CoupledState) -> list[CodedWarning]:
    """Outer rings that are to slide in the housing and that friction holds."""
    if machine.growth is None:
        return []
    heats = coupled.loads.bearing_heat
    pressing = {
        seat.bearing: (heats[seat.bearing].seat_pressure[1], seat.face.area)
        for seat in machine.growth.bodies.seats
        if not seat.is_inner and heats[seat.bearing].seat_pressure is not None
    }
    groups = (group for group in machine.spec.bearing_set if group.fit is not None)
    return [warning for group in groups for warning in stuck_rings(group, pressing)]


def _limits(spec: MachineSpec, coupled: CoupledState, bearings: dict[str, BearingResult]) -> list[str]:
    found = [warning.text for warning in contact_warnings(coupled)]
    lubricants = {bearing.name: spec.lubricant_of(group) for group, bearing in spec.bearings}
    for name in coupled.loads.bearing_heat:
        lubricant = lubricants[name]
        word = "oil" if isinstance(lubricant, Lubrication) else "grease"
        hottest = bearings[name].lubricant_temperature(word)
        if lubricant is not None and hottest > lubricant.temperature_limit:
            limit = lubricant.temperature_limit - 273.15
            found.append(f"{name}: {word} at {hottest - 273.15:.1f} °C, above its {limit:.1f} °C.")
    return found
