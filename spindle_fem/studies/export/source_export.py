"""Heat sources of a definition as inputs, loads and tables of an exported model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.machine_spec import HeatSource, MachineSpec, SourceTable
from spindle_fem.operation.source_terms import SOURCE_PREFIX
from spindle_fem.recordings.source_heat import source_heat
from spindle_fem.studies.export.state_space import CELSIUS, ModelInput, PowerLoad, unit_of_input
from spindle_fem.units import ZERO_CELSIUS_K

Array = NDArray[np.float64]

# Torque over the rated one up to which an exported model knows windings, and its points; between them the
# square is straight, up to 3e-4 of the rated loss.
TORQUE_SHARE, TORQUES = 2.0, 61


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
        if source.input is None and (source.follows_torque or isinstance(source.heat, SourceTable)):
            if source.follows_torque:
                inputs.setdefault("torque", _torque(spec))
            found.tables.append(_table(f"source{number}", name, source, inputs))
            continue
        wanted, gain = _followed(source)
        own = inputs.setdefault(wanted.name, wanted)
        if own not in standard and not own.default:
            # Sources of one input: the first that says what is usual.
            inputs[own.name] = replace(own, default=wanted.default)
        offset = ZERO_CELSIUS_K if own.unit == CELSIUS else 0.0
        found.powers.append(PowerLoad(name, "W", list(inputs).index(own.name), gain, 1.0, offset))
        found.places.append(source.place)
        if source.follows_torque or isinstance(source.heat, SourceTable):
            found.notes.append(
                f'source "{source.name}" follows its input "{source.input}" alone; '
                "its own heat, for recordings without that, is left out"
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


def _torque(spec: MachineSpec) -> ModelInput:
    """Torque of the drive as an input of a model, up to what its sources or its operation have of it."""
    usual = max(source.usual_torque for source in spec.source)
    most = [usual, *(TORQUE_SHARE * (source.rated_torque or 0.0) for source in spec.source)]
    most += [source.heat.torque[-1] for source in spec.source if getattr(source.heat, "torque", ())]
    return ModelInput("torque", "N*m", usual, 0.0, float(max(most)), magnitude=True)


def _table(key: str, load: str, source: HeatSource, inputs: Mapping[str, ModelInput]) -> SourceTableLoad:
    """Own heat of a source with the corners of its table, its ends held to those of the inputs' ranges."""
    table, entries = source.heat, {}
    if isinstance(table, SourceTable):
        entries = {"speed": table.speed} | ({table.load_input: table.load} if table.load else {})
    if source.copper_loss is not None:
        even = np.linspace(0.0, inputs["torque"].high, TORQUES)
        entries["torque"] = np.unique([*even, *entries.get("torque", ())])
    ranges = [(inputs[name].low, inputs[name].high) for name in entries]
    axes = tuple(
        np.unique([low, high, *(entry for entry in own if low < entry < high)])
        for own, (low, high) in zip(entries.values(), ranges, strict=True)
    )
    grid = dict(zip(entries, np.meshgrid(*axes, indexing="ij"), strict=True))
    values = source_heat(source, {name: value.ravel() for name, value in grid.items()})
    shape = tuple(len(axis) for axis in axes)
    return SourceTableLoad(key, load, source.place, tuple(entries), axes, values.reshape(*shape, 1))
