"""Network beside elements: node by node, link by link, cause by cause."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from spindle_fem import __version__
from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.errors import BadInputError, GeometryError, SpindleFemError
from spindle_fem.model.lumped.machine_network import MachineNetwork, build_machine_network
from spindle_fem.operation.bearing_heat import HeatModel
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.solvers.coupled_steady import solve_coupled
from spindle_fem.solvers.machine_network_steady import (
    MachineNetworkState,
    network_heat_model,
    solve_machine_network,
)
from spindle_fem.solvers.prepared_machine import PreparedMachine, prepare_machine
from spindle_fem.studies.crosscheck.axisymmetric import solve_axisymmetric
from spindle_fem.studies.crosscheck.causes import CAUSES, CHECKS, CauseStudy, study_causes
from spindle_fem.studies.crosscheck.flux_matched import MatchedNetwork, element_state, match_fluxes
from spindle_fem.studies.crosscheck.gather_fields import gather_axisymmetric, gather_network
from spindle_fem.studies.crosscheck.node_comparison import Comparison, compare
from spindle_fem.studies.crosscheck.paper_claim import applies, check_claim, element_result
from spindle_fem.studies.crosscheck.regions import NodeRegions, build_regions
from spindle_fem.studies.heat_study import usual_speeds
from spindle_fem.units import ZERO_CELSIUS_K

SCHEMA = "spindle-fem/crosscheck/1"
RPM = np.pi / 30.0
# Places among the usual speeds: a sixth, a half and one and a half of the operating speed.
TEST_SPEEDS = (0, 2, 8)
REFINEMENTS = (2, 4, 8)

Progress = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class Crosscheck:
    """Result of a cross-check.

    Attributes
    ----------
    content : dict
        Of ``crosscheck.json``, but for the names of the exported files.
    comparison : Comparison
        Network against elements, node by node.
    study : CauseStudy
        What makes them differ.
    matched : MatchedNetwork
        The network whose conductances were fitted to the elements.
    points : tuple of OperatingPoint
        For which the matched network is exported.
    """

    content: dict[str, Any]
    comparison: Comparison
    study: CauseStudy
    matched: MatchedNetwork
    points: tuple[OperatingPoint, ...]
    heat_model: HeatModel


def crosscheck(spec: MachineSpec, tell: Progress = lambda stage: None) -> Crosscheck:
    """Build the paper's network of a machine, solve it beside the elements, and find why they differ.

    Raises
    ------
    SpindleFemError
        A model that has no solution.
    """
    point = OperatingPoint.of(spec)
    tell("network")
    started = time.perf_counter()
    network = build_machine_network(spec)
    heat_model = network_heat_model(network)
    built = time.perf_counter()
    state = solve_machine_network(network, point, heat_model=heat_model)
    timing = {"network_set_up": built - started, "network_solve": time.perf_counter() - built}
    prepared = prepare_machine(spec, progress=tell)
    tell("solve")
    coupled = solve_coupled(prepared, point)
    tell("compare")
    regions = build_regions(prepared, network)
    comparison = compare(prepared, coupled, state, regions)
    study = study_causes(
        network, state, prepared, coupled, comparison.fem_temperature, heat_model, progress=tell
    )
    tell("convergence")
    convergence = _convergence(network, state, point, heat_model)
    tell("flux matching")
    matched = match_fluxes(network, [element_state(prepared, coupled, point, regions)], heat_model)
    speeds, not_reached = _speeds(prepared, coupled, regions, matched, state, heat_model, tell)
    claim = None
    if applies(spec):
        claim = _claim(spec, prepared, coupled, tell)
    content = {
        "schema": SCHEMA,
        "machine": spec.name,
        "versions": {"spindle_fem": __version__},
        "operating_point": {
            "speed_rpm": point.speed / RPM,
            "thrust_N": point.thrust,
            "ambient_degC": point.ambient_temperature - ZERO_CELSIUS_K,
            "coolant_inlet_degC": point.coolant_inlet_temperature - ZERO_CELSIUS_K,
        },
        "network": _network_json(network, state),
        "fem": {
            "unknowns": int(prepared.operators.n_unknowns),
            "elements": int(prepared.mesh.n_elements),
            "coolant_outlet_degC": _celsius(matched.matched.coolant_outlet),
        },
        "nodes": _nodes_json(comparison, study, regions),
        "links": [
            {
                "link": item.link,
                "kind": item.kind,
                "network_W": item.network,
                "fem_W": item.fem,
                "surface": item.surface,
            }
            for item in comparison.links
        ],
        "summary": _summary(comparison, study),
        "causes": _causes_json(study),
        "convergence": convergence,
        "matched": {
            "speeds": speeds,
            "not_reached": not_reached,
            "heat_W": {name: float(value) for name, value in matched.matched.heat.items()},
            "nodes": matched.n_nodes,
            "links": len(matched.factor),
            "factor_min": float(matched.factor.min()),
            "factor_median": float(np.median(matched.factor)),
            "factor_max": float(matched.factor.max()),
        },
        "claim": claim,
        "timing_s": timing,
    }
    points = tuple(replace(point, speed=speed) for speed in _with(point.speed, usual_speeds(spec)))
    return Crosscheck(content, comparison, study, matched, points, heat_model)


def _network_json(network: MachineNetwork, state: MachineNetworkState) -> dict[str, Any]:
    columns = [{"name": c.name, "z_mm": [1e3 * value for value in c.z]} for c in network.partition.columns]
    return {
        "nodes": network.n_nodes,
        "columns": columns,
        "nodes_a_column": network.n_nodes / len(columns),
        "heat_in_W": state.heat_in,
        "heat_out_W": dict(state.boundary_heat),
        "imbalance_relative": state.imbalance_relative,
        "newton_steps": state.iterations,
        "coolant_outlet_degC": _celsius(state.coolant_outlet),
    }


def _celsius(temperature: float) -> float | None:
    return None if not np.isfinite(temperature) else float(temperature) - ZERO_CELSIUS_K


def _nodes_json(comparison: Comparison, study: CauseStudy, regions: NodeRegions) -> list[dict[str, Any]]:
    rows = []
    machine = comparison.machine
    for i, name in enumerate(machine.node_names):
        cause, share = study.largest(i)
        row = {
            "node": name,
            "network_degC": float(comparison.network_temperature[i]) - ZERO_CELSIUS_K,
            "fem_degC": float(comparison.fem_temperature[i]) - ZERO_CELSIUS_K,
            "difference_K": float(comparison.difference[i]),
            "contributions_K": {key: float(values[i]) for key, values in study.contribution.items()},
            "largest_cause": cause,
            "largest_cause_K": share,
        }
        if i < machine.n_solid:
            row["volume_error_relative"] = float(regions.volume[i] / machine.centres.volume[i] - 1.0)
        rows.append(row)
    return rows


def _summary(comparison: Comparison, study: CauseStudy) -> dict[str, Any]:
    difference = comparison.difference
    worst = int(np.abs(difference).argmax())
    cause, share = study.largest(worst)
    return {
        "max_difference_K": float(np.abs(difference).max()),
        "rms_difference_K": float(np.sqrt(np.mean(difference**2))),
        "worst_node": comparison.machine.node_names[worst],
        "worst_node_cause": cause,
        "worst_node_cause_K": share,
    }


def _causes_json(study: CauseStudy) -> list[dict[str, Any]]:
    rows = [(key, values, "step", CAUSES) for key, values in study.contribution.items()]
    rows += [(key, values, "check", CHECKS) for key, values in study.check.items()]
    return [
        {
            "cause": key,
            "kind": kind,
            "meaning": titles[key],
            "max_K": float(np.abs(values).max()),
            "rms_K": float(np.sqrt(np.mean(values**2))),
        }
        for key, values, kind, titles in rows
    ]


def _convergence(
    network: MachineNetwork, state: MachineNetworkState, point: OperatingPoint, heat_model: HeatModel
) -> dict[str, Any]:
    """Networks of growing refinement against the axisymmetric elements on the finest one's cells."""
    states = {
        n: solve_machine_network(
            build_machine_network(network.spec, refinement=n, assembly=network.assembly),
            point,
            heat_model=heat_model,
        )
        for n in REFINEMENTS
    }
    finest = states[REFINEMENTS[-1]]
    elements = solve_axisymmetric(finest)
    reference = gather_axisymmetric(network, finest.network.machine, elements)
    rows = [
        {
            "refinement": 1,
            "nodes": network.n_nodes,
            "max_difference_K": _largest(state.temperature, reference),
        }
    ]
    for n, refined in states.items():
        rows.append(
            {
                "refinement": n,
                "nodes": refined.network.machine.n_nodes,
                "max_difference_K": _largest(gather_network(network, refined), reference),
            }
        )
    return {"axisymmetric_unknowns": int(elements.n_unknowns), "rows": rows}


