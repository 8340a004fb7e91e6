"""Rough profiles, spectral moments, asperity contact and film corrections."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad

from spindle_fem.errors import OutOfValidityError, SpecError
from spindle_fem.physics.bearings.lubricant_film import film_fit_warnings, thermal_reduction
from spindle_fem.physics.bearings.rough_surface import (
    SurfaceRoughness,
    contact_area_ratio,
    exceedance_integral,
    roughness_from_rms,
)
from spindle_fem.physics.bearings.traction import ellipse_quadrature


def test_exceedance_integral_against_quadrature() -> None:
    for distance in (-1.0, 0.3, 2.5):
        integral, _ = quad(
            lambda x, t=distance: (x - t) * math.exp(-0.5 * x * x) / math.sqrt(2 * math.pi), distance, 20.0
        )
        assert float(exceedance_integral(distance)) == pytest.approx(integral, rel=1e-9)


def test_asperity_contact_fades_with_the_film() -> None:
    surface = roughness_from_rms(0.05e-6) + roughness_from_rms(0.01e-6)
    ratios = contact_area_ratio(np.array([0.02, 0.05, 0.1, 0.2, 0.9]) * 1e-6, surface)
    assert np.all(np.diff(ratios) < 0.0)
    assert ratios[0] < 0.3
    assert ratios[-1] < 1e-30


def test_moments_add_and_need_a_bandwidth() -> None:
    total = roughness_from_rms(3e-8) + roughness_from_rms(4e-8)
    assert total.height_rms == pytest.approx(5e-8)
    with pytest.raises(OutOfValidityError, match=r"Allowed: at least 1\.5"):
        SurfaceRoughness(1e-15, 1e-3, 1e8)
    with pytest.raises(SpecError, match="All must be above 0"):
        SurfaceRoughness(0.0, 1e-3, 1e12)


def test_ellipse_quadrature_integrates_pressure_and_its_square() -> None:
    across, across_weight, along, along_weight = ellipse_quadrature(20, 6)
    pressure = np.sqrt(1.0 - across**2)[:, None] * along
    disc = across_weight @ (pressure @ along_weight)
    square = across_weight @ (pressure**2 @ along_weight)
    # ∫√(1-r²) = 2π/3, ∫(1-r²) = π/2 over the unit disc
    assert disc == pytest.approx(2.0 * math.pi / 3.0, rel=2e-3)
    assert square == pytest.approx(math.pi / 2.0, rel=1e-6)


def test_thermal_reduction_limits() -> None:
    assert float(thermal_reduction(1e-3, 0.0, 0.14)) == 1.0
    assert float(thermal_reduction(1e-3, 10.0, 0.14, model="none")) == 1.0
    rolling, sliding = (float(thermal_reduction(1e-3, 10.0, 0.14, slide)) for slide in (0.0, 0.2))
    assert sliding < rolling < 1.0


def test_film_fit_warning_names_what_is_outside() -> None:
    assert film_fit_warnings(1e-11, 4000.0, 5.0) == ()
    (warning,) = film_fit_warnings(2e-10, 4000.0, 8.6)
    assert warning.code == "film_fit_extrapolated"
    assert "speed parameter U is 2e-10" in warning.text
    assert "ellipticity of the contact is 8.6" in warning.text
