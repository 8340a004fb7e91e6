"""Possible deviations of a machine with geometry that drawings and mounting leave open."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.effects.framework.effect import Reported
from spindle_fem.inference.candidate_response import BaseRun
from spindle_fem.inference.coordinate_names import GAP_PREFIX, JUMP_PREFIX
from spindle_fem.inference.heat_misdescriptions import with_material
from spindle_fem.inference.misdescription import Change, Misdescription
from spindle_fem.inference.predictor import Predictor
from spindle_fem.model.reduced.fast_model import FastModel, ModelInputs
from spindle_fem.model.reduced.structural_causes import CAPACITY, with_channel
from spindle_fem.model.reduced.structural_model import StructuralModel, structural_model_of

Array = NDArray[np.float64]

# Unit in which a report states a direction, and its size in the model's unit.
TOLD_IN = {"m": ("mm", 1e-3)}
# Operating points whose coefficients differ by less than this share have the same operators here: columns of
# quantities that are known to their prior width need not be exact.
SAME_WITHIN = 0.01
# Columns of all directions (G + 1, c, n), which one march gives together.
_known: WeakKeyDictionary[BaseRun, dict[str, Array]] = WeakKeyDictionary()
# The model with the directions of every machine in use: the same whatever the basis of its fast model.
_models: WeakKeyDictionary[ModelInputs, StructuralModel] = WeakKeyDictionary()


@dataclass(frozen=True, slots=True)
class StructuralChange:
    """Change of the readings by some units of a direction.

    Attributes
    ----------
    channel : tuple of (str, float)
        Keys of the cooling channel that change, and by how much [m] for a unit of the direction.
    """

    name: str
    amount: float = 1.0
    channel: tuple[tuple[str, float], ...] = ()

    def __call__(self, base: BaseRun) -> Change:
        """Derivative of the same run on the model that has the directions."""
        if base not in _known:
            _known[base] = structural_columns(base)
        return Change(direct=self.amount * _known[base][self.name])

    def quantity(self, spec: MachineSpec) -> Reported | None:
        """The length of the channel that changes, mm."""
        if len(self.channel) != 1:
            return None
        ((key, _),) = self.channel
        return Reported(1e3 * float(getattr(spec.channel, key)), "mm")

    def redefined(self, spec: MachineSpec, value: float) -> MachineSpec:
        """The machine with another channel."""
        return with_channel(spec, {key: value * self.amount * each for key, each in self.channel})


@dataclass(frozen=True, slots=True)
class MaterialCapacity(StructuralChange):
    """Change by another heat capacity of one material.

    Attributes
    ----------
    material : str
    """

    material: str = ""

    @property
    def parameter(self) -> str:
        """Its part of the storage."""
        return CAPACITY + self.material

    def of_factor(self, factor: float) -> float:
        """The share of a larger one, of a smaller one the logarithm."""
        return factor - 1.0 if factor > 1.0 else float(np.log(factor))

    def corrected(self, spec: MachineSpec, value: float) -> MachineSpec:
        """The machine with the capacity that it has."""
        return with_material(spec, self.material, "specific_heat_capacity", 1.0 + value)

    def quantity(self, spec: MachineSpec) -> Reported:
        """Its specific heat capacity."""
        return Reported(spec.materials[self.material].specific_heat_capacity, "J/(kg·K)")

    def redefined(self, spec: MachineSpec, value: float) -> MachineSpec:
        """The machine with another capacity, above none however little one to first order is."""
        factor = 1.0 + value if value > 0.0 else float(np.exp(value))
        return with_material(spec, self.material, "specific_heat_capacity", factor)


def structural_columns(base: BaseRun) -> dict[str, Array]:
    """Change where every channel sits for a unit of each direction, (G + 1, c) K, by direction."""
    model = model_with_directions(base.predictor.fast)
    names = tuple(item.name for item in model.structural)
    own = base.predictor.with_model(model, SAME_WITHIN)
    # What rows and gaps leave open moves readings to first order, which no direction changes.
    values = {n: value for n, value in base.values.items() if not n.startswith((JUMP_PREFIX, GAP_PREFIX))}
    predicted = own.at_places(base.number, values, base.candidates, names)
    return {name: predicted.sensitivity[:, :, column] for column, name in enumerate(names)}


def structural_misdescriptions(predictor: Predictor) -> Iterator[Misdescription]:
    """Directions of a machine with geometry; widths are those of its definition.

    None of a model that was not projected from a mesh: it has no faces to move.
    """
    if predictor.is_network or not predictor.fast.model.n_full:
        return
    model = model_with_directions(predictor.fast)
    for item in model.structural:
        unit, scale = TOLD_IN.get(item.unit, (item.unit, 1.0))
        channel = tuple(model.changes[item.name].channel.items())
        change = StructuralChange(item.name, scale, channel)
        if item.name.startswith(CAPACITY):
            change = MaterialCapacity(item.name, scale, material=item.name.removeprefix(CAPACITY))
        yield Misdescription(item.name, item.key, unit, item.sigma / scale, item.statement, change)


def model_with_directions(fast: FastModel) -> StructuralModel:
    """The fast model that may be differentiated by its directions, made or fetched once."""
    if fast.inputs not in _models:
        _models[fast.inputs] = structural_model_of(fast)
    return _models[fast.inputs]
