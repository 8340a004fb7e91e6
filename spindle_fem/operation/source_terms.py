"""Heat sources of a definition: what each gives, and as terms that every model takes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RegularGridInterpolator

from spindle_fem.definition.machine_spec import HeatSource, MachineSpec, SourceTable
from spindle_fem.effects.framework.term import Term, TermContext

SOURCE_PREFIX = "source."


def source_heat(source: HeatSource, inputs: Mapping[str, Any]) -> Any:
    """Heat of a source, W, at one or many values of the inputs.

    Heat that was recorded for it comes first, then the input that it follows, then its own value.

    Parameters
    ----------
    inputs : mapping of str to float or (k,) ndarray
        ``speed`` [rad/s], ``thrust`` [N] and what was recorded, SI.
    """
    given = inputs.get(f"heat.{source.name}")
    if given is not None:
        return given
    if source.input is not None and source.input in inputs:
        gain = 1.0 if source.gain is None else source.gain.amount.value
        return gain * inputs[source.input]
    if isinstance(source.heat, SourceTable):
        return table_heat(source.heat, inputs["speed"], inputs["thrust"])
    return source.heat or 0.0


def table_heat(table: SourceTable, speed: Any, thrust: Any) -> Any:
    """Heat by a table, W, linear between its entries; speed without its sign."""
    if not table.thrust:
        return np.interp(np.abs(speed), table.speed, table.heat)
    rows = np.reshape(table.heat, (len(table.thrust), len(table.speed)))
    point = [
        np.clip(value, axis[0], axis[-1])
        for value, axis in ((thrust, table.thrust), (np.abs(speed), table.speed))
    ]
    return RegularGridInterpolator((table.thrust, table.speed), rows)(tuple(point))


def heated_places(spec: MachineSpec, names: Iterable[str]) -> tuple[str, ...]:
    """Inputs ``heat.<place>`` among some that name a place rather than a source of the machine."""
    taken = {f"heat.{source.name}" for source in spec.source} | set(spec.source_inputs)
    return tuple(name for name in names if name.startswith("heat.") and name not in taken)


class SourceTerm(Term):
    """A source's heat as a term; it follows no temperature."""

    def __init__(self, source: HeatSource) -> None:
        self.source, self.name = source, SOURCE_PREFIX + source.name
        self.heat_places = (source.place,)

    def heat(self, context: TermContext) -> NDArray[np.complex128]:
        """Heat of the source, (1, k) W."""
        found = np.empty((1, context.temperatures.shape[-1]), dtype=complex)
        found[:] = source_heat(self.source, context.inputs)
        return found


def source_terms(spec: MachineSpec) -> tuple[SourceTerm, ...]:
    """A term for each source of a machine."""
    return tuple(SourceTerm(source) for source in spec.source)
