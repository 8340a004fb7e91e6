"""Feasibility of designs, their ranking, and whether the ranking is certain."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spindle_fem.studies.sweep.evaluate_design import FILM_HIGH, FILM_LOW
from spindle_fem.studies.sweep.outputs import limit_of, unit_of
from spindle_fem.studies.sweep.results_table import OK, Row
from spindle_fem.studies.sweep.study_file import Study

# Differences below this share of the spread of an objective are round-off.
ROUND_OFF = 1.0e-9
# K; what temperatures of designs on meshes of their own differ by because of the mesh, by the order of the
# elements: linear ones against quadratic ones, and the coarse preset of these against the normal one
# (docs/modelling.md, "Elements").
MESH_ERROR = {1: 0.3, 2: 0.03}


@dataclass(frozen=True, slots=True)
class Limit:
    """A constraint in the unit of its output; None where there is no bound."""

    output: str
    low: float | None
    high: float | None


def limits_of(study: Study, where: str) -> tuple[Limit, ...]:
    """Constraints of a study in the units of their outputs.

    Raises
    ------
    SpecError
        A limit of another dimension.
    """
    return tuple(
        Limit(
            item.output,
            *(
                None
                if value is None
                else limit_of(value, item.output, f"{where}: constraint[{number + 1}].{key}")
                for key, value in (("min", item.min), ("max", item.max))
            ),
        )
        for number, item in enumerate(study.constraint)
    )


def violations(row: Mapping[str, Any], limits: Sequence[Limit]) -> list[str]:
    """Broken limits of a solved design in words; with the film's band, those that any end of it breaks."""
    found = []
    for limit in limits:
        unit = unit_of(limit.output).text
        values = [row.get(limit.output + end) for end in ("", FILM_LOW, FILM_HIGH)]
        values = [value for value in values if value is not None]
        if not values:
            found.append(f"{limit.output} has no value")
        elif limit.high is not None and max(values) > limit.high:
            found.append(
                f"{limit.output} is {max(values):.6g} {unit}, allowed at most {limit.high:g} {unit}".strip()
            )
        elif limit.low is not None and min(values) < limit.low:
            found.append(
                f"{limit.output} is {min(values):.6g} {unit}, allowed at least {limit.low:g} {unit}".strip()
            )
    return found


def judged(row: Row, limits: Sequence[Limit]) -> Row:
    """``feasible`` and ``reason`` of a row by the limits of the study."""
    if row["status"] != OK:
        return {"feasible": None, "reason": row["reason"]}
    broken = violations(row, limits)
    return {"feasible": "no" if broken else "yes", "reason": "; ".join(broken)}


@dataclass(frozen=True, slots=True)
class Ranking:
    """Feasible designs by their objectives.

    Attributes
    ----------
    rows : tuple of Row
        Feasible ones.
    values, low, high : (n, m) ndarray
        Objectives with smaller always better, and their range over the film's band.
    front : tuple of int
        Rows that no other one beats in every objective: the best row for one
        objective, the Pareto front for several; by the first objective.
    certain : (n,) ndarray of bool
        Whether some row beats this one whatever the film is within its band.
    alike : tuple of int
        Rows beside the front that others beat by no more than the mesh leaves.
    """

    rows: tuple[Row, ...]
    values: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    front: tuple[int, ...]
    certain: NDArray[np.bool_]
    alike: tuple[int, ...]

    @property
    def contenders(self) -> tuple[int, ...]:
        """Rows that no other one certainly beats; the front is among them."""
        return tuple(np.flatnonzero(~self.certain).tolist())


def rank(study: Study, rows: Sequence[Row], mesh_error: float) -> Ranking | None:
    """Judge the feasible rows; None without objectives or without such rows.

    Parameters
    ----------
    mesh_error : float, [K]
        Of objectives that are temperatures, between designs of different geometries; those of one share
        their mesh with its error.
    """
    signs = [1.0 if item.direction == "minimize" else -1.0 for item in study.objective]
    feasible = tuple(
        row
        for row in rows
        if row["feasible"] == "yes" and all(row[item.output] is not None for item in study.objective)
    )
    if not signs or not feasible:
        return None
    ends = ("", FILM_LOW, FILM_HIGH) if study.study.film_uncertainty else ("",)
    states = np.array(
        [
            [
                [sign * row[item.output + end] for sign, item in zip(signs, study.objective, strict=True)]
                for end in ends
            ]
            for row in feasible
        ],
        dtype=np.float64,
    )
    values, low, high = states[:, 0], states.min(axis=1), states.max(axis=1)
    beaten = dominated(values)
    front = [int(index) for index in np.flatnonzero(~beaten)]
    front.sort(key=lambda index: tuple(values[index]))
    errors = [mesh_error if unit_of(item.output).text in ("K", "°C") else 0.0 for item in study.objective]
    told = dominated(values, np.array(errors), np.array([str(row["geometry"]) for row in feasible]))
    alike = tuple(np.flatnonzero(beaten & ~told).tolist())
    return Ranking(feasible, values, low, high, tuple(front), certainly_beaten(low, high), alike)


def dominated(
    values: NDArray[np.float64],
    errors: NDArray[np.float64] | float = 0.0,
    meshes: NDArray[np.str_] | None = None,
) -> NDArray[np.bool_]:
    """Rows that another one equals or beats in every objective and beats in one; smaller is better.

    Parameters
    ----------
    values : (n, m) ndarray
    errors : (m,) ndarray, optional
        By how much more a row has to be better where the two have not the same mesh.
    meshes : (n,) ndarray of str, optional
        All the same where none are given.

    >>> dominated(np.array([[1.0, 2.0], [2.0, 1.0], [2.0, 2.0]])).tolist()
    [False, False, True]
    """
    tolerance = ROUND_OFF * np.maximum(np.ptp(values, axis=0), np.finfo(float).tiny)
    found = np.zeros(len(values), dtype=bool)
    meshes = np.zeros(len(values)) if meshes is None else meshes
    for index, value in enumerate(values):
        not_worse = np.all(values <= value + tolerance, axis=1)
        margin = tolerance + errors * (meshes != meshes[index])[:, None]
        better = np.any(values < value - margin, axis=1)
        found[index] = bool(np.any(not_worse & better))
    return found


def certainly_beaten(low: NDArray[np.float64], high: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Rows that another one beats in every objective even at its own worst and their best.

    The errors of the correlation in two designs are taken as unrelated: they
    may lie in different regimes.

    >>> certainly_beaten(np.array([[1.0], [1.5], [3.0]]), np.array([[2.0], [2.5], [4.0]])).tolist()
    [False, False, True]
    """
    tolerance = ROUND_OFF * np.maximum(np.ptp(np.vstack([low, high]), axis=0), np.finfo(float).tiny)
    return np.array([bool(np.any(np.all(high < best - tolerance, axis=1))) for best in low])
