"""Heat sources of a definition as terms that every model takes."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.machine_spec import HeatSource, MachineSpec
from spindle_fem.effects.framework.term import Term, TermContext
from spindle_fem.recordings.source_heat import source_heat

SOURCE_PREFIX = "source."


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
