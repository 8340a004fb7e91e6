"""A recording that grows beside the machine's fast model: when and where its readings leave the model."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from spindle_fem.definition.load import find_machine, read_definition
from spindle_fem.definition.network_load import is_network_machine
from spindle_fem.errors import BadInputError, RecordingError
from spindle_fem.inference.continued_run import ContinuedRun
from spindle_fem.inference.input_sampling import sampled_errors
from spindle_fem.inference.misdescription_columns import misdescriptions_of, with_misdescriptions
from spindle_fem.inference.opened_machine import DiagnosedMachine, open_machine, with_growth
from spindle_fem.inference.predictor import LONGEST_BIN, STEP, Predictor
from spindle_fem.inference.prepared_problem import Calibrated, calibrate, expected_slow_error
from spindle_fem.inference.reading_noise import SlowError
from spindle_fem.inference.watched_machine import MONTH, Judgement, WatchedMachine, white_noise
from spindle_fem.model.reduced.fast_model import FastModel
from spindle_fem.recordings.align import Recording, read_recording
from spindle_fem.recordings.displaced_readings import with_displacements
from spindle_fem.recordings.faults_beside import manifest_for
from spindle_fem.recordings.growing_file import follow_lines
from spindle_fem.recordings.recordable_names import recordable_names
from spindle_fem.recordings.recording_window import RecordingWindow, part_of, piece_of
from spindle_fem.recordings.smooth_inputs import without_input_noise
from spindle_fem.units import to_si

Progress = Callable[[str], None]

# Rows from which a watch begins: noise and inputs are judged by them.
FIRST_ROWS = 60
# Averages of a network in a correlation time of its slow error.
AVERAGES_A_TIME = 10.0
_PERIODS = {"hour": 3600.0, "day": 86400.0, "week": 604800.0, "month": MONTH, "year": 12.0 * MONTH}


@dataclass(frozen=True, slots=True)
class Watching:
    """Settings of a watch on a recording.

    Attributes
    ----------
    calibrate : sequence of str or Path
        Recordings of the same machine with nothing missing.
    warm_up : float, [s]
        The beginning of the recording itself, taken as sound, in their place; 0 for none.
    alarms : float
        False alarms a month.
    heartbeat : float, [s]
        A line at least so often, by the recording's clock; infinite for state changes only.
    until_end : bool
        Stop at the end of what is there.
    poll : float, [s]
        Time between two looks at the file.
    """

    calibrate: Sequence[str | Path] = ()
    overrides: Sequence[str] = ()
    warm_up: float = 0.0
    alarms: float = 1.0
    heartbeat: float = np.inf
    until_end: bool = False
    poll: float = 1.0


def alarms_a_month(text: str) -> float:
    """False alarms a month from ``1/month``, ``2/week``.

    Raises
    ------
    BadInputError

    >>> alarms_a_month("1/month"), alarms_a_month("12/year")
    (1.0, 1.0)
    """
    number, _, period = text.partition("/")
    try:
        value = float(number)
    except ValueError:
        value = np.nan
    if period.strip() not in _PERIODS or not 0.0 < value < np.inf:
        raise BadInputError(
            "--false-alarms",
            f'"{text}".',
            f'Allowed: a number and a period, "1/month"; {", ".join(_PERIODS)}.',
        )
    return value * MONTH / _PERIODS[period.strip()]


def duration(text: str, where: str) -> float:
    """A positive duration, s, from ``1 h``.

    Raises
    ------
    BadInputError
    """
    value = to_si(text, "s", where=where)
    if not value > 0.0:
        raise BadInputError(where, f'"{text}".', 'Allowed: above 0, such as "1 h".')
    return value


def watch_recording(
    machine: str | Path, recording: str | Path, how: Watching, *, progress: Progress = lambda stage: None
) -> Iterator[dict[str, Any]]:
    """Yield state changes of a machine against its recording, and heartbeats, as they occur.

    Parameters
    ----------
    machine : str or Path
        A definition or the name of one that ships; with geometry or a ``[network]``.
    recording : str or Path
        Manifest of the data being written; ``data = "-"`` reads standard input.
    progress : callable
        Called with each stage, and with faults of the file.

    Yields
    ------
    dict
        ``time``, ``state``, ``channel``, ``condition``, ``false_alarms_per_month``, ``departure_K`` (of the
        channel, by how much it reads too high; ``departure_um`` of a displacement) and ``evidence`` (1
        raises an alarm).

    Raises
    ------
    SpindleFemError
    """
    names = partial(recordable_names, machine, tuple(how.overrides))
    manifest, data = manifest_for(recording, names, growing=True)
    calibration = [read_recording(path, names=names) for path in how.calibrate]
    if how.calibrate and how.warm_up:
        raise BadInputError("--warm-up", "and --calibrate are both given.", "Give one of them.")
    if is_network_machine(read_definition(find_machine(machine))) and not (how.calibrate or how.warm_up):
        raise BadInputError(
            str(machine),
            "is a network, whose noise is not known before a recording.",
            'Give --calibrate RECORDING, or --warm-up "8 h": the beginning of this one, taken as sound.',
        )
    window = RecordingWindow(manifest, data, progress, how.warm_up)
    lines = follow_lines(data, to_end=how.until_end, poll=how.poll, tell=progress)
    watched, teller = None, _Teller(how)
    for fresh in lines:
        window.add(fresh)
        if watched is None and _may_begin(window, how.warm_up):
            first = _smooth(window)
            watched = first and _begin(machine, how, first, calibration, progress)
        if watched is not None:
            yield from teller.of(_follow(watched, window), window)
    last = _smooth(window)
    if watched is None:
        if last is None:
            raise RecordingError(
                str(recording), f"has no reading with every input in {window.waiting.size} rows."
            )
        if window.waiting.size < 3 or (how.warm_up and not _may_begin(window, how.warm_up)):
            raise RecordingError(
                str(recording), f"ends after {window.waiting.size} rows.", "Too few to begin a watch."
            )
        watched = _begin(machine, how, last, calibration, progress)
    yield from teller.of(_follow(watched, window, to_end=True), window)
    yield from teller.end(window)


def _may_begin(window: RecordingWindow, warm_up: float) -> bool:
    waiting = window.waiting
    return waiting.size >= FIRST_ROWS and waiting[-1] - waiting[0] > warm_up


def _smooth(window: RecordingWindow) -> Recording | None:
    """The rows at hand without the noise of their measured inputs, as a diagnosis takes them."""
    recording = window.recording()
    return None if recording is None else without_input_noise(recording)[0]


def _begin(
    machine: str | Path, how: Watching, first: Recording, calibration: Sequence[Recording], progress: Progress
) -> WatchedMachine:
    """The machine fitted to its calibration recordings, or to the beginning of this one."""
    progress("reduced model")
    stop = int(np.searchsorted(first.times, first.times[0] + how.warm_up, side="right"))
    warm_up = [piece_of(first, 0, stop)] if how.warm_up else []
    opened = open_machine(machine, tuple(how.overrides), [first], [*calibration, *warm_up], progress=progress)
    opened = with_growth(opened)
    first, *warm_up = (_grown(item, opened.fast) for item in (first, *warm_up))
    run = ContinuedRun(opened.fast, opened.effects)
    begun = run.begins(piece_of(first, 0, first.times.size))
    if opened.calibration:
        progress("calibration")
    known = _known(opened, opened.calibration, begun)
    watched = WatchedMachine(
        run,
        known,
        white_noise(first),
        width=_width(known, first, opened.is_network),
        alarms=how.alarms,
        beside=_of_inputs(opened, known),
        wandering=_wandering(opened),
    )
    sound = [(known, item) for item in opened.calibration]
    long = all(item.times.size >= FIRST_ROWS for item in opened.calibration)
    if opened.is_network and long and not how.warm_up:
        # What is coarse shows where the machine works otherwise than in what it was fitted to.
        sound = [(_known(opened, others, begun), own) for own, others in _halves(opened.calibration)]
    watched.learn_spread(sound)
    if how.warm_up:
        watched.pass_over(warm_up[0])
    return watched


def _halves(sound: Sequence[Recording]) -> list[tuple[Recording, list[Recording]]]:
    """Each half of each recording, and all others."""
    halves = []
    for item in sound:
        middle = item.times.size // 2
        halves += [part_of(item, 0, middle), part_of(item, middle, item.times.size)]
    return [(own, [other for other in halves if other is not own]) for own in halves]


def _known(opened: DiagnosedMachine, sound: Sequence[Recording], begun: Predictor) -> Calibrated:
    """What recordings with nothing missing tell of the machine; what is known before where there are none."""
    earlier = None
    if sound:
        earlier = Predictor(opened.fast, sound, effects=opened.effects)
        earlier = with_misdescriptions(earlier, misdescriptions_of(earlier))
    known = calibrate(earlier, begun)
    # A fit of hours takes up part of the slow error and does not show how far it wanders in a month.
    return replace(known, slow=known.slow.no_less_than(expected_slow_error(earlier or begun)))


def _wandering(opened: DiagnosedMachine) -> list[str]:
    """Factors of a network's sources by a power of what switches from row to row, and within rows."""
    if not opened.is_network:
        return []
    network, unseen = opened.fast.network, np.max(opened.unseen, axis=0)
    sources = zip(network.source_names, network.source_exponent, unseen, strict=True)
    return [f"gain.{name}" for name, exponent, power in sources if power > 0.0 and exponent != 1.0]


