"""External bridges to the housing of a machine: brackets, hoses and cables that no drawing shows."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spindle_fem.inference import tuned
from spindle_fem.inference.candidate_response import BaseRun
from spindle_fem.inference.misdescription import Change, Misdescription
from spindle_fem.inference.predictor import Predictor
from spindle_fem.machine.view.part_roles import Layout
from spindle_fem.machine.view.place_names import ACROSS, UP

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Bridge:
    """A conductance between two places in parallel to the machine's own metal.

    Attributes
    ----------
    start, end : str
        Places whose mean temperatures drive the heat.
    side : str
        First harmonic of ``end`` round the axis that takes heat from its mean to one side; empty for the
        mean itself.
    """

    start: str
    end: str
    side: str = ""

    def __call__(self, base: BaseRun) -> Change:
        """Loads for 1 W/K."""
        model = base.predictor.fast.model
        start, end = model.place(self.start), model.place(self.end)
        # Heat all on one line along the place is its mean and twice its harmonics.
        load = 2.0 * model.place(self.side) if self.side else end - start
        loads = np.outer(base.states @ (start - end), load)
        return Change(loads[:-1], loads[1:])


def mounting_misdescriptions(predictor: Predictor) -> Iterator[Misdescription]:
    """Bridges from the flange, where a machine is held, to every other segment of its housing.

    Where round the axis they end is open as well. Width: ``BRIDGE_SIGMA`` of
    :mod:`spindle_fem.inference.tuned`.
    """
    if predictor.is_network:
        return
    places = set(predictor.fast.model.place_names)
    layout = Layout(predictor.fast.spec, places)
    if layout.housing is None or not layout.flange:
        return
    flange = f"{layout.housing.name}.{layout.flange}"
    for segment in layout.housing.segment:
        place = f"{layout.housing.name}.{segment.name}"
        if place == flange or not {place, flange} <= places:
            continue
        key = f"mounting of {place}"
        what = f"conductance of what bridges {flange} and {place} from outside (bracket, hoses, cables)"
        yield Misdescription(
            f"bridge.{segment.name}", key, "W/K", tuned.BRIDGE_SIGMA, what, Bridge(flange, place)
        )
        for name, prefix, where in (("up", UP, "above"), ("across", ACROSS, "to the side")):
            if prefix + place in places:
                yield Misdescription(
                    f"bridge.{segment.name}.{name}",
                    key,
                    "W/K",
                    # the mean square of a cosine
                    tuned.BRIDGE_SIGMA * np.sqrt(0.5),
                    f"{what}, as far as it ends {where} and not all round",
                    Bridge(flange, place, prefix + place),
                )
