"""What the balls' wetting, where a machine does not give it, leaves open of its inner rings."""

from __future__ import annotations

from dataclasses import replace

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.errors import SpindleFemError
from spindle_fem.model.lumped.machine_network import build_machine_network
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.results.thermal_result import ThermalResult
from spindle_fem.solvers.machine_network_steady import solve_machine_network
from spindle_fem.validity import CodedWarning, by_consequence

# K of an inner ring from which the range is told.
TOLD_FROM = 2.0


def with_wetting_range(result: ThermalResult) -> ThermalResult:
    """The result with a warning of the range of inner rings; itself where wetting is given or says little.

    The ends are contacts alone and balls wetted all round, by the machine's own network: its change is
    added to the rings of the result. Published formulas of the heat from ring to ring lie on both sides of
    the share that is taken (Jungnickel 2010 below, Schäfer 1993 above).
    """
    spec = result.spec
    rows = [bearing.name for group, bearing in spec.bearings if group.lubrication is None]
    if not rows or spec.grease is None or spec.grease.wetted_share is not None:
        return result
    try:
        own, all_round, alone = (_inner_rings(spec, share) for share in (None, 1.0, 0.0))
    except SpindleFemError as error:
        text = f"{_assumed(spec)} Rings of balls wetted less or more could not be worked out: {error}"
        return _with(result, text)
    spans = []
    for name in rows:
        changes = [end[name] - own[name] for end in (all_round, alone)]
        if max(map(abs, changes)) > TOLD_FROM:
            ring = result.bearings[name].temperature_inner - 273.15
            low, high = (ring + end(changes) for end in (min, max))
            spans.append(f"{name} {low:.0f} to {high:.0f} °C (here {ring:.0f})")
    if not spans:
        return result
    told = f"From balls wetted all round to contacts alone, inner rings are: {', '.join(spans)}."
    return _with(result, f"{_assumed(spec)} {told}")


def _assumed(spec: MachineSpec) -> str:
    share = spec.grease.free_volume_fill
    return (
        f"How far grease wets the balls is not given (grease.wetted_share); {100.0 * share:.0f} % is taken."
    )


def _with(result: ThermalResult, text: str) -> ThermalResult:
    said = CodedWarning("wetting_assumed", text)
    return replace(result, warnings=by_consequence((*result.warnings, said)))


def _inner_rings(spec: MachineSpec, share: float | None) -> dict[str, float]:
    if share is not None:
        grease = spec.grease.model_copy(update={"wetted_share": share})
        spec = spec.model_copy(update={"grease": grease})
    state = solve_machine_network(build_machine_network(spec), OperatingPoint.of(spec))
    return {name: item.inner for name, item in state.bearing_temperatures().items()}
