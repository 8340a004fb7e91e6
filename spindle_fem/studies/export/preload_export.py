"""Preload that follows temperatures in an exported model: what it does to friction, ball rows and joints."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from spindle_fem.model.reduced.fast_model import FastModel
from spindle_fem.model.reduced.followed_preload import PER_LOG_SPEED, PER_NEWTON, FollowedPreload
from spindle_fem.model.reduced.sampled_response import SampledResponse
from spindle_fem.operation.mounted_states import MountedSet
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.studies.export.effect_export import ExportedEffects
from spindle_fem.studies.export.state_space import FeedbackTable
from spindle_fem.units import ZERO_CELSIUS_K

Array = NDArray[np.float64]

# Numbers of a bearing among the quantities of its set: three logarithms, and the preload, which drives none.
OF_BEARING, LOGARITHMS = 4, 3


class ExportedPreload:
    """Responses of the bearing sets, one behind the other, and what each of their logarithms is of.

    Attributes
    ----------
    bearings : mapping of str to (int, int, int)
        Logarithms of friction and of both ball conductances of a bearing.
    joints : mapping of str to int
        Logarithms of the conductance of joints, by coefficient.
    """

    def __init__(self, fast: FastModel, preload: FollowedPreload) -> None:
        self._fast, self._preload = fast, preload
        self.bearings: dict[str, tuple[int, int, int]] = {}
        self.joints: dict[str, int] = {}
        first = 0
        for group, _, _ in preload.responses:
            for name in group.bearings:
                self.bearings[name] = (first, first + 1, first + 2)
                first += LOGARITHMS
            for name in group.joints:
                self.joints[name] = first
                first += 1

    def header(self, inputs: dict[str, int]) -> list[dict[str, Any]]:
        """Plain data of every response, with positions of the model's inputs."""
        known = (
            {
                "input": inputs["speed"],
                "gain": PER_LOG_SPEED,
                "logarithm": True,
                "lowest": self._preload.lowest_speed,
            },
            {
                "input": inputs["thrust"],
                "gain": PER_NEWTON,
                "logarithm": False,
                "lowest": float(self._preload.mounted.friction.thrust[0]),
            },
        )
        return [
            {
                "name": f"mounted{number}",
                "length": response.length,
                "reach": _reach(response),
                "inputs": [known[column] for column in response.fixed.tolist()],
            }
            for number, (_, response, _) in enumerate(self._preload.responses)
        ]

    def arrays(self, modes: Array) -> dict[str, Array]:
        """Arrays of every response, for states that are coordinates (r, r) of modes in °C."""
        model = self._fast.model
        found = {}
        for number, (group, response, zero) in enumerate(self._preload.responses):
            names = [
                name for name in self._preload.reads if name.rsplit(".", 1)[0] == f"mounted.{group.name}"
            ]
            rows = np.array([self._preload.read_row(model, name) for name in names]).reshape(-1, model.size)
            kept = _driving(group)
            own = {
                "rows": rows @ modes,
                "zero": zero - ZERO_CELSIUS_K * (rows @ model.one),
                "samples": response.samples,
                "weights": response.weights[:, kept],
                "line": response.line[:, kept],
                "limits": response.limits()[:, kept],
            }
            found |= {f"mounted{number}.{key}": values for key, values in own.items()}
        return found

    def joint_table(self, effects: ExportedEffects) -> FeedbackTable:
        """What every joint that follows its fit conducts beyond what the operators hold."""
        fast, size = self._fast, self._fast.model.size
        usual = OperatingPoint.of(fast.spec)
        values = fast.coefficients(usual, effects.factors, effects.changes(usual))
        out, into, response = [], [], []
        for name, number in self.joints.items():
            vectors, spectrum = fast.directions.of(name)
            out.append(vectors.T)
            into.append(-values[name] * spectrum[:, None] * vectors.T)
            response += [number] * len(spectrum)
        column = np.zeros(len(response), dtype=np.int64)
        return FeedbackTable(
            sense=np.zeros(size),
            sense_load={},
            inputs=(),
            axes=(np.array([0.0, 1.0]),),
            values=np.ones((2, 1)),
            column=column,
            out=np.concatenate(out),
            into=np.concatenate(into),
            load=[{} for _ in response],
            less=column,
            response=np.array(response, dtype=np.int64),
        )


def _driving(group: MountedSet) -> list[int]:
    """Quantities of a set that drive the model: all but its preloads."""
    rings = OF_BEARING * len(group.bearings)
    own = [number for number in range(rings) if number % OF_BEARING < LOGARITHMS]
    return [*own, *range(rings, group.number)]


def _reach(response: SampledResponse) -> float:
    """Distance from every sample beyond which a state is not among them: the widest gap between two."""
    apart = cdist(response.samples, response.samples)
    np.fill_diagonal(apart, np.inf)
    return float(apart.min(axis=1).max())
