"""The function behind ``spindle-fem diagnose``."""

from __future__ import annotations

import csv
import json
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from spindle_fem.commands.checked_machine import recording_of, resolved_text
from spindle_fem.inference.coarse_machine import refined
from spindle_fem.inference.diagnosis import MOST_WORKERS, Diagnosis, diagnose_recordings
from spindle_fem.inference.diagnosis_content import diagnosis_content, plain_data, unexplained_content
from spindle_fem.inference.findings import predictions_at_stamps, states_of
from spindle_fem.inference.full_model_check import (
    AUTO,
    OFF,
    BegunRuns,
    full_model_errors,
    nothing_run,
    require_choice,
)
from spindle_fem.inference.full_model_confirmation import with_confirmation
from spindle_fem.inference.heldout import heldout_stamps
from spindle_fem.inference.improved_machine import improved_machine
from spindle_fem.inference.next_measurement import next_measurement
from spindle_fem.inference.opened_machine import DiagnosedMachine, open_machine, with_growth
from spindle_fem.inference.redefined_machine import with_definition_put_right
from spindle_fem.inference.sufficiency import says_too_little
from spindle_fem.inference.worker_processes import Workers
from spindle_fem.parallel import BackgroundProcess, keep_freed_memory, thread_count
from spindle_fem.recordings.align import Recording
from spindle_fem.recordings.compare import write_simulated
from spindle_fem.results.output_folder import output_folder, replace_text
from spindle_fem.results.run_log import LOGGER

Progress = Callable[[str], None]
STATE_COLUMNS = ("start", "end", "effect", "component", "value", "unit")


@dataclass(frozen=True, slots=True)
class _Request:
    """Arguments of :func:`diagnose`."""

    machine: str | Path
    recordings: Iterable[str | Path | Recording]
    folder: str | Path
    calibrate: Iterable[str | Path | Recording] = ()
    overrides: Iterable[str] = ()
    heldout: str = "blocks"
    full_model: str = AUTO
    progress: Progress | None = None


