"""A network case's files: machine definition, recordings with what loggers do to them."""

import gzip
from pathlib import Path

import numpy as np

from .scene import Owner, Run, with_noise


def machine_text(owner: Owner, name: str) -> str:
    """The machine's definition: estimates only."""
    machine, known = owner.machine, owner.estimates
    out = [
        f"# {machine.title} No drawings; every value is an estimate.",
        'schema = "spindle-fem/machine/1"',
        f'name = "{name}"',
        'initial = "first_reading"',
    ]
    for node in machine.network.nodes:
        bare = "" if node in owner.sensors else "\n# no sensor"
        out.append(
            f'\n[[network.node]]\nname = "{node}"{bare}\ncapacity = {known["capacity." + node].text("J/K")}'
        )
    for boundary in machine.network.boundaries:
        given = f'"{boundary}"'
        if boundary == machine.room and not owner.room_recorded:
            low, high = owner.room_range
            given = f'{{low = "{low:.1f} degC", high = "{high:.1f} degC"}}  # not recorded'
        out.append(f'\n[[network.boundary]]\nname = "{boundary}"\ntemperature = {given}')
    for link in machine.network.conductance:
        a, b = link.split("|")
        text = known["conductance." + link].text("W/K")
        out.append(f'\n[[network.link]]\nbetween = ["{a}", "{b}"]\nconductance = {text}')
    for source in machine.network.sources:
        lines = [f'\n[[network.source]]\nnode = "{source.node}"\ninput = "{source.input}"']
        plain = source.unit == "W"
        if not plain:
            lines.append(f'reference = "{source.reference:g} {source.unit}"')
        lines.append(f"gain = {known['gain.' + source.name].text('W/W' if plain else 'W')}")
        if source.exponent != 1.0:
            lines.append("exponent = 1.666666667")
        out.append("\n".join(lines))
    return "\n".join(out) + "\n"


def _manifest(owner: Owner, title: str, data: str, shown: list[str]) -> str:
    head = (
        f'schema = "spindle-fem/recording/1"\nname = "{title}"\ndata = "{data}"\n'
        'time = {column = "time_s", unit = "s"}\n'
    )
    blocks = [
        f'\n[[channel]]\ncolumn = "{n}_degC"\nrole = "temperature"\nprobe = "{n}"\nunit = "degC"\n'
        f"sigma = {np.hypot(s.white_K, s.rounding_K / 12**0.5):.2g}\n"
        for n, s in owner.sensors.items()
    ]
    for name in shown:
        unit = owner.machine.units.get(name, "degC")
        surrounding = name in owner.machine.network.boundaries
        column = f"{name}_degC" if surrounding else name
        hold = "" if surrounding else 'hold = "previous"\n'
        blocks.append(
            f'\n[[channel]]\ncolumn = "{column}"\nrole = "input"\ndrives = "{name}"\n{hold}unit = "{unit}"\n'
        )
    for name in owner.machine.work.covariates:
        blocks.append(
            f'\n[[channel]]\ncolumn = "{name}"\nrole = "covariate"\nunit = "{owner.machine.units[name]}"\n'
        )
    return head + "".join(blocks)


def _gone(rng: np.random.Generator, time: np.ndarray) -> tuple[np.ndarray, list[list[float]], list[int]]:
    """Rows that are there, long gaps, and rows at which the logger starts again."""
    keep = np.ones(time.size, dtype=bool)
    gaps, restarts = [], []
    if rng.random() < 0.6:
        for start in rng.integers(10, time.size, int(rng.poisson(time.size / 400.0))):
            keep[start : start + int(rng.integers(1, 5))] = False
    for _ in range(int(rng.choice([0, 0, 1, 2, 3]))):
        start = int(rng.integers(time.size // 10, time.size * 9 // 10))
        stop = start + max(3, int(time.size * 10 ** rng.uniform(-2.6, -1.3)))
        keep[start:stop] = False
        gaps.append([float(time[start]), float(time[min(stop, time.size - 1)])])
        restarts.append(min(stop, time.size - 1))
    return keep, sorted(gaps), restarts


def write_run(rng: np.random.Generator, owner: Owner, run: Run, folder: Path, stem: str) -> dict[str, object]:
    """Write ``stem.toml`` and ``stem.csv.gz``; returns what was done to the rows."""
    readings = with_noise(rng, owner, run.truth)
    keep, gaps, restarts = _gone(rng, run.time)
    cells = [[f"{v:.6g}" for v in row] for row in np.round(readings, 3)]
    empty = 0
    for channel in range(readings.shape[1]):
        for k in rng.integers(1, run.time.size, int(rng.poisson(run.time.size * 0.002))):
            cells[k][channel] = ""
            empty += 1
    for at in restarts:
        # A logger that starts again has inputs before its slow temperature cards.
        for k in range(at, min(at + int(rng.integers(1, 4)), run.time.size)):
            cells[k] = [""] * readings.shape[1]
    shown = [k for k in run.logged if k != owner.machine.room or owner.room_recorded]
    columns = []
    for name in shown:
        values = run.logged[name]
        if name in owner.machine.network.boundaries:
            values = np.round(values + 0.05 * rng.standard_normal(values.size), 2)
        columns.append(["" if np.isnan(v) else f"{v:g}" for v in values])
    columns += [[f"{v:g}" for v in run.covariates[name]] for name in owner.machine.work.covariates]
    header = ["time_s", *(f"{n}_degC" for n in owner.channels)]
    header += [f"{n}_degC" if n in owner.machine.network.boundaries else n for n in shown]
    header += list(owner.machine.work.covariates)
    lines = [",".join(header)]
    for k in np.flatnonzero(keep):
        lines.append(",".join([f"{run.time[k]:g}", *cells[k], *(c[k] for c in columns)]))
    folder.mkdir(parents=True, exist_ok=True)
    with gzip.GzipFile(folder / f"{stem}.csv.gz", "wb", mtime=0) as stream:
        stream.write(("\n".join(lines) + "\n").encode())
    title = folder.name if stem == "recording" else f"{folder.name} {stem}"
    text = _manifest(owner, title, f"{stem}.csv.gz", shown)
    (folder / f"{stem}.toml").write_text(text, encoding="utf-8")
    return {"rows": len(lines) - 1, "gaps_s": gaps, "restarts": len(restarts), "empty": empty}
