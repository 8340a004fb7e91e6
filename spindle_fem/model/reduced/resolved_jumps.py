"""Steps that are short where inputs jump: rows a minute apart hide how fast ball rows and films answer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from spindle_fem.effects.framework.term import COVARIATE
from spindle_fem.model.reduced.drive import PREDICTED, Drive, classes_of

Array = NDArray[np.float64]

# Jumps that count: kelvins, and shares of the largest value of an input. What smaller ones leave of a step of
# a minute is below a hundredth of a kelvin: a jump of a router spindle from standstill to 12,000 rpm leaves
# half a kelvin, and heat follows speed by its power of two at most.
LEAST = {"ambient": 1.0, "coolant_inlet": 0.2}
LEAST_SHARE = {"speed": 0.01, "coolant_flow": 0.02, "thrust": 0.05}
OTHER_SHARE = 0.02
# A bend leaves a third of what a jump leaves.
BEND = 3.0
# First step after a jump [s]: balls take ten times as long; later ones, as a share of the time since.
FIRST, GROWTH = 0.5, 0.5
# Largest change of an input within a step, in jumps that count, as heat is no straight line over the speed;
# and the shortest step that this makes [s].
MOST_JUMPS, SHORTEST = 10.0, 2.0
# Memory for matrices of steps, of which each operator and length of step has so many.
MOST_BYTES, MATRICES = 1.2e9, 6


def shorter_steps(length: float, since: float, longest: float, coarseness: float = 1.0) -> list[float]:
    """Steps [s] into which one is divided.

    Parameters
    ----------
    length : float, [s]
    since : float, [s]
        From the last jump to its start.
    longest : float, [s]
        Of the steps asked for.
    coarseness : float
        Steps are so many times as long.

    >>> shorter_steps(10.0, 0.0, 60.0)
    [0.5, 0.5, 0.5, 0.75, 1.125, 1.6875, 2.46875, 2.46875]
    >>> shorter_steps(10.0, 60.0, 60.0)
    [10.0]
    """
    found, left = [], length
    while True:
        allowed = min(longest, coarseness * max(FIRST, GROWTH * since))
        # no last one that is much shorter than the one before
        step = left if left <= allowed * (1.0 + 1e-9) else min(allowed, 0.5 * left)
        found.append(step)
        left, since = left - step, since + step
        if left <= 1e-9 * length:
            return found


def with_resolved_jumps(drive: Drive, size: int) -> Drive:
    """A drive whose steps are short after its start, after inputs jump or bend, and while they change much.

    Inputs are those of the drive at all times; steps grow with the time since, so that every mode of the
    machine meets steps that are short for it. Where these would need too many matrices, they are longer, and
    then only larger jumps count; a note of the drive says so. For drives whose readings have own classes.

    Parameters
    ----------
    size : int
        Unknowns of the fast model.
    """
    least, most = _least(drive), MOST_BYTES / (MATRICES * 8 * size**2)
    for coarseness, times in ((1.0, 1.0), (2.0, 1.0), (4.0, 1.0), *((4.0, 2.0**n) for n in range(1, 8))):
        found = _divided(drive, times * least, coarseness)
        kinds = np.unique(np.column_stack((found.step_class, np.round(1e6 * found.steps))), axis=0)
        if len(kinds) <= most:
            break
    if coarseness == 1.0:
        return found
    note = f"inputs jump so often that steps after jumps are {coarseness:.0f} times as long as usual: for a "
    note += "minute readings can be off by some hundredths of a kelvin"
    if times > 1.0:
        share = f"{100.0 * times * LEAST_SHARE['speed']:.3g} %"
        note += (
            f", and by tenths after changes of less than {share} of the highest speed, which count for none"
        )
    return replace(found, notes=(*found.notes, note))


def _divided(drive: Drive, least: Array, coarseness: float) -> Drive:
    """A drive with short steps after jumps above some sizes, (m,)."""
    grid, start, end, steps = drive.grid, drive.start, drive.end, drive.steps
    changed = (end - start) / least
    jump = np.abs(start[1:] - end[:-1]) / least
    bend = np.abs(changed[1:] - changed[:-1] * (steps[1:] / steps[:-1])[:, None]) / BEND
    disturbed = np.concatenate(([True], (np.maximum(jump, bend) > 1.0).any(axis=1)))
    pieces = np.maximum(1.0, np.ceil(np.abs(changed).max(axis=1) / MOST_JUMPS))
    since, lengths = 0.0, []
    for length, begins, number in zip(steps.tolist(), disturbed.tolist(), pieces.tolist(), strict=True):
        since = 0.0 if begins else since
        lengths.append(shorter_steps(length, since, max(SHORTEST, length / number), coarseness))
        since += length
    counts = [len(own) for own in lengths]
    owner = np.repeat(np.arange(len(steps)), counts)
    within = np.concatenate([np.cumsum([0.0, *own[:-1]]) for own in lengths])
    fine = np.append(np.repeat(grid[:-1], counts) + within, grid[-1])
    first, last = (
        start[owner] + ((at - grid[owner]) / steps[owner])[:, None] * (end[owner] - start[owner])
        for at in (fine[:-1], fine[1:])
    )
    found, points = classes_of(np.vstack((0.5 * (first + last), first, last[-1:])), PREDICTED)
    step_class, read_class = np.split(found, [len(first)])
    return replace(
        drive, grid=fine, start=first, end=last, step_class=step_class, points=points, read_class=read_class
    )


def _least(drive: Drive) -> Array:
    """Smallest jump of every input that counts, (m,); none of covariates, which only terms follow."""
    largest = np.maximum(np.abs(drive.start).max(axis=0), np.abs(drive.end).max(axis=0))
    return np.array([least_jump(*item) for item in zip(drive.names, largest.tolist(), strict=True)])


def least_jump(name: str, largest: float) -> float:
    """Smallest jump of an input that counts, in its unit.

    Parameters
    ----------
    name : str
    largest : float
        Value that it takes.

    >>> least_jump("speed", 1000.0), least_jump("coolant_inlet", 293.15)
    (10.0, 0.2)
    """
    if name.startswith(COVARIATE):
        return np.inf
    return LEAST.get(name, LEAST_SHARE.get(name, OTHER_SHARE) * max(abs(largest), 1e-12))


def rule_of_jumps() -> dict[str, float]:
    """What programs beside this one need to divide their steps alike."""
    return {"bend": BEND, "first_s": FIRST, "growth": GROWTH, "most": MOST_JUMPS, "shortest_s": SHORTEST}