def diagnose(
    machine: str | Path,
    recordings: Iterable[str | Path | Recording],
    folder: str | Path,
    calibrate: Iterable[str | Path | Recording] = (),
    overrides: Iterable[str] = (),
    *,
    heldout: str = "blocks",
    full_model: str = AUTO,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Say where recordings and a machine differ, what was left out, and how well it fits with it.

    Parameters
    ----------
    machine : str or Path
        A definition or the name of one that ships; with geometry or a ``[network]``.
    recordings : iterable of str, Path or Recording
        To be explained; what is found acts in all of them.
    folder : str or Path
        Gets ``diagnosis.json``, ``improved_machine.toml``, ``states.csv``,
        ``before.csv`` and ``after.csv`` (predictions), the same of the full
        model as ``before_full_model.csv`` and ``after_full_model.csv``,
        ``machine.toml``, ``diagnosis.nc``, ``figures/*.png`` and ``report.html``.
    calibrate : iterable of str, Path or Recording
        Recordings of the same machine with nothing missing.
    overrides : iterable of str
        ``path=value`` texts.
    heldout : str
        ``blocks`` or ``last:0.4``: readings that the fit does not see.
    full_model : {"auto", "off", "coarse", "own"}
        Mesh on which both fits are run again by the full model; ``auto`` is
        the coarse one unless that would take very many time steps.

    Returns
    -------
    dict
        The content of ``diagnosis.json``.

    Raises
    ------
    SpindleFemError
    """
    request = _Request(machine, recordings, folder, calibrate, overrides, heldout, full_model, progress)
    with BackgroundProcess(_ReportWorker) as reporter:
        return _diagnose(request, reporter)


def diagnose_without_report(
    machine: str | Path,
    recordings: Iterable[str | Path | Recording],
    folder: str | Path,
    *others: Any,
    **choices: Any,
) -> dict[str, Any]:
    """Run :func:`diagnose`, with the same parameters, without ``diagnosis.nc``, figures and report."""
    return _diagnose(_Request(machine, recordings, folder, *others, **choices), None)


class _ReportWorker:
    """Figures and report of a diagnosis: what they need is loaded while there is nothing to draw yet."""

    def __init__(self) -> None:
        from spindle_fem.report import diagnosis_report

        self._report, self._pictures = diagnosis_report, None

    def draw(self, place: Path, content: Mapping[str, Any]) -> None:
        """Draw the figures from what is known so far."""
        self._pictures = self._report.draw_ahead(place, content)

    def write(self, place: Path) -> None:
        """Write the report of a folder that is complete but for it."""
        self._report.write_diagnosis_report(place, self._pictures)


def _diagnose(request: _Request, reporter: BackgroundProcess | None) -> dict[str, Any]:
    started = time.perf_counter()
    require_choice(request.full_model)
    keep_freed_memory()
    overrides = tuple(request.overrides)
    tell = request.progress or LOGGER.info
    tell("reading")
    read = [recording_of(item, request.machine, overrides) for item in request.recordings]
    earlier = [recording_of(item, request.machine, overrides) for item in request.calibrate]
    for recording in read:
        # A choice that is none is refused before a fast model is made for it.
        heldout_stamps(recording, request.heldout)
    opened = open_machine(request.machine, overrides, read, earlier, heldout=request.heldout, progress=tell)
    opened = with_growth(refined(opened))
    with output_folder(request.folder) as place:
        reason = says_too_little(opened)
        # written once there is something to say: an interrupted one leaves the machine of an earlier one
        definition = resolved_text(request.machine, overrides)
        if reason:
            replace_text(place / "machine.toml", definition)
            content = unexplained_content(opened, reason)
            content["fit"]["full_model"] = nothing_run(
                OFF if request.full_model == AUTO else request.full_model, "Nothing was fitted."
            )
        else:
            workers = Workers(min(thread_count(), MOST_WORKERS))
            workers.wake()
            begun: list[BegunRuns] = []

            def diagnosed(machine: DiagnosedMachine) -> Diagnosis:
                begun.append(BegunRuns(machine, request.full_model))
                return diagnose_recordings(
                    machine,
                    heldout=request.heldout,
                    progress=tell,
                    workers=workers,
                    settled=begun[-1].begin,
                    meanwhile=begun[-1].prepare,
                )

            opened, diagnosis = with_definition_put_right(opened, diagnosed(opened), diagnosed, tell)
            tell("writing")
            replace_text(place / "machine.toml", definition)
            improved = workers.ahead(partial(improved_machine, diagnosis, opened))
            proposed = workers.ahead(partial(next_measurement, diagnosis))
            content = _write(diagnosis, opened, place, report=reporter is not None)
            if reporter is not None:
                drawn = reporter.ask("draw", place, json.loads(json.dumps(plain_data(content))))
            content["fit"]["full_model"] = full_model_errors(
                diagnosis,
                opened,
                mesh=request.full_model,
                begun=begun,
                keep=lambda name, predicted: _write_predictions(
                    diagnosis, place, f"{name}_full_model", predicted
                ),
                progress=tell,
            )
            content = with_confirmation(content)
            content["next_measurement"] = proposed()
            made = improved()
            replace_text(place / "improved_machine.toml", made.text)
            content["fit"]["improved_machine"] = dict(made.errors)
            for what in made.lacks:
                LOGGER.warning("improved_machine.toml lacks %s", what)
            if reporter is not None:
                drawn()
        content["wall_time_s"] = time.perf_counter() - started
        replace_text(place / "diagnosis.json", json.dumps(plain_data(content), indent=1) + "\n")
        if reporter is not None:
            tell("report")
            reporter.ask("write", place)()
        return content


def _write(diagnosis: Diagnosis, opened: DiagnosedMachine, place: Path, *, report: bool) -> dict[str, Any]:
    """Write predictions, states and the data of the report; the content so far."""
    before = predictions_at_stamps(diagnosis.unchanged, diagnosis.null)
    after = predictions_at_stamps(diagnosis.predictor, diagnosis.stated_fit)
    _write_predictions(diagnosis, place, "before", before)
    _write_predictions(diagnosis, place, "after", after)
    content = diagnosis_content(diagnosis, opened, before, after)
    rows = states_of(content["findings"])
    if rows:
        with (place / "states.csv").open("w", newline="", encoding="utf-8") as stream:
            columns = (
                (*STATE_COLUMNS, "recording") if any("recording" in row for row in rows) else STATE_COLUMNS
            )
            writer = csv.DictWriter(stream, columns, lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)
    if report:
        from spindle_fem.report.diagnosis_data import diagnosis_dataset
        from spindle_fem.results.dataset import write_dataset

        write_dataset(diagnosis_dataset(diagnosis, before, after), place / "diagnosis.nc")
    return content


def _write_predictions(diagnosis: Diagnosis, place: Path, name: str, predicted: Sequence[np.ndarray]) -> None:
    """Write predictions beside readings, one file per recording."""
    recordings = diagnosis.predictor.recordings
    for number, recording in enumerate(recordings):
        label = f"_{number + 1}" if len(recordings) > 1 else ""
        write_simulated(place / f"{name}{label}.csv", recording, predicted[number])
