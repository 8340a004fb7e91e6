"""Solve groups of designs by one projected model; designs outside its validity are left to full solves."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from spindle_fem import __version__
from spindle_fem.cache import cache_directory, source_digest
from spindle_fem.effects.framework.term import CHANNEL_FILM
from spindle_fem.errors import SpindleFemError
from spindle_fem.model.reduced.build_for_designs import (
    FIRST_TABLES,
    build_model_for_designs,
    state_coefficients,
)
from spindle_fem.model.reduced.design_inputs import DesignInputs, design_inputs
from spindle_fem.model.reduced.heat_tables import BearingTables
from spindle_fem.model.reduced.steady_batch import SteadyBatch, SteadySolver
from spindle_fem.model.thermal_model import FORMAT, ThermalModel
from spindle_fem.parallel import one_thread
from spindle_fem.results.thermal_result import ThermalResult
from spindle_fem.solvers.prepared_machine import machine_on_mesh
from spindle_fem.studies.sweep.evaluate_design import (
    FILM_HIGH,
    FILM_LOW,
    SOLVE_ERRORS,
    DesignTask,
    Question,
    how_meshed,
    row_of,
    shared_operators,
    solve_checked,
)
from spindle_fem.studies.sweep.fast_outputs import band_ratios, extreme_temperatures, values_of
from spindle_fem.studies.sweep.results_table import OK, REDUCED, Row

Array = NDArray[np.float64]

# A row whose error may be larger than this is solved in full, K.
LARGEST_ERROR = 0.02
CHECKS = 3
AT_ONCE = 256
# Errors of a model at the designs that were solved in full: the largest in K, and the largest ratio of a
# true error to its estimate, at least 1.
TRUE_ERROR, ERROR_RATIO = "true", "true over estimated"
# Designs whose coefficients exceed the range of the basis by more than this are solved in full.
RANGE_SLACK = 1.0e-6


@dataclass(frozen=True, slots=True)
class GroupTask:
    """Designs of one structure for one worker.

    Attributes
    ----------
    plan : tuple of DesignTask
        All planned designs of the group: the model is made for them, so that
        it does not depend on which of them have rows already.
    wanted : tuple of DesignTask
        Those that need rows; planned ones or others.
    """

    plan: tuple[DesignTask, ...]
    wanted: tuple[DesignTask, ...]


def answer_group(group: GroupTask, question: Question) -> list[Row]:
    """Rows of the designs that the projected model covers, and of those used to check it.

    Every design that gets no row is for the full solve: outside the model's
    range, with too large an error, or of a machine that the model refuses.
    """
    with threadpool_limits(1), one_thread():
        try:
            model, rows, tables = model_of(group, question)
        except SpindleFemError:
            return []  # the full solves will report the fault, design by design
        if not model.errors[TRUE_ERROR] <= LARGEST_ERROR:
            return rows
        wanted = {task.key for task in group.wanted} - {row["key"] for row in rows} - set(model.checked)
        for tasks in (group.plan, tuple(t for t in group.wanted if t not in group.plan)):
            if wanted & {task.key for task in tasks}:
                found = answer_tasks(model, tables, tasks, question)
                rows += [row for row in found if row["key"] in wanted]
        return rows


def answer_tasks(
    model: ThermalModel, tables: BearingTables, tasks: Sequence[DesignTask], question: Question
) -> list[Row]:
    """Rows of designs inside the model's range."""
    specs = [task.spec for task in tasks]
    inputs = _inputs(model, tasks)
    solver = SteadySolver(model, tables, [bearing.name for _, bearing in specs[0].bearings])
    rows: list[Row] = []
    for first in range(0, len(tasks), AT_ONCE):
        index = np.arange(first, min(first + AT_ONCE, len(tasks)))
        rows += _answer(solver, inputs, index, tasks, question)
    return rows


def _answer(
    solver: SteadySolver,
    inputs: DesignInputs,
    index: NDArray[np.int64],
    tasks: Sequence[DesignTask],
    question: Question,
) -> list[Row]:
    """Rows of some designs; where a correlation refuses one of them, the others are solved without it."""
    own = inputs.take(index)
    try:
        states = _states(solver, own, question)
        values = [values_of(solver.model, own, state, question.outputs) for state in states]
    except SpindleFemError:
        if len(index) == 1:
            return []
        half = len(index) // 2
        return [
            row
            for part in (index[:half], index[half:])
            for row in _answer(solver, inputs, part, tasks, question)
        ]
    model = solver.model
    error = model.errors[ERROR_RATIO] * np.max([state.estimate for state in states], axis=0)
    error = np.maximum(error, model.errors[TRUE_ERROR])
    good = np.all([state.settled for state in states], axis=0) & (error <= LARGEST_ERROR)
    good &= inside_range(model, states[0])
    rows = []
    for row in np.flatnonzero(good):
        task = tasks[index[row]]
        answers = dict(values[0][row])
        for ending, at_end in zip((FILM_LOW, FILM_HIGH), values[1:], strict=False):
            answers |= {path + ending: value for path, value in at_end[row].items()}
        head = {"design": task.design.number, **task.design.values, "key": task.key}
        rows.append(
            {
                **head,
                **answers,
                "geometry": task.geometry[:12],
                "status": OK,
                "reason": "",
                "backend": REDUCED,
                "error_estimate_K": float(f"{error[row]:.3g}"),
                "mesh": how_meshed(task, model.mesh_digest),
            }
        )
    return rows


