"""Kernels are compiled beside the first machine that is meshed, and loaded from disk after that."""

import os
import subprocess
import sys

import pytest

# What a first run does: begins, waits for the kernels of a steady solution, solves and waits for columns.
FIRST_RUN = """
from spindle_fem.model.mesh.kernels import column_loops, compile, team_loops
assert not compile._are_kept()
jobs = compile.begin_compiling()
for stage in ("elements", "steady", "columns"):
    jobs[stage]()
assert not team_loops.cycle.signatures  # compiled elsewhere
assert compile._are_kept()
compile.KernelsInTurn().steady()
compile.KernelsInTurn().columns()
for kernel in (team_loops.cycle, team_loops.conjugate_step, column_loops.left_over):
    assert sum(kernel.stats.cache_hits.values()) == 1 and not kernel.stats.cache_misses, kernel
"""


@pytest.mark.slow  # compiles all kernels: 15 s
def test_a_copy_of_the_process_compiles_what_this_one_loads(tmp_path):
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path), "SPINDLE_FEM_THREADS": "2"}
    done = subprocess.run(
        [sys.executable, "-c", FIRST_RUN], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
