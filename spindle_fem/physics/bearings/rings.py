"""Cylinder walls by Lamé, and what rings that give way do to the balls between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spindle_fem.physics.bearings.bearing_geometry import (
    STEEL_DENSITY,
    STEEL_EXPANSION,
    STEEL_POISSON_RATIO,
    STEEL_YOUNG_MODULUS,
)

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class SeatMaterial:
    """Elastic and thermal constants of a ring's counterpart.

    Attributes
    ----------
    young_modulus : float, [Pa]
    poisson_ratio : float, [-]
    density : float, [kg/m³]
    thermal_expansion : float, [1/K]
    """

    young_modulus: float = STEEL_YOUNG_MODULUS
    poisson_ratio: float = STEEL_POISSON_RATIO
    density: float = STEEL_DENSITY
    thermal_expansion: float = STEEL_EXPANSION


STEEL = SeatMaterial()


@dataclass(frozen=True, slots=True)
class Annulus:
    """A cylinder wall in plane stress.

    Attributes
    ----------
    inside, outside : float, [m]
        Radii; ``inside`` 0 for a solid shaft.

    Source: Lamé (1852); rotating discs: Timoshenko & Goodier, Theory of Elasticity, section 32.
    """

    inside: float
    outside: float
    material: SeatMaterial = STEEL

    @property
    def _shape(self) -> float:
        return (self.outside**2 + self.inside**2) / (self.outside**2 - self.inside**2)

    @property
    def bore_by_bore_pressure(self) -> float:
        """Growth of the bore for each pascal inside it, m/Pa."""
        return self.inside / self.material.young_modulus * (self._shape + self.material.poisson_ratio)

    @property
    def outside_by_outside_pressure(self) -> float:
        """Shrinkage of the outside for each pascal on it, m/Pa."""
        return self.outside / self.material.young_modulus * (self._shape - self.material.poisson_ratio)

    @property
    def outside_by_bore_pressure(self) -> float:
        """Growth of the outside for each pascal in the bore, m/Pa."""
        share = 2.0 * self.inside**2 / (self.outside**2 - self.inside**2)
        return share * self.outside / self.material.young_modulus

    @property
    def bore_by_outside_pressure(self) -> float:
        """Shrinkage of the bore for each pascal on the outside, m/Pa."""
        share = 2.0 * self.outside**2 / (self.outside**2 - self.inside**2)
        return share * self.inside / self.material.young_modulus

    def spin_growth(self, speed: float) -> tuple[float, float]:
        """Growth of bore and outside by rotation (rad/s), m."""
        a, b, nu = self.inside, self.outside, self.material.poisson_ratio
        scale = self.material.density * speed**2 / (4.0 * self.material.young_modulus)
        return (
            scale * a * ((3.0 + nu) * b**2 + (1.0 - nu) * a**2),
            scale * b * ((1.0 - nu) * b**2 + (3.0 + nu) * a**2),
        )


@dataclass(frozen=True, slots=True)
class RingLaw:
    """Raceway growth of one bearing, inner less outer, over the radial force of its balls.

    The largest of its lines holds: ``growth = max(level - compliance * force)``,
    with the summed radial ball load of the inner ring as force.

    Attributes
    ----------
    level : tuple of float, [m]
    compliance : tuple of float, [m/N]
    """

    level: tuple[float, ...]
    compliance: tuple[float, ...]

    def growth(self, force: float) -> float:
        """Inner less outer raceway growth at a radial ball force (N), m."""
        return max(a - c * force for a, c in zip(self.level, self.compliance, strict=True))

    def force(self, growth: float) -> float:
        """Radial ball force (N) that leaves a growth (m); negative: the rings would have to be pulled."""
        return max((a - growth) / c for a, c in zip(self.level, self.compliance, strict=True))


@dataclass(frozen=True, slots=True, eq=False)
class RingCompliance:
    """Ring laws of a system's bearings as restoring forces on displacements of its own.

    Attributes
    ----------
    columns : (k,) int64 ndarray
        Displacements that are raceway growths, inner less outer.
    level : (k, 4) ndarray, [m]
    compliance : (k, 4) ndarray, [m/N]
    """

    columns: NDArray[np.int64]
    level: FloatArray
    compliance: FloatArray

    @classmethod
    def of(cls, laws: list[RingLaw], columns: NDArray[np.int64]) -> RingCompliance:
        """Laws of bearings whose growth is the displacement at ``columns``."""
        return cls(columns, np.array([law.level for law in laws]), np.array([law.compliance for law in laws]))

    def force(self, displacement: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Radial force of every law (N) and its fall with the growths, (k,) and (k, k) N/m."""
        forces = (self.level - displacement[self.columns][:, None]) / self.compliance
        active = np.argmax(forces, axis=1)
        rows = np.arange(len(active))
        return forces[rows, active], np.diag(1.0 / self.compliance[rows, active])

    @classmethod
    def joined(cls, parts: Sequence[tuple[int, RingCompliance]]) -> RingCompliance:
        """Join systems side by side, each given with the number of its first displacement."""
        return cls(
            np.concatenate([first + part.columns for first, part in parts]),
            np.concatenate([part.level for _, part in parts]),
            np.concatenate([part.compliance for _, part in parts]),
        )
