"""How soon a watch says that a recording has left its machine, and how often it says so wrongly.

``python -m validation.watch_delay RESULTS [--recordings DIR | --study DIR] [--only NAME ...] [--sound]``
watches every open example, or every case of a study, to its end, writes ``RESULTS/watch_delay.json`` and
prints a table: effect, onset, delay to "leaving" and to "left", channel, and for what is sound the number of
alarms and the hours it was watched. With ``--sound`` only consistent machines are watched. ``--alarms`` is
``--false-alarms`` of the command.

A machine with calibration recordings is calibrated by them; a network without begins with a warm-up, the
first fifth of its recording, but no longer than up to the onset where the effect has one. Delays count from
the onset, or from where the watch begins. Calibration recordings, in which nothing is missing, are watched
as well: their second half, by what the first tells.
"""

import argparse
import json
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from spindle_fem.definition.load import find_machine, read_definition
from spindle_fem.definition.network_load import is_network_machine
from spindle_fem.recordings.align import read_recording
from spindle_fem.studies.watch import Watching, alarms_a_month, watch_recording

from .open_examples import MESH, cases_of, examples

WARM_UP_SHARE = 0.2
# Calibration recordings are watched as well: the second half, calibrated by the first.
SOUND, HALF = "_sound", 0.5
# Least warm-up worth the name, as a share of a recording: an earlier onset lies within it.
LEAST_SHARE = 0.02


def onset_of(answer: dict[str, Any]) -> float:
    """First moment at which something is missing, s; 0 where it always is, infinite where nothing is."""
    if "changes_s" in answer:
        return float(min(answer["changes_s"]))
    effects = answer.get("effects", [])
    starts = [effect["intervals"][0][0] if effect.get("intervals") else 0.0 for effect in effects]
    return float(min(starts, default=np.inf))


def concealed(answer: dict[str, Any]) -> list[str]:
    """Effects that an answer names."""
    return [effect["effect"] for effect in answer.get("effects", answer.get("acceptable", []))]


def watch_case(name: str, case: Path, machine: str, answer: Path, alarms: str) -> dict[str, Any]:
    """One line of the table; names that end in ``SOUND`` are those of calibration recordings."""
    truth, path, earlier = json.loads(answer.read_text()), case / "recording.toml", case / "calibration.toml"
    calibration = [earlier] if earlier.exists() else []
    if name.endswith(SOUND):
        truth, path, calibration = {}, earlier, []
    onset, recording = onset_of(truth), read_recording(path)
    duration = float(recording.times[-1] - recording.times[0])
    warm_up = HALF * duration if name.endswith(SOUND) else 0.0
    if is_network_machine(read_definition(find_machine(machine))) and not (calibration or warm_up):
        whole = WARM_UP_SHARE * duration
        warm_up = min(whole, onset) if onset > LEAST_SHARE * duration else whole
    how = Watching(
        calibration,
        () if machine.endswith(".toml") else MESH,
        warm_up=warm_up,
        alarms=alarms_a_month(alarms),
        heartbeat=1.0,
        until_end=True,
    )
    began = time.perf_counter()
    lines = list(watch_recording(machine, path, how))
    at = np.array([_seconds(line["time"], recording.start) for line in lines])
    states = np.array([line["state"] for line in lines])
    away = np.flatnonzero((states == "left") & (np.append("", states[:-1]) != "left"))
    counted = max(onset, float(at[0]))
    found = {
        word: next((float(at[i]) - counted for i in np.flatnonzero(states == word) if at[i] >= counted), None)
        for word in ("leaving", "left")
    }
    first = next((lines[i] for i in np.flatnonzero(states == "left") if at[i] >= counted), {})
    return {
        "case": name,
        "truth": concealed(truth),
        "onset_s": None if np.isinf(onset) else onset,
        "watched_h": (duration - float(at[0])) / 3600.0,
        "sound_h": max(0.0, min(onset, duration) - float(at[0])) / 3600.0,
        "false_alarms": int(np.sum(at[away] < onset)),
        "leaving_after_s": found["leaving"],
        "left_after_s": found["left"],
        "channel": first.get("channel"),
        "wall_s": time.perf_counter() - began,
    }


def _seconds(stamp: float | str, start: str | None) -> float:
    """A time of a line since the first row, s."""
    if start is None:
        return float(stamp)
    ends = (np.datetime64(text.removesuffix("Z")) for text in (stamp, start))
    return float((next(ends) - next(ends)) / np.timedelta64(1, "s"))


def main(arguments: list[str] | None = None) -> None:
    """Watch what is asked for and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("results", type=Path)
    parser.add_argument("--recordings", type=Path, default=Path("../shared/recordings"))
    parser.add_argument("--study", type=Path)
    parser.add_argument("--sound", action="store_true", help="consistent machines only")
    parser.add_argument("--only", nargs="*", default=[], help="names or beginnings of names")
    parser.add_argument("--alarms", default="1/month")
    parser.add_argument("--jobs", type=int, default=1)
    given = parser.parse_args(arguments)
    given.results.mkdir(parents=True, exist_ok=True)
    found = examples(given.recordings) if given.study is None else cases_of(given.study)
    wanted = {
        name: item
        for name, item in found.items()
        if (not given.only or name.startswith(tuple(given.only)))
        and not (given.sound and concealed(json.loads(item[2].read_text())))
    }
    wanted |= {name + SOUND: item for name, item in wanted.items() if (item[0] / "calibration.toml").exists()}
    rows = []
    with ProcessPoolExecutor(given.jobs) as pool:
        orders = [pool.submit(watch_case, name, *item, given.alarms) for name, item in wanted.items()]
        for order in orders:
            rows.append(order.result())
            print(_line(rows[-1]), flush=True)
    (given.results / "watch_delay.json").write_text(json.dumps(rows, indent=1), encoding="utf-8")
    sound = sum(row["sound_h"] for row in rows)
    print(f"{sum(row['false_alarms'] for row in rows)} false alarms in {sound:.0f} h of sound machines")


def _line(row: dict[str, Any]) -> str:
    def hours(value: float | None) -> str:
        return "     –" if value is None else f"{value / 3600.0:6.2f}"

    return (
        f"{row['case']:32s} onset {hours(row['onset_s'])} h  leaving after {hours(row['leaving_after_s'])} h"
        f"  left after {hours(row['left_after_s'])} h  {row['channel'] or '–':20s}"
        f" false {row['false_alarms']} in {row['sound_h']:6.1f} h  {row['wall_s']:4.0f} s"
        f"  {', '.join(row['truth']) or '(consistent)'}"
    )


if __name__ == "__main__":
    main()
