"""Solve a machine from its definition to a checked result, as ``spindle-fem run`` does."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from spindle_fem.definition.load import load_machine
from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.errors import NoEquilibriumError, OutOfValidityError
from spindle_fem.machine.geometry.assembly import build_assembly
from spindle_fem.model.mesh.evaluate import probe_matrix, temperature_at_nodes
from spindle_fem.operation.bearing_heat import BearingMechanics, BearingTemperatures
from spindle_fem.operation.circuits import stream_answer
from spindle_fem.operation.driven_flow import channel_warnings
from spindle_fem.operation.open_gaps import heated_gaps_without_exchange
from spindle_fem.operation.operating_limits import lost_to_air, operation_warnings, speeds_beyond_catalogues
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.results.thermal_result import (
    BearingResult,
    CircuitResult,
    CoolantResult,
    EnergyBalance,
    ThermalResult,
)
from spindle_fem.solvers.coupled_steady import (
    FIELD_TOLERANCE,
    LINEAR_RESIDUAL_LIMIT,
    CoupledState,
    circuit_mismatch,
    circuit_outlets,
    coolant_mismatch,
    solve_coupled,
)
from spindle_fem.solvers.prepared_machine import Clock, PreparedMachine, Progress, prepare_machine
from spindle_fem.studies import run_checks as checks
from spindle_fem.studies.machine_equilibrium import contact_warnings, equilibrium_of, sliding_warnings
from spindle_fem.validity import CodedWarning, by_consequence, fold_warnings

# Between the element sizes of the two meshes of an estimate.
REFINEMENT_RATIO = 1.5
# Highest over lowest film of the correlations from which a result says so.
WIDEST_BAND = 3.0


def solve(
    machine: MachineSpec | str | Path,
    point: OperatingPoint | None = None,
    *,
    progress: Progress = lambda stage: None,
) -> ThermalResult:
    """Steady temperatures of a machine, with its self-checks.

    Parameters
    ----------
    machine : MachineSpec, str or Path
        Loaded, or its file, or the name of one that ships.
    point : OperatingPoint, optional
        The definition's own by default.
    progress : callable
        Called with the name of each stage as it begins.

    Returns
    -------
    ThermalResult
        :func:`spindle_fem.studies.run_checks.require_checks` raises on a check that failed.

    Raises
    ------
    GeometryError, MeshQualityError, NoSteadyStateError, ConvergenceError, EnergyBalanceError
    """
    spec = machine if isinstance(machine, MachineSpec) else load_machine(machine)
    return solve_prepared(prepare_machine(spec, progress=progress), point, progress=progress)


def solve_prepared(
    machine: PreparedMachine,
    point: OperatingPoint | None = None,
    *,
    progress: Progress = lambda stage: None,
    find_fold: bool = False,
    solved: Callable[[ThermalResult], None] = lambda result: None,
) -> ThermalResult:
    """Steady temperatures of a prepared machine; see :func:`solve`.

    Parameters
    ----------
    find_fold : bool
        Whether to look for the speed at which a preload that is followed runs away.
    solved : callable
        Called with the result before that speed is looked for.
    """
    clock = Clock(progress)
    clock.begin("solve")
    point = point or OperatingPoint.of(machine.spec)
    beyond = None
    if machine.spec.effects:
        # loaded where needed: what effects read brings the fast model and recordings along
        from spindle_fem.model.reduced.defined_effects import physics_of
        from spindle_fem.solvers.mesh_terms import steady_physics, with_factors

        machine, physics = with_factors(machine, physics_of(machine))
        beyond = steady_physics(machine, physics)
    coupled = solve_coupled(machine, point, beyond=beyond)
    clock.begin("evaluate")
    result = replace(_build_result(machine, point, coupled), growth_model=machine.growth)
    solved(result)
    equilibrium = equilibrium_of(machine, point, coupled, result.bearings, search=find_fold)
    result = replace(result, equilibrium=equilibrium)
    clock.end()
    return result.with_timings({**machine.timings, **clock.timings})


def _build_result(machine: PreparedMachine, point: OperatingPoint, coupled: CoupledState) -> ThermalResult:
    spec, operators, solution = machine.spec, machine.operators, coupled.solution
    nodes = temperature_at_nodes(operators, solution.temperature)
    hottest = int(np.argmax(nodes))
    balance = solution.balance
    energy = EnergyBalance(
        heat_in=balance.total_in, heat_in_by=dict(balance.heat_in), heat_out=dict(balance.films)
    )
    lumped = dict(zip(solution.problem.lumped_names, solution.lumped_temperature.tolist(), strict=True))
    around = machine.builder.bearing_temperatures(machine.field_state(solution.temperature, lumped))
    bearings = _bearings(coupled, around)
    coolant = _coolant(machine, point, coupled)
    coldest = min([point.coldest, *(film.inlet_temperature for film in spec.circuits)])
    area_error, volume_error = operators.area_error(), operators.volume_error()
    warnings = [CodedWarning("mesh_note", note) for note in machine.mesh.notes]
    warnings += [CodedWarning("geometry_note", note) for note in machine.geometry_notes]
    warnings += coupled.loads.warnings
    done = [
        checks.check_energy(energy),
        checks.check_measures("areas", area_error),
        checks.check_measures("volumes", volume_error),
        checks.check_coldest(float(nodes.min()), coldest),
        checks.check_residual(solution.residual, LINEAR_RESIDUAL_LIMIT),
        checks.check_closing_shift(solution.closing_shift),
        checks.check_fixed_point(
            coupled.change, FIELD_TOLERANCE * max(1.0, float(nodes.max()) - point.coldest), coupled.iterations
        ),
    ]
    if coupled.coolant is not None:
        done.append(checks.check_coolant(coolant_mismatch(machine, solution, coupled.coolant)))
    circuits = _circuits(machine, point, coupled)
    if circuits:
        done.append(checks.check_circuits(circuit_mismatch(machine, solution, coupled.loads)))
    if coolant is not None:
        warnings += channel_warnings(spec, coolant.flow, coolant.pressure_drop)
        warnings += _uncertain_film(coolant)
    warnings += [
        *lost_to_air(spec),
        *operation_warnings(spec, point.speed),
        *(heated_gaps_without_exchange(spec, build_assembly(spec)) if spec.source else ()),
        *speeds_beyond_catalogues(spec, point.speed),
        *_omitted_preload(spec, point, coupled, around),
        *fold_warnings(contact_warnings(coupled), bearings),
        *sliding_warnings(machine, coupled),
    ]
    for lubricant in _lubricants(spec, bearings):
        done.append(lubricant)
        if not lubricant.passed:
            word = lubricant.name.partition(" ")[0]
            reached, limit = f"{lubricant.value:.1f} °C", f"{lubricant.limit:.1f} °C"
            text = f"{word.capitalize()} reaches {reached}, its limit is {limit}."
            warnings.append(CodedWarning(f"{word}_temperature", text))
    films = coupled.loads.films
    return ThermalResult(
        spec=spec,
        speed=point.speed,
        mesh=machine.mesh,
        order=operators.order,
        n_unknowns=operators.n_unknowns,
        temperature=nodes,
        air_temperature={name: value for name, value in lumped.items() if ".balls" not in name},
        film_coefficient={name: film.coefficient for name, film in films.items()},
        fluid_temperature={name: film.temperature for name, film in films.items()},
        bearings=bearings,
        bearing_temperatures=around,
        coolant=coolant,
        circuits=circuits,
        probes=_probes(machine, coupled, coolant, circuits),
        energy=energy,
        heat_flows=dict(balance.joints),
        area_error_relative=area_error,
        volume_error_relative=volume_error,
        temperature_minimum=float(nodes.min()),
        temperature_maximum=float(nodes[hottest]),
        temperature_maximum_at=machine.mesh.points[hottest].copy(),
        checks=tuple(done),
        warnings=by_consequence(warnings),
        iterations={"coupling": coupled.iterations, "linear": solution.iterations},
        timings={},
    )


def _bearings(coupled: CoupledState, around: Mapping[str, BearingTemperatures]) -> dict[str, BearingResult]:
    found = {}
    for name, temperatures in around.items():
        heat = coupled.loads.bearing_heat[name]
        found[name] = BearingResult(
            heat=heat.total,
            terms=dict(heat.terms),
            heat_to=dict(coupled.loads.heat_to[name]),
            temperature_inner=temperatures.inner,
            temperature_outer=temperatures.outer,
            temperature_ball=temperatures.ball,
            contact_angle_inner=heat.contact_angle_inner,
            contact_angle_outer=heat.contact_angle_outer,
            preload=heat.preload,
            film_thickness=heat.film_thickness,
            film_thickness_ratio=heat.film_thickness_ratio,
            contact_pressure=heat.contact_pressure,
            axial_load=heat.axial_load,
            axial_stiffness=heat.axial_stiffness,
            ball_forces=heat.ball_forces,
        )
    return found


def _omitted_preload(
    spec: MachineSpec,
    point: OperatingPoint,
    coupled: CoupledState,
    temperatures: Mapping[str, BearingTemperatures],
) -> list[CodedWarning]:
    """Warn of the preload change that the solved temperatures would cause where it is not modelled."""
    if spec.follows_preload or spec.heat.model == "table" or not spec.bearing_set:
        return []
    hint = "heat.thermal_preload = true follows it."
    try:
        states = BearingMechanics(spec).states(point, temperatures, expand=True)
    except (NoEquilibriumError, OutOfValidityError) as error:
        text = f"Thermal expansion is left out; with it there would be no equilibrium here ({error}). {hint}"
        return [CodedWarning("thermal_preload_omitted", text)]
    cold = coupled.loads.bearing_heat
    # Bearings of a set grow by the same preload, to rounding: of equals the one that heats most is named.
    grown = {
        key: round(state.preload - cold[key].preload, 3)
        for key, state in states.items()
        if math.isfinite(state.preload) and math.isfinite(cold[key].preload)
    }
    if not grown:
        return []
    name = max(grown, key=lambda key: (grown[key], states[key].heat.total))
    if not states[name].preload > 1.1 * cold[name].preload:
        return []
    factors = {bearing.name: group.heat_factor.value for group, bearing in spec.bearings}
    text = (
        f"Thermal expansion is left out: at these temperatures the preload of {name} would be "
        f"{states[name].preload:.0f} N instead of {cold[name].preload:.0f} N, its friction heat "
        f"{factors[name] * states[name].heat.total:.0f} W instead of {cold[name].total:.0f} W. {hint}"
    )
    return [CodedWarning("thermal_preload_omitted", text)]


def _coolant(machine: PreparedMachine, point: OperatingPoint, coupled: CoupledState) -> CoolantResult | None:
    if coupled.coolant is None:
        return None
    state, loop, cells = coupled.coolant, machine.builder.coolant_loop, machine.builder.cells
    march, section = state.march, loop.section
    at_inlet = loop.coolant.properties(point.coolant_inlet_temperature)
    velocity = section.velocity(point.coolant_flow)
    area = cells.cell_area
    field = machine.field_state(coupled.solution.temperature, {})
    wall = machine.builder.wall_temperature(field)
    regimes = np.atleast_1d(march.film.regime).ravel()
    order = ("laminar", "transition", "turbulent")

    def mean(values: np.ndarray) -> float:
        # Average over the channel itself; the short ports have a film of their own.
        wall = area[:, ~cells.is_port]
        return float((values[:, ~cells.is_port] * wall).sum() / wall.sum())

    return CoolantResult(
        flow=point.coolant_flow,
        asked_flow=machine.spec.coolant.flow,
        inlet_temperature=point.coolant_inlet_temperature,
        outlet_temperature=march.march.mixed_outlet_temperature,
        heat=march.march.enthalpy_rise,
        reynolds=velocity * section.hydraulic_diameter / float(at_inlet.kinematic_viscosity),
        prandtl=float(at_inlet.prandtl),
        velocity=velocity,
        regime=max(regimes.tolist(), key=order.index),
        source=march.film.source,
        in_range=bool(np.all(march.film.in_range)),
        pressure_drop=state.pressure.total,
        ports_pressure_drop=state.pressure.ports,
        pumping_power=state.pressure.pumping_power,
        hydraulic_diameter=section.hydraulic_diameter,
        length=section.length,
        wetted_area=float(area.sum()),
        position=cells.position,
        angle=cells.angle,
        bulk_temperature=np.atleast_2d(march.march.bulk_temperature)[0],
        wall_temperature=wall[0],
        film_coefficient=state.film_coefficient[0],
        film_low=state.film_low[0],
        film_high=state.film_high[0],
        mean_film_coefficient=mean(state.film_coefficient),
        mean_film_low=mean(state.film_low),
        mean_film_high=mean(state.film_high),
    )


def _uncertain_film(coolant: CoolantResult) -> Iterator[CodedWarning]:
    """Warning of a film whose correlations lie so far apart that the walls' temperature does too."""
    low, high = coolant.mean_film_low, coolant.mean_film_high
    if not 0.0 < WIDEST_BAND * low < high:
        return
    flux = coolant.heat / coolant.wetted_area
    above = f"{flux / coolant.mean_film_coefficient:.2g} K above the coolant"
    text = (
        f"Correlations of the channel's film differ {high / low:.2g}-fold, {low:.0f} to {high:.0f} W/(m²·K): "
        f"its walls are {above} with the {coolant.mean_film_coefficient:.0f} W/(m²·K) taken, "
        f"{flux / high:.2g} to {flux / low:.2g} K with the others."
    )
    yield CodedWarning("film_uncertain", text)


