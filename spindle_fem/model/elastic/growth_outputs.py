"""Shifts of a machine's faces as linear outputs of its temperatures, each solved once.

Outputs of one body: radial shift of its seats and raceways, axial place of its seats, and how far its
nose or flange moves along the axis. Each has a row of weights over the unknowns of the thermal mesh,
so that it is an inner product with any temperature field, and compliances between the body's faces.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spindle_fem.model.elastic.elastic_body import ElasticBody

Array = NDArray[np.float64]
# Directions (z, r, θ) of outputs; the last is that of a whole section, moved sideways.
RADIAL, AXIAL, SIDEWAYS = (0.0, 1.0), (1.0, 0.0), (0.0, 0.5, -0.5)


@dataclass(frozen=True, slots=True)
class BodyOutputs:
    """Outputs of one body and their solutions.

    Attributes
    ----------
    names : tuple of str
    loads : (n, k) ndarray
        Each output as a functional of the displacement.
    solutions : (n, k) ndarray
        Displacement under each functional as a load.
    """

    body: ElasticBody
    names: tuple[str, ...]
    loads: Array
    solutions: Array

    @classmethod
    def of(cls, body: ElasticBody, outputs: Mapping[str, Array]) -> BodyOutputs:
        """Solve the body once for each output, a functional (n,) in balance."""
        loads = np.stack(list(outputs.values()), axis=1)
        solutions = np.stack([body.solve(load) for load in loads.T], axis=1)
        return cls(body, tuple(outputs), loads, solutions)

    @property
    def by_spin(self) -> Array:
        """Shift (k,) at 1 rad/s, m s²."""
        return self.solutions.T @ self.body.spin_load

    def compliance(self, areas: Array) -> Array:
        """Shift of every output by a pressure on the face of each, (k, k) m/Pa.

        Parameters
        ----------
        areas : (k,) ndarray, [m²]
            Of the faces, negative where a pressure pushes against the output's direction.
        """
        return self.solutions.T @ self.loads * areas

    def by_temperature(self) -> Array:
        """Shift (k, n_corners) of every output by a kelvin at each corner of the section's cells, m/K."""
        return (self.body.expansion_load.T @ self.solutions).T
