"""``sweep.json``: what a study found, as plain numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from spindle_fem.results.run_summary import package_versions
from spindle_fem.studies.sweep.file_names import SWEEP_SCHEMA
from spindle_fem.studies.sweep.judge_designs import MESH_ERROR, Ranking, rank
from spindle_fem.studies.sweep.outputs import unit_of
from spindle_fem.studies.sweep.prepared_study import PreparedStudy
from spindle_fem.studies.sweep.results_table import FAILED, FULL, IMPOSSIBLE, MOVED, NEW, OK, REDUCED, Row
from spindle_fem.studies.sweep.sensitivity import neighbours, sensitivities

# Neighbours of the best design listed for each parameter.
NEIGHBOURS = 2
# Machines shown cut open.
PICTURES = 4


def summarise(prepared: PreparedStudy, rows: Sequence[Row], *, reused: int) -> dict[str, Any]:
    """Counts, the best designs, what they are compared with, and what matters."""
    statuses = [row["status"] for row in rows]
    mesh_error = MESH_ERROR[prepared.spec.mesh.order]
    ranking = rank(prepared.study, rows, mesh_error)
    numbers = [
        *dict.fromkeys((*(item.output for item in prepared.study.objective), *prepared.question.outputs))
    ]
    return {
        "schema": SWEEP_SCHEMA,
        "study": prepared.name,
        "machine": prepared.spec.name,
        "parameters": [{"path": axis.path, "unit": axis.unit} for axis in prepared.axes],
        "outputs": [{"path": path, "unit": unit_of(path).text} for path in prepared.question.outputs],
        "constraints": [
            {"output": limit.output, "min": limit.low, "max": limit.high} for limit in prepared.limits
        ],
        "objectives": [{"output": i.output, "direction": i.direction} for i in prepared.study.objective],
        "film_uncertainty": prepared.question.film_uncertainty,
        "designs": len(rows),
        "ok": statuses.count(OK),
        "failed": statuses.count(FAILED),
        "impossible": statuses.count(IMPOSSIBLE),
        "feasible": sum(row["feasible"] == "yes" for row in rows),
        "geometries": len({row["geometry"] for row in rows if row["geometry"]}),
        "meshes": {how: sum(row["mesh"] == how for row in rows) for how in (NEW, MOVED)},
        "mesh_error_K": mesh_error,
        "reused_rows": reused,
        "backends": _backends(rows),
        "optimum": None if ranking is None else _optimum(prepared, rows, ranking),
        "pictured": pictured_designs(prepared, rows, ranking),
        "references": {
            name: _design(prepared, rows[number - 1]) for name, number in prepared.references.items()
        },
        "sensitivities": [
            {
                "output": item.output,
                "method": item.method,
                "predicted_share": item.prediction,
                "parameters": [
                    {"path": path, "first_order": first, "total": total, "change_over_range": slope}
                    for path, first, total, slope in zip(
                        item.paths, item.first, item.total, item.slope, strict=True
                    )
                ],
            }
            for item in sensitivities(prepared.axes, rows, numbers)
        ],
        "versions": package_versions(),
    }


def _backends(rows: Sequence[Row]) -> dict[str, Any]:
    """Numbers of designs solved in full and by a projected model, and its largest error estimate."""
    errors = [row["error_estimate_K"] for row in rows if row["backend"] == REDUCED]
    return {
        FULL: sum(row["backend"] == FULL for row in rows),
        REDUCED: len(errors),
        "largest_error_estimate_K": max(errors, default=None),
    }


def pictured_designs(prepared: PreparedStudy, rows: Sequence[Row], ranking: Ranking | None) -> list[int]:
    """Designs to picture: the best, spread over the front, and those to compare with."""
    if ranking is None:
        return []
    front = [ranking.rows[index]["design"] for index in ranking.front]
    compared = [n for n in prepared.references.values() if rows[n - 1]["status"] == OK][: PICTURES - 1]
    room = min(PICTURES - len(compared), len(front))
    spread = [front[round(step * (len(front) - 1) / max(room - 1, 1))] for step in range(room)]
    return list(dict.fromkeys([*spread, *compared]))


def _optimum(prepared: PreparedStudy, rows: Sequence[Row], ranking: Ranking) -> dict[str, Any]:
    best = ranking.rows[ranking.front[0]]
    return {
        "best": _design(prepared, best) if len(prepared.study.objective) == 1 else None,
        "front": [ranking.rows[index]["design"] for index in ranking.front],
        "not_certainly_worse": [ranking.rows[index]["design"] for index in ranking.contenders],
        "within_mesh_error": [ranking.rows[index]["design"] for index in ranking.alike],
        "neighbours": [
            _design(prepared, row)
            for row in neighbours(prepared.axes, rows, best, NEIGHBOURS * len(prepared.axes))
        ],
    }


def _design(prepared: PreparedStudy, row: Row) -> Mapping[str, Any]:
    return {
        "design": row["design"],
        "status": row["status"],
        "feasible": row["feasible"],
        "parameters": {axis.path: row[axis.path] for axis in prepared.axes},
        "outputs": {path: row[path] for path in prepared.question.columns},
    }
