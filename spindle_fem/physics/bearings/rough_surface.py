"""Rough surfaces (eqs 4-9): Weierstrass-Mandelbrot profiles, spectral moments, asperity contact."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import ndtr

from spindle_fem.errors import OutOfValidityError, SpecError

FloatArray = NDArray[np.float64]
_SUMMIT_CONSTANT = 0.8968
_UNITS = {"m": 1.0, "mm": 1e-3, "um": 1e-6, "nm": 1e-9}


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


def weierstrass_mandelbrot_profile(
    position: ArrayLike,
    scale: float,
    fractal_dimension: float,
    lowest: int,
    highest: int,
    *,
    frequency_ratio: float = 1.5,
) -> FloatArray:
    """Height of a Weierstrass-Mandelbrot profile (eq. 4), cut off at a highest mode.

    Parameters
    ----------
    position : (n,) array_like, [m]
    scale : float, [m]
        Characteristic length G.
    fractal_dimension : float, [-]
        Between 1 and 2.
    lowest, highest : int
        Modes n; wave length γ_f^-n in m. Without the upper end (the
        instrument's resolution) slope and curvature have no finite mean square.

    >>> z = weierstrass_mandelbrot_profile([0.0], 1e-9, 1.5, 20, 20)
    >>> round(float(z[0]) * 1e6, 3)
    0.548
    """
    _require_fractal(fractal_dimension, lowest, highest, frequency_ratio)
    modes = np.arange(lowest, highest + 1)
    frequency = frequency_ratio**modes
    amplitude = scale ** (fractal_dimension - 1.0) / frequency ** (2.0 - fractal_dimension)
    return np.cos(2.0 * np.pi * np.multiply.outer(np.asarray(position, float), frequency)) @ amplitude


def weierstrass_mandelbrot_moments(
    scale: float, fractal_dimension: float, lowest: int, highest: int, *, frequency_ratio: float = 1.5
) -> tuple[float, float, float]:
    """m0 (m²), m2, m4 (1/m²) of a Weierstrass-Mandelbrot profile in closed form.

    Each mode of amplitude A and angular frequency w adds A²/2, A²w²/2, A²w⁴/2.
    """
    _require_fractal(fractal_dimension, lowest, highest, frequency_ratio)
    frequency = frequency_ratio ** np.arange(lowest, highest + 1)
    power = 0.5 * (scale ** (fractal_dimension - 1.0) / frequency ** (2.0 - fractal_dimension)) ** 2
    angular = 2.0 * np.pi * frequency
    return float(power.sum()), float((power * angular**2).sum()), float((power * angular**4).sum())


def _require_fractal(dimension: float, lowest: int, highest: int, ratio: float) -> None:
    if not 1.0 < dimension < 2.0:
        raise SpecError("fractal_dimension", f"it is {dimension:g}.", "Allowed: between 1 and 2.")
    if highest < lowest:
        raise SpecError("highest", f"highest mode {highest} lies below the lowest {lowest}.", "Swap them.")
    if ratio <= 1.0:
        raise SpecError("frequency_ratio", f"it is {ratio:g}.", "It must be above 1; 1.5 is usual.")


def profile_moments(position: ArrayLike, height: ArrayLike) -> tuple[float, float, float]:
    """m0 (m²), m2, m4 (1/m²) of a sampled profile (eq. 5).

    The mean line is taken out; slopes and second derivatives are central
    differences, so wave lengths below about ten samples are underrated.

    Parameters
    ----------
    position, height : (n,) array_like, [m]
        Equally spaced.

    Raises
    ------
    SpecError
        Fewer than 16 points or unequal spacing.
    """
    x, z = np.asarray(position, float), np.asarray(height, float)
    if x.ndim != 1 or x.shape != z.shape or len(x) < 16:
        raise SpecError(
            "profile", f"{len(np.atleast_1d(x))} points.", "Give at least 16 positions with heights."
        )
    if not (np.isfinite(x).all() and np.isfinite(z).all()):
        raise SpecError("profile", "a position or height is not finite.", "Remove or repair it.")
    steps = np.diff(x)
    step = float(steps.mean())
    if step <= 0.0 or np.max(np.abs(steps - step)) > 1e-3 * step:
        raise SpecError("profile", "positions are not equally spaced and growing.", "Resample the profile.")
    levelled = z - np.polyval(np.polyfit(x - x.mean(), z, 1), x - x.mean())
    slope = (levelled[2:] - levelled[:-2]) / (2.0 * step)
    second = (levelled[2:] - 2.0 * levelled[1:-1] + levelled[:-2]) / step**2
    return float(np.mean(levelled**2)), float(np.mean(slope**2)), float(np.mean(second**2))


def read_profile(path: str | Path) -> tuple[FloatArray, FloatArray]:
    """Position and height (m) of a measured profile from a CSV file.

    The header names both columns with their unit: ``x_um,z_nm`` (m, mm, um, nm).

    Raises
    ------
    SpecError
        A header without units, or a row that is no number.
    """
    file = Path(path)
    try:
        with file.open(newline="", encoding="utf-8") as stream:
            rows = [row for row in csv.reader(stream) if row]
    except (OSError, UnicodeDecodeError) as error:
        raise SpecError(str(file), f"cannot be read ({error}).", "Give a CSV file.") from error
    header = [name.strip() for name in rows[0]] if rows else []
    factors = [
        _UNITS.get(name.removeprefix(prefix)) if name.startswith(prefix) else None
        for name, prefix in zip(header, ("x_", "z_"), strict=False)
    ]
    if len(header) != 2 or None in factors:
        raise SpecError(
            str(file), f"header {','.join(header)!r}.", "Write it as x_um,z_nm (units m, mm, um, nm)."
        )
    values = np.empty((len(rows) - 1, 2))
    for index, row in enumerate(rows[1:]):
        try:
            values[index] = [float(cell) for cell in row]
        except ValueError as error:
            raise SpecError(
                f"{file}: line {index + 2}", f"{','.join(row)!r} is no pair of numbers."
            ) from error
    return values[:, 0] * factors[0], values[:, 1] * factors[1]


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
