"""The function behind ``spindle-fem transient``."""

from __future__ import annotations

import contextlib
import csv
import json
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from spindle_fem.definition.load import load_machine, write_machine
from spindle_fem.model.mesh.evaluate import temperature_at_nodes
from spindle_fem.model.mesh.thermal_state import ThermalState
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.parallel import BackgroundProcess
from spindle_fem.results.field_series import FieldSeries
from spindle_fem.results.output_folder import output_folder, replace_text
from spindle_fem.results.run_log import LOGGER
from spindle_fem.solvers.mesh_terms import NO_PHYSICS
from spindle_fem.solvers.prepared_machine import PreparedMachine, prepare_machine
from spindle_fem.solvers.saved_state import load_state, save_state
from spindle_fem.studies.shipped_files import find_study
from spindle_fem.studies.solve_machine import solve_prepared
from spindle_fem.studies.transient_study import (
    StudyResult,
    TransientStudy,
    last_point,
    load_study,
    run_study,
)
from spindle_fem.studies.transient_summary import motion_key, summarise
from spindle_fem.units import ZERO_CELSIUS_K

FIELDS = "fields.vtkhdf"


def run_transient_study(
    study: str | Path,
    folder: str | Path,
    *,
    machine: str | Path | None = None,
    overrides: Iterable[str] = (),
    restart: str | Path | None = None,
    progress: Callable[[str], None] = LOGGER.info,
    keep: Callable[[PreparedMachine, StudyResult], None] = lambda machine, result: None,
) -> dict[str, Any]:
    """Run a transient study by the full model and write what came of it.

    Parameters
    ----------
    study : str or Path
        File with ``schema = "spindle-fem/transient/1"``, or the name of one that ships.
    folder : str or Path
        Gets ``transient.csv``, ``transient.json``, ``state.npz``,
        ``machine.toml``, ``figures/*.png`` and ``report.html``; of a study with
        ``fields_every`` also ``fields.vtkhdf``.
    machine : str or Path, optional
        In place of the study's own.
    overrides : iterable of str
        ``path=value`` texts for the machine.
    restart : str or Path, optional
        ``state.npz`` of an earlier run on the same mesh, to go on from.
    progress : callable, optional
        Called with the name of each stage as it begins.
    keep : callable, optional
        Given the machine and the study as it ran.

    Returns
    -------
    dict
        The content of ``transient.json``.
    """
    asked = load_study(find_study(study))
    start, memory = (None, None) if restart is None else load_state(restart)
    spec = load_machine(asked.machine if machine is None else machine, overrides)
    with output_folder(folder) as place:
        prepared = prepare_machine(spec, progress=progress)
        physics = NO_PHYSICS
        if spec.effects:
            # loaded where needed: what effects read brings the fast model and recordings along
            from spindle_fem.model.reduced.defined_effects import physics_of

            physics = physics_of(prepared)
        make = partial(_Beside, prepared, last_point(spec, asked))
        with BackgroundProcess(make) as beside, _fields(place / FIELDS, prepared, asked) as add_field:
            steady = beside.ask("steady_probes")
            result = run_study(
                prepared,
                asked,
                start=start,
                memory=memory,
                physics=physics,
                progress=progress,
                keep=add_field,
            )
            keep(prepared, result)
            # kept whatever becomes of the steady state that is waited for next
            _write_table(result, place / "transient.csv")
            save_state(place / "state.npz", result.state, result.memory)
            replace_text(place / "machine.toml", write_machine(prepared.spec))
            summary = summarise(prepared, result, steady)
            replace_text(place / "transient.json", json.dumps(summary, indent=1) + "\n")
            pages = beside.ask("write_pages", summary, result, place)
            pages()
        return summary


class _Beside:
    """What a process beside the steps does of a study: the steady state at its end, pictures and page."""

    def __init__(self, machine: PreparedMachine, point: OperatingPoint) -> None:
        self._machine, self._point = machine, point

    def steady_probes(self) -> dict[str, float]:
        """Probes of the steady state that the last phase tends to, K.

        Raises
        ------
        SpindleFemError
        """
        # what draws is loaded while the other process steps
        from spindle_fem.report import transient_report  # noqa: F401

        return dict(solve_prepared(self._machine, self._point).probes)

    def write_pages(self, summary: dict[str, Any], result: StudyResult, folder: Path) -> None:
        """Write the pictures and the page."""
        from spindle_fem.report.transient_report import write_transient_figures, write_transient_report

        write_transient_figures(summary, result, folder)
        write_transient_report(folder)


@contextlib.contextmanager
def _fields(
    path: Path, machine: PreparedMachine, study: TransientStudy
) -> Iterator[Callable[[ThermalState], None]]:
    """Writer of the fields that a study requests."""
    path.unlink(missing_ok=True)
    if study.fields_every is None:
        yield lambda state: None
        return
    with FieldSeries(path, machine.mesh) as series:
        yield lambda state: series.add(state.time, temperature_at_nodes(machine.operators, state.temperature))


def _write_table(result: StudyResult, path: Path) -> None:
    first = result.phases[0].transient
    header = [
        "time_s",
        *(f"{name}_degC" for name in first.probes),
        *(f"{name}_{part}_degC" for name in first.bearings for part in ("inner", "outer", "balls")),
        *(motion_key(name) for name in first.motions),
    ]
    parts = np.stack([result.joined(name) for name in ("inner", "outer", "balls")], axis=2)
    temperatures = np.hstack((result.joined("readings"), parts.reshape(len(parts), -1))) - ZERO_CELSIUS_K
    values = np.hstack((temperatures, 1.0e6 * result.joined("motion")))
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(header)
        for time, row in zip(result.joined("times"), values, strict=True):
            writer.writerow([f"{time:.6g}", *(f"{value:.4f}" for value in row)])
