"""Predicted readings of every channel of some recordings by a machine's fast model, and derivatives.

One predictor serves everything: calibration and simulation use it for every
stamp of a recording; a diagnosis, which runs it thousands of times, on steps
of a minute from one change of the inputs to the next, shorter about each.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from spindle_fem.effects.framework.effect import Candidate
from spindle_fem.effects.framework.term import Term
from spindle_fem.inference.coordinate_names import (
    DIRECTIONS,
    GAP_PREFIX,
    JUMP_PREFIX,
    NO_VALUES,
    PROBE_PREFIX,
    START_PREFIX,
    run_name,
)
from spindle_fem.inference.drive_steps import coarse_drive, even_drive
from spindle_fem.inference.misdescription import Misdescription
from spindle_fem.inference.observations import Observation, observe
from spindle_fem.inference.prediction import Prediction, acting_in, late_channels, readings_of
from spindle_fem.inference.priors import Prior, priors_of
from spindle_fem.inference.recording_gaps import (
    channel_changes,
    gap_pieces,
    hidden_forcing,
    hidden_in,
    jump_forcing,
    unseen_jumps,
    weights_of_earlier,
)
from spindle_fem.model.reduced.defined_effects import NO_EFFECTS, ActiveEffects
from spindle_fem.model.reduced.drive import FITTED, Drive, drive_of_recording
from spindle_fem.model.reduced.fast_model import FastModel
from spindle_fem.model.reduced.reduced_transient import TransientRun, simulate_fast
from spindle_fem.model.reduced.run_start import Start
from spindle_fem.recordings.align import Recording

Array = NDArray[np.float64]

# Longest step of a diagnosed machine with geometry, s; readings are averaged over as long.
STEP = 60.0
# A network's recordings last minutes or months: longest bin [s], and number of bins of a recording.
LONGEST_BIN, BINS = 600.0, 300


class Predictor:
    """A machine on its recordings.

    Parameters
    ----------
    use : sequence of (N,) bool ndarray, optional
        Stamps that may be fitted, per recording; the rest is held out. All by default.
    effects : ActiveEffects
        What the definition itself switches on.
    step : float, [s]
        Longest step; a network takes that of its recording.
    at_stamps : bool
        Whether to predict every stamp, each recording on its own grid and with no gap left open, instead
        of steps for a diagnosis.
    drives : sequence of Drive, optional
        Inputs over time that are known already.
    same_within : float
        Operating points whose coefficients differ by less than this share have the same operators.
    """

    def __init__(
        self,
        fast: FastModel,
        recordings: Sequence[Recording],
        use: Sequence[NDArray[np.bool_]] | None = None,
        effects: ActiveEffects = NO_EFFECTS,
        *,
        step: float = STEP,
        at_stamps: bool = False,
        drives: Sequence[Drive] | None = None,
        same_within: float = 0.0,
    ) -> None:
        self.fast, self.effects = fast, effects
        self.same_within, self.step, self.at_stamps = same_within, step, at_stamps
        self.recordings = tuple(recordings)
        self.use = tuple(np.ones(r.times.size, dtype=bool) for r in recordings) if use is None else tuple(use)
        self.is_network = fast.network is not None
        self.drives = tuple(self._drive(item) for item in self.recordings) if drives is None else drives
        left_open = not (self.is_network or at_stamps)
        pairs = list(zip(self.recordings, self.drives, strict=True))
        self._felt = [effects.felt(item, drive) for item, drive in pairs]
        self._initial = [
            fast.inputs.initial_parameters(item) if self.is_network else () for item in self._felt
        ]
        self.unread_jumps = [unseen_jumps(item, drive) if left_open else () for item, drive in pairs]
        self._gaps = [() if at_stamps else gap_pieces(item) for item in self.recordings]
        self._hidden = [
            hidden_in(recording, gaps, [group.name for group in fast.spec.bearing_set]) if left_open else ()
            for recording, gaps in zip(self.recordings, self._gaps, strict=True)
        ]
        self._unread: dict[tuple[str, int], Array] = {}
        self._last: dict[int, TransientRun] = {}  # its matrices serve the next run where nothing moved them
        self._about: tuple[Mapping[str, float], Sequence[Candidate]] = ({}, ())
        self.misdescribed: tuple[Misdescription, ...] = ()
        self.unseen: tuple[Array, ...] = ()
        self._columns: dict[tuple[int, str], Array] = {}
        self._stacked: dict[int, tuple[list[str], Array]] = {}
        self.columns = [fast.require_channels(item.probes, item.source) for item in recordings]
        self.late = np.zeros(len(self.recordings))
        self.observations = self._observe(self.use)
        self.heldout = self._observe([~mask for mask in self.use])

    def _drive(self, recording: Recording) -> Drive:
        """Inputs of a recording, and the times at which its channels are predicted."""
        if self.at_stamps:
            own = self.fast.inputs.drive(recording) if self.is_network else None
            return drive_of_recording(self.fast.spec, recording, widths=FITTED) if own is None else own
        if self.is_network:
            drive = even_drive(self.fast, recording)
        else:
            drive = coarse_drive(self.fast.spec, recording, self.step)
        return replace(drive, times=drive.grid)

    def _observe(self, masks: Sequence[NDArray[np.bool_]]) -> tuple[Observation, ...]:
        coarse = self.is_network and not self.at_stamps
        widths = [
            min(LONGEST_BIN, float(r.times[-1] - r.times[0]) / BINS) if coarse else None
            for r in self.recordings
        ]
        grids = [None if self.at_stamps else drive.grid for drive in self.drives]
        thinned = [item.defects.thinned for item in self.recordings]
        rows = [0.0 if item is None else item.step_s for item in thinned] if coarse else None
        stamps = [self.stamps(number) for number in range(len(self.recordings))]
        return observe(self.recordings, masks, grids, widths, rows, stamps)

    def stamps(self, number: int) -> Array:
        """Stamps of the readings of a recording on the clock of its inputs, (N,) s."""
        return self.recordings[number].times - self.late[number]

    def on_clocks(self, late: Array) -> Predictor:
        """The predictor with temperatures stamped so much later than inputs, for each recording, s."""
        found = copy.copy(self)
        found.late = late
        found.observations = found._observe(found.use)
        found.heldout = found._observe([~mask for mask in found.use])
        return found

    def with_model(self, fast: FastModel, same_within: float = 0.0) -> Predictor:
        """The predictor with another reduction of the same machine."""
        found = Predictor(
            fast,
            self.recordings,
            self.use,
            self.effects,
            step=self.step,
            drives=self.drives,
            same_within=same_within,
        )
        return found.misdescribed_like(self).with_unseen(self.unseen).on_clocks(self.late)

    def with_unseen(self, power: Sequence[Array]) -> Predictor:
        """The predictor with the uncertainty of rarely read inputs of each recording.

        Parameters
        ----------
        power : sequence of (n_sources,) ndarray
            :func:`spindle_fem.inference.input_sampling.unseen_power`.
        """
        found = copy.copy(self)
        found.unseen = tuple(power)
        return found

    def misdescribed_by(
        self,
        directions: Sequence[Misdescription],
        columns: Mapping[tuple[int, str], Array],
        about: tuple[Mapping[str, float], Sequence[Candidate]] = ({}, ()),
    ) -> Predictor:
        """The predictor with directions in which the machine may differ from its definition.

        Parameters
        ----------
        columns : mapping of (recording, coordinate) to (G + 1, c) ndarray, [K]
            Change of every channel for each unit of a direction; none where it does nothing.
        about : values and candidates
            Of the run that they, and what gaps and rows leave open, are worked out about.
        """
        found = copy.copy(self)
        found.misdescribed, found._columns, found._stacked = tuple(directions), dict(columns), {}
        found._about, found._unread = about, {}
        return found

    def column_of(self, number: int, coordinate: str) -> Array | None:
        """Change of every channel of a recording for a unit of a direction, (G + 1, c) K; None for none."""
        return self._columns.get((number, coordinate))

    def misdescribed_like(self, other: Predictor) -> Predictor:
        """The predictor with the directions of another predictor of the same recordings."""
        return self.misdescribed_by(other.misdescribed, other._columns, other._about)

    # ------------------------------------------------------------------ what is uncertain
    def uncertain(self) -> tuple[Prior, ...]:
        """The machine's uncertain parameters."""
        return priors_of(self.fast)

    def starts(self) -> tuple[Prior, ...]:
        """Uncertain temperatures at the start of each recording of a network."""
        if not self.is_network or self.fast.spec.initial != "first_reading":
            return ()
        return tuple(
            Prior(f"{START_PREFIX}{number}.{item.name}", item.value, item.sigma_log, item.unit)
            for number, items in enumerate(self._initial)
            for item in items
        )

    def jumps(self) -> list[tuple[str, float, float]]:
        """Changes of inputs that fell into gaps: name; least and most that they were earlier [s]."""
        return [
            (f"{JUMP_PREFIX}{number}.{index}", least, most)
            for number, items in enumerate(self.unread_jumps)
            for index, (_, least, most) in enumerate(items)
        ]

    def gaps(self) -> list[tuple[str, float]]:
        """What may have happened within gaps: name, and one standard deviation."""
        return [
            (f"{GAP_PREFIX}{number}.{index}", item.sigma)
            for number, items in enumerate(self._hidden)
            for index, item in enumerate(items)
        ]

    def gap_intervals(self, number: int) -> tuple[tuple[float, float], ...]:
        """Pieces of the gaps of one recording in which something may have happened, [s]."""
        return self._gaps[number]

    def unread_within(
        self, number: int, spans: Sequence[tuple[float, float]], values: Mapping[str, float]
    ) -> dict[str, tuple[Array, Array]]:
        """What changed between rows, or in gaps, within stretches of time, by name.

        Returns
        -------
        dict of str to two (G + 1, c) ndarray
            Change of the channels by the value [K], and with each unit more.
        """
        grid = self.drives[number].grid
        moments = {JUMP_PREFIX: [float(grid[step]) for step, _, _ in self.unread_jumps[number]]}
        moments[GAP_PREFIX] = [0.5 * (item.begin + item.end) for item in self._hidden[number]]
        return {
            name: self._opened(kind, number, index, values.get(name, 0.0))
            for kind, own in moments.items()
            for index, moment in enumerate(own)
            if (name := f"{kind}{number}.{index}") and any(begin <= moment <= end for begin, end in spans)
        }

    def displacements(self) -> tuple[str, ...]:
        """Names of the displacements of every point probe that is read."""
        model = self.fast.model
        if not model.probe_gradients.size:
            return ()
        read = {probe for item in self.recordings for probe in item.probes[: item.temperature_count]}
        return tuple(
            f"{PROBE_PREFIX}{probe}.{direction}"
            for probe in model.probe_names
            if probe in read
            for direction in DIRECTIONS
        )

    # ------------------------------------------------------------------ simulation
    def start(
        self, number: int, values: Mapping[str, float] = NO_VALUES, derivatives: Sequence[str] = ()
    ) -> float | Start:
        """Initial state of a recording: a uniform temperature [K], or that of every node of a network."""
        if self.is_network:
            return self.fast.inputs.start(
                self._felt[number],
                self.drives[number],
                self._factors(number, values, (), ()),
                derivatives,
                kind=self.fast.spec.initial,
                initial=self._initial[number],
            )
        if self.fast.spec.initial == "ambient":
            return self.drives[number].first("ambient")
        return float(np.mean(list(self._felt[number].first_readings().values())))

    def _factors(
        self, number: int, values: Mapping[str, float], known: Sequence[str], readings: Sequence[str]
    ) -> dict[str, float]:
        """Factors of the machine's parameters in the run of one recording."""
        factors: dict[str, float] = dict(self.effects.factors)
        for name, value in values.items():
            own = None if name in known or name in readings else run_name(number, name)
            if own is not None:
                factors[own] = factors.get(own, 1.0) * value
        return factors

    def _physics(
        self, number: int, values: Mapping[str, float], candidates: Sequence[Candidate]
    ) -> tuple[dict[str, float], tuple[Term, ...]]:
        """Factors and term parameters by name, and terms, of one recording's run."""
        candidates, idle = acting_in(candidates, number)
        values = {name: value for name, value in values.items() if name not in idle}
        terms = (*self.effects.terms, *(term for candidate in candidates for term in candidate.terms))
        known = {
            name: values.get(name, item.value)
            for candidate in candidates
            for term in candidate.terms
            for name, item in term.names().items()
        }
        readings = {f"{r.name}.{item.name}" for r in readings_of(candidates) for item in r.parameters}
        return self._factors(number, values, known, readings) | known, terms

    def transient(
        self,
        number: int,
        values: Mapping[str, float],
        candidates: Sequence[Candidate] = (),
        derivatives: Sequence[str] = (),
        like: TransientRun | None = None,
    ) -> TransientRun:
        """A run of one recording that is ready to march.

        Parameters
        ----------
        number : int
            Recording.
        values : mapping of str to float
            Factors of the machine's parameters, ``effect:<name>`` for factors of
            candidates, values of term parameters; of readings, which the run ignores.
        derivatives : sequence of str
            Names of the machine or of terms.
        like : TransientRun, optional
            Another run of this recording; what both have in common is taken from it.
        """
        drive, (parameters, terms) = self.drives[number], self._physics(number, values, candidates)
        run = self._last[number] = TransientRun(
            self.fast,
            drive,
            parameters,
            tuple(derivatives),
            (*self.fast.own_terms(drive), *terms),
            like=self._last.get(number) if like is None else like,
            same_within=self.same_within,
        )
        return run

    def predict(
        self,
        number: int,
        values: Mapping[str, float],
        candidates: Sequence[Candidate] = (),
        derivatives: Sequence[str] = (),
        near: Prediction | None = None,
    ) -> Prediction:
        """Predicted readings of every channel of one recording.

        Parameters as for :meth:`transient`; ``derivatives`` may also name
        factors of candidates (``effect:<name>``) and parameters of readings.
        Derivatives are to logarithms, to values for parameters that say so.
        ``near`` is a prediction of the recording for values that are near: it begins there.
        """
        predicted = self.at_places(number, values, candidates, derivatives, near)
        self.pass_on(number, predicted, values, candidates, derivatives)
        return predicted

    def at_places(
        self,
        number: int,
        values: Mapping[str, float],
        candidates: Sequence[Candidate] = (),
        derivatives: Sequence[str] = (),
        near: Prediction | None = None,
    ) -> Prediction:
        """Temperatures where sensors sit, as :meth:`predict`, of the machine as defined."""
        acting, idle = acting_in(candidates, number)
        values = {name: value for name, value in values.items() if name not in idle}
        # A reading may share a parameter with its term: a bypass that joins before the outlet's sensor.
        shared = {name for c in acting for term in c.terms for name in term.names()}
        of_readings = {f"{r.name}.{item.name}" for r in readings_of(acting) for item in r.parameters}
        outside = (of_readings - shared) | idle
        inner = [None if name in outside else run_name(number, name) for name in derivatives]
        of_run = tuple(dict.fromkeys(own for own in inner if own is not None))
        initial = self.start(number, values, of_run)
        if self.at_stamps:
            parameters, terms = self._physics(number, values, acting)
            run, own = None, {"parameters": parameters, "derivatives": of_run, "terms": terms}
            found = simulate_fast(self.fast, self.drives[number], initial, **own)
        else:
            run = self.transient(number, values, acting, of_run, None if near is None else near.run)
            found = run.solve(initial, None if near is None else near.states)
        owners = np.array([-1 if own is None else of_run.index(own) for own in inner], dtype=np.int64)
        columns = self.columns[number]
        temperature = found.temperature[:, columns]
        sensitivity = np.zeros((*temperature.shape, len(derivatives)))
        inside, inlet = owners >= 0, (found.inlet, np.zeros((len(temperature), len(derivatives))))
        sensitivity[:, :, inside] = found.sensitivity[:, columns][:, :, owners[inside]]
        if found.inlet_by is not None:
            inlet[1][:, inside] = found.inlet_by[:, owners[inside]]
        predicted = Prediction(temperature, sensitivity, found.states, run, found.tangents, owners, *inlet)
        predicted.displace(self.fast.model, self.recordings[number].probes, values, derivatives)
        self._unseen(number, predicted, values, derivatives)
        return predicted

    def pass_on(
        self,
        number: int,
        predicted: Prediction,
        values: Mapping[str, float],
        candidates: Sequence[Candidate] = (),
        derivatives: Sequence[str] = (),
    ) -> Array:
        """Turn temperatures of places into readings, in place; what sensors feel, delayed, (G + 1, c) K."""
        names, drive = self.recordings[number].temperature_names, self.drives[number]
        own = [(reading, NO_VALUES, ()) for reading in self.effects.readings]
        own += [(reading, values, derivatives) for reading in readings_of(acting_in(candidates, number)[0])]
        (known, slopes), late = self.directions_of(number), late_channels(candidates, number)
        kind = {item.coordinate: item.of_sensor for item in self.misdescribed if item.delays not in late}
        # What a sensor does wrong it does to what reaches it.
        for of_sensor in (False, True):
            acting = [name if kind.get(name) is of_sensor else "" for name in known]
            predicted.add(acting, slopes, values, derivatives)
            felt = predicted.temperature.copy()
            for reading, *told in own:
                if reading.before_sensor is not of_sensor:
                    predicted.read(reading, names, drive, *told)
        return felt

    def _unseen(
        self, number: int, predicted: Prediction, values: Mapping[str, float], derivatives: Sequence[str]
    ) -> None:
        """Add first-order changes by what gaps and rows leave open, in place."""
        for kind, open_ones in ((JUMP_PREFIX, self.unread_jumps[number]), (GAP_PREFIX, self._hidden[number])):
            names = [f"{kind}{number}.{index}" for index in range(len(open_ones))]
            if any(name in values or name in derivatives for name in names):
                slopes, at = self._columns_of(kind, number), values
                if kind == JUMP_PREFIX:
                    earlier = np.array([values.get(name, 0.0) for name in names])
                    earlier, by = weights_of_earlier(np.array([most for *_, most in open_ones]), earlier)
                    predicted.temperature[:] += np.tensordot(slopes, earlier, 2)
                    if not derivatives:
                        continue
                    slopes, at = np.einsum("gcnt,nt->gcn", slopes, by), NO_VALUES
                predicted.add(names, slopes, at, derivatives)

    def directions_of(self, number: int) -> tuple[list[str], Array]:
        """Coordinates of directions that do something in a recording, and what they do, (G + 1, c, k) K."""
        if number not in self._stacked:
            known = [i.coordinate for i in self.misdescribed if (number, i.coordinate) in self._columns]
            own = [self._columns[number, name] for name in known]
            self._stacked[number] = known, np.stack(own, axis=2) if own else np.zeros((0, 0, 0))
        return self._stacked[number]

    def _opened(self, kind: str, number: int, index: int, value: float) -> tuple[Array, Array]:
        """Change of the channels (G + 1, c) [K] by what gaps and rows leave open, and with each unit more."""
        columns = self._columns_of(kind, number)
        if kind == JUMP_PREFIX:
            most = np.array([self.unread_jumps[number][index][2]])
            return tuple(columns[:, :, index] @ own[0] for own in weights_of_earlier(most, np.array([value])))
        return value * columns[:, :, index], columns[:, :, index]

    def _columns_of(self, kind: str, number: int) -> Array:
        """Changes of the channels by earlier changes (G + 1, c, n, times), or by one of each event."""
        if (kind, number) not in self._unread:
            values, candidates = self._about
            run = self.transient(number, values, candidates)
            states, tracks = run.march(self.start(number, values))
            if kind == JUMP_PREFIX:
                forcing = jump_forcing(run, states, self.unread_jumps[number])
            else:
                forcing = hidden_forcing(run, self.fast, self._hidden[number])
            found = channel_changes(run, tracks, forcing, self.columns[number])
            if kind == JUMP_PREFIX:
                found = found.reshape(*found.shape[:2], len(self.unread_jumps[number]), -1)
            self._unread[kind, number] = found
        return self._unread[kind, number]

    def read(
        self,
        number: int,
        candidates: Sequence[Candidate],
        values: Mapping[str, float],
        temperature: Array,
        inlet: Array | None = None,
    ) -> Array:
        """Readings of the channels whose places have the temperatures (G + 1, c), beside an inlet."""
        nothing = np.zeros((*temperature.shape, 0))
        predicted = Prediction(temperature.copy(), nothing, np.zeros(0), inlet=inlet)
        names, drive = self.recordings[number].temperature_names, self.drives[number]
        for reading in readings_of(candidates):
            predicted.read(reading, names, drive, values, ())
        return predicted.temperature
