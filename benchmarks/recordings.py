"""Speed of reading and simulating recordings; run by hand, prints one line a case.

    python benchmarks/recordings.py [RECORDING]

Without a recording, a year of half-minute means is made up: 200,000 rows of
eight channels with gaps, empty cells and spikes.
"""

from __future__ import annotations

import gzip
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from spindle_fem.definition.load import machine_folder
from spindle_fem.definition.network_load import load_network_machine
from spindle_fem.model.lumped.written_network import build_network
from spindle_fem.model.reduced.network_inputs import fast_network
from spindle_fem.model.reduced.reduced_transient import simulate_fast
from spindle_fem.recordings.align import Recording, read_recording
from spindle_fem.recordings.compare import compare

ROWS = 200_000
MANIFEST = """
schema = "spindle-fem/recording/1"
name = "made up"
data = "{data}"
time = {{column = "time_utc"}}
"""
CHANNELS = {
    "main_spindle": 'role = "temperature"\nprobe = "main_spindle"\nunit = "degC"',
    "milling_spindle": 'role = "temperature"\nprobe = "milling_spindle"\nunit = "degC"',
    "n_main": 'role = "input"\ndrives = "main_speed"\nhold = "previous"\nunit = "rpm"',
    "n_milling": 'role = "input"\ndrives = "milling_speed"\nhold = "previous"\nunit = "rpm"',
    "p_main": 'role = "input"\ndrives = "main_load"\nhold = "previous"\nunit = "percent"',
    "p_milling": 'role = "input"\ndrives = "milling_load"\nhold = "previous"\nunit = "percent"',
    "humidity": 'role = "covariate"\nunit = "percent"',
    "pressure": 'role = "covariate"\nunit = "bar"',
}


def timed(label: str, function: Callable[[], Any], repeats: int = 3) -> Any:
    """Print the best of some runs and return the last result."""
    best = np.inf
    for _ in range(repeats):
        start = time.perf_counter()
        result = function()
        best = min(best, time.perf_counter() - start)
    print(f"{label:58s} {1e3 * best:9.2f} ms")
    return result


def make_recording(folder: Path, data: str) -> Path:
    """A large recording with every usual defect."""
    random = np.random.default_rng(0)
    seconds = 30.0 * (np.arange(ROWS) + 3.0 * np.cumsum(random.uniform(size=ROWS) < 0.01))
    stamps = pd.Timestamp("2020-01-01T00:00:00Z") + pd.to_timedelta(seconds, unit="s")
    frame = pd.DataFrame({"time_utc": stamps.strftime("%Y-%m-%dT%H:%M:%SZ")})
    wander = np.cumsum(random.standard_normal((ROWS, 2)), axis=0)
    frame[["main_spindle", "milling_spindle"]] = (
        25.0 + 5.0 * np.sin(wander / 300.0) + 0.1 * random.standard_normal((ROWS, 2))
    ).round(2)
    blocks = np.repeat(random.integers(0, 9, (ROWS // 100, 4)), 100, axis=0)
    frame[["n_main", "n_milling", "p_main", "p_milling"]] = blocks * [500, 500, 10, 10]
    frame[["humidity", "pressure"]] = random.uniform(1.0, 50.0, (ROWS, 2)).round(1)
    frame.loc[random.integers(0, ROWS, 2000), "main_spindle"] = np.nan
    frame.loc[random.integers(0, ROWS, 100), "milling_spindle"] += 30.0
    frame = frame.iloc[np.sort(np.concatenate([np.arange(ROWS), random.integers(0, ROWS, 200)]))]
    if data.endswith(".parquet"):
        frame.to_parquet(folder / data)
    else:
        content = frame.to_csv(index=False).encode()
        (folder / data).write_bytes(gzip.compress(content) if data.endswith(".gz") else content)
    text = MANIFEST.format(data=data)
    text += "".join(f'[[channel]]\ncolumn = "{name}"\n{body}\n' for name, body in CHANNELS.items())
    path = folder / f"{data.replace('.', '_')}.toml"
    path.write_text(text)
    return path


def bench_recording(label: str, path: Path) -> None:
    """Read, check, simulate, differentiate and compare one recording."""
    recording: Recording = timed(f"read and check {label}", lambda: read_recording(path))
    print(f"{'':4s}{recording.defects.lines()[0]}")
    probes = set(recording.probes)
    machine = "turning_centre" if "main_spindle" in probes else "bench_motor"
    network = build_network(load_network_machine(machine_folder() / f"{machine}.toml").network)
    if not probes <= set(network.node_names):
        return
    fast = fast_network(network)

    def simulate(names: tuple[str, ...] = ()) -> Any:
        drive = fast.inputs.drive(recording)
        start = fast.inputs.start(recording, drive, {}, names)
        return simulate_fast(fast, drive, start, derivatives=names).temperature

    temperature = timed("simulate", simulate)
    names = tuple(parameter.name for parameter in network.parameters)
    timed(f"simulate with derivatives to {len(names)} parameters", lambda: simulate(names))
    rows = fast.require_channels(recording.probes, "benchmark")
    timed("errors by channel and condition", lambda: compare(recording, temperature[:, rows]))


def main() -> None:
    """Run every case."""
    if len(sys.argv) > 1:
        bench_recording(sys.argv[1], Path(sys.argv[1]))
        return
    with tempfile.TemporaryDirectory() as name:
        for data in ("data.csv", "data.csv.gz", "data.parquet"):
            bench_recording(data, make_recording(Path(name), data))


if __name__ == "__main__":
    main()