def _lubricants(spec: MachineSpec, bearings: Mapping[str, BearingResult]) -> Iterator[checks.Check]:
    """Warmest of the bearings in grease, and of those in oil of each limit."""
    warmest: dict[tuple[str, float], dict[str, float]] = {}
    for group, bearing in spec.bearings:
        lubricant = spec.lubricant_of(group)
        if lubricant is not None and bearing.name in bearings:
            found = bearings[bearing.name]
            word = "grease" if group.lubrication is None else "oil"
            own = warmest.setdefault((word, lubricant.temperature_limit), {})
            own[bearing.name] = found.lubricant_temperature(word)
    for (word, limit), temperatures in warmest.items():
        yield checks.check_lubricant(word, temperatures, limit)


def _circuits(
    machine: PreparedMachine, point: OperatingPoint, coupled: CoupledState
) -> dict[str, CircuitResult]:
    """Flow, heat and film of every stream beside the channel."""
    found = {}
    outlets = circuit_outlets(machine, coupled.solution, coupled.loads)
    for film in machine.spec.circuits:
        answer = stream_answer(film, point.speed)
        areas = {name: float(machine.builder.facet_area[name].sum()) for name in film.surface}
        films = {name: float(coupled.loads.films[name].coefficient.mean()) for name in film.surface}
        found[film.name] = CircuitResult(
            flow=answer.volume_flow,
            inlet_temperature=film.inlet_temperature,
            outlet_temperature=outlets[film.name],
            heat=float(sum(coupled.solution.balance.films[name] for name in film.surface)),
            reynolds=answer.reynolds,
            prandtl=answer.prandtl,
            velocity=answer.velocity,
            regime=answer.regime,
            source=answer.source,
            film_coefficient=sum(films[name] * areas[name] for name in areas) / sum(areas.values()),
            pressure_drop=answer.pressure_drop,
            wetted_area=sum(areas.values()),
        )
    return found


