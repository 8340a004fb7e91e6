"""Energy balances and independence of the mesh on the machines that ship."""

from __future__ import annotations

import json
import resource
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from book.page import Chapter, Pictures
from book.work import ROOT, Desk, read_json
from spindle_fem.report.block_page import Section, Table, Text
from spindle_fem.report.run_tables import readable
from spindle_fem.report.table_rows import column, number, rows_of, significant
from spindle_fem.results.output_folder import replace_text

TITLE = "Energy balance and mesh independence"
MACHINES = ("wu_tan_2016", "recorded_spindle", "small_two_start", "uncooled")
REFERENCE = "wu_tan_2016"
PRESETS = ("coarse", "normal", "fine")
LIMIT = 1e-8
REPORT = ROOT / "reports" / "reference_run" / "summary.json"


def make(desk: Desk, pictures: Pictures) -> Chapter:
    """Solve every machine on the coarse mesh and the reference spindle on three, and compare."""
    del pictures
    runs = {
        (machine, preset): solved(desk, machine, preset)
        for machine, preset in [
            *((machine, "coarse") for machine in MACHINES),
            *((REFERENCE, preset) for preset in PRESETS if preset != "coarse"),
        ]
    }
    worst = max(abs(run["energy"]["imbalance_relative"]) for run in runs.values())
    finest = runs[REFERENCE, "fine"]
    moved = {
        preset: max(
            abs(runs[REFERENCE, preset]["probes"][name] - finest["probes"][name]) for name in finest["probes"]
        )
        for preset in PRESETS[:-1]
    }
    times = finest["mesh"]["elements"] / runs[REFERENCE, "normal"]["mesh"]["elements"]
    report = read_json(REPORT)
    again = max(
        abs(report["probes"][name] - value) for name, value in runs[REFERENCE, "normal"]["probes"].items()
    )
    return Chapter(
        outcome=(
            f"Heat in equals heat out to {significant(worst, 1)} of it on every machine and mesh "
            f"({LIMIT:g} asked). A mesh with {times:.1f} times the elements moves the reference spindle's "
            f"probes by at most {significant(moved['normal'], 2)} K; the coarse mesh is off by "
            f"{significant(moved['coarse'], 2)} K. The run in reports/reference_run comes out again within "
            f"{significant(again, 2)} K."
        ),
        sections=[
            Section("balance", "Energy balance", [_balance_table(runs)]),
            Section(
                "heat",
                "Where the heat of the reference spindle goes",
                [_heat_table(runs[REFERENCE, "normal"]), _bearings_table(runs[REFERENCE, "normal"])],
            ),
            Section(
                "mesh",
                "The reference spindle on three meshes",
                [
                    Text(
                        "Films, friction and coolant are coupled on each mesh anew, so that everything "
                        "that a finer mesh changes is in the difference."
                    ),
                    _mesh_table(runs, report),
                ],
            ),
            Section("checks", "What every run checks of itself", [_checks_table(runs[REFERENCE, "normal"])]),
        ],
        commands=[
            *(
                f"spindle-fem run {REFERENCE} --set mesh.preset={preset} -o runs/{preset}"
                for preset in PRESETS
            ),
            "python -m book --only balances",
        ],
        evidence=[
            "No heat is lost between friction, solids, joints, films, balls, gap air and oil.",
            "What the reports print depends on the mesh by a few hundredths of a kelvin.",
        ],
        not_evidence=[
            "A balance closes for wrong coefficients as well as for right ones.",
            "The meshes come from one mesher and one geometry; the drawing's assumptions stay.",
        ],
        tone="good" if worst < LIMIT else "bad",
    )


def solved(desk: Desk, machine: str, preset: str) -> dict[str, Any]:
    """Summary of a machine that ships, solved on a preset of the mesh."""

    def run(folder: Path) -> None:
        from spindle_fem.definition.load import load_machine
        from spindle_fem.results.run_summary import build_summary
        from spindle_fem.studies.run_checks import require_checks
        from spindle_fem.studies.solve_machine import solve

        started = time.perf_counter()
        result = solve(load_machine(machine, (f"mesh.preset={preset}",)))
        require_checks(result.checks, machine)
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
        summary = build_summary(result, time.perf_counter() - started, peak)
        replace_text(folder / "summary.json", json.dumps(summary, indent=1))

    step = desk.step(f"solved_{machine}_{preset}", run)
    return read_json(step.folder / "summary.json")


