"""What a transient study leaves in its folder: tables, charts, report, a state to go on from."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np

from spindle_fem.definition.load import write_machine
from spindle_fem.errors import NoSteadyStateError
from spindle_fem.report.block_page import Cards, Section, Table, Text, illustration_of, render_document
from spindle_fem.report.figure_style import save_png
from spindle_fem.report.run_tables import column, number, rows_of, significant
from spindle_fem.report.transient_charts import bearing_history, heat_history, probe_history, step_history
from spindle_fem.results.output_folder import replace_text
from spindle_fem.results.run_summary import package_versions
from spindle_fem.solvers.coupled_steady import PreparedMachine
from spindle_fem.solvers.saved_state import save_state
from spindle_fem.studies.solve_machine import solve_prepared
from spindle_fem.studies.transient_study import StudyResult, time_to_stay_within
from spindle_fem.units import ZERO_CELSIUS_K

SCHEMA = "spindle-fem/transient-result/1"
# Bands around the steady readings for which the time of arrival is given, K.
BANDS = (1.0, 0.5, 0.1)


def summarise_transient(machine: PreparedMachine, result: StudyResult) -> dict[str, Any]:
    """Phases, energy, steps and approach to the steady state, as plain data with units in the keys."""
    phases = []
    for phase in result.phases:
        run = phase.transient
        phases.append(
            {
                "name": phase.name,
                "speed_rpm": phase.point.speed * 30.0 / np.pi,
                "thrust_N": phase.point.thrust,
                "start_s": phase.start,
                "end_s": phase.end,
                "settled": phase.settled,
                "probes_degC": dict(
                    zip(run.probes, (run.readings[-1] - ZERO_CELSIUS_K).tolist(), strict=True)
                ),
                "hottest_degC": float(run.steps.hottest[-1]) - ZERO_CELSIUS_K,
                "heat_W": float(run.steps.bearing_heat[-1].sum()),
                "coolant_heat_W": float(run.steps.coolant_heat[-1]),
                "energy": {
                    "heat_in_J": float(run.energy.heat_in),
                    "heat_out_J": {name: float(heat) for name, heat in run.energy.heat_out.items()},
                    "stored_J": float(run.energy.stored),
                    "imbalance_relative": float(run.energy.imbalance_relative),
                },
                "steps": len(run.steps.times),
                "largest_error_K": float(run.steps.errors.max()),
                "counts": dict(run.counts),
                "cpu_seconds": run.cpu_seconds,
            }
        )
    return {
        "schema": SCHEMA,
        "study": result.study.name,
        "machine": machine.spec.name,
        "unknowns": machine.operators.n_unknowns,
        "mesh_preset": machine.spec.mesh.preset,
        "phases": phases,
        "equilibrium": equilibrium_of(machine, result),
        "versions": package_versions(),
    }


def equilibrium_of(machine: PreparedMachine, result: StudyResult) -> dict[str, Any]:
    """The steady state that the last phase tends to, how far off it is and when it came near.

    ``shares_s`` are the times at which every probe had covered that share of
    its way from the start of the phase; ``bands_s`` those after which all stay
    within so many kelvin. Both count from the start of the phase.
    """
    phase = result.phases[-1]
    run = phase.transient
    try:
        steady = solve_prepared(machine, phase.point)
    except NoSteadyStateError as error:
        return {"exists": False, "reason": str(error)}
    final = np.array([steady.probes[name] for name in run.probes])
    way = np.abs(final - run.readings[0])
    moved = way > 0.5
    shares = {}
    for share in (0.95, 0.99):
        left = np.abs(run.readings - final)[:, moved] / way[moved]
        shares[f"{share:g}"] = _finite(
            time_to_stay_within(run.times, left, np.zeros(left.shape[1]), 1.0 - share)
        )
    return {
        "exists": True,
        "steady_degC": {name: float(value) - ZERO_CELSIUS_K for name, value in steady.probes.items()},
        "left_K": float(np.abs(run.readings[-1] - final).max()),
        "shares_s": shares,
        "bands_s": {
            f"{band:g}": _finite(time_to_stay_within(run.times, run.readings, final, band)) for band in BANDS
        },
    }


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None


def write_transient(machine: PreparedMachine, result: StudyResult, folder: Path) -> dict[str, Any]:
    """Write ``transient.csv``, ``transient.json``, ``state.npz``, figures, machine and report.

    Returns
    -------
    dict
        The content of ``transient.json``.
    """
    summary = summarise_transient(machine, result)
    _write_table(result, folder / "transient.csv")
    save_state(folder / "state.npz", result.state, result.memory)
    replace_text(folder / "machine.toml", write_machine(machine.spec))
    figures = {
        "probes": (
            probe_history(result, summary["equilibrium"].get("steady_degC")),
            "Every probe, and the speed; dotted, where the last phase tends to.",
        ),
        "bearings": (
            bearing_history(result),
            "Raceway means of every bearing and how much hotter the inner ring is.",
        ),
        "heat": (
            heat_history(result),
            "Friction heat follows speed and grease temperature; "
            "the difference to the coolant is stored or lost to the air.",
        ),
        "steps": (
            step_history(result),
            "Steps grow as the temperatures come to rest; the dashed line is the error asked for.",
        ),
    }
    place = folder / "figures"
    place.mkdir(exist_ok=True)
    pictures = []
    for name, (figure, caption) in figures.items():
        if figure is not None:
            save_png(figure, place / f"{name}.png")
            pictures.append(illustration_of(figure, caption))
    replace_text(folder / "transient.json", json.dumps(summary, indent=1) + "\n")
    replace_text(folder / "report.html", _report(summary, pictures))
    return summary


def _write_table(result: StudyResult, path: Path) -> None:
    first = result.phases[0].transient
    header = [
        "time_s",
        *(f"{name}_degC" for name in first.probes),
        *(f"{name}_{part}_degC" for name in first.bearings for part in ("inner", "outer", "balls")),
    ]
    parts = np.stack([result.joined(name) for name in ("inner", "outer", "balls")], axis=2)
    temperatures = np.hstack((result.joined("readings"), parts.reshape(len(parts), -1))) - ZERO_CELSIUS_K
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(header)
        for time, row in zip(result.joined("times"), temperatures, strict=True):
            writer.writerow([f"{time:.6g}", *(f"{value:.4f}" for value in row)])


def _report(summary: dict[str, Any], pictures: list[Any]) -> str:
    phases, equilibrium = summary["phases"], summary["equilibrium"]
    total = phases[-1]["end_s"] - phases[0]["start_s"]
    worst = max(phase["energy"]["imbalance_relative"] for phase in phases)
    cards = [
        {"value": f"{number(total / 3600.0, 2)} h", "name": "simulated"},
        {"value": f"{number(phases[-1]['hottest_degC'])} °C", "name": "hottest place at the end"},
        {"value": significant(worst, 2), "name": "relative imbalance of the heat"},
        {"value": str(sum(phase["steps"] for phase in phases)), "name": "time steps"},
    ]
    sections = [
        Section("summary", "Summary", [Cards(cards), Text(equilibrium_text(equilibrium))]),
        Section("course", "Course", pictures),
        Section("phases", "Phases", [_phase_table(phases), _energy_table(phases)]),
    ]
    subtitle = f"{summary['machine']}, {summary['mesh_preset']} mesh, {summary['unknowns']} temperatures"
    return render_document("Transient", summary["study"], sections, subtitle)


def equilibrium_text(equilibrium: dict[str, Any]) -> str:
    """What :func:`equilibrium_of` found, in words."""
    if not equilibrium["exists"]:
        return f"The last phase tends to no steady state: {equilibrium['reason']}"

    def hours(value: float | None) -> str:
        return "not within this run" if value is None else f"after {value / 3600.0:.2f} h"

    shares, bands = equilibrium["shares_s"], equilibrium["bands_s"]
    return (
        f"At the end the probes are within {equilibrium['left_K']:.2f} K of the steady state of the last "
        f"phase. Counted from its start, every probe has gone 95 % of the way: {hours(shares['0.95'])}; "
        f"99 %: {hours(shares['0.99'])}. All probes stay within 0.5 K: {hours(bands['0.5'])}; "
        f"within 0.1 K: {hours(bands['0.1'])}."
    )


def _phase_table(phases: list[dict[str, Any]]) -> Table:
    probes = list(phases[0]["probes_degC"])
    words = {True: "yes", False: "no", None: "–"}
    columns = [
        column("phase"),
        *(column(name, number=True) for name in ("h", "settled", "heat W", "hottest °C", *probes)),
    ]
    rows = [
        [
            phase["name"],
            number((phase["end_s"] - phase["start_s"]) / 3600.0, 2),
            words[phase["settled"]],
            number(phase["heat_W"]),
            number(phase["hottest_degC"], 2),
            *(number(phase["probes_degC"][name], 2) for name in probes),
        ]
        for phase in phases
    ]
    return Table(tuple(columns), rows_of(rows), caption="At the end of each phase; probes in °C.")


def _energy_table(phases: list[dict[str, Any]]) -> Table:
    sinks = list(phases[0]["energy"]["heat_out_J"])
    columns = [
        column("phase"),
        *(column(name, number=True) for name in ("heat in", "stored", *sinks, "imbalance")),
    ]
    rows = [
        [
            phase["name"],
            *(
                number(value / 1.0e3)
                for value in (
                    phase["energy"]["heat_in_J"],
                    phase["energy"]["stored_J"],
                    *(phase["energy"]["heat_out_J"][name] for name in sinks),
                )
            ),
            significant(phase["energy"]["imbalance_relative"], 2),
        ]
        for phase in phases
    ]
    return Table(
        tuple(columns), rows_of(rows), caption="Heat in kJ; the imbalance relative to the heat moved."
    )