def _of_inputs(opened: DiagnosedMachine, known: Calibrated) -> dict[str, SlowError]:
    """Errors of a network's nodes by what its inputs did between their rows; none with geometry."""
    if not opened.is_network:
        return {}
    belief = known.belief
    fitted = {c.name: c.at(u) for c, u in zip(belief.coordinates, belief.mean, strict=True)}
    return sampled_errors(opened.fast.inputs.moved(fitted), opened.unseen)


def _grown(recording: Recording, fast: FastModel) -> Recording:
    """The recording as a diagnosis takes it: of machines with geometry, displacements among the readings."""
    return with_displacements(recording) if fast.network is None else recording


def _width(known: Calibrated, first: Recording, is_network: bool) -> float:
    """Over how long readings are averaged, s: as a diagnosis does it, but no less than from row to row."""
    spacing = float(np.median(np.diff(first.times)))
    return max(spacing, min(known.slow.time / AVERAGES_A_TIME, LONGEST_BIN) if is_network else STEP)


def _follow(watched: WatchedMachine, window: RecordingWindow, *, to_end: bool = False) -> list[Judgement]:
    """Follow what has come, if it is enough for an average."""
    waiting = window.waiting
    if not waiting.size or (not to_end and waiting[-1] - max(watched.used, waiting[0]) < watched.width):
        return []
    recording = _smooth(window)
    if recording is None:
        return []
    found = watched.follow(_grown(recording, watched.run.fast), to_end=to_end)
    window.use(watched.used)
    return found