def _largest(one: np.ndarray, other: np.ndarray) -> float:
    return float(np.abs(one - other).max())


def _speeds(
    prepared: PreparedMachine,
    coupled: Any,
    regions: NodeRegions,
    matched: MatchedNetwork,
    state: MachineNetworkState,
    heat_model: HeatModel,
    tell: Progress,
) -> tuple[list[dict[str, float]], list[dict[str, Any]]]:
    """Both networks against the elements at speeds that were not fitted; and speeds without a state."""
    point, n = matched.matched.point, matched.n_nodes
    usual = usual_speeds(prepared.spec)
    rows, not_reached = [], []
    for speed in _with(point.speed, [usual[place] for place in TEST_SPEEDS if place < len(usual)]):
        if speed == point.speed:
            own, plain = matched.matched, state
        else:
            tell(f"elements at {speed / RPM:.0f} rpm")
            at = replace(point, speed=speed)
            try:
                own = element_state(
                    prepared, solve_coupled(prepared, at, coupled.solution.temperature), at, regions
                )
                plain = solve_machine_network(state.network.machine, at, heat_model=heat_model)
            except SpindleFemError as error:
                not_reached.append({"speed_rpm": speed / RPM, "reason": str(error)})
                continue
        moving = matched.steady(own.point, own.heat, matched.conductance(own.point, heat_model))
        rows.append(
            {
                "speed_rpm": speed / RPM,
                "matched_max_K": _largest(moving, own.temperature[:n]),
                "fixed_max_K": _largest(matched.steady(own.point, own.heat), own.temperature[:n]),
                "unmatched_max_K": _largest(plain.temperature[:n], own.temperature[:n]),
            }
        )
    return rows, not_reached


def _with(own: float, speeds: Sequence[float]) -> list[float]:
    """Speeds and a machine's own one, in order; one that differs by rounding only is the own one."""
    return sorted({own, *(speed for speed in speeds if abs(speed - own) > 1.0e-6 * own)})


def _claim(spec: MachineSpec, prepared: PreparedMachine, coupled: Any, tell: Progress) -> Mapping[str, Any]:
    try:
        return check_claim(spec, element_result("base", prepared, coupled), progress=tell)
    except (GeometryError, BadInputError) as error:
        return {"not_possible": f"The machine has no such design: {error}"}
