"""A machine on its recordings, quick enough to be simulated hundreds of times.

Readings are averaged over bins of a minute or more; the model steps over the
same time scale, from one change of the inputs to the next, and its basis is
cut down to what these recordings can excite.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.uncertain_parameters import uncertain_parameters
from spindle_fem.effects.framework.effect import Candidate, Reading
from spindle_fem.effects.framework.term import Term
from spindle_fem.inference.drive_steps import coarse_drive, even_drive
from spindle_fem.inference.reading_noise import ChannelBins, channel_bins
from spindle_fem.inference.recording_gaps import WARMTH, gap_pieces, hidden_in, unseen_jumps
from spindle_fem.model.reduced.defined_effects import NO_EFFECTS, ActiveEffects
from spindle_fem.model.reduced.drive import Drive
from spindle_fem.model.reduced.fast_model import FastModel
from spindle_fem.model.reduced.network_fast_model import NetworkFastModel
from spindle_fem.model.reduced.reduced_transient import FastTransient, TransientRun, grid_weights
from spindle_fem.model.reduced.run_start import Start
from spindle_fem.operation.coefficient_table import INNER_SHARE
from spindle_fem.recordings.align import Recording

Array = NDArray[np.float64]

STEP = 60.0
# Of a network, whose recordings last minutes or months.
LONGEST_BIN, BINS = 600.0, 300
# Coordinates of a candidate's factors are not those of the machine's own parameters.
EFFECT_PREFIX = "effect:"
# Displacement of a probe from its nominal place, m: ``probe.<probe>.<direction>``.
PROBE_PREFIX = "probe."
# Temperature of a node at the start of one recording: ``start.<recording>.initial.<node>``.
START_PREFIX = "start."
# How long before the middle of a gap an input had changed, s: ``jump.<recording>.<number>``.
JUMP_PREFIX = "jump."
# What happened within a piece of a gap beyond what the inputs beside it say,
# ``within_gap.<recording>.<number>``: friction of a bearing set, as a share of the highest that it gives; an
# input temperature that is another after the gap, as a share of its change.
GAP_PREFIX = "within_gap."
# Coordinates that say nothing about other recordings.
OF_ONE_RECORDING = (START_PREFIX, JUMP_PREFIX, GAP_PREFIX)
NO_VALUES: Mapping[str, float] = MappingProxyType({})
DIRECTIONS = ("r", "z")
BASIS_TOLERANCE = 1.0e-3
# While searching: a third of a per cent of a film is some millikelvins, and final fits go without.
SAME_WITHIN = 3.0e-3
# Of the conductance of a contact, in the basis of a search.
OPENED = 0.1


@dataclass(frozen=True, slots=True)
class Observation:
    """Readings of one channel of one recording, averaged over bins.

    Attributes
    ----------
    recording : int
    channel : int
        Column of the recording.
    bins : ChannelBins
    values : (b,) ndarray, [K]
        Mean reading of each bin.
    right : (b,) int ndarray
        Point of the model's grid after each bin's time.
    part : (b,) ndarray
        Share of the step before it that has passed.
    """

    recording: int
    channel: int
    bins: ChannelBins
    values: Array
    right: NDArray[np.int64]
    part: Array

    def at(self, on_grid: Array) -> Array:
        """Values at the bins from values (G + 1, ...) on the grid."""
        part = self.part.reshape(-1, *([1] * (on_grid.ndim - 1)))
        left = on_grid[self.right - 1]
        return left + part * (on_grid[self.right] - left)


@dataclass(frozen=True, slots=True)
class Prediction:
    """Readings of all channels of one recording on the model's grid.

    Attributes
    ----------
    temperature : (G + 1, c) ndarray, [K]
        In the order of the recording's channels, sensor effects included.
    sensitivity : (G + 1, c, p) ndarray
        To the coordinates asked for.
    states : (G + 1, r) ndarray
        Unknowns of the model.
    run : TransientRun
        Whose states they are.
    tangents : (G + 1, r, q) ndarray or None
        Of the states, to what the run knows of the coordinates asked for; None where none were.
    columns : (p,) int ndarray
        Which of them each coordinate is, -1 for none.
    """

    temperature: Array
    sensitivity: Array
    states: Array
    run: TransientRun
    tangents: Array | None = None
    columns: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, dtype=np.int64))

    def moved(self, move: Array) -> Prediction:
        """The same run with states where they go to first order with the coordinates (p,)."""
        if self.tangents is None or self.run.dynamic is None:
            # What follows straight lines gains nothing from a start that is nearer.
            return self
        inside = self.columns >= 0
        own = np.zeros(self.tangents.shape[2])
        np.add.at(own, self.columns[inside], move[inside])
        return replace(self, states=self.states + self.tangents @ own, tangents=None)

    def slopes_at(self, places: Array) -> Array:
        """Derivatives (G + 1, n, p) of the temperatures of places (n, r) to the coordinates asked for."""
        found = np.zeros((len(self.states), len(places), len(self.columns)))
        if self.tangents is not None:
            inside = self.columns >= 0
            found[:, :, inside] = (places @ self.tangents)[:, :, self.columns[inside]]
        return found


class Plant:
    """Machine and recordings.

    Parameters
    ----------
    fast : FastModel
        Or a network's, which has the same methods.
    recordings : sequence of Recording
    use : sequence of (N,) bool ndarray
        Stamps that may be fitted, per recording; the rest is held out.
    effects : ActiveEffects
        What the definition itself switches on.
    step : float, [s]
        Longest step of the model; a network takes that of its recording.
    same_within : float
        Operating points whose coefficients differ by less than this share have the same operators.
    """

    def __init__(
        self,
        fast: FastModel,
        recordings: Sequence[Recording],
        use: Sequence[NDArray[np.bool_]],
        effects: ActiveEffects = NO_EFFECTS,
        *,
        step: float = STEP,
        drives: Sequence[Drive] | None = None,
        same_within: float = 0.0,
    ) -> None:
        self.fast = fast
        self.same_within = same_within
        self.recordings = tuple(recordings)
        self.use = tuple(use)
        self.effects = effects
        self.step = step
        self.is_network = isinstance(fast, NetworkFastModel)
        if drives is None:
            drives = [
                even_drive(fast, item) if self.is_network else coarse_drive(fast.spec, item, step)
                for item in recordings
            ]
        self.drives = tuple(replace(drive, times=drive.grid) for drive in drives)
        self._initial = [fast.initial_parameters(item) if self.is_network else () for item in self.recordings]
        self._jumps = [
            () if self.is_network else unseen_jumps(item, drive)
            for item, drive in zip(self.recordings, self.drives, strict=True)
        ]
        self._gaps = [() if self.is_network else gap_pieces(item) for item in self.recordings]
        self._hidden = [
            hidden_in(recording, gaps, [group.name for group in fast.spec.bearing_set]) if gaps else ()
            for recording, gaps in zip(self.recordings, self._gaps, strict=True)
        ]
        self._slopes: dict[tuple[str, int], Array] = {}
        self.columns = [fast.require_channels(item.probes, item.source) for item in recordings]
        self.observations = self._observe(self.use)
        self.heldout = self._observe([~mask for mask in self.use])

    def _observe(self, masks: Sequence[NDArray[np.bool_]]) -> tuple[Observation, ...]:
        found = []
        for number, (recording, mask) in enumerate(zip(self.recordings, masks, strict=True)):
            duration = float(recording.times[-1] - recording.times[0])
            width = None if not self.is_network else min(LONGEST_BIN, duration / BINS)
            for bins in channel_bins(recording, mask, width=width):
                values = bins.average(recording.temperature[:, bins.channel])
                right, part = grid_weights(bins.times, self.drives[number].grid)
                found.append(Observation(number, bins.channel, bins, values, right, part))
        return tuple(found)

    def with_model(self, fast: FastModel, same_within: float = 0.0) -> Plant:
        """The same recordings on another reduction of the same machine."""
        return Plant(
            fast,
            self.recordings,
            self.use,
            self.effects,
            step=self.step,
            drives=self.drives,
            same_within=same_within,
        )

    def uncertain(self) -> list[tuple[str, float, float]]:
        """The machine's uncertain parameters: name, 1 σ of the logarithm, highest factor."""
        if self.is_network:
            return [
                (item.name, item.sigma_log, np.inf)
                for item in self.fast.network.parameters
                if item.sigma_log > 0.0
            ]
        return [
            (item.name, item.sigma_log, 0.999 / item.value if item.name == INNER_SHARE else np.inf)
            for item in uncertain_parameters(self.fast.spec)
        ]

    def starts(self) -> list[tuple[str, float]]:
        """Uncertain temperatures at the start of each recording: name, 1 σ of the logarithm."""
        if not self.is_network or self.fast.spec.initial != "first_reading":
            return []
        return [
            (f"{START_PREFIX}{number}.{item.name}", item.sigma_log)
            for number, items in enumerate(self._initial)
            for item in items
        ]

    def jumps(self) -> list[tuple[str, float, float]]:
        """Changes of inputs that fell into gaps: name; least and most that they were earlier [s]."""
        return [
            (f"{JUMP_PREFIX}{number}.{index}", least, most)
            for number, items in enumerate(self._jumps)
            for index, (_, least, most) in enumerate(items)
        ]

    def gaps(self) -> list[str]:
        """Names of what may have happened within gaps."""
        return [
            f"{GAP_PREFIX}{number}.{index}"
            for number, items in enumerate(self._hidden)
            for index in range(len(items))
        ]

    def gap_intervals(self, number: int) -> tuple[tuple[float, float], ...]:
        """Pieces of the gaps of one recording in which something may have happened, [s]."""
        return self._gaps[number]

    # ---------------------------------------------------------------- simulation
    def start(
        self, number: int, values: Mapping[str, float] = NO_VALUES, derivatives: Sequence[str] = ()
    ) -> float | Start:
        """Where a recording begins: a uniform temperature [K], or that of every node of a network."""
        if self.is_network:
            return self.fast.start(
                self.recordings[number],
                self.drives[number],
                self._factors(number, values, {}, set()),
                derivatives,
                kind=self.fast.spec.initial,
                initial=self._initial[number],
            )
        if self.fast.spec.initial == "ambient":
            return self.drives[number].first("ambient")
        return float(np.mean(list(self.recordings[number].first_readings().values())))

    def _run_name(self, number: int, name: str, readings: Mapping[str, object]) -> str | None:
        """What a coordinate is called in the run of one recording; None where it does not enter."""
        if name in readings or name.startswith((PROBE_PREFIX, JUMP_PREFIX, GAP_PREFIX)):
            return None
        if name.startswith(START_PREFIX):
            owner, _, own = name.removeprefix(START_PREFIX).partition(".")
            return own if int(owner) == number else None
        return name.removeprefix(EFFECT_PREFIX)

    def _factors(
        self,
        number: int,
        values: Mapping[str, float],
        known: Mapping[str, float],
        readings: set[str],
    ) -> dict[str, float]:
        """Factors of the machine's parameters in the run of one recording."""
        factors: dict[str, float] = dict(self.effects.factors)
        for name, value in values.items():
            own = None if name in known else self._run_name(number, name, dict.fromkeys(readings))
            if own is not None:
                factors[own] = factors.get(own, 1.0) * value
        return factors

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
        candidates : sequence of Candidate
        derivatives : sequence of str
            Names of the machine or of terms.
        like : TransientRun, optional
            Another run of this recording; what both have in common is taken from it.
        """
        drive = self.drives[number]
        candidates, idle = _acting(candidates, number)
        values = {name: value for name, value in values.items() if name not in idle}
        terms: list[Term] = [*self.fast.own_terms(drive), *self.effects.terms]
        known: dict[str, float] = {}
        readings: set[str] = set()
        for candidate in candidates:
            terms += candidate.terms
            for term in candidate.terms:
                known |= {name: values.get(name, item.value) for name, item in term.names().items()}
            if candidate.reading is not None:
                readings |= {f"{candidate.reading.name}.{item.name}" for item in candidate.reading.parameters}
        factors = self._factors(number, values, known, readings)
        return TransientRun(
            self.fast,
            drive,
            factors | known,
            tuple(derivatives),
            tuple(terms),
            like=like,
            same_within=self.same_within,
        )

    def predict(
        self,
        number: int,
        values: Mapping[str, float],
        candidates: Sequence[Candidate] = (),
        derivatives: Sequence[str] = (),
        near: Prediction | None = None,
    ) -> Prediction:
        """What every channel of one recording should read.

        Parameters as for :meth:`transient`; ``derivatives`` may also name
        factors of candidates (``effect:<name>``) and parameters of readings.
        Derivatives are to logarithms, to values for parameters that say so.
        ``near`` is a prediction of the recording for values that are near: it begins there.
        """
        candidates, idle = _acting(candidates, number)
        values = {name: value for name, value in values.items() if name not in idle}
        owners = {
            f"{c.reading.name}.{item.name}": (c.reading, item)
            for c in candidates
            if c.reading is not None
            for item in c.reading.parameters
        }
        # A reading may share a parameter with its term: a bypass that joins before the outlet's sensor.
        shared = {name for c in candidates for term in c.terms for name in term.names()}
        apart = owners.keys() - shared
        outside = dict.fromkeys((*apart, *idle))
        inner = {name: self._run_name(number, name, outside) for name in derivatives}
        of_run = tuple(dict.fromkeys(own for own in inner.values() if own is not None))
        run = self.transient(number, values, candidates, of_run, None if near is None else near.run)
        initial = self.start(number, values, of_run)
        found: FastTransient = run.solve(initial, None if near is None else near.states)
        columns = self.columns[number]
        temperature = found.temperature[:, columns]
        sensitivity = np.zeros((*temperature.shape, len(derivatives)))
        for position, name in enumerate(derivatives):
            if inner[name] is not None:
                sensitivity[:, :, position] = found.sensitivity[:, columns, of_run.index(inner[name])]
        self._displace(number, found.states, values, derivatives, temperature, sensitivity)
        self._unseen(number, values, derivatives, temperature, sensitivity)
        for reading in self.effects.readings:
            self._read(number, reading, {}, (), temperature, sensitivity)
        for candidate in candidates:
            if candidate.reading is not None:
                self._read(number, candidate.reading, values, derivatives, temperature, sensitivity)
        owners = [-1 if inner[name] is None else of_run.index(inner[name]) for name in derivatives]
        return Prediction(
            temperature, sensitivity, found.states, run, found.tangents, np.array(owners, dtype=np.int64)
        )

    def displacements(self) -> tuple[str, ...]:
        """Names of the displacements of every point probe that is read."""
        model = self.fast.model
        if not model.probe_gradients.size:
            return ()
        read = {probe for recording in self.recordings for probe in recording.probes}
        return tuple(
            f"{PROBE_PREFIX}{probe}.{direction}"
            for probe in model.probe_names
            if probe in read
            for direction in DIRECTIONS
        )

    def _displace(
        self,
        number: int,
        states: Array,
        values: Mapping[str, float],
        derivatives: Sequence[str],
        temperature: Array,
        sensitivity: Array,
    ) -> None:
        """Read each probe where it sits, to first order in its displacement, in place."""
        model, probes = self.fast.model, self.recordings[number].probes
        for name in {name for name in (*values, *derivatives) if name.startswith(PROBE_PREFIX)}:
            probe, _, direction = name.removeprefix(PROBE_PREFIX).rpartition(".")
            if probe not in probes:
                continue
            slope = (
                states @ model.probe_gradients[model.probe_names.index(probe), DIRECTIONS.index(direction)]
            )
            column = probes.index(probe)
            temperature[:, column] += values.get(name, 0.0) * slope
            if name in derivatives:
                sensitivity[:, column, derivatives.index(name)] += slope

    def _unseen(
        self,
        number: int,
        values: Mapping[str, float],
        derivatives: Sequence[str],
        temperature: Array,
        sensitivity: Array,
    ) -> None:
        """What happened in gaps of the recording, to first order, in place."""
        for kind in (JUMP_PREFIX, GAP_PREFIX):
            prefix = f"{kind}{number}."
            for name in {name for name in (*values, *derivatives) if name.startswith(prefix)}:
                slope = self._slopes_of(kind, number)[:, :, int(name.removeprefix(prefix))]
                temperature += values.get(name, 0.0) * slope
                if name in derivatives:
                    sensitivity[:, :, derivatives.index(name)] += slope

    def _slopes_of(self, kind: str, number: int) -> Array:
        """Change of the channels (G + 1, c, n): K for each second that an input changed earlier, or K."""
        if (kind, number) not in self._slopes:
            run = self.transient(number, {})
            states, tracks = run.march(self.start(number))
            forcing = (
                self._jump_forcing(run, states, number)
                if kind == JUMP_PREFIX
                else self._gap_forcing(run, number)
            )
            tangent = run.tangents(forcing, tracks)
            owner = np.append(run.drive.step_class, run.drive.step_class[-1])
            outputs = np.array([item.outputs[self.columns[number]] for item in run.operators])
            self._slopes[kind, number] = np.einsum("gcr,grm->gcm", outputs[owner], tangent, optimize=True)
        return self._slopes[kind, number]

    def _jump_forcing(self, run: TransientRun, states: Array, number: int) -> Array:
        forcing = np.zeros((len(run.drive.steps), states.shape[1], len(self._jumps[number])))
        for index, (step, _, _) in enumerate(self._jumps[number]):
            before, after = (int(run.drive.step_class[i]) for i in (step - 1, step))
            gained = run.loads[after] @ run.start[step] - run.loads[before] @ run.end[step - 1]
            gained -= (run.operators[after].conduction - run.operators[before].conduction) @ states[step]
            forcing[step - 1, :, index] = np.linalg.solve(run.built.storage, gained)
        return forcing

    def _gap_forcing(self, run: TransientRun, number: int) -> Array:
        highest = run.start.max(axis=0)
        members = {
            group.name: [row for item in group.bearing for row in self.fast.heat_rows(item.name)]
            for group in self.fast.spec.bearing_set
        }
        hidden = self._hidden[number]
        forcing = np.zeros((len(run.drive.steps), self.fast.model.size, len(hidden)))
        for key, rows in run.groups.items():
            propagator, loads = run.propagators[key], run.loads[key[0]]
            along = {name: loads[:, own] @ highest[own] for name, own in members.items()}
            along |= {name: loads[:, self.fast.load_names.index(name)] for name in WARMTH}
            middles = 0.5 * (run.drive.grid[rows] + run.drive.grid[rows + 1])
            for index, item in enumerate(hidden):
                inside = rows[(middles > item.begin) & (middles < item.end)]
                answer = (propagator.from_start + propagator.from_end) @ along[item.what]
                forcing[inside, :, index] = item.size * answer
        return forcing

    def read(
        self, number: int, candidates: Sequence[Candidate], values: Mapping[str, float], temperature: Array
    ) -> Array:
        """What the channels tell where their places have the temperatures (G + 1, c)."""
        told = temperature.copy()
        nothing = np.zeros((*told.shape, 0))
        for candidate in candidates:
            if candidate.reading is not None:
                self._read(number, candidate.reading, values, (), told, nothing)
        return told

    def _read(
        self,
        number: int,
        reading: Reading,
        values: Mapping[str, float],
        derivatives: Sequence[str],
        temperature: Array,
        sensitivity: Array,
    ) -> None:
        """Pass one channel through a sensor effect, in place."""
        names = self.recordings[number].temperature_names
        if reading.channel not in names:
            return
        column = names.index(reading.channel)
        inner = {
            item.name: values.get(f"{reading.name}.{item.name}", item.value) for item in reading.parameters
        }
        own = [
            (position, item)
            for position, name in enumerate(derivatives)
            for item in reading.parameters
            if name == f"{reading.name}.{item.name}"
        ]
        n_par = len(derivatives)
        # Affine in the temperatures: differences of whole columns; complex steps for its own parameters.
        width = 1 + n_par + len(own)
        series = np.repeat(temperature[:, column, None].astype(complex), width, axis=1)
        series[:, 1 : 1 + n_par] += sensitivity[:, column]
        parameters = {name: np.full(width, value, dtype=complex) for name, value in inner.items()}
        for i, (_, item) in enumerate(own):
            scale = inner[item.name] if item.logarithmic else 1.0
            parameters[item.name][1 + n_par + i] += 1e-30j * scale
        drive = self.drives[number]
        inputs = {name: np.append(drive.start[:, i], drive.end[-1, i]) for i, name in enumerate(drive.names)}
        told = reading.read(drive.grid, series, inputs, parameters)
        temperature[:, column] = told[:, 0].real
        sensitivity[:, column] = (told[:, 1 : 1 + n_par] - told[:, :1]).real
        for i, (position, _) in enumerate(own):
            sensitivity[:, column, position] += told[:, 1 + n_par + i].imag / 1e-30

    # ------------------------------------------------------------------ reduction
    def compressed(self, names: Sequence[str], places: Sequence[str], contacts: Sequence[str] = ()) -> Plant:
        """The plant on the smaller basis that its own recordings need.

        States and their sensitivities of every recording, with the machine's
        parameters at their prior values and two standard deviations to either
        side in a few combinations, what heat at every place leaves, and states
        with each contact all but opened.

        Parameters
        ----------
        names : sequence of str
            Parameters of the machine.
        places : sequence of str
            Where candidates put heat.
        contacts : sequence of str
            Coefficients that candidates scale one by one; parameters scale them together.
        """
        model = self.fast.model
        snapshots = []
        generator = np.random.default_rng(0)
        priors = self.fast.sigmas(names)
        for number in range(len(self.recordings)):
            for draw in range(4):
                factors = {}
                if draw:
                    signs = generator.choice((-2.0, 2.0), len(names))
                    factors = {n: float(np.exp(s * priors[n])) for n, s in zip(names, signs, strict=True)}
                wanted = tuple(names) if draw == 0 else ()
                run = self.transient(number, factors, (), wanted)
                initial = self.start(number)
                states, tracks = run.march(initial)
                snapshots.append((states - initial * model.one).T)
                if draw == 0:
                    usual = states
                if wanted:
                    tangent = run.tangents(run.forcing_of(states, tracks), tracks)
                    snapshots.append(tangent[::4].transpose(1, 0, 2).reshape(model.size, -1))
                    if number == 0:
                        snapshots.append(self._place_snapshots(run, places))
            for contact in contacts if number == 0 else ():
                opened, _ = self.transient(number, {contact: OPENED}).march(initial)
                # States less those of the machine as it is: a share of them would drown the rest.
                snapshots.append((opened - usual).T)
        # The uniform field stays exactly: a share of it would be a share of 293 K.
        uniform = model.one / np.linalg.norm(model.one)
        rest = np.hstack([_scaled(item) for item in snapshots])
        rest -= np.outer(uniform, uniform @ rest)
        vectors, values, _ = np.linalg.svd(rest, full_matrices=False)
        kept = int(np.sum(values > BASIS_TOLERANCE * values[0]))
        basis = np.column_stack((uniform, vectors[:, :kept]))
        spread = np.concatenate((values[:1], values[:kept]))
        return self.with_model(self.fast.projected(basis, spread), SAME_WITHIN)

    def _place_snapshots(self, run: TransientRun, places: Sequence[str]) -> Array:
        loads = np.array([self.fast.model.place(name) for name in places]).T
        found = []
        for key in run.groups:
            conduction = run.operators[key[0]].conduction
            for rate in (0.0, 3e-4, 3e-3):
                found.append(np.linalg.solve(conduction + rate * run.built.storage, 50.0 * loads))
        return np.hstack(found)


def _scaled(columns: Array) -> Array:
    """Columns so that a thousand snapshots of one kind weigh as much as one of another."""
    return columns / np.sqrt(max(columns.shape[1], 1))


def _acting(candidates: Sequence[Candidate], number: int) -> tuple[tuple[Candidate, ...], set[str]]:
    """Candidates that act in a recording, and names that belong to the others only."""
    acting = tuple(c for c in candidates if c.recording in (None, number))
    idle = {
        EFFECT_PREFIX + name if name in {f.name for f in c.factors} else name
        for c in candidates
        if c.recording not in (None, number)
        for name in c.parameters
    }
    return acting, idle
