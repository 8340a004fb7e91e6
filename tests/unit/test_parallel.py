"""Threads, worker processes and the background process: order, errors, deaths, what is sent when."""

import os
import platform
import re
import signal
import subprocess
import sys
import threading
import time
import types
from functools import partial
from pathlib import Path

import pytest

import spindle_fem
from spindle_fem import parallel
from spindle_fem.errors import BadInputError, WorkerDiedError
from spindle_fem.parallel import (
    BackgroundProcess,
    Shared,
    StandingCopies,
    WorkerPool,
    in_copies,
    start_copy,
    worker_pool,
)

SEVERAL_CORES = parallel.core_count() > 1


# ------------------------------------------------------------------ worker processes
class Told:
    """Notes which thread sends it."""

    def __init__(self, senders):
        self.senders = senders

    def __reduce__(self):
        self.senders.append(threading.current_thread())
        return str, ("sent",)


def die_beside(parent):
    if os.getpid() != parent:
        os.kill(os.getpid(), signal.SIGKILL)
    return parent


def die_once(mark):
    if not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return "done again"


def refuse():
    raise BadInputError("work", "it was refused.")


def threads_there():
    return parallel.thread_count(), os.environ["OPENBLAS_NUM_THREADS"]


def largest(shared):
    return max(shared.value), id(shared.value), os.getpid()


def test_a_job_that_is_started_is_sent_before_anything_goes_on():
    senders, sizes = [], {"a": 1}
    waiting = WorkerPool(2).start(partial(str, Told(senders)))
    assert senders == [threading.main_thread()]
    counted = WorkerPool(2).start(partial(len, sizes))
    sizes |= {"b": 2}
    assert (waiting(), counted()) == ("sent", 1)


def test_jobs_are_sent_by_the_thread_that_has_them_and_answers_keep_their_order():
    senders = []
    jobs = [partial(lambda told, number: number, Told(senders), number) for number in range(5)]
    assert WorkerPool(2).map(jobs) == [0, 1, 2, 3, 4]
    assert set(senders) == {threading.main_thread()}


def test_alone_nothing_is_sent():
    senders, pool = [], WorkerPool(1)
    assert pool.is_alone
    assert pool.start(partial(len, {"a": 1}))() == 1
    jobs = [partial(isinstance, Told(senders), Told)] * 2
    assert pool.map(jobs) == [True, True]
    assert list(pool.stream(jobs)) == [(0, True), (1, True)]
    assert senders == []


def test_other_processes_are_woken_where_there_are_any(monkeypatch):
    started = []
    idle = types.SimpleNamespace(submit=lambda job: None)
    monkeypatch.setattr(worker_pool, "_executor", lambda number: started.append(number) or idle)
    WorkerPool(1).wake()
    assert started == []
    WorkerPool(3).wake()
    assert started == [2, 2]


def test_a_stream_answers_every_job_from_workers_with_one_thread_each():
    found = dict(WorkerPool(2).stream([threads_there] * 5))
    assert found == dict.fromkeys(range(5), (1, "1"))


def test_what_is_shared_is_read_once_a_worker():
    shared = Shared([3, 1, 2])
    found = dict(WorkerPool(2).stream([partial(largest, shared)] * 6))
    assert {value for value, _, _ in found.values()} == {3}
    assert len({(place, process) for _, place, process in found.values()}) <= 2
    assert os.getpid() not in {process for _, _, process in found.values()}


def test_an_error_of_a_job_is_raised_here_whoever_ran_it():
    pool = WorkerPool(2)
    for ask in (lambda: pool.map([refuse] * 3), lambda: list(pool.stream([refuse] * 3)), pool.start(refuse)):
        with pytest.raises(BadInputError, match="it was refused"):
            ask()


def test_what_a_worker_died_on_is_done_again(tmp_path):
    jobs = [partial(len, "ab"), partial(die_once, tmp_path / "died"), *[partial(len, "abc")] * 4]
    found = list(WorkerPool(2).stream(jobs))
    assert sorted(place for place, _ in found) == list(range(6))
    assert dict(found) == {0: 2, 1: "done again", 2: 3, 3: 3, 4: 3, 5: 3}


def test_a_worker_that_dies_is_an_error_that_names_its_job():
    pool, job = WorkerPool(2), partial(die_beside, os.getpid())
    with pytest.raises(WorkerDiedError, match=r"^design 8: its worker process ended before its time"):
        list(pool.stream([partial(len, "a"), job, job], ["design 7", "design 8", "design 8"]))
    with pytest.raises(WorkerDiedError, match=r"^the fit: "):
        pool.start(job, "the fit")()
    with pytest.raises(WorkerDiedError, match=r"die_beside [1-4] of 4"):
        pool.map([job] * 4)
    # and the next pool has new processes
    assert sorted(dict(pool.stream([partial(len, "ab")] * 3)).values()) == [2, 2, 2]


