"""Lumped network and finite elements of the same machine, node by node."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from book.measured import read_tests, run_tests
from book.page import Chapter, Pictures
from book.tables import comparisons
from book.work import Desk, read_json
from spindle_fem.report.block_page import Section, Table, Text, illustration_of
from spindle_fem.report.table_rows import column, number, rows_of, significant

TITLE = "Lumped network against finite elements"
MACHINE, MESH = "recorded_spindle", "coarse"
FILE = "tests/verification/test_lumped_refinement.py"
FIGURES = {
    "difference": "Network minus elements, drawn on the machine.",
    "causes": "What makes the difference, node by node.",
    "convergence": "Networks of growing refinement against axisymmetric elements.",
    "speeds": "Network and flux-matched network against the elements at speeds that were not fitted.",
}


def make(desk: Desk, pictures: Pictures) -> Chapter:
    """Run the cross-check and the refinement tests."""

    def run(folder: Path) -> None:
        from spindle_fem.commands.crosscheck_command import crosscheck_machine

        crosscheck_machine(MACHINE, folder / "crosscheck", (f"mesh.preset={MESH}",))

    step = desk.step("crosscheck", run)
    folder = step.folder / "crosscheck"
    content = read_json(folder / "crosscheck.json")
    tests = [t for t in read_tests(run_tests(desk).folder / "figures.json") if t.file == FILE]
    summary, convergence = content["summary"], content["convergence"]["rows"]
    illustrations = {}
    for name, caption in FIGURES.items():
        path = folder / "figures" / f"{name}.png"
        if path.is_file():
            pictures.copy(name, path)
            illustrations[name] = illustration_of(path, caption)
    first, last = convergence[0], convergence[-1]
    rise = max(row["fem_degC"] for row in content["nodes"]) - content["operating_point"]["coolant_inlet_degC"]
    return Chapter(
        outcome=(
            f"{content['network']['nodes']} lumps differ from the elements by at most "
            f"{number(summary['max_difference_K'], 2)} K (rms {number(summary['rms_difference_K'], 2)} K) "
            f"of a rise of {number(rise, 1)} K; every kelvin of it is assigned to a cause. Cut "
            f"{last['refinement']} times finer, the network is within "
            f"{significant(last['max_difference_K'], 2)} K of axisymmetric elements "
            f"({significant(first['max_difference_K'], 2)} K before)."
        ),
        sections=[
            Section(
                "nodes",
                "Node by node",
                [
                    Text(
                        f"{MACHINE} at its operating point: the network knows the same films, friction and "
                        "coolant, the elements are averaged over each lump. The causes come from a chain "
                        "of models that differ in one assumption each and add up to the whole difference."
                    ),
                    *_of(illustrations, "difference", "causes"),
                    _causes_table(content),
                    _nodes_table(content),
                ],
            ),
            Section("links", "Link by link", [_links_table(content)]),
            Section(
                "refinement",
                "Refined networks converge to elements",
                [
                    *_of(illustrations, "convergence"),
                    _convergence_table(convergence),
                    comparisons(tests, FILE),
                ],
            ),
            Section("speeds", "Other speeds", _of(illustrations, "speeds")),
        ],
        commands=[
            f"spindle-fem crosscheck {MACHINE} --set mesh.preset={MESH} -o runs/crosscheck",
            f"python -m pytest {FILE}",
            "python -m book --only network",
        ],
        evidence=[
            "Two codes that share films and friction but neither mesh nor discretisation agree, and "
            "converge to each other where they solve the same problem.",
            "Where they differ it is the lumps, the smeared helix or the ports, in kelvin, node by node.",
        ],
        not_evidence=[
            "Films, friction and coolant are the same functions in both: an error in them is in both.",
        ],
    )


def _of(illustrations: dict[str, Any], *names: str) -> list[Any]:
    return [illustrations[name] for name in names if name in illustrations]


def _causes_table(content: dict[str, Any]) -> Table:
    rows = [
        [row["cause"].replace("_", " "), row["meaning"], number(row["max_K"], 3), number(row["rms_K"], 3)]
        for row in content["causes"]
    ]
    columns = (
        column("cause"),
        column("meaning"),
        column("largest / K", number=True),
        column("rms / K", number=True),
    )
    return Table(columns, rows_of(rows))


def _nodes_table(content: dict[str, Any]) -> Table:
    rows = [
        [
            row["node"],
            number(row["network_degC"], 2),
            number(row["fem_degC"], 2),
            number(row["difference_K"], 2),
            row["largest_cause"].replace("_", " "),
            number(row["largest_cause_K"], 2),
        ]
        for row in content["nodes"]
    ]
    columns = (
        column("node"),
        column("network / °C", number=True),
        column("elements / °C", number=True),
        column("difference / K", number=True),
        column("largest cause"),
        column("its share / K", number=True),
    )
    return Table(columns, rows_of(rows), "", f"All {len(rows)} nodes")


def _links_table(content: dict[str, Any]) -> Table:
    rows = [
        [
            row["link"],
            row["kind"],
            number(row["network_W"], 1),
            number(row["fem_W"], 1),
            number(row["network_W"] - row["fem_W"], 1),
        ]
        for row in content["links"]
        if row["network_W"] is not None and row["fem_W"] is not None
    ]
    columns = (
        column("link"),
        column("kind"),
        column("network / W", number=True),
        column("elements / W", number=True),
        column("difference / W", number=True),
    )
    return Table(columns, rows_of(rows), "", f"All {len(rows)} links")


def _convergence_table(convergence: list[dict[str, Any]]) -> Table:
    rows = [
        [str(r["refinement"]), f"{r['nodes']:,}", significant(r["max_difference_K"], 3)] for r in convergence
    ]
    columns = (
        column("cells to a bearing width"),
        column("nodes", number=True),
        column("largest difference from axisymmetric elements / K", number=True),
    )
    return Table(columns, rows_of(rows))
