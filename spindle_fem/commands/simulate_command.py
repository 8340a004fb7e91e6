"""The function behind ``spindle-fem simulate``: what every channel should have read, and its files."""

from __future__ import annotations

import csv
import json
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import norm

from spindle_fem.commands.checked_machine import recording_of, resolved_text
from spindle_fem.inference.calibration import LEVEL, Calibration
from spindle_fem.recordings.align import Recording
from spindle_fem.recordings.compare import (
    ALL,
    Comparison,
    displacement_errors,
    simulation_summary,
    write_simulated,
)
from spindle_fem.report.read_against_predicted import draw_channels, draw_displacements
from spindle_fem.report.simulation_data import simulation_dataset
from spindle_fem.report.simulation_report import write_simulation_report
from spindle_fem.results.dataset import write_dataset
from spindle_fem.results.output_folder import output_folder, replace_text
from spindle_fem.results.run_log import LOGGER
from spindle_fem.results.run_summary import package_versions
from spindle_fem.studies.simulate import Simulation, simulate_recordings

Progress = Callable[[str], None]


def simulate_machine(
    machine: str | Path,
    recording: str | Path | Recording,
    folder: str | Path,
    calibrate: Iterable[str | Path | Recording] = (),
    overrides: Iterable[str] = (),
    progress: Progress | None = None,
    keep: Callable[[Simulation], None] = lambda simulation: None,
) -> dict[str, Any]:
    """Predict every temperature channel of a recording and write what came of it.

    Parameters
    ----------
    machine : str or Path
        A definition file or the name of a machine that ships; with geometry
        or a ``[network]``.
    recording : str, Path or Recording
        Folder or manifest, or what was read from it.
    folder : str or Path
        Gets ``simulated.csv``, ``simulation.json``, ``simulation.nc``, ``error_table.csv``,
        ``machine.toml``, ``figures/residual_<channel>.png``, ``report.html`` and, when
        calibrated, ``calibrated_machine.toml``.
    calibrate : iterable of str, Path or Recording
        Recordings that may move the uncertain parameters first.
    overrides : iterable of str
        ``path=value`` texts.
    progress : callable, optional
        Called with the name of each stage as it begins.
    keep : callable, optional
        Given what was simulated.

    Returns
    -------
    dict
        The content of ``simulation.json``.

    Raises
    ------
    SpindleFemError
    """
    started = time.perf_counter()
    overrides = tuple(overrides)
    tell = progress or LOGGER.info
    tell("reading")
    read = recording_of(recording, machine, overrides)
    others = [recording_of(item, machine, overrides) for item in calibrate]
    with output_folder(folder) as place:
        simulation = simulate_recordings(machine, read, others, overrides=overrides, progress=tell)
        keep(simulation)
        replace_text(place / "machine.toml", resolved_text(machine, overrides))
        tell("writing")
        return write_simulation(simulation, place, started=started)


def write_simulation(simulation: Simulation, folder: Path, *, started: float) -> dict[str, Any]:
    """Write everything that ``simulate`` leaves in its folder.

    Returns
    -------
    dict
        The content of ``simulation.json``.
    """
    recording, comparison = simulation.recording, simulation.comparison
    write_simulated(folder / "simulated.csv", recording, simulation.predicted, simulation.displacements)
    write_dataset(simulation_dataset(simulation), folder / "simulation.nc")
    figures = draw_channels(folder / "figures", recording, simulation.predicted, simulation.half_width)
    if simulation.displacements.size:
        figures += draw_displacements(folder / "figures", recording, simulation.displacements)
    _write_error_table(folder / "error_table.csv", comparison)
    summary = simulation_summary(comparison)
    inside = np.abs(comparison.residual) <= simulation.half_width
    for entry in summary["channels"]:
        index = recording.temperature_names.index(entry["channel"])
        read = np.isfinite(comparison.residual[:, index])
        entry["inside_90_percent_interval"] = float(np.mean(inside[read, index])) if read.any() else None
        entry["interval_half_width_K"] = float(np.mean(simulation.half_width[:, index]))
    if recording.displacement_names and simulation.displacements.size:
        summary["displacements"] = displacement_errors(recording, simulation.displacements)
    if simulation.preload:
        summary["preload_N"] = {
            name: {"least": float(values.min()), "most": float(values.max()), "last": float(values[-1])}
            for name, values in simulation.preload.items()
        }
    summary |= {
        "recording": recording.name,
        "notes": list(simulation.notes),
        "machine": simulation.machine,
        "defects": recording.defects.to_json(),
        "defects_text": recording.defects.lines(),
        "reduced_model": dict(simulation.model),
        "calibration": None
        if simulation.calibration is None
        else calibration_summary(simulation.calibration),
        "figures": [str(path.relative_to(folder)) for path in figures],
        "versions": package_versions(),
    }
    if simulation.machine_text is not None:
        replace_text(folder / "calibrated_machine.toml", simulation.machine_text)
    summary["wall_time_s"] = time.perf_counter() - started
    replace_text(folder / "simulation.json", json.dumps(summary, indent=1) + "\n")
    write_simulation_report(folder)
    return summary


def _write_error_table(path: Path, comparison: Comparison) -> None:
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(["channel", "condition", "readings", "rmse_K", "mean_K", "max_K", "noise_K"])
        for row in comparison.rows:
            values = (row.rmse, row.mean, row.largest, row.noise)
            writer.writerow([row.channel, row.condition or ALL, row.readings, *(f"{v:.4f}" for v in values)])


def calibration_summary(result: Calibration) -> dict[str, Any]:
    """A calibration as plain data with units in the keys."""
    return {
        "level": LEVEL,
        "parameters": [
            {
                "name": item.name,
                "value": item.value,
                "low": item.low,
                "high": item.high,
                "unit": item.unit,
                "prior": item.prior,
                "factor": item.factor,
                "prior_sigma_log": item.prior_sigma_log,
                "sigma_log": item.sigma_log,
                "learned": item.learned,
                "prior_two_sided_p": float(2.0 * norm.sf(abs(np.log(item.factor)) / item.prior_sigma_log)),
            }
            for item in result.estimates
        ],
        "correlation": np.round(result.correlation, 4).tolist(),
        "cannot_tell_apart": [list(pair) for pair in result.cannot_tell_apart()],
        "not_learned": list(result.unlearned()),
        "slow_error": {"sigma_K": result.slow.sigma, "time_s": result.slow.time},
        "chi_square_per_value": result.chi_square,
        "outlier_share": result.outlier_share,
        "evaluations": result.evaluations,
    }