def test_workers_are_as_many_as_asked_for_or_one_a_core(monkeypatch):
    assert parallel.worker_count(3) == WorkerPool(3).size() == 3
    monkeypatch.setenv("SPINDLE_FEM_THREADS", "7")
    parallel.core_count.cache_clear()
    try:
        assert parallel.worker_count(0) == 7
    finally:
        monkeypatch.undo()
        parallel.core_count.cache_clear()


# ------------------------------------------------------------------ a background process
class Counter:
    """Remembers what it was asked for."""

    def __init__(self):
        self.total = 0

    def add(self, number):
        self.total += number
        return self.total, os.getpid()

    def add_largest(self, values):
        return self.add(max(values.values()))[0]

    def fail(self):
        raise BadInputError("worker", "cannot do it.")

    def die(self):
        os.kill(os.getpid(), signal.SIGKILL)


def test_a_background_process_answers_in_order():
    with BackgroundProcess(Counter) as process:
        first, second = process.ask("add", 1), process.ask("add", 2)
        assert second()[0] == 3
        assert first()[0] == 1
        assert first()[1] == second()[1]
        assert (first()[1] != os.getpid()) == SEVERAL_CORES


@pytest.mark.skipif(not SEVERAL_CORES, reason="works in this process on one core")
def test_the_object_is_made_before_it_is_asked_anything(tmp_path):
    with BackgroundProcess(partial(Path.touch, tmp_path / "made")):
        for _ in range(100):
            if (tmp_path / "made").exists():
                break
            threading.Event().wait(0.1)
        assert (tmp_path / "made").exists()


def test_an_object_that_cannot_be_made_is_an_error_of_the_first_call():
    with BackgroundProcess(Counter().fail) as process, pytest.raises(BadInputError, match="cannot do it"):
        process.ask("add", 1)()


def test_what_may_not_be_beside_works_here():
    with BackgroundProcess(Counter, beside=False) as process:
        first, second = process.ask("add", 1), process.ask("add", 2)
        assert second() == (3, os.getpid())
        assert first() == (1, os.getpid())


def test_an_error_in_a_background_process_is_raised_here_and_it_goes_on():
    with BackgroundProcess(Counter) as process:
        wrong, right = process.ask("fail"), process.ask("add", 2)
        with pytest.raises(BadInputError, match="cannot do it"):
            wrong()
        assert right()[0] == 2


@pytest.mark.skipif(not SEVERAL_CORES, reason="works in this process on one core")
class AsksForDask:
    """Does what xarray does with every array of a dataset."""

    def about(self, value):
        from xarray.namedarray.utils import is_dask_collection

        return is_dask_collection(value)


@pytest.mark.skipif(not SEVERAL_CORES, reason="works here, where Dask may be loaded")
def test_a_background_process_needs_no_dask_that_was_only_heard_of(monkeypatch):
    from xarray.namedarray.utils import module_available

    assert module_available("dask")  # xarray remembers it
    for name in [name for name in sys.modules if name.partition(".")[0] == "dask"]:
        monkeypatch.delitem(sys.modules, name)
    with BackgroundProcess(AsksForDask) as process:
        assert process.ask("about", 1.0)() is False


def test_a_background_process_that_dies_is_an_error_that_names_the_call():
    with BackgroundProcess(Counter) as process:
        before, at, after = process.ask("add", 1), process.ask("die"), process.ask("add", 2)
        assert before()[0] == 1
        with pytest.raises(WorkerDiedError, match="Counter, die: its process ended"):
            at()
        with pytest.raises(WorkerDiedError, match="Counter, add: its process ended"):
            after()


def test_large_and_read_only_arguments_are_taken_while_the_object_is_still_made():
    values = types.MappingProxyType({index: index for index in range(200_000)})
    with BackgroundProcess(Counter) as process:
        assert process.ask("add_largest", values)() == 199_999


def test_a_background_process_ends_with_the_one_that_started_it(tmp_path):
    code = (
        "import os, sys, time; from spindle_fem.parallel import BackgroundProcess\n"
        "class Named:\n    def pid(self): return os.getpid()\n"
        "process = BackgroundProcess(Named); print(process.ask('pid')(), flush=True); os._exit(0)"
    )
    answer = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60
    )
    other = int(answer.stdout)
    for _ in range(100):
        if not _runs(other):
            break
        threading.Event().wait(0.1)
    assert not _runs(other)


