"""Solved bearings as plain numbers with their units in the keys."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spindle_fem.physics.bearings.bearing_geometry import BearingGeometry
from spindle_fem.physics.bearings.bearing_state import BearingState
from spindle_fem.physics.bearings.hertz import INNER, OUTER
from spindle_fem.physics.bearings.rating_life import rating_life
from spindle_fem.physics.bearings.roller_bearing import RollerGeometry
from spindle_fem.validity import CodedWarning

REPORT_SCHEMA = "spindle-fem/bearing-report/1"


def report_of_states(
    states: tuple[BearingState, ...], warnings: tuple[CodedWarning, ...] = ()
) -> dict[str, Any]:
    """Report of solved bearings as plain numbers, for JSON.

    Parameters
    ----------
    states : tuple of BearingState
        Of one bearing or one set, in its order.
    warnings : tuple of CodedWarning
        Of the input; those of the states follow them.

    Returns
    -------
    dict
        Units are in the keys; None marks missing quantities (no film).
    """
    first = states[0]
    has_heat = first.heat is not None
    report: dict[str, Any] = {
        "schema": REPORT_SCHEMA,
        "axial_deflection_um": first.axial_displacement * 1e6,
        "radial_deflection_um": first.radial_displacement * 1e6,
        "axial_stiffness_N_um": first.axial_stiffness * 1e-6,
        "rating_life_h": None,
        "heat_W": sum(state.heat_W for state in states) if has_heat else None,
        "terms_W": _sum_terms(states),
    }
    lives = [
        life_report(state.geometry, state.balls.load, state.balls.weight, state.speed) for state in states
    ]
    if len(states) == 1:
        report |= lives[0] | {"balls": _ball_reports(first)}
    else:
        report["rating_life_h"] = _set_life([life["rating_life_h"] for life in lives])
        report["bearings"] = [
            {
                "name": state.name,
                "axial_deflection_um": state.axial_displacement * 1e6,
                "radial_deflection_um": state.radial_displacement * 1e6,
                "axial_load_N": state.axial_force,
                "preload_N": _number(state.preload),
                "heat_W": state.heat_W if has_heat else None,
                **life,
                "terms_W": state.terms_W,
                "balls": _ball_reports(state),
            }
            for state, life in zip(states, lives, strict=True)
        ]
    found = [warning for state in states for warning in state.warnings]
    report["warnings"] = [{"code": entry.code, "text": entry.text} for entry in (*warnings, *found)]
    return report


def life_report(
    geometry: BearingGeometry | RollerGeometry,
    load: NDArray[np.float64],
    weight: NDArray[np.float64] | None,
    speed: float,
) -> dict[str, float | None]:
    """Basic rating life in millions of turns and in hours; None without load or, of hours, at rest."""
    turns = rating_life(geometry, load, weight)
    hours = turns * 1e6 * 2.0 * math.pi / (3600.0 * abs(speed)) if speed else math.inf
    return {"rating_life_million_turns": _number(turns), "rating_life_h": _number(hours)}


def _set_life(hours: list[float | None]) -> float | None:
    """Life of all bearings together, h: they fail independently, with a Weibull slope of 10/9."""
    damage = sum(life ** (-10.0 / 9.0) for life in hours if life is not None)
    return damage**-0.9 if damage > 0.0 else None


def _sum_terms(states: tuple[BearingState, ...]) -> dict[str, float]:
    total: dict[str, float] = {}
    for state in states:
        for name, value in state.terms_W.items():
            total[name] = total.get(name, 0.0) + value
    return total


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _ball_reports(state: BearingState) -> list[dict[str, Any]]:
    """One record per ball; equal balls under axial load are listed one by one."""
    count, balls = state.geometry.ball_count, state.balls
    reports = []
    for ball in range(count):
        row = ball if len(balls.weight) == count else 0
        record: dict[str, Any] = {"azimuth_deg": 360.0 * ball / count}
        for name, field, factor in (
            ("contact_angle_{}_deg", "contact_angle", 180.0 / math.pi),
            ("load_{}_N", "load", 1.0),
            ("pressure_{}_GPa", "pressure", 1e-9),
            ("semi_major_{}_mm", "semi_major", 1e3),
            ("semi_minor_{}_mm", "semi_minor", 1e3),
            ("deformation_{}_um", "deformation", 1e6),
        ):
            for side, ring in ((INNER, "inner"), (OUTER, "outer")):
                record[name.format(ring)] = float(getattr(balls, field)[row, side]) * factor
        record |= {
            "centrifugal_force_N": float(balls.centrifugal_force[row]),
            "gyroscopic_moment_Nmm": float(balls.gyroscopic_moment[row]) * 1e3,
            "orbital_speed_rad_s": float(balls.orbital_speed[row]),
            "spin_speed_rad_s": float(balls.spin_speed[row]),
        }
        for name, field, factor in (
            ("film_central{}_um", "film_central", 1e6),
            ("film_minimum{}_um", "film_minimum", 1e6),
            ("lambda{}", "film_thickness_ratio", 1.0),
        ):
            values = getattr(balls, field)[row] * factor
            record[name.format("")] = _number(float(np.fmin(*values)))
            for side, ring in ((INNER, "_inner"), (OUTER, "_outer")):
                record[name.format(ring)] = _number(float(values[side]))
        reports.append(record)
    return reports
