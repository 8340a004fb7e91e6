"""A study on a real Dask scheduler with two worker processes, one of which is killed in the middle."""

import os
import signal

import pytest

from spindle_fem.commands.sweep_command import sweep_machine
from spindle_fem.errors import BadInputError
from spindle_fem.parallel import WorkerPool
from spindle_fem.studies.sweep.results_table import RESULTS

distributed = pytest.importorskip("distributed")

pytestmark = pytest.mark.usefixtures("unpictured")
QUICK = ("mesh.preset=coarse", "mesh.order=1", "heat.model=table")
STUDY = """
schema = "spindle-fem/study/1"
[[parameter]]
path = "coolant.flow"
low = "4 L/min"
high = "12 L/min"
number = 4
[study]
outputs = ["temperature.max_degC", "coolant.outlet_degC"]
"""


@pytest.mark.slow
def test_a_killed_worker_loses_no_row_and_changes_no_digit(tmp_path, monkeypatch):
    path = tmp_path / "study.toml"
    path.write_text(STUDY, encoding="utf-8")
    sweep_machine("small_two_start", path, tmp_path / "serial", QUICK)
    landed = []
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
    ) as cluster:
        victim = next(iter(cluster.workers.values())).pid
        original = WorkerPool.stream

        def killing(self, jobs, names=()):
            for place, rows in original(self, jobs, names):
                if not landed:
                    os.kill(victim, signal.SIGKILL)
                landed.extend(row["design"] for row in rows)
                yield place, rows

        monkeypatch.setattr(WorkerPool, "stream", killing)
        sweep_machine("small_two_start", path, tmp_path / "dask", QUICK, scheduler=cluster.scheduler_address)
    assert sorted(landed) == [1, 2, 3, 4]
    assert (tmp_path / "dask" / RESULTS).read_bytes() == (tmp_path / "serial" / RESULTS).read_bytes()


def test_no_scheduler_there_is_bad_input(tmp_path, monkeypatch):
    client = distributed.Client
    monkeypatch.setattr(distributed, "Client", lambda address, timeout: client(address, timeout="300ms"))
    path = tmp_path / "study.toml"
    path.write_text(STUDY, encoding="utf-8")
    with pytest.raises(BadInputError, match="no Dask scheduler answers"):
        sweep_machine("small_two_start", path, tmp_path / "out", QUICK, scheduler="tcp://127.0.0.1:9")