# ------------------------------------------------------------------ copies of this process
def test_copies_answer_in_the_order_of_the_jobs_and_nothing_is_sent_to_them():
    senders = []
    jobs = [partial(lambda told, number: (number, os.getpid()), Told(senders), number) for number in range(5)]
    for number in (1, 2):
        answers = in_copies(jobs, number)
        assert [place for place, _ in answers] == [0, 1, 2, 3, 4]
        assert {process for _, process in answers} == {os.getpid()} or number > 1
    assert senders == []
    assert in_copies([], 2) == []


@pytest.mark.skipif(not SEVERAL_CORES, reason="works in this process on one core")
def test_a_copy_works_beside_this_process_and_makes_no_copies_of_its_own():
    def where():
        return os.getpid(), in_copies([os.getpid, os.getpid], 2), parallel.thread_count()

    process, inner, threads = start_copy(where)()
    assert process != os.getpid()
    assert inner == [process, process]
    assert threads == 1


def test_errors_and_answers_that_are_functions_come_from_copies():
    with pytest.raises(BadInputError, match="it was refused"):
        in_copies([refuse] * 3, 2)
    waiting = start_copy(refuse)
    with pytest.raises(BadInputError, match="it was refused"):
        waiting()
    double, triple = in_copies([lambda: lambda x: 2 * x, lambda: lambda x: 3 * x], 2)
    assert (double(2), triple(2)) == (4, 6)


@pytest.mark.skipif(not SEVERAL_CORES, reason="works in this process on one core")
def test_a_copy_that_dies_is_an_error():
    with pytest.raises(WorkerDiedError, match="its process ended before its time"):
        start_copy(partial(die_beside, os.getpid()))()


def note(number, noted):
    noted.append(number)
    time.sleep(0.05)
    return os.getpid(), number, tuple(noted)


def fail_first(number, noted):
    return note(number, noted) if number else refuse()


@pytest.mark.skipif(not SEVERAL_CORES, reason="works in this process on one core")
def test_standing_copies_keep_what_jobs_leave_with_them():
    with StandingCopies([], 2) as copies:
        rounds = [copies.map([partial(note, number) for number in own]) for own in (range(4), range(4, 8))]
        assert [number for answers in rounds for _, number, _ in answers] == list(range(8))
        first, second = ({process for process, *_ in answers} for answers in rounds)
        assert first == second
        assert len(first) == 2
        for process in first:
            own = [(number, noted) for answers in rounds for by, number, noted in answers if by == process]
            assert own[-1][1] == tuple(number for number, _ in own)


def test_standing_copies_that_failed_are_not_met_again():
    noted = []
    with StandingCopies(noted, 2) as copies:
        with pytest.raises(BadInputError, match="it was refused"):
            copies.map([partial(fail_first, number) for number in range(6)])
        answers = copies.map([partial(note, number) for number in range(10, 14)])
    assert [(process, number) for process, number, _ in answers] == [(os.getpid(), n) for n in range(10, 14)]
    assert noted[-4:] == [10, 11, 12, 13]


FAULTS = """
import resource
import numpy as np
from spindle_fem.parallel import keep_freed_memory

def faults():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    np.ones(4_000_000)
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

given_back = [faults(), faults()][1]
keep_freed_memory()
print(given_back, [faults(), faults()][1])
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="another library of C keeps what it likes")
def test_freed_arrays_are_kept():
    told = subprocess.run([sys.executable, "-c", FAULTS], capture_output=True, text=True, check=True)
    given_back, kept = map(int, told.stdout.split())
    assert kept < 0.01 * given_back


def _runs(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().split()[2] != "Z"
    except OSError:
        return False


# ------------------------------------------------------------------ the only place
def test_nothing_else_starts_threads_or_processes():
    folder = Path(spindle_fem.__file__).parent
    starts = re.compile(
        r"^\s*(from|import) (concurrent|multiprocessing|joblib|distributed)\b|\bThread\(|\bos\.fork\b",
        re.MULTILINE,
    )
    found = {
        path.relative_to(folder).as_posix()
        for path in folder.rglob("*.py")
        if starts.search(path.read_text(encoding="utf-8"))
    }
    assert found == {
        "parallel/background_process.py",
        "parallel/process_copies.py",
        "parallel/worker_pool.py",
        "parallel/worker_threads.py",
    }


def test_a_job_beside_gives_its_answer_or_its_error_when_it_is_waited_for():
    assert parallel.beside(lambda: 7)() == 7
    with pytest.raises(BadInputError, match="it was refused"):
        parallel.beside(refuse)()


def test_with_one_core_a_job_beside_begins_when_it_is_waited_for(monkeypatch):
    monkeypatch.setattr("spindle_fem.parallel.worker_threads.core_count", lambda: 1)
    seen = []
    waiting = parallel.beside(lambda: seen.append(1))
    assert seen == []
    waiting()
    assert seen == [1]