def _probes(
    machine: PreparedMachine,
    coupled: CoupledState,
    coolant: CoolantResult | None,
    circuits: Mapping[str, CircuitResult],
) -> dict[str, float]:
    points = [probe for probe in machine.spec.probe if probe.kind == "point"]
    readings: dict[str, float] = {}
    if points:
        places = [
            (-probe.r * np.sin(probe.angle), probe.r * np.cos(probe.angle), probe.z) for probe in points
        ]
        rows = probe_matrix(machine.operators, places, [probe.part for probe in points])
        values = rows @ coupled.solution.temperature
        readings = {probe.name: float(value) for probe, value in zip(points, values, strict=True)}
    for probe in machine.spec.probe:
        if probe.kind == "coolant_outlet":
            readings[probe.name] = coolant.outlet_temperature
        elif probe.kind == "circuit_outlet":
            readings[probe.name] = circuits[probe.circuit].outlet_temperature
    return {probe.name: readings[probe.name] for probe in machine.spec.probe}


def estimate_refinement(result: ThermalResult, spec: MachineSpec) -> ThermalResult:
    """Add what the probes and the hottest point change by on a second mesh.

    The second mesh is coarser, or finer where the preset is the coarsest already.

    Returns
    -------
    ThermalResult
        With ``mesh_refinement`` in ``extra``: the nodes of both, the change of
        each probe in K, and ``estimate_K``, the error of this result when
        errors fall with the power ``order + 1`` of the element size.
    """
    coarser = spec.mesh.preset != "coarse"
    factor = spec.mesh.size_factor * (REFINEMENT_RATIO if coarser else 1.0 / REFINEMENT_RATIO)
    second = solve_prepared(prepare_machine(spec, size_factor=factor))
    change = {name: value - second.probes[name] for name, value in result.probes.items()}
    change["hottest"] = result.temperature_maximum - second.temperature_maximum
    power = REFINEMENT_RATIO ** (spec.mesh.order + 1)
    # A coarser mesh errs by `power` times as much as this one, a finer one by 1/power.
    share = 1.0 / (power - 1.0) if coarser else power / (power - 1.0)
    refinement = {
        "nodes": result.n_unknowns,
        "second_nodes": second.n_unknowns,
        "change_K": change,
        "estimate_K": {name: share * abs(value) for name, value in change.items()},
    }
    return replace(result, extra={**result.extra, "mesh_refinement": refinement})
