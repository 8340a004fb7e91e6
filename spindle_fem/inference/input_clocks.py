"""Inputs of a calibration recording that were logged at another rate than its temperatures."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import minimize_scalar

from spindle_fem.inference.hypothesis_fit import NOT_SIMULATED, Problem
from spindle_fem.inference.opened_machine import DiagnosedMachine
from spindle_fem.inference.predictor import Predictor
from spindle_fem.inference.prepared_problem import expected_slow_error, known_before
from spindle_fem.recordings.align import Recording

# Logarithms of rates that are tried: a logger that skips rows or was set to another interval loses or gains
# up to a quarter. Nearer to one than the next number a rate moves no heat that shows.
LOG_RATES, LEAST_OFF = np.linspace(-0.28, 0.28, 29), 0.03
# Around the best of them: how far rates are then looked for, steps of the other parameters' fit at each, and
# how near to the optimum.
NEAR, STEPS, EXACT = 0.05, 4, 0.002
# An input has begun to change where it is this share of its range away from its first value.
BEGUN = 0.1


def with_input_rate(recording: Recording, inputs: Sequence[str], rate: float) -> Recording:
    """The recording with inputs whose stamps lie ``rate`` times as far from where they first changed.

    Separate logs are usually laid together at the first rise, so that is where they agree. Before
    it, and after the end of a log, an input keeps its nearest value.

    Parameters
    ----------
    inputs : sequence of str
        What each of them drives.
    """
    columns = [number for number, name in enumerate(recording.input_names) if name in inputs]
    moved = recording.inputs.copy()
    for column in columns:
        values = recording.inputs[:, column]
        read = np.flatnonzero(np.isfinite(values))
        if read.size < 2:
            continue
        times, known = recording.times[read], values[read]
        begun = np.abs(known - known[0]) > BEGUN * np.ptp(known)
        start = times[int(np.argmax(begun))]
        asked = np.where(recording.times > start, start + (recording.times - start) / rate, recording.times)
        if recording.held[column]:
            found = known[np.clip(np.searchsorted(times, asked, side="right") - 1, 0, known.size - 1)]
        else:
            found = np.interp(asked, times, known)
        moved[:, column] = np.where(np.isfinite(values), found, np.nan)
    return replace(recording, inputs=moved)


def other_clocks(machine: DiagnosedMachine) -> Iterator[tuple[str, DiagnosedMachine]]:
    """The machine of a network with the inputs of one calibration recording at the rate that fits best.

    Yields
    ------
    (str, DiagnosedMachine)
        Statement, and the machine. Only of recordings that fit better at another rate than at their own, at
        parameters that all recordings give together.
    """
    heat = [name for name in machine.fast.network.source_input if name is not None]
    unseen = machine.unseen[len(machine.recordings) :]

    def prepared(items: Sequence[Recording]) -> Problem:
        plain = Predictor(machine.fast, items, effects=machine.effects).with_unseen(unseen)
        return Problem(plain, known_before(plain), expected_slow_error(plain), plain.observations)

    values = prepared(machine.calibration).fit().values
    for number, recording in enumerate(machine.calibration):

        def at(rate: float, number: int = number, recording: Recording = recording) -> list[Recording]:
            items = list(machine.calibration)
            items[number] = with_input_rate(recording, heat, rate)
            return items

        def misfit(log_rate: float, steps: int = 0, at: Callable = at) -> float:
            """Of all recordings, after some steps of a fit from the parameters that they give together."""
            try:
                return prepared(at(np.exp(log_rate))).fit((), values, iterations=steps).misfit_with_prior
            except NOT_SIMULATED:
                return np.inf

        coarse = min(LOG_RATES, key=misfit)
        if abs(coarse) <= LEAST_OFF:
            continue
        near = (coarse - NEAR, coarse + NEAR)
        rate = float(np.exp(minimize_scalar(misfit, args=(STEPS,), bounds=near, options={"xatol": EXACT}).x))
        yield (
            f"the inputs of {recording.name} stretched {rate:.2f} times from where they first change (their "
            "log ran on a clock of its own, or skipped rows)",
            replace(machine, calibration=tuple(at(rate))),
        )
