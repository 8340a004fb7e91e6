"""Processor time of a steady state with preload followed, over that of one at the size of assembly.

The reference spindle; pairs one after the other in one process, so that the ratio is that of one load.

Run: ``python benchmarks/growth.py``
"""

from __future__ import annotations

import json
import time

import numpy as np

from spindle_fem.definition.load import load_machine
from spindle_fem.solvers.prepared_machine import PreparedMachine, prepare_machine
from spindle_fem.studies.solve_machine import solve_prepared

MACHINE = ("mesh.preset=coarse",)
PAIRS = 3


def prepared(follow: bool) -> PreparedMachine:
    """The machine on its mesh."""
    chosen = f"heat.thermal_preload={str(follow).lower()}"
    return prepare_machine(load_machine("wu_tan_2016", [*MACHINE, chosen]))


def seconds(machine: PreparedMachine, find_fold: bool) -> float:
    """Processor time of one solve."""
    begin = time.process_time()
    solve_prepared(machine, find_fold=find_fold)
    return time.process_time() - begin


def main() -> None:
    """Print one line for a state alone and one with the search for the fold."""
    plain, followed = prepared(follow=False), prepared(follow=True)
    seconds(plain, find_fold=False)  # compiled and cached things are made once
    for find_fold in (False, True):
        pairs = [(seconds(plain, find_fold), seconds(followed, find_fold)) for _ in range(PAIRS)]
        without, coupled = np.median(pairs, axis=0).round(2).tolist()
        line = {"fold": find_fold, "plain_s": without, "coupled_s": coupled}
        print(json.dumps(line | {"ratio": round(coupled / without, 2)}))


if __name__ == "__main__":
    main()
