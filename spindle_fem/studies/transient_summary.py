"""Results of a transient study as plain data: phases, energy, steps, approach to the steady state."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from spindle_fem.errors import NoSteadyStateError, SpindleFemError
from spindle_fem.model.elastic.machine_growth import NOSE
from spindle_fem.results.run_summary import package_versions
from spindle_fem.solvers.prepared_machine import PreparedMachine
from spindle_fem.solvers.transient_records import MachineTransient
from spindle_fem.studies.transient_study import StudyResult, time_to_stay_within
from spindle_fem.units import ZERO_CELSIUS_K

SCHEMA = "spindle-fem/transient-result/1"
# Bands around the steady readings for which the time of arrival is given, K.
BANDS = (1.0, 0.5, 0.1)


def summarise(
    machine: PreparedMachine, result: StudyResult, steady: Callable[[], Mapping[str, float]]
) -> dict[str, Any]:
    """Phases, energy, steps and approach to the steady state, as plain data with units in the keys.

    Parameters
    ----------
    steady : callable
        Gives the probes [K] of the steady state that the last phase tends to; raises ``NoSteadyStateError``
        where there is none, another ``SpindleFemError`` where it cannot be worked out.
    """
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
                **_growth(run),
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
        "equilibrium": equilibrium_of(result, steady),
        "versions": package_versions(),
    }


def equilibrium_of(result: StudyResult, steady: Callable[[], Mapping[str, float]]) -> dict[str, Any]:
    """The steady state that the last phase tends to, how far off it is and when it came near.

    ``shares_s`` are the times at which every probe had covered that share of
    its way from the start of the phase; ``bands_s`` those after which all stay
    within so many kelvin. Both count from the start of the phase. ``exists`` is None, with the reason, where
    the steady state could not be worked out.
    """
    phase = result.phases[-1]
    run = phase.transient
    try:
        probes = steady()
    except NoSteadyStateError as error:
        return {"exists": False, "reason": str(error)}
    except SpindleFemError as error:
        return {"exists": None, "reason": str(error)}
    final = np.array([probes[name] for name in run.probes])
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
        "steady_degC": {name: float(value) - ZERO_CELSIUS_K for name, value in probes.items()},
        "left_K": float(np.abs(run.readings[-1] - final).max()),
        "shares_s": shares,
        "bands_s": {
            f"{band:g}": _finite(time_to_stay_within(run.times, run.readings, final, band)) for band in BANDS
        },
    }


def _growth(run: MachineTransient) -> dict[str, Any]:
    """Blocks ``growth`` and ``displacements`` at the end of a phase; none without elastic bodies."""
    if not run.motions:
        return {}
    last = dict(zip(run.motions, (1.0e6 * run.motion[-1]).tolist(), strict=True))
    nose = {motion_key(name): last.pop(name) for name in NOSE if name in last}
    return {"growth": nose, "displacements": last}


def motion_key(name: str) -> str:
    """A motion with its unit, as keys of results have it: ``nose_axial_um``, ``nose_tilt_up_urad``.

    >>> motion_key("nose_tilt_up")
    'nose_tilt_up_urad'
    """
    return f"{name}_{'urad' if '_tilt_' in name else 'um'}"


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None
