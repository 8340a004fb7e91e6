"""Rough surfaces (eqs 4-9): Weierstrass-Mandelbrot profiles, spectral moments, asperity contact."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import ndtr

from spindle_fem.errors import OutOfValidityError, SpecError

FloatArray = NDArray[np.float64]
_SUMMIT_CONSTANT = 0.8968


@dataclass(frozen=True, slots=True)
class SurfaceRoughness:
    """Spectral moments of one profile, or of two surfaces together.

    Attributes
    ----------
    m0 : float, [m²]
        Mean square height.
    m2 : float, [-]
        Mean square slope.
    m4 : float, [1/m²]
        Mean square second derivative.

    Raises
    ------
    OutOfValidityError
        Bandwidth m0 m4/m2² below 1.5, which no isotropic Gaussian surface has.
    """

    m0: float
    m2: float
    m4: float

    def __post_init__(self) -> None:
        if not (self.m0 > 0.0 and self.m2 > 0.0 and self.m4 > 0.0):
            raise SpecError(
                "roughness", f"moments {self.m0:g}, {self.m2:g}, {self.m4:g}.", "All must be above 0."
            )
        if self.bandwidth < 1.5 * (1.0 - 1e-9):
            raise OutOfValidityError(
                "roughness", f"bandwidth m0 m4/m2² is {self.bandwidth:.3g}.",
                "Allowed: at least 1.5 (isotropic Gaussian surface).",
            )  # fmt: skip

    @property
    def height_rms(self) -> float:
        """σ (Rq), m."""
        return math.sqrt(self.m0)

    @property
    def bandwidth(self) -> float:
        """α_r = m0 m4/m2²."""
        return self.m0 * self.m4 / self.m2**2

    def __add__(self, other: SurfaceRoughness) -> SurfaceRoughness:
        """Moments of both surfaces in contact."""
        return SurfaceRoughness(self.m0 + other.m0, self.m2 + other.m2, self.m4 + other.m4)


def roughness_from_rms(
    height_rms: float, slope_rms: float = 0.02, bandwidth: float = 10.0
) -> SurfaceRoughness:
    """Moments of a finish of which only Rq is known.

    Parameters
    ----------
    height_rms : float, [m]
    slope_rms : float, [-]
        Assumed 0.02: a honed or superfinished raceway.
    bandwidth : float, [-]
        m0 m4/m2², assumed 10.
    """
    return SurfaceRoughness(height_rms**2, slope_rms**2, bandwidth * slope_rms**4 / height_rms**2)


def exceedance_integral(distance: ArrayLike) -> FloatArray:
    """F_1(t) = ∫_t^∞ (x - t) φ(x) dx = φ(t) - t (1 - Φ(t)) of eq. 8.

    >>> float(exceedance_integral(0.0).round(6))
    0.398942
    """
    t = np.asarray(distance, float)
    return np.exp(-0.5 * t * t) / math.sqrt(2.0 * math.pi) - t * ndtr(-t)


def contact_area_ratio(film: ArrayLike, roughness: SurfaceRoughness) -> FloatArray:
    """Ac/A0, the share of the ellipse carried by touching asperities (eqs 7-9).

    Parameters
    ----------
    film : array_like, [m]
        Distance of the mean planes (central film).
    roughness : SurfaceRoughness
        Composite moments (sum over both surfaces).

    Range: Ac/A0 below about 0.05; larger values are returned up to 1 and
    belong to boundary lubrication, where the theory no longer holds.

    Source: Greenwood & Williamson (1966); McCool (1986).
    """
    alpha = roughness.bandwidth
    narrowing = 1.0 - _SUMMIT_CONSTANT / alpha
    summit_radius = 0.375 * math.sqrt(math.pi / roughness.m4)
    summit_deviation = math.sqrt(narrowing * roughness.m0)
    density = roughness.m4 / (6.0 * math.pi * math.sqrt(3.0) * roughness.m2)
    normalised = np.asarray(film, float) / roughness.height_rms - 4.0 / math.sqrt(math.pi * alpha)
    ratio = (
        math.pi
        * summit_radius
        * summit_deviation
        * density
        * exceedance_integral(normalised / math.sqrt(narrowing))
    )
    return np.minimum(ratio, 1.0)
