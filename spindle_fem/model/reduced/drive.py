"""Inputs of a machine over time, and the classes of operating points that share their operators."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.effects.framework.term import COVARIATE
from spindle_fem.errors import RecordingError
from spindle_fem.machine.geometry.coolant_path import delivered_flow
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.recordings.align import Recording
from spindle_fem.recordings.input_limits import require_possible_inputs
from spindle_fem.recordings.standard_inputs import standard_inputs

Array = NDArray[np.float64]

# Walls of the channel whose mean differs by less share a film where films follow the wall, K; that many
# classes more at most.
WALL_BIN, MOST_WALLS = 0.02, 200
LARGEST_STEP = 60.0
MOST_STEP_SIZES = 200


@dataclass(frozen=True, slots=True)
class ClassWidths:
    """How far inputs may differ between steps that share their films.

    Attributes
    ----------
    inlet : float, [K]
        Films follow viscosity by about 1 % per kelvin.
    flow, speed : float
        Shares of the highest; a film at constant Nusselt number follows flow by 0.3 % per per cent, one that
        turns turbulent by 3 %.
    most : int
        Classes; widths grow where inputs take more values.
    reads : bool
        Whether outlets of streams are read with the films of the moment; those of the step that begins there
        otherwise.
    """

    inlet: float
    flow: float
    speed: float
    most: int
    reads: bool = False


# Readings within a millikelvin of those with a film for each step.
PREDICTED = ClassWidths(0.01, 3.0e-4, 1.0e-4, 400, reads=True)
# For fits, which march many times: some 0.1 mK, up to 25 mK for minutes where the coolant turns turbulent.
FITTED = ClassWidths(0.25, 0.01, 2.0e-3, 120)

STANDARD = ("speed", "thrust", "ambient", "coolant_inlet", "coolant_flow")


@dataclass(frozen=True, slots=True)
class WarmedPoint(OperatingPoint):
    """Operating point with the temperature of the channel's wall.

    Attributes
    ----------
    channel_wall : (n_cells,) ndarray, [K]
        Mean of each cell over the steps of a class.
    """

    channel_wall: Array | None = None


@dataclass(frozen=True, slots=True)
class Drive:
    """Inputs on a grid of steps.

    Attributes
    ----------
    times : (N,) ndarray, [s]
        Where outputs are wanted.
    grid : (G + 1,) ndarray, [s]
        Ends of the steps.
    names : tuple of str
        ``speed`` [rad/s], ``thrust`` [N], ``ambient``, ``coolant_inlet`` [K],
        ``coolant_flow`` [m³/s], then ``heat.<source>`` [W] and
        ``covariate.<column>``, which only terms may follow: means over each step.
    start, end : (G, m) ndarray
        Inputs just after the start and just before the end of each step.
    step_class : (G,) int ndarray
        Class of each step.
    points : tuple of OperatingPoint
        Mean operating point of each class.
    restarts : tuple of int
        Points of the grid at which a network starts again, after a long gap.
    read_class : (G + 1,) int ndarray or None
        Class of the readings at every point of the grid; None for that of the step that begins there.
    """

    times: Array
    grid: Array
    names: tuple[str, ...]
    start: Array
    end: Array
    step_class: NDArray[np.int64]
    points: tuple[OperatingPoint, ...]
    notes: tuple[str, ...]
    restarts: tuple[int, ...] = ()
    read_class: NDArray[np.int64] | None = None

    @property
    def steps(self) -> Array:
        """Length of each step, (G,) [s]."""
        return np.diff(self.grid)

    def column(self, name: str) -> int:
        """Column of an input."""
        return self.names.index(name)

    def first(self, name: str) -> float:
        """Value of an input at the start."""
        return float(self.start[0, self.column(name)])


def drive_of_recording(
    spec: MachineSpec,
    recording: Recording,
    *,
    largest_step: float = LARGEST_STEP,
    widths: ClassWidths = PREDICTED,
) -> Drive:
    """Inputs of a recording on the steps of its own grid.

    Raises
    ------
    RecordingError
        An input that the machine does not know or cannot take, or a speed that is not given.
    """
    unusual = require_possible_inputs(spec, recording)
    known = standard_inputs(spec)
    notes = [
        f'"{name}" is not recorded: the definition\'s value is used'
        + (", as far as the pump drives it" if name == "coolant_flow" and spec.has_pump_limit else "")
        for name in known
        if name not in recording.input_names and (spec.coolant is not None or "coolant" not in name)
    ]
    names = (*known, *(n for n in recording.input_names if n not in known))
    history = recording.input_history()
    columns, held = [], []
    for name in names:
        if name in history.names:
            position = history.names.index(name)
            values = history.values[:, position]
            # Friction does not know which way a spindle turns.
            columns.append(np.abs(values) if name == "speed" else values)
            held.append(bool(history.held[position]))
        elif name == "coolant_flow" and spec.has_pump_limit:
            inlet = names.index("coolant_inlet")
            columns.append(delivered_flow(spec, columns[inlet]))
            held.append(held[inlet])
        else:
            columns.append(np.full(recording.times.size, known[name]))
            held.append(True)
    beside = recording.covariate_history()
    names = (*names, *(COVARIATE + name for name in beside))
    columns += beside.values()
    held += [False] * len(beside)
    return make_drive(
        recording.times,
        names,
        np.column_stack(columns),
        np.array(held),
        notes=(*notes, *unusual),
        largest_step=largest_step,
        widths=widths,
    )


def make_drive(
    times: Array,
    names: tuple[str, ...],
    values: Array,
    held: NDArray[np.bool_],
    *,
    notes: tuple[str, ...] = (),
    largest_step: float = LARGEST_STEP,
    widths: ClassWidths = PREDICTED,
) -> Drive:
    """Inputs on steps no longer than allowed, sorted into classes.

    Parameters
    ----------
    times : (N,) ndarray, [s]
        Strictly increasing.
    names : tuple of str
        The standard ones first, as in :class:`Drive`.
    values : (N, m) ndarray, SI
    held : (m,) bool ndarray
    largest_step : float, [s]
    """
    if names[: len(STANDARD)] != STANDARD:
        raise RecordingError("inputs", f"named {names}.", f"Allowed: {STANDARD} first.")
    grid, start, end = inputs_on_steps(np.asarray(times, dtype=float), values, held, largest_step)
    level_covariates(names, start, end)
    inputs = 0.5 * (start + end)
    if widths.reads:
        inputs = np.vstack((inputs, start, end[-1:]))
    found, points = classes_of(inputs, widths)
    step_class, read_class = np.split(found, [len(start)])
    drive = Drive(np.asarray(times, dtype=float), grid, names, start, end, step_class, points, notes)
    return replace(drive, read_class=read_class) if widths.reads else drive


def inputs_on_steps(
    times: Array, values: Array, held: NDArray[np.bool_], largest_step: float, breaks: Sequence[float] = ()
) -> tuple[Array, Array, Array]:
    """Ends of the steps (G + 1,), and the inputs at the start and end of each (G, m).

    Parameters
    ----------
    times : (N,) ndarray, [s]
    values : (N, m) ndarray
    held : (m,) bool ndarray
    largest_step : float, [s]
    breaks : sequence of float, [s]
        Stamps that begin a new segment: one step, of any length, leads to each.
    """
    grid = _grid(times, values[:, held], largest_step, np.asarray(breaks, dtype=float))
    start, end = np.empty((grid.size - 1, len(held))), np.empty((grid.size - 1, len(held)))
    owner = np.searchsorted(times, 0.5 * (grid[:-1] + grid[1:]), side="right") - 1
    for column in range(len(held)):
        if held[column]:
            start[:, column] = end[:, column] = values[owner, column]
        else:
            on_grid = np.interp(grid, times, values[:, column])
            start[:, column], end[:, column] = on_grid[:-1], on_grid[1:]
    return grid, start, end


def level_covariates(names: Sequence[str], start: Array, end: Array) -> None:
    """Let covariates keep their mean over each step, in place: what follows them sees one value."""
    for column in covariate_columns(names):
        start[:, column] = end[:, column] = 0.5 * (start[:, column] + end[:, column])


def covariate_columns(names: Sequence[str]) -> list[int]:
    """Columns that were recorded beside the inputs."""
    return [column for column, name in enumerate(names) if name.startswith(COVARIATE)]


def _grid(times: Array, held: Array, largest: float, breaks: Array) -> Array:
    """Ends of the steps: every stamp, long gaps divided; few sizes only where stamps jitter."""
    gaps = np.diff(times)
    bridges = np.isin(times[1:], breaks)
    pieces = np.where(bridges, 1, np.maximum(1, np.ceil(gaps / largest - 1e-9).astype(int)))
    if np.unique(np.round((gaps / pieces)[~bridges], 6)).size <= MOST_STEP_SIZES:
        within = np.arange(pieces.sum()) - np.repeat(np.cumsum(pieces) - pieces, pieces)
        return np.append(np.repeat(times[:-1], pieces) + within * np.repeat(gaps / pieces, pieces), times[-1])
    # Equal steps between the changes of held inputs; outputs are interpolated between them.
    changes = times[1:][np.any(np.diff(held, axis=0) != 0.0, axis=1)]
    step = min(largest, float(np.median(gaps)))
    edges = np.unique(np.concatenate(([times[0]], changes, times[:-1][bridges], breaks, [times[-1]])))
    parts = []
    for begin, stop in itertools.pairwise(edges):
        if stop in breaks:
            parts.append(np.array([begin]))
            continue
        whole = int(np.floor((stop - begin) / step * (1.0 + 1e-9)))
        parts.append(
            begin + step * np.arange(whole + 1 if begin + whole * step < stop - 1e-6 * step else whole)
        )
    return np.append(np.concatenate(parts), times[-1])


def classes_of(inputs: Array, widths: ClassWidths) -> tuple[NDArray[np.int64], tuple[OperatingPoint, ...]]:
    """Steps whose films differ too little to matter share one operator."""
    speed, thrust, ambient, inlet, flow = inputs[:, : len(STANDARD)].T
    width = widths.speed * max(float(speed.max()), 1.0)
    flow_width = widths.flow * max(float(flow.max()), 1e-9)
    inlet_width = widths.inlet
    while True:
        keys = np.column_stack(
            (np.round(speed / width), np.round(inlet / inlet_width), np.round(flow / flow_width))
        )
        # Standstill is a class of its own: films at rest are not those of slow turning.
        keys[speed == 0.0, 0] = -1.0
        _, label = np.unique(keys, axis=0, return_inverse=True)
        label = label.reshape(-1)
        if label.max() < widths.most:
            break
        width, inlet_width, flow_width = 1.5 * width, 1.5 * inlet_width, 1.5 * flow_width
    means = [
        np.bincount(label, weights=column) / np.bincount(label)
        for column in (speed, thrust, ambient, inlet, flow)
    ]
    return label, tuple(OperatingPoint(*(float(v) for v in values)) for values in zip(*means, strict=True))


def with_walls(drive: Drive, walls: Array) -> Drive:
    """The drive with its classes divided by the temperature of the channel's wall.

    Parameters
    ----------
    walls : (G + 1, n_cells) ndarray, [K]
        At the ends of the steps.
    """
    owners, steps = drive.step_class, len(drive.step_class)
    wall = 0.5 * (walls[:-1] + walls[1:])
    if drive.read_class is not None:
        owners, wall = np.append(owners, drive.read_class), np.vstack((wall, walls))
    mean, width = wall.mean(axis=1), WALL_BIN
    while True:
        keys = np.column_stack((owners, np.round(mean / width)))
        first, label = np.unique(keys, axis=0, return_inverse=True)
        if len(first) <= len(drive.points) + MOST_WALLS:
            break
        width *= 1.5
    label = label.reshape(-1)
    points = []
    for number, (owner, _) in enumerate(first):
        point = drive.points[int(owner)]
        own = {name: getattr(point, name) for name in OperatingPoint.__slots__}
        points.append(WarmedPoint(**own, channel_wall=wall[label == number].mean(axis=0)))
    reads = None if drive.read_class is None else label[steps:]
    return replace(drive, step_class=label[:steps], points=tuple(points), read_class=reads)


def inputs_at(drive: Drive, times: Array) -> Mapping[str, Array]:
    """Inputs at any times, as they are just after them."""
    step = np.clip(np.searchsorted(drive.grid, times, side="right") - 1, 0, drive.grid.size - 2)
    part = ((times - drive.grid[step]) / drive.steps[step])[:, None]
    values = drive.start[step] + part * (drive.end[step] - drive.start[step])
    return {name: values[:, column] for column, name in enumerate(drive.names)}
