"""A machine followed while it is recorded: expectation, evidence against it, what is learned."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spindle_fem.inference.continued_run import ContinuedRun
from spindle_fem.inference.cumulative_sums import CumulativeSums, spread_of_sound
from spindle_fem.inference.followed_coordinates import FollowedCoordinates
from spindle_fem.inference.innovations import InnovationFilter
from spindle_fem.inference.missing_heat import conditions_of
from spindle_fem.inference.observations import Observation
from spindle_fem.inference.prepared_problem import Calibrated, start_coordinates
from spindle_fem.inference.reading_noise import SlowError, key_of
from spindle_fem.recordings.align import LONG_GAP_SECONDS, LONG_GAP_STEPS, Recording
from spindle_fem.recordings.recording_window import piece_of

Array = NDArray[np.float64]

AS_MODELLED, LEAVING, LEFT = "as modelled", "leaving", "left"
# Mean length of a month, s.
MONTH = 365.25 / 12.0 * 86400.0
# "leaving" may be said by chance this many times as often as "left".
SOONER = 10.0
# A slow error this many times its usual size keeps a channel from being as modelled again.
STILL_OUT = 3.0
# Times the slowest time constant after which an unknown state has faded to a twentieth.
FADED = 3.0
# Instants of one piece: the model is linearised anew after each.
PIECE_INSTANTS = 60
# Moments and events that rows and gaps leave open, of some hours of work: what earlier ones did faded.
MOST_OPEN = 60
# Rows whose inputs differ by more than this share of the largest are amid a change: no piece ends there.
CHANGED = 0.02
# But where they differ over more rows than this: such is the machine's work, and a watch must go on.
MOST_AMID = 10
# Innovations by which the spread is judged, at most.
MOST_NUMBERS = 20_000
NOTHING_BESIDE: Mapping[str, SlowError] = {}
# Instants by which heating and cooling are distinguished.
REMEMBERED = 300


@dataclass(frozen=True, slots=True)
class Judgement:
    """State of the machine at one instant.

    Attributes
    ----------
    time : float, [s]
        Since the first row.
    state : str
        ``as modelled``, ``leaving`` or ``left``.
    channel : str or None
        With the most evidence; None while as modelled.
    departure : float or None, [K, µm]
        What the channel read last beyond what the machine, as it is known, should read; of a displacement in
        µm, but for the sensor's zero.
    evidence : float
        Largest sum over the level of an alarm.
    displaced : bool
        Whether the channel reads a displacement.
    """

    time: float
    state: str
    channel: str | None
    condition: str
    departure: float | None
    evidence: float
    displaced: bool = False


class WatchedMachine:
    """The state of a machine, its coordinates and the evidence that readings leave it.

    Parameters
    ----------
    known : Calibrated
        What is known of the machine; only its own coordinates and temperatures at the start count.
    white : (c,) ndarray, [K, µm]
        Noise of a single reading of each channel, as :func:`white_noise` has it.
    width : float, [s]
        Readings are averaged over it.
    alarms : float
        False alarms a month.
    beside : mapping of str to SlowError
        Further slow errors by place of the sensor, which no calibration tells of.
    wandering : sequence of str
        As :class:`FollowedCoordinates` takes it.

    Attributes
    ----------
    used : float, [s]
        Rows up to here were followed.
    spread : float
        Of innovations where nothing is wrong, in units of what the noise model says.
    """

    def __init__(
        self,
        run: ContinuedRun,
        known: Calibrated,
        white: Array,
        *,
        width: float,
        alarms: float,
        beside: Mapping[str, SlowError] = NOTHING_BESIDE,
        wandering: Sequence[str] = (),
    ) -> None:
        self.run, self.slow, self.white, self.width = run, known.slow, white, width
        self._alarms, self._beside, self._wandering = alarms, beside, wandering
        self.used = -np.inf
        self.coordinates = FollowedCoordinates(known.belief, wandering)
        self.sums = CumulativeSums(len(white), MONTH / width / alarms, SOONER)
        self.state = AS_MODELLED
        self._filter: InnovationFilter | None = None
        self._channels: tuple[str, ...] = ()
        # Leading channels that are temperatures; the others are displacements.
        self._kelvins = len(white)
        self._past: deque[tuple[float, float, float]] = deque(maxlen=REMEMBERED)
        self._time: float | None = None
        self._away = np.zeros(len(white))
        self._gap, self._unknown_until = np.inf, -np.inf
        self.spread = 1.0
        self._numbers: deque[Array] = deque(maxlen=MOST_NUMBERS)

    def learn_spread(self, sound: Sequence[tuple[Calibrated, Recording]]) -> None:
        """Take the spread of innovations from recordings with nothing missing, of whatever channels.

        Each with what is known of the machine to follow it with.
        """
        numbers = []
        for known, recording in sound:
            trial = WatchedMachine(
                ContinuedRun(self.run.fast, self.run.effects),
                known,
                white_noise(recording),
                width=self.width,
                alarms=self._alarms,
                beside=self._beside,
                wandering=self._wandering,
            )
            trial.run.heat = self.run.heat
            trial.follow(recording, to_end=True)
            numbers += trial._numbers
        if numbers:
            most = max(map(len, numbers))
            padded = [np.pad(row, (0, most - len(row)), constant_values=np.nan) for row in numbers]
            self.spread = spread_of_sound(np.array(padded))

    # ------------------------------------------------------------------ coordinates
    def _begin(self, piece: Recording) -> None:
        """Begin with a piece, at the start or after a long gap: temperatures are found from its readings."""
        self.coordinates.begin(start_coordinates(self.run.begins(piece)))
        self.run.restart()
        self._kelvins, every = piece.temperature_count, len(self.white)
        slow = [self.slow.of(key_of(piece, channel)) for channel in range(every)]
        beside = [(i, self._beside[p]) for i, p in enumerate(piece.probes) if p in self._beside]
        self._filter = InnovationFilter(
            self.coordinates.covariance, slow, range(self._kelvins, every), beside
        )

    # ------------------------------------------------------------------ following
    def pass_over(self, piece: Recording) -> None:
        """Follow rows from the beginning without judging them: what is known was learned from them.

        A network begins again from its readings after them.
        """
        self.used = float(piece.times[-1])
        self._begin(piece)
        *_, opened = self.run.follow(piece, self.coordinates.values, self.coordinates.names, self.width)
        self._filter.open_further(opened.shape[2])

    def follow(self, recording: Recording, *, to_end: bool = False) -> list[Judgement]:
        """Follow the rows of a recording that are new, as far as whole averages go.

        Parameters
        ----------
        recording : Recording
            Rows around those that are new; the last one used must be among them.
        to_end : bool
            Whether nothing follows these rows.

        Returns
        -------
        list of Judgement
            One an instant.
        """
        found: list[Judgement] = []
        times = recording.times
        if not np.isfinite(self.used):
            self.used = float(times[0])
            self._begin(piece_of(recording, 0, times.size))
        self._gap = long_gap(times)
        gap = self._gap if self.run.fast.network is not None else np.inf
        while True:
            begin = int(np.searchsorted(times, self.used - 1e-6))
            left = float(times[-1] - self.used)
            whole = int(np.floor(left / self.width + 1e-6))
            if begin + 1 >= times.size or (whole == 0 and not to_end):
                return found
            if times[begin + 1] - times[begin] > gap:
                self.used = float(times[begin + 1])
                if begin + 2 >= times.size:
                    return found
                self._begin(piece_of(recording, begin + 1, times.size))
                continue
            until = self.used + min(max(whole, 1), PIECE_INSTANTS) * self.width
            stop = max(int(np.searchsorted(times, until + 1e-6)), begin + 2)
            wide = np.flatnonzero(np.diff(times[begin:stop]) > gap)
            if wide.size:
                stop = begin + 1 + int(wide[0])
            elif self.run.fast.network is None:
                stop = _past_changes(recording, stop)
                if stop > times.size:
                    if not to_end:
                        return found
                    stop = times.size
            found += self._piece(piece_of(recording, begin, stop))
            self.used = float(times[stop - 1])

    def _piece(self, piece: Recording) -> list[Judgement]:
        known = self.coordinates
        predicted, observations, opened = self.run.follow(piece, known.values, known.names, self.width)
        self._filter.open_further(opened.shape[2] - self._filter.open)
        slopes = np.concatenate((known.by_number(predicted.sensitivity), opened), axis=2)
        instants = _Instants.of(piece, observations, predicted.temperature, slopes, self.width)
        self._channels = piece.temperature_names
        if np.diff(piece.times).max() > self._gap:
            # The history of a machine with geometry during the gap is unknown until it has faded.
            self._unknown_until = float(piece.times[-1]) + FADED * self.run.slowest_time()
        if not instants.times.size:
            return []
        running = _running(piece, self.run, instants.times)
        self._past += zip(instants.times, running, instants.expected, strict=True)
        words = conditions_of(*np.array(self._past).T)[-len(instants.times) :]
        found = []
        for index, time in enumerate(instants.times.tolist()):
            elapsed = time - (float(piece.times[0]) if self._time is None else self._time)
            self._time = time
            numbers = self._filter.step(
                elapsed,
                instants.residual[index],
                instants.slopes[index],
                self.white / np.sqrt(instants.number[index]),
                learn=self.state != LEFT and time >= self._unknown_until,
            )
            if time >= self._unknown_until:
                self._numbers.append(numbers)
                self.sums.add(numbers / self.spread)
            read = np.isfinite(instants.residual[index])
            self._away = np.where(read, instants.residual[index] - self._filter.zeros, self._away)
            found.append(self._judge(time, words[index]))
        self._recentre(float(piece.times[-1] - piece.times[0]))
        faded = max(0, self._filter.open - MOST_OPEN)
        self.run.forget_open(faded)
        self._filter.forget_open(faded)
        return found

    def _judge(self, time: float, condition: str) -> Judgement:
        evidence, out = (
            self.sums.evidence,
            np.abs(self._filter.slow_errors) > STILL_OUT * self._filter.slow_sigma,
        )
        if evidence.max() >= 1.0:
            self.state = LEFT
        elif self.state == LEFT:
            self.state = LEFT if np.any(self.sums.rising | out) else AS_MODELLED
        else:
            self.state = LEAVING if self.sums.rising.any() else AS_MODELLED
        worst = int(np.argmax(evidence))
        away = self.state != AS_MODELLED
        return Judgement(
            time,
            self.state,
            self._channels[worst] if away else None,
            condition,
            float(self._away[worst]) if away else None,
            float(evidence[worst]),
            away and worst >= self._kelvins,
        )

    def _recentre(self, elapsed: float) -> None:
        """Count coordinates from where they are now, and forget a little of what was learned."""
        self.run.move(self.coordinates.move(self._filter.moved(), self._filter.covariance, elapsed))


def _past_changes(recording: Recording, stop: int) -> int:
    """Where a piece ends that was to end before row ``stop``: not with a row whose inputs are others.

    When they changed is seen by the rows after it. One more than there are rows, where rows to come tell.
    """
    size, most = recording.times.size, stop + MOST_AMID
    rows = np.arange(max(stop - 2, 0), min(size, most))
    changed = np.zeros(rows.size - 1, dtype=bool)
    for column in np.flatnonzero(recording.held):
        values = recording.input_at(recording.input_names[column], recording.times[rows])
        largest = np.nanmax(np.abs(recording.inputs[:, column]))
        changed |= np.abs(np.diff(values)) > CHANGED * largest
    settled = np.flatnonzero(~changed)
    if settled.size:
        return stop + int(settled[0])
    return stop if size >= most else size + 1


def white_noise(recording: Recording) -> Array:
    """White noise of a single reading of each channel, rounding included, (c,) K or µm."""
    rounding = np.array([noise.resolution for noise in recording.noise]) / np.sqrt(12.0)
    return np.hypot(recording.sigma, rounding)


def long_gap(times: Array) -> float:
    """Distance of rows, s, over which a machine is not followed."""
    return max(LONG_GAP_SECONDS, LONG_GAP_STEPS * float(np.median(np.diff(times))))


@dataclass(frozen=True, slots=True)
class _Instants:
    """Averages of a piece, one row an instant.

    Attributes
    ----------
    times : (k,) ndarray, [s]
    residual : (k, c) ndarray, [K, µm]
        Read less predicted; NaN where nothing was read.
    slopes : (k, c, p) ndarray, [K, µm]
        Derivatives of the prediction to the coordinates.
    number : (k, c) ndarray
        Readings in each average.
    expected : (k,) ndarray, [K]
        Predicted mean of the temperatures.
    """

    times: Array
    residual: Array
    slopes: Array
    number: Array
    expected: Array

    @classmethod
    def of(
        cls,
        piece: Recording,
        observations: Sequence[Observation],
        predicted: Array,
        by_number: Array,
        width: float,
    ) -> _Instants:
        """Averages by instant of channels (G + 1, c) and their derivatives (G + 1, c, p)."""
        first, channels = float(piece.times[0]), piece.temperature.shape[1]
        owners = [np.floor((item.bins.times - first) / width + 1e-9).astype(int) for item in observations]
        known = np.unique(np.concatenate([np.zeros(0, dtype=int), *owners]))
        residual = np.full((known.size, channels), np.nan)
        number, times = np.ones_like(residual), np.full_like(residual, np.nan)
        slopes, expected = np.zeros((*residual.shape, by_number.shape[2])), np.full_like(residual, np.nan)
        for item, owner in zip(observations, owners, strict=True):
            rows, channel = np.searchsorted(known, owner), item.channel
            expected[rows, channel] = item.at(predicted[:, channel])
            residual[rows, channel] = item.values - expected[rows, channel]
            slopes[rows, channel] = item.at(by_number[:, channel])
            number[rows, channel], times[rows, channel] = item.bins.number, item.bins.times
        mean = np.nanmean(times, axis=1)
        warm = np.isfinite(expected[:, : piece.temperature_count])
        known = warm.any(axis=1)
        total = np.where(warm, expected[:, : piece.temperature_count], 0.0).sum(axis=1)
        if known.any():
            total = np.interp(mean, mean[known], total[known] / warm[known].sum(axis=1))
        return cls(mean, residual, slopes, number, total)


def _running(piece: Recording, run: ContinuedRun, times: Array) -> Array:
    """Zero at standstill: speed, or what a network's sources follow; 1 where neither is read."""
    network = run.fast.network
    wanted = {"speed"} if network is None else {"speed", *network.source_input}
    read = [np.abs(piece.input_at(name, times)) for name in piece.input_names if name in wanted]
    return np.sum(read, axis=0) if read else np.ones_like(times)
