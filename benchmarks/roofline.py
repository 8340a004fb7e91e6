"""Limits set by the memory: stream bandwidth, one sparse product, the products that a solve takes.

python benchmarks/roofline.py CASE_FOLDER
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from spindle_fem.model.mesh import threads
from spindle_fem.model.mesh.kernels.multigrid_loops import multiply

HERE = Path(__file__).resolve().parent
REPEATS = 20
STREAM_DOUBLES = 1 << 25


def fastest(run: Callable[[], object], repeats: int = REPEATS) -> float:
    """Least seconds of several calls."""
    run()
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        run()
        times.append(time.perf_counter() - begin)
    return min(times)


def stream_bandwidth(n_threads: int) -> float:
    """Bytes a second of ``a = b + c`` on arrays far larger than the caches, by threads."""
    share = STREAM_DOUBLES // n_threads
    arrays = [[np.ones(share) for _ in range(3)] for _ in range(n_threads)]
    with ThreadPoolExecutor(n_threads) as pool:
        seconds = fastest(lambda: list(pool.map(lambda abc: np.add(abc[1], abc[2], out=abc[0]), arrays)), 8)
    # the write also reads its line first
    return 4 * 8 * share * n_threads / seconds


def measure(case: Path) -> dict:
    """Seconds and bandwidths of one case's matrix."""
    sys.path[:0] = [str(HERE), str(HERE / "peers")]
    from run_spindle_fem import thermal_system, warm_up

    warm_up()
    matrix = thermal_system(case)[2].matrix
    n = matrix.shape[0]
    vector, out = np.random.default_rng(0).standard_normal((2, n))
    bytes_read = matrix.nnz * 12 + 4 * n + 16 * n
    answer = {
        "nodes": n,
        "entries_a_row": matrix.nnz / n,
        "product_bytes": bytes_read,
        "stream_GB_s": {str(k): stream_bandwidth(k) / 1e9 for k in (1, 2)},
        "product_s": {"scipy": fastest(lambda: matrix @ vector)},
    }
    for count in (1, 2):
        bounds = np.linspace(0, n, count + 1).astype(np.int64)
        for name, dtype in (("", np.float64), (", single", np.float32)):
            rows = (*threads.unsigned(matrix.indptr, matrix.indices), matrix.data.astype(dtype))
            given = (multiply, bounds, *rows, vector.astype(dtype), out.astype(dtype))
            answer["product_s"][f"{count} threads{name}"] = fastest(
                lambda given=given: threads.run_blocks(*given)
            )
    best = max(answer["stream_GB_s"].values())
    answer["product_at_stream_s"] = bytes_read / (best * 1e9)
    return answer


if __name__ == "__main__":
    json.dump(measure(Path(sys.argv[1])), sys.stdout)
    print()
