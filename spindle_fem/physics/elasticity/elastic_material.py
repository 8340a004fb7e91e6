"""Stiffness and thermal expansion of a solid, and of a wall that a channel has cut into lands."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

# Share of a rectangular section's area that carries shear (Timoshenko, Strength of Materials, 1955).
SHEAR_SHARE = 5.0 / 6.0
# Stiffness across the voids of a grooved wall over that of the solid: nothing bridges them.
BRIDGED = 1.0e-6


@dataclass(frozen=True, slots=True)
class Stiffness:
    """Hooke's law in the directions z, r, θ, and the stress that holds a heated body in its shape.

    Attributes
    ----------
    normal : (3, 3) ndarray, [Pa]
        Normal stresses by normal strains.
    shear : (3,) ndarray, [Pa]
        Moduli of zr, rθ, zθ.
    thermal : (3,) ndarray, [Pa/K]
        Normal stress for each kelvin that expansion is prevented.
    density : float, [kg/m³]
        Of the body as smeared.
    solid_share : float
        Part of the volume that is metal.
    """

    normal: NDArray[np.float64]
    shear: NDArray[np.float64]
    thermal: NDArray[np.float64]
    density: float
    solid_share: float = 1.0


@dataclass(frozen=True, slots=True)
class ElasticMaterial:
    """An isotropic solid.

    Attributes
    ----------
    young_modulus : float, [Pa]
    poisson_ratio : float
    thermal_expansion : float, [1/K]
    density : float, [kg/m³]
    """

    young_modulus: float
    poisson_ratio: float
    thermal_expansion: float
    density: float = 0.0

    @property
    def shear_modulus(self) -> float:
        """G, Pa."""
        return 0.5 * self.young_modulus / (1.0 + self.poisson_ratio)

    @property
    def stiffness(self) -> Stiffness:
        """Stiffness of the solid metal, with Lamé's constants Λ and μ.

        >>> ElasticMaterial(200e9, 0.25, 1e-5).stiffness.normal[0, :2] / 1e9
        array([240.,  80.])
        """
        shear = self.shear_modulus
        first = 2.0 * shear * self.poisson_ratio / (1.0 - 2.0 * self.poisson_ratio)
        normal = np.full((3, 3), first) + 2.0 * shear * np.eye(3)
        return Stiffness(normal, np.full(3, shear), self.thermal_expansion * normal.sum(axis=1), self.density)

    def lands(self, height: float, width: float, pitch: float) -> Stiffness:
        """Stiffness of a wall layer in which lands alternate with the turns of a channel along z.

        A land carries radial and hoop stress as a plate that is free in z. Against shear in zr it bends
        between the walls that hold both its edges: a guided beam of unit breadth yields by
        V height³/(12 E' I) + V height/(κ G width). Nothing carries axial stress across a channel.

        Parameters
        ----------
        height, width, pitch : float, [m]
            Radial height of the lands, their axial width, and the distance from land to land.
        """
        share = width / pitch
        plate = self.young_modulus / (1.0 - self.poisson_ratio**2)
        bending = height**2 / (plate * width**3)
        shearing = 1.0 / (SHEAR_SHARE * self.shear_modulus * width)
        beam = 1.0 / (pitch * (bending + shearing))
        normal = np.zeros((3, 3))
        normal[1:, 1:] = share * plate * np.array([[1.0, self.poisson_ratio], [self.poisson_ratio, 1.0]])
        normal[0, 0] = BRIDGED * self.young_modulus
        weak = BRIDGED * self.shear_modulus
        return Stiffness(
            normal,
            np.array([beam, share * self.shear_modulus, weak]),
            self.thermal_expansion * normal.sum(axis=1),
            share * self.density,
            share,
        )
