"""Further machines: what the six spindles written in a page compute, and what their sources measured."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from book.chapters.balances import solved
from book.page import Chapter, Pictures
from book.work import Desk
from spindle_fem.report.block_page import Section, Table, Text
from spindle_fem.report.table_rows import column, number, rows_of, significant

TITLE = "Further machines"
# Machine: what it is, and the source of its kind.
MACHINES = {
    "externally_driven": (
        "coupling, 7014 C and 7012 C, grease, no coolant",
        "Brecher and others (2015), Engineering 7(2): abstract only",
    ),
    "motor_spindle": ("built-in motor, 7014 C and 7012 C, glycol", "none"),
    "grinding_spindle": (
        "belt, 7016 C triplex and 7014 C, oil-air",
        "Kim, Zverev & Lee (2010), Intelligent Information Management 2: abstract only",
    ),
    "belt_lathe": ("belt, NN3018 K, 7018 AC pair, NN3016 K", "none"),
    "router_spindle": ("built-in motor, hybrid 7006 C and 7005 C, 24 000 rpm, water", "none"),
    "groove_spindle": ("belt, sealed 6208, spring", "none"),
}


def make(desk: Desk, pictures: Pictures) -> Chapter:
    """Solve the six on the coarse mesh."""
    del pictures
    runs = {machine: solved(desk, machine, "coarse") for machine in MACHINES}
    worst = max(abs(run["energy"]["imbalance_relative"]) for run in runs.values())
    return Chapter(
        outcome=(
            f"{len(runs)} machines of other kinds solve; heat in equals heat out to {significant(worst, 1)}. "
            "None is compared with a measurement: the measured values of their sources were not at hand."
        ),
        sections=[
            Section(
                "six",
                "What they compute",
                [
                    _table(runs),
                    Text(
                        "Temperatures of the mesh “coarse” at the operating point of each file. Every "
                        "dimension in them is assumed and marked so."
                    ),
                ],
            )
        ],
        commands=[f"spindle-fem run {machine} --set mesh.preset=coarse -o {machine}" for machine in MACHINES],
        evidence=[
            "Kinds of bearing, drive and cooling beside the reference spindle's go through the whole tool."
        ],
        not_evidence=["How far computed temperatures of these machines are from measured ones."],
        tone="good" if worst < 1e-8 else "bad",
    )


def _table(runs: Mapping[str, Mapping[str, Any]]) -> Table:
    rows = []
    for machine, run in runs.items():
        bearings = run["bearings"].values()
        what, source = MACHINES[machine]
        rows.append(
            [
                machine,
                what,
                number(sum(bearing["heat_W"] for bearing in bearings), 0),
                number(max(bearing["temperature_outer_degC"] for bearing in bearings), 1),
                number(max(bearing["temperature_inner_degC"] for bearing in bearings), 1),
                source,
                "not at hand",
            ]
        )
    columns = (
        column("machine"),
        column("what it is"),
        column("friction W", number=True),
        column("warmest outer ring °C", number=True),
        column("warmest inner ring °C", number=True),
        column("source of its kind"),
        column("measured"),
    )
    return Table(columns, rows_of(rows))
