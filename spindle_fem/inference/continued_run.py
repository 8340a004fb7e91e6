"""A fast model followed from piece to piece of a recording: each begins where the last one ended."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from spindle_fem.errors import SpecError
from spindle_fem.inference.candidate_response import BaseRun
from spindle_fem.inference.coordinate_names import NO_VALUES, run_name
from spindle_fem.inference.drive_steps import centred, coarse_drive
from spindle_fem.inference.gap_misdescriptions import heat_over_steps
from spindle_fem.inference.heat_misdescriptions import clock_change
from spindle_fem.inference.misdescription import Misdescription
from spindle_fem.inference.misdescription_columns import direction_columns, misdescriptions_of
from spindle_fem.inference.observations import Observation, observe
from spindle_fem.inference.open_events import carried_on, opened_by_gaps, opened_by_rows
from spindle_fem.inference.prediction import Prediction
from spindle_fem.inference.predictor import STEP, Predictor
from spindle_fem.inference.structural_misdescriptions import StructuralChange, model_with_directions
from spindle_fem.model.reduced.defined_effects import ActiveEffects
from spindle_fem.model.reduced.drive import Drive
from spindle_fem.model.reduced.fast_model import FastModel
from spindle_fem.model.reduced.reduced_transient import TransientRun
from spindle_fem.model.reduced.run_start import Start
from spindle_fem.recordings.align import GAP_STEPS, Recording

Array = NDArray[np.float64]

# Steps of a network's sources that say how their heat varies.
REMEMBERED = 2000


def require_no_memory(effects: ActiveEffects) -> None:
    """Refuse effects whose own memory would be lost between two pieces.

    Raises
    ------
    SpecError
    """
    for candidate in effects.candidates:
        if candidate.reading is not None or any(term.n_states for term in candidate.terms):
            raise SpecError(
                f"effect {candidate.label}",
                "remembers what was before, which is not followed from piece to piece.",
                "Leave it out of the machine to be watched.",
            )


class _Piece(Predictor):
    """A machine on a piece of a recording that begins in a given state, or as a recording does."""

    def __init__(
        self,
        fast: FastModel,
        piece: Recording,
        effects: ActiveEffects,
        begun: tuple[Array, Mapping[str, Array]] | None,
    ) -> None:
        self._begun = begun
        super().__init__(fast, [piece], effects=effects, drives=[_drive_of(fast, piece)])

    def changes_by_open(self, base: BaseRun, begun: Array, earlier: Sequence[Array]) -> tuple[Array, Array]:
        """Changes by what rows and gaps leave open, as :func:`carried_on` gives them.

        ``earlier`` is what :func:`opened_by_gaps` takes, of a network.
        """
        if self.is_network:
            opened = opened_by_gaps(base, earlier)
            return carried_on(base, begun, np.zeros(opened.shape[:2]), opened)
        return carried_on(base, begun, *opened_by_rows(base, self.unread_jumps[0], self._hidden[0]))

    def start(
        self, number: int, values: Mapping[str, float] = NO_VALUES, derivatives: Sequence[str] = ()
    ) -> float | Start:
        """State at the end of the previous piece."""
        if self._begun is None:
            return super().start(number, values, derivatives)
        state, tangents = self._begun
        by = {own: tangents[name][None] for name in tangents if (own := run_name(0, name)) is not None}
        return Start(np.zeros(1, dtype=np.int64), state[None], by)


def _drive_of(fast: FastModel, piece: Recording) -> Drive:
    """Inputs on steps that end with the piece: of a minute with geometry, from row to row of a network."""
    if fast.network is None:
        drive = coarse_drive(fast.spec, piece, STEP)
    else:
        spacing, usual = np.diff(piece.times), piece.usual_spacing
        # Within a gap rows as usual, so that heat that nobody saw may come and go in it.
        longest = np.max(spacing, where=spacing <= GAP_STEPS * usual, initial=usual)
        drive = centred(fast.inputs.drive(piece, largest_step=float(longest)), piece)
    return replace(drive, times=drive.grid)


def _end_of(predicted: Prediction, names: Sequence[str]) -> tuple[Array, dict[str, Array]]:
    """State at the end of a piece and its derivatives to coordinates, zero where they do not enter."""
    slopes = np.zeros((predicted.states.shape[1], len(names)))
    inside = predicted.columns >= 0
    if predicted.tangents is not None:
        slopes[:, inside] = predicted.tangents[-1][:, predicted.columns[inside]]
    return predicted.states[-1], dict(zip(names, slopes.T, strict=True))


def _by_coordinate(directions: Sequence[Misdescription], columns: Array) -> dict[tuple[int, str], Array]:
    """What directions do to the one recording of a piece, columns (G + 1, c, n), by name."""
    return {(0, item.coordinate): columns[:, :, index] for index, item in enumerate(directions)}


class ContinuedRun:
    """The state of a machine over time and its derivatives to named coordinates.

    Parameters
    ----------
    effects : ActiveEffects
        What the definition switches on, none with a memory.

    Attributes
    ----------
    heat : deque of (s,) ndarray, [W]
        Of every source of a network over each of the last steps, but for pieces throughout which nothing
        changed: how much a machine may have done in a gap is seen from when it works.
    """

    def __init__(self, fast: FastModel, effects: ActiveEffects) -> None:
        require_no_memory(effects)
        self.fast, self.effects = fast, effects
        self.heat: deque[Array] = deque(maxlen=REMEMBERED)
        self.restart()

    def restart(self) -> None:
        """Begin with the next piece as a recording does."""
        self.begun: tuple[Array, Mapping[str, Array]] | None = None
        # Derivatives of the state to directions of misdescription, which it does not follow itself.
        self._directions: dict[str, Array] = {}
        self._structural: tuple[Array, Mapping[str, Array]] | None = None
        # What rows and gaps left open does to it; nothing yet but for a column of what is expected.
        self._open = np.zeros((self.fast.model.size, 1))
        self._run: TransientRun | None = None

    def begins(self, piece: Recording) -> Predictor:
        """The machine where a recording begins with this piece.

        Of what belongs to a recording its clock alone is the same in later pieces: courses of a room, heat
        within gaps and coolant that stood begin anew with each.
        """
        found = _Piece(self.fast, piece, self.effects, None)
        lasting = [
            item
            for item in misdescriptions_of(found)
            if item.recording is None or item.change is clock_change
        ]
        return found.misdescribed_by(lasting, {})

    def follow(
        self, piece: Recording, values: Mapping[str, float], names: Sequence[str], width: float
    ) -> tuple[Prediction, tuple[Observation, ...], Array]:
        """Follow a further piece, whose first row is the last one of the piece before.

        An input that is another in its last row alone changed unnoticed: the next piece begins with it.

        Parameters
        ----------
        values : mapping of str to float
            Of the coordinates.
        names : sequence of str
            Coordinates to differentiate by.
        width : float, [s]
            Over which readings are averaged.

        Returns
        -------
        Prediction
        tuple of Observation
            Averages of the readings after the first row.
        (G + 1, c, e) ndarray, [K]
            Changes of the channels by a standard deviation of whatever rows and gaps left open since the
            start: that of this piece last, but for what was forgotten.
        """
        predictor = _Piece(self.fast, piece, self.effects, self.begun)
        predicted = predictor.at_places(0, values, (), names)
        base = BaseRun(predictor, 0, values)
        self.begun, self._run = _end_of(predicted, names), predicted.run
        self._misdescribed(predictor, base, names).pass_on(0, predicted, values, (), names)
        opened, self._open = predictor.changes_by_open(base, self._open, self.heat)
        heat = heat_over_steps(base.run)
        if predictor.is_network and np.ptp(heat, axis=0).any():
            self.heat += list(heat)
        predicted.temperature[:] += opened[:, :, 0]
        fresh = np.ones(piece.times.size, dtype=bool)
        fresh[0] = False
        return predicted, observe([piece], [fresh], [predictor.drives[0].grid], [width]), opened[:, :, 1:]

    def forget_open(self, number: int) -> None:
        """Drop the oldest of what rows and gaps left open: it has faded."""
        self._open = np.delete(self._open, slice(1, 1 + number), axis=1)

    def _misdescribed(self, predictor: _Piece, base: BaseRun, names: Sequence[str]) -> Predictor:
        """The piece with what directions of misdescription do, those of earlier pieces carried on."""
        asked = [item for item in misdescriptions_of(predictor) if item.coordinate in names]
        structural = [item for item in asked if isinstance(item.change, StructuralChange)]
        columns = {}
        if structural:
            # Their model carries them in its own state.
            model, own = model_with_directions(self.fast), [item.change.name for item in structural]
            beside = _Piece(model, predictor.recordings[0], self.effects, self._structural)
            differs = beside.at_places(0, base.values, (), own)
            self._structural = _end_of(differs, own)
            amounts = np.array([item.change.amount for item in structural])
            columns |= _by_coordinate(structural, differs.sensitivity * amounts)
        directions = [item for item in asked if not isinstance(item.change, StructuralChange)]
        if directions:
            channels, states = direction_columns(base, directions)
            if self._directions:
                start = np.column_stack([self._directions[item.coordinate] for item in directions])
                carried = base.run.tangents(np.zeros_like(states[1:]), base.tracks, start=start[None])
                channels, states = channels + base.outputs(carried), states + carried
            self._directions = {item.coordinate: states[-1, :, i] for i, item in enumerate(directions)}
            columns |= _by_coordinate(directions, channels)
        return predictor.misdescribed_by(asked, columns)

    def slowest_time(self) -> float:
        """Longest time constant of the machine as it ran last, s."""
        operators = self._run.operators[int(self._run.step_class[-1])]
        return float(
            np.linalg.eigvals(np.linalg.solve(operators.conduction, self._run.built.storage)).real.max()
        )

    def move(self, changes: Mapping[str, float]) -> None:
        """Move the state to first order with changes of the coordinates, as derivatives are taken."""
        state, tangents = self.begun
        for name, change in changes.items():
            state = state + change * tangents[name]
        self.begun = state, tangents
