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
from spindle_fem.model.lumped.network_transient import TimeScheme, simulate_transient
from spindle_fem.model.lumped.thermal_network import ConductanceLaw, ThermalNetwork
from spindle_fem.model.lumped.written_network import build_network
from spindle_fem.recordings.align import Recording, read_recording
from spindle_fem.recordings.compare import compare
from spindle_fem.recordings.input_samples import InputHistory
from spindle_fem.solvers.network_steady import solve_steady
from spindle_fem.solvers.simulate_network import simulate_on_recording

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


def large_network() -> tuple[ThermalNetwork, InputHistory]:
    """A grid of 9 by 8 nodes with natural convection outside and heat that falls as it warms."""
    columns, layers = 9, 8
    number = columns * layers
    grid = np.arange(number).reshape(columns, layers)
    pairs = np.concatenate(
        [
            np.stack([grid[:-1].ravel(), grid[1:].ravel()], axis=1),
            np.stack([grid[:, :-1].ravel(), grid[:, 1:].ravel()], axis=1),
            np.stack([grid[:, -1], np.full(columns, number)], axis=1),
        ]
    )
    random = np.random.default_rng(0)
    heated = grid[[1, 2, 6, 7], 3]

    def convection(first: Any, second: Any, inputs: Any) -> Any:
        difference = first - second
        size = np.sqrt(difference**2 + 1.0)
        slope = 0.125 * size**-1.75 * difference
        return 0.5 * size**0.25, slope, -slope

    def friction(nodes: Any, boundaries: Any, inputs: Any) -> Any:
        heat, slope = np.zeros(number), np.zeros((number, number))
        heat[heated] = 0.5 * inputs["speed"] * np.exp(-0.02 * (nodes[heated] - 293.15))
        slope[heated, heated] = -0.02 * heat[heated]
        return heat, slope

    network = ThermalNetwork(
        tuple(f"node{k}" for k in range(number)),
        random.uniform(50.0, 1000.0, number),
        pairs[:, 0],
        pairs[:, 1],
        random.uniform(1.0, 20.0, len(pairs)),
        ("air",),
        [293.15],
        conductance_laws=(ConductanceLaw(np.arange(len(pairs) - columns, len(pairs)), convection),),
        heat_laws=(friction,),
        law_inputs=("speed",),
    )
    times = np.arange(0.0, 14401.0, 10.0)
    speed = 50.0 + 50.0 * (times // 1600.0)
    return network, InputHistory(times, ("speed",), speed[:, None], [True])


def bench_recording(label: str, path: Path) -> None:
    """Read, check, simulate, differentiate and compare one recording."""
    recording: Recording = timed(f"read and check {label}", lambda: read_recording(path))
    print(f"{'':4s}{recording.defects.lines()[0]}")
    probes = set(recording.probes)
    machine = "turning_centre" if "main_spindle" in probes else "bench_motor"
    network = build_network(load_network_machine(machine_folder() / f"{machine}.toml").network)
    if not probes <= set(network.node_names):
        return
    result = timed("simulate", lambda: simulate_on_recording(network, recording))
    number = len(network.parameters)
    timed(
        f"simulate with derivatives to {number} parameters",
        lambda: simulate_on_recording(network, recording, parameters=network.parameters),
    )
    timed("errors by channel and condition", lambda: compare(recording, result.predicted))


def main() -> None:
    """Run every case."""
    network, history = large_network()
    start = np.full(network.n_nodes, 293.15)
    timed("steady state, 72 nodes with laws", lambda: solve_steady(network, {"speed": 450.0}), 20)
    for error in (1e-3, 1e-2, None):
        timed(
            f"4 h at 10 s, 72 nodes with laws, step error {error} K",
            lambda error=error: simulate_transient(
                network, history, start, scheme=TimeScheme(step_error=error)
            ),
        )
    if len(sys.argv) > 1:
        bench_recording(sys.argv[1], Path(sys.argv[1]))
        return
    with tempfile.TemporaryDirectory() as name:
        for data in ("data.csv", "data.csv.gz", "data.parquet"):
            bench_recording(data, make_recording(Path(name), data))


if __name__ == "__main__":
    main()
