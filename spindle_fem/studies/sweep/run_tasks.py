"""Tasks of a study to workers: this process, processes of this machine, or a Dask cluster."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, TypeVar

from spindle_fem.errors import BadInputError, SpindleFemError
from spindle_fem.studies.sweep.evaluate_design import DesignTask, Question, evaluate_tasks
from spindle_fem.studies.sweep.fast.backend import GroupTask, answer_group
from spindle_fem.studies.sweep.fast.fast_outputs import ONLY_FULL
from spindle_fem.studies.sweep.results_table import Row

# Rows that a worker holds before they land in the table: few are lost when it dies,
# and its mesh is not prepared again for each.
CHUNK = 4
# Designs of one group from which making a projected model of them pays: it costs some twenty full solves.
LEAST_GROUP = 32

Land = Callable[[Row], None]
Task = TypeVar("Task")


def run_tasks(
    tasks: Sequence[DesignTask],
    question: Question,
    land: Land,
    *,
    plan: Sequence[DesignTask] = (),
    jobs: int = 1,
    scheduler: str | None = None,
) -> None:
    """Solve tasks and hand over each row as it comes, in any order.

    Parameters
    ----------
    tasks : sequence of DesignTask
    question : Question
    land : callable
        Called in this process only.
    plan : sequence of DesignTask
        All designs of the study: what makes groups for projected models.
    jobs : int
        Worker processes of this machine; below 1 for one a core.
    scheduler : str, optional
        Address of a Dask scheduler, in place of ``jobs``.

    Raises
    ------
    BadInputError
        Dask is not installed, or no scheduler answers there.
    SpindleFemError
        The cluster lost a task for good.
    """
    for task in tasks:
        if task.spec is None:
            land(evaluate_tasks([task], question)[0])
    left = {task.key: task for task in tasks if task.spec is not None}
    groups = groups_of(plan, tuple(left.values()), question)
    for answer, pieces in ((answer_group, groups), (evaluate_tasks, None)):
        if pieces is None:
            pieces = _pieces(tuple(left.values()), jobs, scheduler)
        if not pieces:
            continue
        if scheduler is not None:
            found = _on_cluster(answer, pieces, question, scheduler)
        elif worker_count(jobs) == 1 or len(pieces) == 1:
            found = (answer(piece, question) for piece in pieces)
        else:
            found = _in_processes(answer, pieces, question, worker_count(jobs))
        for rows in found:
            for row in rows:
                land(row)
                del left[row["key"]]


def groups_of(
    plan: Sequence[DesignTask], wanted: Sequence[DesignTask], question: Question
) -> list[GroupTask]:
    """Groups of planned designs for projected models, with those of them and others that need rows."""
    if question.backend == "full" or ONLY_FULL & set(question.outputs):
        return []
    planned: dict[str, dict[str, DesignTask]] = {}
    for task in plan:
        if task.spec is not None and task.structure:
            planned.setdefault(task.structure, {}).setdefault(task.key, task)
    least = LEAST_GROUP if question.backend == "auto" else 1
    found = []
    for structure, members in planned.items():
        missing = tuple(task for task in wanted if task.structure == structure)
        if missing and len(members) >= least:
            found.append(GroupTask(tuple(members.values()), missing))
    return found


def _pieces(
    tasks: Sequence[DesignTask], jobs: int, scheduler: str | None
) -> list[list[DesignTask]] | list[Sequence[DesignTask]]:
    if scheduler is None and worker_count(jobs) == 1:
        return [[task] for task in _sorted(tasks)]
    return chunks_of(tasks, worker_count(jobs) if scheduler is None else _cluster_size(scheduler))


def worker_count(jobs: int) -> int:
    """Number of worker processes; one a usable core where ``jobs`` is below 1."""
    if jobs >= 1:
        return jobs
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def chunks_of(tasks: Sequence[DesignTask], workers: int) -> list[list[DesignTask]]:
    """Tasks in pieces of one mesh each, made or moved from, small enough that every worker gets some.

    Where meshes are moved, the first piece of every one comes before the
    second of any, so that workers do not wait for the same one to be made.
    """
    size = max(1, min(CHUNK, len(tasks) // (2 * workers)))
    chunks: list[list[DesignTask]] = []
    for task in _sorted(tasks):
        last = chunks[-1] if chunks else []
        if last and _mesh_of(last[0]) == _mesh_of(task) and len(last) < size:
            last.append(task)
        else:
            chunks.append([task])
    seen: Counter[str] = Counter()
    turns = []
    for chunk in chunks:
        turns.append(seen[chunk[0].source] if chunk[0].source else 0)
        seen[chunk[0].source] += 1
    return [chunks[place] for place in sorted(range(len(chunks)), key=turns.__getitem__)]


def _mesh_of(task: DesignTask) -> str:
    """The mesh that a design begins with: its own, or the one that is moved."""
    return task.source or task.geometry


def _sorted(tasks: Sequence[DesignTask]) -> list[DesignTask]:
    """By mesh, then geometry; meshes, geometries and designs in the order of the study."""
    first: dict[str, int] = {}
    for position, task in enumerate(tasks):
        first.setdefault(_mesh_of(task), position)
        first.setdefault(task.geometry, position)
    return sorted(tasks, key=lambda task: (first[_mesh_of(task)], first[task.geometry]))


def _in_processes(
    answer: Callable[[Task, Question], list[Row]], pieces: Sequence[Task], question: Question, jobs: int
) -> Iterator[list[Row]]:
    from joblib import Parallel, delayed, parallel_config

    with parallel_config(backend="loky", inner_max_num_threads=1):
        parallel = Parallel(n_jobs=jobs, return_as="generator_unordered", batch_size=1)
        yield from parallel(delayed(answer)(piece, question) for piece in pieces)


def _cluster_size(address: str) -> int:
    with _client(address) as client:
        return max(1, len(client.scheduler_info(n_workers=-1)["workers"]))


def _on_cluster(
    answer: Callable[[Task, Question], list[Row]], pieces: Sequence[Task], question: Question, address: str
) -> Iterator[list[Row]]:
    with _client(address) as client:
        from distributed import as_completed
        from distributed.scheduler import KilledWorker

        # A piece that dies with its worker goes to another one; Dask gives up after some.
        futures = client.map(answer, pieces, question=question, pure=False)
        for future in as_completed(futures):
            try:
                rows = future.result()
            except KilledWorker as error:
                raise SpindleFemError(
                    f"scheduler {address}",
                    f"several workers died on the same designs ({error}).",
                    "The rows so far are kept; give the workers more memory and run the command again.",
                ) from error
            future.release()
            yield rows


@contextmanager
def _client(address: str) -> Iterator[Any]:
    try:
        from distributed import Client
    except ImportError as error:
        raise BadInputError(
            "--scheduler", "needs the package distributed.", "Install spindle-fem[cluster]."
        ) from error
    try:
        client = Client(address, timeout="10s")
    except (OSError, ValueError) as error:
        raise BadInputError(
            f"--scheduler {address}",
            f"no Dask scheduler answers ({error}).",
            "For example tcp://127.0.0.1:8786.",
        ) from error
    with client:
        yield client
