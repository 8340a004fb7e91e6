"""Spoilt recordings and manifests: drawn, drafted, simulated, watched, diagnosed."""

from __future__ import annotations

import random
from pathlib import Path

import tomli_w

from .child import run_command, run_process
from .judged import Record
from .material import COARSE, PUMP, SPINDLE, pump_recording, spindle_recording
from .mutated_data import mutated_data
from .mutations import mutated

EVERY_PROCESS = 50
SHARE_DATA, SHARE_MANIFEST = 0.7, 0.45
# Of twenty cases, the number for each command.
COMMANDS = {"simulate": 8, "show": 4, "draft": 4, "simulate_spindle": 2, "watch": 1, "diagnose": 1}
WRITTEN = frozenset({"out", "out.png"})


def try_recording(number: int, chance: random.Random, folder: Path) -> Record:
    """One mutated recording, given to one of the commands that read recordings."""
    record = Record("recordings", number)
    order = [name for name, share in COMMANDS.items() for _ in range(share)]
    command = order[number % len(order)]
    manifest, frame = spindle_recording() if command == "simulate_spindle" else pump_recording()
    record.done = [command]
    data, suffix = frame.to_csv(index=False).encode(), ".csv"
    both = chance.random()
    if both < SHARE_DATA or command == "draft":
        data, suffix, done = mutated_data(chance, frame)
        record.done += done
    manifest["data"] = f"data{suffix}"
    text = tomli_w.dumps(manifest).encode()
    if both > 1.0 - SHARE_MANIFEST:
        text, done = mutated(chance, manifest)
        record.done += done
    (folder / f"data{suffix}").write_bytes(data)
    (folder / "recording.toml").write_bytes(text)
    arguments = {
        "simulate": ["simulate", str(PUMP), "recording.toml", "-o", "out"],
        "show": ["recording", "show", "recording.toml", "-o", "out.png"],
        "draft": ["recording", "draft", f"data{suffix}", "-o", "out"],
        "simulate_spindle": ["simulate", SPINDLE, "recording.toml", "-o", "out", *COARSE],
        "watch": ["watch", str(PUMP), "recording.toml", "--warm-up", "40 min", "--until-end"],
        "diagnose": ["diagnose", str(PUMP), "recording.toml", "-o", "out"],
    }[command]
    run = run_process if number % EVERY_PROCESS == 0 else run_command
    record.step(command, run(arguments, folder))
    return record
