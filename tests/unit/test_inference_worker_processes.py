"""Jobs for other processes leave as they are when they are given."""

import threading
from functools import partial

from spindle_fem.inference import worker_processes as abreast
from spindle_fem.inference.worker_processes import Workers


class Told:
    """Notes which thread sends it."""

    def __init__(self, senders):
        self.senders = senders

    def __reduce__(self):
        self.senders.append(threading.current_thread())
        return str, ("sent",)


def taken(problem, told):
    return str(told)


def test_what_is_done_ahead_is_sent_before_anything_goes_on():
    senders, sizes = [], {"a": 1}
    waiting = Workers(2).ahead(partial(taken, None, Told(senders)))
    assert senders == [threading.main_thread()]
    counted = Workers(2).ahead(partial(len, sizes))
    sizes |= {"b": 2}
    assert (waiting(), counted()) == ("sent", 1)


def test_jobs_on_a_problem_are_sent_by_the_thread_that_has_them():
    senders = []
    jobs = [partial(taken, told=Told(senders)) for _ in range(5)]
    found = Workers(2).done({"a": 1}, jobs)
    # Those of this process are as they were given.
    assert len(found) == 5
    assert set(senders) == {threading.main_thread()}


def test_alone_nothing_is_sent():
    senders = []
    assert Workers(1).ahead(partial(len, {"a": 1}))() == 1
    assert len(Workers(1).done(None, [partial(taken, told=Told(senders))])) == 1
    assert senders == []


def test_other_processes_are_woken_where_there_are_any(monkeypatch):
    started = []
    monkeypatch.setattr(
        abreast, "_others", lambda number: started.append(number) or abreast.ThreadPoolExecutor(1)
    )
    Workers(1).wake()
    assert started == []
    Workers(2).wake()
    assert started == [1]
