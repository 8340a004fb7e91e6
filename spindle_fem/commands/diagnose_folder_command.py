"""``spindle-fem diagnose`` of a folder of recordings: a diagnosis each, a table, a page that lists them."""

from __future__ import annotations

import contextlib
import hashlib
import json
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from spindle_fem import __version__
from spindle_fem.commands.diagnose_command import diagnose
from spindle_fem.definition.load import find_machine, read_definition
from spindle_fem.errors import BadInputError, SpindleFemError
from spindle_fem.inference.full_model_check import AUTO, require_choice
from spindle_fem.parallel import WorkerPool
from spindle_fem.recordings.manifest import find_manifest, load_manifest
from spindle_fem.recordings.recording_folder import recordings_in
from spindle_fem.report.diagnoses_report import DIAGNOSES, DIAGNOSES_SCHEMA, write_diagnoses_report
from spindle_fem.report.diagnosis_words import heldout_errors
from spindle_fem.results.output_folder import is_complete, output_folder, replace_text
from spindle_fem.results.run_log import LOGGER
from spindle_fem.studies.sweep.results_table import FAILED, OK, ResultTable, Row
from spindle_fem.studies.sweep.study_lock import folder_lock

TABLE = "diagnoses.csv"
COLUMNS = (
    "recording",
    "verdict",
    "findings",
    "probability",
    "before_rmse_K",
    "after_rmse_K",
    "noise_K",
    "wall_s",
    "status",
    "reason",
    "key",
)


@dataclass(frozen=True, slots=True)
class FolderOrder:
    """Options of :func:`diagnose_folder` that apply to every recording.

    Attributes
    ----------
    machine : str or Path
    calibrate : sequence of Path
        Recordings of the same machine with nothing missing.
    overrides : sequence of str
    heldout, full_model : str
        As :func:`spindle_fem.commands.diagnose_command.diagnose` takes them.
    """

    machine: str | Path
    calibrate: Sequence[Path] = ()
    overrides: Sequence[str] = ()
    heldout: str = "blocks"
    full_model: str = AUTO


def diagnose_folder(
    order: FolderOrder,
    recordings: str | Path,
    folder: str | Path,
    *,
    jobs: int = 1,
    scheduler: str | None = None,
    progress: Callable[[str], None] = LOGGER.info,
) -> dict[str, Any]:
    """Diagnose every recording of a folder by itself.

    A command that was stopped goes on where it ended: recordings that are in the table with the same machine,
    data and options are not diagnosed again. A recording that fails is a row with its reason.

    Parameters
    ----------
    recordings : str or Path
        Folder with several recordings: manifests, or sub-folders with one each.
    folder : str or Path
        Gets a folder for each recording, ``diagnoses.csv`` (and ``.parquet``), ``diagnoses.json`` and
        ``report.html``.
    jobs : int
        Worker processes; below 1 for one a core.
    scheduler : str, optional
        Address of a Dask scheduler, in place of ``jobs``; its workers see the same files.

    Returns
    -------
    dict
        The content of ``diagnoses.json``.

    Raises
    ------
    SpindleFemError
        A broken machine, no recording, or none that could be diagnosed.
    """
    started = time.perf_counter()
    require_choice(order.full_model)
    machine = read_definition(find_machine(order.machine))
    calibration = [find_manifest(path) for path in order.calibrate]
    found = recordings_in(recordings, calibration)
    if not found:
        raise BadInputError(str(recordings), "holds no recording.", "Give a folder with manifests in it.")
    common = [
        __version__,
        json.dumps(machine, sort_keys=True, default=str),
        *order.overrides,
        order.heldout,
        order.full_model,
    ]
    common += [_content_of(path) for path in calibration]
    keys = {name: _key(name, [*common, _content_of(path)]) for name, path in found.items()}
    # Workers may run in another directory; a machine that ships goes by its name.
    path = Path(order.machine)
    sent = replace(
        order,
        machine=path.resolve() if path.is_file() else order.machine,
        calibrate=[item.resolve() for item in calibration],
    )
    with folder_lock(folder), output_folder(folder) as place:
        table = ResultTable(place, COLUMNS, TABLE)
        waiting = [
            name
            for name, key in keys.items()
            if key not in table or (table.rows[key]["status"] == OK and not is_complete(place / name))
        ]
        calls = [partial(_diagnosed, sent, found[name].resolve(), place.resolve() / name) for name in waiting]
        done = len(found) - len(waiting)
        progress(f"{done} of {len(found)} recordings")
        began = time.perf_counter()
        for number, row in WorkerPool(jobs, scheduler).stream(calls, waiting):
            name = waiting[number]
            if keys[name] not in table:
                table.append(row | {"recording": name, "key": keys[name]})
            done += 1
            left = len(found) - done
            each = (time.perf_counter() - began) / (len(waiting) - left)
            progress(f"{done} of {len(found)} recordings{_left_words(left * each)}")
        rows = table.finish({"key": keys[name], "recording": name} for name in found)
        good = [row for row in rows if row["status"] == OK]
        content = {
            "schema": DIAGNOSES_SCHEMA,
            "machine": machine.get("name", str(order.machine)),
            "recordings": len(rows),
            "diagnosed": len(good),
            "failed": len(rows) - len(good),
            "reused": len(found) - len(waiting),
            "rows": [{name: row[name] for name in COLUMNS if name != "key"} for row in rows],
            "wall_time_s": time.perf_counter() - started,
        }
        replace_text(place / DIAGNOSES, json.dumps(content, indent=1) + "\n")
        write_diagnoses_report(place)
        if not good:
            raise BadInputError(
                str(recordings), f"none of {len(rows)} recordings could be diagnosed: {rows[0]['reason']}"
            )
    return content