def _states(solver: SteadySolver, inputs: DesignInputs, question: Question) -> list[SteadyBatch]:
    """States of designs: nominal, and at both ends of the channel film's band if requested."""
    nominal = solver.solve(inputs)
    if not question.film_uncertainty:
        return [nominal]
    return [nominal, *(solver.solve(inputs, ratio) for ratio in band_ratios(nominal.channel))]


def inside_range(model: ThermalModel, batch: SteadyBatch) -> NDArray[np.bool_]:
    """Whether every coefficient of a design lies among those that the basis was made for, (n,)."""
    values = state_coefficients(batch)
    low, high = np.array([model.ranges[name] for name in (*model.coefficient_names, CHANNEL_FILM)]).T
    slack = RANGE_SLACK * np.maximum(np.abs(low), np.abs(high))
    return np.all((values >= low - slack) & (values <= high + slack), axis=1)


def _inputs(model: ThermalModel, tasks: Sequence[DesignTask]) -> DesignInputs:
    return design_inputs(
        [task.spec for task in tasks],
        model.coefficient_names,
        model.fluid_names,
        model.contacts,
        model.gap_radii,
        [task.mechanics for task in tasks],
    )


def model_of(group: GroupTask, question: Question) -> tuple[ThermalModel, list[Row], BearingTables]:
    """Checked model of the planned designs, from the cache where it was made before.

    Returns
    -------
    list of Row
        Of the designs that were solved in full to check it; none from the cache.

    Raises
    ------
    SpindleFemError
        The machine cannot be meshed, solved or projected.
    """
    first = group.plan[0]
    path = cache_directory() / f"designs-{_digest(group, question)}.npz"
    tables = BearingTables(*FIRST_TABLES)
    found = ThermalModel.load(path)
    if found is not None:
        return found, [], tables
    mesh, operators = shared_operators(first)
    machine = machine_on_mesh(first.spec, mesh, operators)
    model, solver = build_model_for_designs(
        machine, [task.spec for task in group.plan], film_band=question.film_uncertainty
    )
    model, rows = checked_model(model, solver, group.plan, question)
    model.save(path)
    return model, rows, solver.tables


def _digest(group: GroupTask, question: Question) -> str:
    keys = sorted({task.key for task in group.plan})
    made_by = [FORMAT, source_digest(__name__), __version__]
    text = json.dumps([*made_by, group.plan[0].structure, keys, question.film_uncertainty])
    return hashlib.sha256(text.encode()).hexdigest()


def checked_model(
    model: ThermalModel, solver: SteadySolver, plan: Sequence[DesignTask], question: Question
) -> tuple[ThermalModel, list[Row]]:
    """The model with its true error at some designs: the worst estimated, the hottest, and one at random.

    Returns
    -------
    ThermalModel
        With its ``errors`` and the designs ``checked``.
    list of Row
        Of these designs, from the full solves.
    """
    inputs = _inputs(model, plan)
    chosen = _designs_to_check(model, solver, inputs)
    own = inputs.take(chosen)
    batch = solver.solve(own)
    low, high = extreme_temperatures(model, batch.unknowns, own.ambient)
    rows, errors, ratios = [], [], [1.0]
    for place, row in enumerate(chosen):
        task = plan[row]
        try:
            result = solve_checked(task)
            rows.append(row_of(task, question, result))
        except SOLVE_ERRORS:
            continue  # its full solve among the others will say so
        error = true_error(model, batch, place, (low[place], high[place]), result)
        errors.append(error)
        ratios.append(error / max(float(batch.estimate[place]), 1e-9))
    return (
        replace(
            model,
            errors={
                **model.errors,
                TRUE_ERROR: max(errors) if errors else float("inf"),
                ERROR_RATIO: max(ratios),
            },
            checked=tuple(plan[row].key for row in chosen),
        ),
        rows,
    )


def _designs_to_check(model: ThermalModel, solver: SteadySolver, inputs: DesignInputs) -> list[int]:
    estimate, hottest = np.zeros(len(inputs)), np.zeros(len(inputs))
    for first in range(0, len(inputs), AT_ONCE):
        index = np.arange(first, min(first + AT_ONCE, len(inputs)))
        batch = solver.solve(inputs.take(index))
        estimate[index] = batch.estimate
        hottest[index] = batch.temperatures.max(axis=(1, 2)) if batch.temperatures.size else 0.0
    drawn = np.random.default_rng(1).permutation(len(inputs)).tolist()
    return list(dict.fromkeys([int(np.argmax(estimate)), int(np.argmax(hottest)), *drawn]))[:CHECKS]


def true_error(
    model: ThermalModel, batch: SteadyBatch, row: int, ends: tuple[float, float], result: ThermalResult
) -> float:
    """Largest difference to a full solve: extremes of the field, bearings, probes, coolant outlet, in K."""
    found = [ends[0] - result.temperature_minimum, ends[1] - result.temperature_maximum]
    for column, bearing in enumerate(result.bearings.values()):
        exact = (bearing.temperature_inner, bearing.temperature_outer, bearing.temperature_ball)
        found += [value - other for value, other in zip(batch.temperatures[row, column], exact, strict=True)]
    readings = batch.unknowns[row] @ model.probes.T
    found += [value - result.probes[name] for name, value in zip(model.probe_names, readings, strict=True)]
    if result.coolant is not None:
        found.append(batch.channel.march.outlet_temperature[row].mean() - result.coolant.outlet_temperature)
    return float(np.abs(found).max())
