"""A written network and its recordings, made by an independent integrator with known differences."""

from itertools import pairwise

import numpy as np
import pandas as pd
from scipy.integrate import solve_ivp

from tests.support.written_texts import manifest_text, network_text

MACHINE = network_text(
    "drive",
    {"winding": ("400 J/K", 0.1), "bearing": ("250 J/K", 0.1), "body": ("1500 J/K", 0.1)},
    {"winding|body": ("4 W/K", 0.15), "bearing|body": ("3 W/K", 0.15), "body|ambient": ("2.5 W/K", 0.15)},
    [
        ("winding", "power", ("0.9 W/W", 0.05)),
        ("bearing", "speed", ("12 W", 0.1), {"reference": "1000 rpm", "exponent": 1.5}),
    ],
)
MANIFEST = manifest_text(
    "%s",
    {"Tw": "winding", "Tl": "bearing", "Tb": "body"},
    {"room": "ambient", "P": "power", "n": "speed"},
    time="t",
)
SPREADS = {
    "winding": ("C", 400.0, 0.1),
    "bearing": ("C", 250.0, 0.1),
    "body": ("C", 1500.0, 0.1),
    "winding|body": ("G", 4.0, 0.15),
    "bearing|body": ("G", 3.0, 0.15),
    "body|ambient": ("G", 2.5, 0.15),
    "power": ("gain", 0.9, 0.05),
    "speed": ("gain", 12.0, 0.1),
}
STEP, DURATION = 60.0, 14400.0
# Steps that are held, at stamps of the recording: start, W, rpm.
PROGRAMME = ((0.0, 0.0, 0.0), (900.0, 60.0, 1500.0), (4500.0, 60.0, 0.0), (6300.0, 0.0, 3000.0))
PROGRAMME = (*PROGRAMME, (9000.0, 90.0, 2000.0), (11700.0, 0.0, 0.0))


def as_built(seed):
    """A machine drawn from half of what its definition leaves open, as values."""
    generator = np.random.default_rng(1000 + seed)
    return {
        key: nominal * np.exp(0.5 * sigma * generator.standard_normal())
        for key, (_, nominal, sigma) in SPREADS.items()
    }


def inputs_at(time):
    row = next(row for row in reversed(PROGRAMME) if time >= row[0] - 1e-9)
    return row[1], row[2], 21.0 + 1.5 * np.sin(time / 4000.0)


# When a cover hangs before the body's fins.
COVERED = (4700.0, 9000.0)


def covered(time):
    return 0.5 if COVERED[0] <= time < COVERED[1] else 1.0


def temperatures(built, times, extra=lambda time: 0.0, share=lambda time: 1.0):
    """Of the nodes by an adaptive integrator, restarted where an input jumps.

    ``extra`` heats the body, ``share`` of whose cooling is left.
    """

    def slope(time, state):
        power, speed, room = inputs_at(min(time, stop - 1e-6))
        winding, bearing, body = state
        one = built["winding|body"] * (winding - body)
        two = built["bearing|body"] * (bearing - body)
        out = share(time) * built["body|ambient"] * (body - room)
        heat = built["speed"] * (speed / 1000.0) ** 1.5
        return [
            (built["power"] * power - one) / built["winding"],
            (heat - two) / built["bearing"],
            (one + two - out + extra(time)) / built["body"],
        ]

    state, found = np.full(3, inputs_at(0.0)[2]), np.empty((times.size, 3))
    switched = [edge for pair in (*HOT, COVERED) for edge in pair]
    edges = np.unique([row[0] for row in PROGRAMME] + switched + [times[-1]])
    for start, stop in pairwise(edges):
        own = (times >= start) & (times < stop)
        wanted = np.append(times[own], stop)
        solved = solve_ivp(slope, (start, stop), state, t_eval=wanted, rtol=1e-8, atol=1e-8, max_step=60.0)
        found[own], state = solved.y[:, :-1].T, solved.y[:, -1]
    found[times == times[-1]] = state
    return found


HOT = ((5100.0, 6600.0), (9900.0, 11400.0))
HEAT = 40.0


def hot(time):
    return HEAT if any(start <= time < end for start, end in HOT) else 0.0


def record(folder, seed, *, built=None, reading=None, times=None, beside=None, **physics):
    """Write a recording; ``reading`` turns the temperatures (N, 3) into what the sensors tell.

    ``beside`` is what a covariate told over time, ``physics`` as :func:`temperatures` has it.
    """
    folder.mkdir(parents=True)
    times = np.arange(0.0, DURATION + 1.0, STEP) if times is None else times
    told = temperatures(as_built(seed) if built is None else built, times, **physics)
    if reading is not None:
        told = reading(times, told)
    told = told + np.random.default_rng(seed).normal(0.0, 0.1, told.shape)
    power, speed, room = np.array([inputs_at(time) for time in times]).T
    columns = {"t": times, "Tw": told[:, 0], "Tl": told[:, 1], "Tb": told[:, 2], "room": room}
    columns |= {"P": power, "n": speed}
    manifest = MANIFEST % folder.name
    if beside is not None:
        columns["load"] = [beside(time) for time in times]
        manifest = manifest.replace("]\n", '{column = "load", role = "covariate", unit = "percent"},\n]\n')
    pd.DataFrame(columns).to_csv(folder / "data.csv", index=False)
    (folder / "recording.toml").write_text(manifest)
    return folder


LOADS = (0.0, 30.0, 80.0, 50.0, 100.0, 20.0, 0.0, 70.0, 40.0, 90.0, 10.0, 60.0)