class _Teller:
    """Lines of a watch: at state changes, and at least every heartbeat."""

    def __init__(self, how: Watching) -> None:
        self._how = how
        self._said: Judgement | None = None
        self._latest: Judgement | None = None

    def of(self, judgements: Sequence[Judgement], window: RecordingWindow) -> Iterator[dict[str, Any]]:
        """Lines for judgements of successive instants: where the state changes, and at every heartbeat."""
        for item in judgements:
            self._latest, said = item, self._said
            if (
                said is None
                or (item.state, item.channel is None) != (said.state, said.channel is None)
                or item.time - said.time >= self._how.heartbeat
            ):
                yield self._line(item, window)

    def end(self, window: RecordingWindow) -> Iterator[dict[str, Any]]:
        """Yield the final state unless it was already reported."""
        if self._latest is not None and self._latest is not self._said:
            yield self._line(self._latest, window)

    def _line(self, item: Judgement, window: RecordingWindow) -> dict[str, Any]:
        self._said = item
        away = None if item.departure is None else round(item.departure, 3)
        return {
            "time": window.stamp(item.time),
            "state": item.state,
            "channel": item.channel,
            "condition": item.condition,
            "false_alarms_per_month": self._how.alarms,
            "departure_K": None if away is None or item.displaced else away,
            **({"departure_um": away} if away is not None and item.displaced else {}),
            "evidence": round(item.evidence, 3),
        }
