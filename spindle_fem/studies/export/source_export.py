"""Heat sources of a definition as inputs, loads and tables of an exported model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.machine_spec import HeatSource, MachineSpec, SourceTable
from spindle_fem.operation.source_terms import SOURCE_PREFIX
from spindle_fem.recordings.source_heat import table_heat
from spindle_fem.studies.export.state_space import CELSIUS, ModelInput, PowerLoad, unit_of_input
from spindle_fem.units import ZERO_CELSIUS_K

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class SourceTableLoad:
    """Heat over inputs, linear between the points of its axes.

    Attributes
    ----------
    key : str
        Of the table among the arrays.
    load, place : str
        Of the model's loads; where it enters.
    inputs : tuple of str
        The table's axes.
    axes : tuple of ndarray
    values : (n, ..., 1) ndarray, [W]
    """

    key: str
    load: str
    place: str
    inputs: tuple[str, ...]
    axes: tuple[Array, ...]
    values: Array


@dataclass(frozen=True, slots=True)
class SourceLoads:
    """Contribution of all sources of a machine to its exported model.

    Attributes
    ----------
    inputs : list of ModelInput
        Beside the standard ones: ``heat.NAME`` [W], or what sources follow.
    powers, places : lists
        Loads that are an input times a gain, and where each enters.
    tables : list of SourceTableLoad
    notes : list of str
    """

    inputs: list[ModelInput]
    powers: list[PowerLoad]
    places: list[str]
    tables: list[SourceTableLoad]
    notes: list[str]


def source_loads(spec: MachineSpec, standard: Sequence[ModelInput]) -> SourceLoads:
    """Loads of every source: one that follows an input by its gain, a table over speed, or an own input.

    Parameters
    ----------
    standard : sequence of ModelInput
        The model's inputs without sources; the first two are speed and thrust, with their ranges.
    """
    inputs = {item.name: item for item in standard}
    found = SourceLoads([], [], [], [], [])
    for number, source in enumerate(spec.source):
        name = SOURCE_PREFIX + source.name
        if source.input is None and isinstance(source.heat, SourceTable):
            found.tables.append(_table(f"source{number}", name, source, standard))
            continue
        wanted, gain = _followed(source)
        own = inputs.setdefault(wanted.name, wanted)
        if own not in standard and not own.default:
            # Sources of one input: the first that says what is usual.
            inputs[own.name] = replace(own, default=wanted.default)
        offset = ZERO_CELSIUS_K if own.unit == CELSIUS else 0.0
        found.powers.append(PowerLoad(name, "W", list(inputs).index(own.name), gain, 1.0, offset))
        found.places.append(source.place)
        if isinstance(source.heat, SourceTable):
            found.notes.append(
                f'source "{source.name}" follows its input "{source.input}" alone; '
                "its table, for recordings without that, is left out"
            )
    return replace(found, inputs=list(inputs.values())[len(standard) :])


def _followed(source: HeatSource) -> tuple[ModelInput, float]:
    """Input that a source follows, with its usual value, and W for each unit of it."""
    usual = 0.0 if source.heat is None or isinstance(source.heat, SourceTable) else float(source.heat)
    if source.input is None:
        return ModelInput(f"heat.{source.name}", "W", usual), 1.0
    if source.gain is None:
        return ModelInput(source.input, "W", usual), 1.0
    gain = float(source.gain.amount.value)
    unit = unit_of_input(source.gain.unit, 1.0) or "1"
    return ModelInput(source.input, unit, usual / gain if gain else 0.0), gain


def _table(key: str, load: str, source: HeatSource, inputs: Sequence[ModelInput]) -> SourceTableLoad:
    """A table with its corners, and its ends held to those of the inputs' ranges."""
    table = source.heat
    entries = (table.speed, table.thrust) if table.thrust else (table.speed,)
    ranges = [(item.low, item.high) for item in inputs[: len(entries)]]
    axes = tuple(
        np.unique([low, high, *(entry for entry in own if low < entry < high)])
        for own, (low, high) in zip(entries, ranges, strict=True)
    )
    grid = np.meshgrid(*axes, indexing="ij")
    values = np.asarray(table_heat(table, grid[0].ravel(), grid[-1].ravel()))
    return SourceTableLoad(
        key,
        load,
        source.place,
        tuple(item.name for item in inputs[: len(entries)]),
        axes,
        values.reshape(*grid[0].shape, 1),
    )