def _balance_table(runs: Mapping[tuple[str, str], Mapping[str, Any]]) -> Table:
    rows = []
    for (machine, preset), run in runs.items():
        energy, mesh = run["energy"], run["mesh"]
        areas = mesh["area_error_relative"]
        rows.append(
            [
                f"{machine}, {preset}",
                f"{mesh['nodes']:,}",
                f"{mesh['elements']:,}",
                number(mesh["min_quality"], 2),
                significant(max(abs(value) for value in areas.values()), 1),
                number(energy["heat_in_W"], 1),
                number(sum(energy["heat_out_W"].values()), 1),
                significant(abs(energy["imbalance_relative"]), 1),
            ]
        )
    columns = (
        column("machine, mesh"),
        column("temperatures", number=True),
        column("elements", number=True),
        column("worst element quality", number=True),
        column("largest error of a tagged area", number=True),
        column("heat in / W", number=True),
        column("heat out / W", number=True),
        column("imbalance, relative", number=True),
    )
    return Table(columns, rows_of(rows), "Element quality: minSICN of gmsh. Areas against the solid model.")


def _heat_table(run: Mapping[str, Any]) -> Table:
    energy = run["energy"]
    total = energy["heat_in_W"]
    into: dict[str, float] = {}
    for name, value in energy["heat_in_by_W"].items():
        into[name.partition(".")[0]] = into.get(name.partition(".")[0], 0.0) + value
    rows = [
        [f"in: friction of {name}", number(value, 1), f"{100 * value / total:.1f} %"]
        for name, value in into.items()
    ]
    rows += [
        [f"out: {readable(name)}", number(value, 1), f"{100 * value / total:.1f} %"]
        for name, value in sorted(energy["heat_out_W"].items(), key=lambda item: -item[1])
    ]
    return Table(
        (column("heat"), column("W", number=True), column("share", number=True)),
        rows_of(rows),
        f"{REFERENCE}, normal mesh.",
    )


def _bearings_table(run: Mapping[str, Any]) -> Table:
    rows = [
        [
            name,
            number(state["heat_W"], 1),
            number(state["temperature_inner_degC"], 1),
            number(state["temperature_outer_degC"], 1),
            number(state["ring_difference_K"], 1),
            number(state["film_um"], 2),
            number(state["lambda"], 1),
        ]
        for name, state in run["bearings"].items()
    ]
    columns = (
        column("bearing"),
        *(
            column(title, number=True)
            for title in (
                "heat / W",
                "inner ring / °C",
                "outer ring / °C",
                "inner − outer / K",
                "film / µm",
                "lambda",
            )
        ),
    )
    return Table(columns, rows_of(rows), f"{REFERENCE}, normal mesh; the README prints these.")


def _mesh_table(runs: Mapping[tuple[str, str], Mapping[str, Any]], report: Mapping[str, Any]) -> Table:
    series = [runs[REFERENCE, preset] for preset in PRESETS]
    finest = series[-1]
    rows = [
        [
            name,
            *(number(run["probes"][name], 3) for run in series),
            *(number(run["probes"][name] - finest["probes"][name], 3) for run in series[:-1]),
            number(report["probes"][name], 3),
        ]
        for name in finest["probes"]
    ]
    rows.append(
        [
            "elements",
            *(f"{run['mesh']['elements']:,}" for run in series),
            "",
            "",
            f"{report['mesh']['elements']:,}",
        ]
    )
    rows.append(
        [
            "warmest place",
            *(number(run["temperature"]["max_degC"], 3) for run in series),
            "",
            "",
            number(report["temperature"]["max_degC"], 3),
        ]
    )
    columns = (
        column("probe"),
        *(column(f"{preset} / °C", number=True) for preset in PRESETS),
        *(column(f"{preset} − fine / K", number=True) for preset in PRESETS[:-1]),
        column("reports/reference_run / °C", number=True),
    )
    return Table(columns, rows_of(rows))


def _checks_table(run: Mapping[str, Any]) -> Table:
    rows = [
        [
            item["name"],
            significant(item["value"], 3),
            significant(item["limit"], 3),
            item["unit"],
            item["passed"],
            item["explanation"],
        ]
        for item in run["checks"]
    ]
    columns = (
        column("check"),
        column("value", number=True),
        column("limit", number=True),
        column("unit"),
        column("", verdict=True),
        column("what it is"),
    )
    return Table(columns, rows_of(rows), f"{REFERENCE}, normal mesh.")
