"""Tasks of a study to workers: this process, processes of this machine, or a Dask cluster."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial

from spindle_fem.parallel import WorkerPool
from spindle_fem.studies.sweep.evaluate_design import DesignTask, Question, evaluate_tasks
from spindle_fem.studies.sweep.fast_backend import GroupTask, answer_group
from spindle_fem.studies.sweep.outputs import only_full
from spindle_fem.studies.sweep.results_table import Row

# Rows that a worker holds before they land in the table: few are lost when it dies,
# and its mesh is not prepared again for each.
CHUNK = 4
# Designs of one group from which making a projected model of them pays: it costs some twenty full solves.
LEAST_GROUP = 32

Land = Callable[[Row], None]


def run_tasks(
    tasks: Sequence[DesignTask],
    question: Question,
    land: Land,
    *,
    plan: Sequence[DesignTask] = (),
    jobs: int = 1,
    scheduler: str | None = None,
) -> None:
    """Solve tasks and pass on each row as it arrives, in any order.

    Parameters
    ----------
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
        Dask is not installed, or no scheduler responds there.
    WorkerDiedError
        A worker process died; the rows so far have landed.
    """
    for task in tasks:
        if task.spec is None:
            land(evaluate_tasks([task], question)[0])
    pool = WorkerPool(jobs, scheduler)
    left = {task.key: task for task in tasks if task.spec is not None}
    groups = groups_of(plan, tuple(left.values()), question)
    for answer, pieces in ((answer_group, groups), (evaluate_tasks, None)):
        if pieces is None:
            pieces = _pieces(tuple(left.values()), pool)
        calls = [partial(answer, piece, question) for piece in pieces]
        for _, rows in pool.stream(calls, [_designs_of(piece) for piece in pieces]):
            for row in rows:
                land(row)
                del left[row["key"]]


def _designs_of(piece: Sequence[DesignTask] | GroupTask) -> str:
    """Name of a piece of work, for error messages."""
    tasks = piece.wanted if isinstance(piece, GroupTask) else piece
    return f"sweep, designs {', '.join(str(task.design.number) for task in tasks)}"


def groups_of(
    plan: Sequence[DesignTask], wanted: Sequence[DesignTask], question: Question
) -> list[GroupTask]:
    """Groups of planned designs for projected models, with those of them and others that need rows."""
    if question.backend == "full" or any(map(only_full, question.outputs)):
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


def _pieces(tasks: Sequence[DesignTask], pool: WorkerPool) -> list[list[DesignTask]]:
    return [[task] for task in _sorted(tasks)] if pool.is_alone else chunks_of(tasks, pool.size())


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
    """Tasks by mesh, then geometry; meshes, geometries and designs in the order of the study."""
    first: dict[str, int] = {}
    for position, task in enumerate(tasks):
        first.setdefault(_mesh_of(task), position)
        first.setdefault(task.geometry, position)
    return sorted(tasks, key=lambda task: (first[_mesh_of(task)], first[task.geometry]))
