"""Temperatures of a mesh at one time: what a transient starts from, ends with and is restarted from."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from spindle_fem.cache import DAMAGED
from spindle_fem.errors import BadInputError
from spindle_fem.model.mesh.conduction_problem import ConductionProblem

STATE_SCHEMA = "spindle-fem/thermal-state/1"


@dataclass(frozen=True, slots=True)
class ThermalState:
    """Temperatures at one time, enough to go on from.

    Attributes
    ----------
    time : float, [s]
    temperature : (n_unknowns,) ndarray, [K]
    lumped_temperature : (m,) ndarray, [K]
    step : float, [s]
        Step size to go on with; 0 when unknown.
    """

    time: float
    temperature: NDArray[np.float64]
    lumped_temperature: NDArray[np.float64]
    step: float = 0.0

    def vector(self) -> NDArray[np.float64]:
        """All temperatures, lumped nodes last, (n + m,) [K]."""
        return np.concatenate((self.temperature, self.lumped_temperature))

    def save(self, path: Path) -> None:
        """Write to an ``.npz`` file."""
        with Path(path).open("wb") as stream:
            np.savez_compressed(
                stream,
                schema=STATE_SCHEMA,
                time=self.time,
                temperature=self.temperature,
                lumped_temperature=self.lumped_temperature,
                step=self.step,
            )

    @classmethod
    def load(cls, path: Path) -> ThermalState:
        """Read what :meth:`save` wrote.

        Raises
        ------
        BadInputError
            Not a saved state, or of another version.
        """
        try:
            with np.load(path, allow_pickle=False) as data:
                schema = str(data["schema"])
                if schema != STATE_SCHEMA:
                    raise BadInputError(str(path), f'schema "{schema}".', f'Allowed: "{STATE_SCHEMA}".')
                return cls(
                    float(data["time"]), data["temperature"], data["lumped_temperature"], float(data["step"])
                )
        except DAMAGED as error:
            raise BadInputError(str(path), f"no saved thermal state ({error}).") from error


def uniform_state(problem: ConductionProblem, temperature: float, time: float = 0.0) -> ThermalState:
    """State of one temperature everywhere.

    Parameters
    ----------
    temperature : float, [K]
    time : float, [s]
    """
    return ThermalState(
        time,
        np.full(problem.operators.n_unknowns, float(temperature)),
        np.full(len(problem.lumped_nodes), float(temperature)),
    )