def _diagnosed(order: FolderOrder, recording: Path, folder: Path) -> Row:
    """Row of one recording, diagnosed in any process; errors become part of the row."""
    started = time.perf_counter()
    row: Row = dict.fromkeys(COLUMNS)
    try:
        content = diagnose(
            order.machine,
            [recording],
            folder,
            order.calibrate,
            order.overrides,
            heldout=order.heldout,
            full_model=order.full_model,
        )
    except (SpindleFemError, OSError, ArithmeticError, ValueError) as error:
        row |= {"status": FAILED, "reason": f"{type(error).__name__}: {error}"}
    else:
        row |= _cells(content)
    return row | {"wall_s": round(time.perf_counter() - started, 2)}


def _cells(content: Mapping[str, Any]) -> Row:
    """Cells from the result of a diagnosis."""
    fit = content["fit"]
    before, after, _ = heldout_errors(fit)
    return {
        "verdict": content["verdict"],
        "findings": "; ".join(f"{item['effect']} @ {item['component']}" for item in content["findings"]),
        "probability": content.get("set_probability"),
        "before_rmse_K": before,
        "after_rmse_K": after,
        "noise_K": fit["noise_K"],
        "status": OK,
        "reason": content["reason"],
    }


def _content_of(manifest: Path) -> str:
    """Hash of a manifest and its data; of the manifest alone where that leads nowhere."""
    found = hashlib.sha256(manifest.read_bytes())
    with contextlib.suppress(SpindleFemError, OSError):
        found.update(load_manifest(manifest)[1].read_bytes())
    return found.hexdigest()


def _left_words(seconds: float) -> str:
    """Time left in words, rounded up; empty when nothing is left.

    >>> _left_words(0.0), _left_words(40.0), _left_words(5000.0)
    ('', ', some 1 min left', ', some 1.4 h left')
    """
    if seconds <= 0.0:
        return ""
    minutes = math.ceil(seconds / 60.0)
    return f", some {minutes} min left" if minutes < 60 else f", some {seconds / 3600.0:.1f} h left"


def _key(name: str, parts: Sequence[str]) -> str:
    return hashlib.sha256("\0".join([name, *parts]).encode()).hexdigest()[:24]
