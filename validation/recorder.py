"""Write a recording's files from true readings: noise, rounding, and how loggers treat rows."""

import gzip
from dataclasses import asdict, dataclass
from pathlib import Path as FilePath

import numpy as np
from numpy.typing import NDArray

from .cycles import Plan
from .machine import CHANNELS

_INPUTS = (
    ("ambient", "ambient", "degC"),
    ("coolant_in", "coolant_inlet", "degC"),
    ("speed", "speed", "rpm"),
    ("thrust", "thrust", "N"),
)


@dataclass(frozen=True, slots=True)
class Noise:
    """White and slow errors, K and s, and the rounding step, K (0 for three decimals)."""

    white_K: float
    slow_K: float
    slow_s: float
    rounding_K: float = 0.0

    @property
    def total_K(self) -> float:
        """White and slow noise together, K."""
        return float(np.hypot(self.white_K, self.slow_K))

    def answer(self) -> dict[str, float]:
        """Noise in the form of the answers."""
        return asdict(self) | {"total_K": self.total_K}


@dataclass(frozen=True, slots=True)
class Logger:
    """Steps between rows to choose from, s; channels recorded; how late temperatures are stamped, s."""

    steps: tuple[float, ...] = (15.0, 20.0, 30.0)
    channels: tuple[int, ...] = tuple(range(len(CHANNELS)))
    late: float = 0.0

    @property
    def names(self) -> list[str]:
        """Names of the channels that are recorded."""
        return [CHANNELS[c] for c in self.channels]


EVERY_CHANNEL = Logger()


def draw_noise(rng: np.random.Generator) -> Noise:
    """Draw the noise of one machine's sensors."""
    return Noise(
        float(rng.choice([0.08, 0.10, 0.15])),
        float(rng.uniform(0.02, 0.05)),
        float(rng.uniform(600, 2400)),
        float(rng.choice([0.0, 0.05, 0.1])),
    )


def slow_error(
    rng: np.random.Generator, time: NDArray[np.float64], size: float, constant: float
) -> NDArray[np.float64]:
    """One stationary first-order Gauss-Markov path."""
    keep = np.exp(-np.diff(time, prepend=time[0] - 1e9) / constant)
    kicks = rng.standard_normal(time.size) * np.sqrt(1.0 - keep**2)
    out = np.empty(time.size)
    value = 0.0
    for k in range(time.size):
        value = keep[k] * value + kicks[k]
        out[k] = value
    return size * out


def record(
    folder: FilePath,
    stem: str,
    name: str,
    plan: Plan,
    readings: NDArray[np.float64],
    noise: Noise,
    rng: np.random.Generator,
    logger: Logger = EVERY_CHANNEL,
) -> dict[str, int]:
    """Write ``stem.toml`` and ``stem.csv.gz``; returns what was done to the rows."""
    step = float(rng.choice(logger.steps))
    drive = plan.drive
    time = np.arange(0.0, drive.time[-1], step)
    faults = {"gaps": 0, "empty": 0, "spikes": 0, "doubled": 0, "swapped": 0}
    columns = []
    for channel in logger.channels:
        y = np.interp(time - logger.late, drive.time, readings[:, channel])
        y += noise.white_K * rng.standard_normal(time.size) + slow_error(
            rng, time, noise.slow_K, noise.slow_s
        )
        columns.append(y)
    values = np.stack(columns, axis=1)
    if rng.random() < 0.25:
        faults["spikes"] = int(rng.integers(1, 6))
        for _ in range(faults["spikes"]):
            values[rng.integers(5, time.size), rng.integers(values.shape[1])] += rng.choice(
                [-1, 1]
            ) * rng.uniform(3, 30)
    if noise.rounding_K:
        values = np.round(values / noise.rounding_K) * noise.rounding_K
    cells = [[f"{v:.3f}" for v in row] for row in values]
    if rng.random() < 0.35:
        for _ in range(int(rng.integers(1, 4))):
            channel = int(rng.integers(values.shape[1]))
            where = rng.choice(time.size, int(rng.integers(5, 40)), replace=False)
            faults["empty"] += where.size
            for k in where:
                cells[k][channel] = ""
    held = np.minimum((time / drive.step + 1e-9).astype(int), drive.time.size - 1)
    ambient = np.interp(time, drive.time, drive.ambient) + 0.07 * rng.standard_normal(time.size)
    ambient[0] = drive.ambient[0] + 0.02 * rng.standard_normal()
    inlet = np.interp(time, drive.time, drive.coolant_in) + 0.05 * rng.standard_normal(time.size)
    rows = [
        f"{t:g},"
        + ",".join(cells[k])
        + f",{ambient[k]:.2f},{inlet[k]:.2f},{drive.speed[i]:g},{drive.thrust[i]:g}"
        for k, (t, i) in enumerate(zip(time, held, strict=True))
    ]
    keep = np.ones(time.size, dtype=bool)
    if rng.random() < 0.3:
        faults["gaps"] = int(rng.integers(1, 3))
        for _ in range(faults["gaps"]):
            start = int(rng.integers(20, time.size - 80))
            keep[start : start + int(rng.uniform(200, 1200) / step)] = False
    rows = [row for row, kept in zip(rows, keep, strict=True) if kept]
    if rng.random() < 0.25:
        for _ in range(2):
            k = int(rng.integers(10, len(rows) - 10))
            rows.insert(k, rows[k])
        k = int(rng.integers(10, len(rows) - 10))
        rows[k], rows[k + 1] = rows[k + 1], rows[k]
        faults["doubled"], faults["swapped"] = 2, 1
    folder.mkdir(parents=True, exist_ok=True)
    header = ",".join(["time_s", *logger.names, *(n for n, _, _ in _INPUTS)])
    with gzip.GzipFile(folder / f"{stem}.csv.gz", "wb", mtime=0) as stream:
        stream.write(("\n".join([header, *rows]) + "\n").encode())
    (folder / f"{stem}.toml").write_text(
        _manifest(name, f"{stem}.csv.gz", noise.white_K, logger.names), encoding="utf-8"
    )
    return faults


def _manifest(name: str, data: str, sigma: float, channels: list[str]) -> str:
    head = (
        f'schema = "spindle-fem/recording/1"\nname = "{name}"\ndata = "{data}"\n'
        'time = {column = "time_s", unit = "s"}\n'
    )
    blocks = [
        f'\n[[channel]]\ncolumn = "{c}"\nrole = "temperature"\nprobe = "{c}"\n'
        f'unit = "degC"\nsigma = {sigma:g}\n'
        for c in channels
    ]
    for column, drives, unit in _INPUTS:
        hold = 'hold = "previous"\n' if column in ("speed", "thrust") else ""
        blocks.append(
            f'\n[[channel]]\ncolumn = "{column}"\nrole = "input"\n'
            f'drives = "{drives}"\n{hold}unit = "{unit}"\n'
        )
    return head + "".join(blocks)
