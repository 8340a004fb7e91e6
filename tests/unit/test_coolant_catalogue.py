"""Oils by grade and glycol by fraction: against standards, published points and one another."""

from __future__ import annotations

import numpy as np
import pytest

from spindle_fem.definition.load import load_machine
from spindle_fem.physics.coolant.coolants import COOLANTS
from spindle_fem.physics.coolant.mineral_oil import mineral_oil

GRADES = (10, 22, 46, 68)
FRACTIONS = (20, 30, 40, 50)
CELSIUS = 273.15
NAMES = (*(f"iso_vg_{grade}" for grade in GRADES), *(f"ethylene_glycol_{share}" for share in FRACTIONS))


@pytest.mark.parametrize("grade", GRADES)
def test_an_oil_has_the_viscosity_of_its_grade(grade: int) -> None:
    oil = COOLANTS[f"iso_vg_{grade}"]
    assert float(oil.properties(40.0 + CELSIUS).kinematic_viscosity) == pytest.approx(1e-6 * grade, rel=1e-9)


def test_an_oil_by_grade_is_near_the_measured_one_of_that_grade() -> None:
    temperature = np.array([20.0, 30.0, 40.0]) + CELSIUS
    ours = mineral_oil("VG 32", 873.0, 32.0, 5.4).properties(temperature)
    paper = COOLANTS["iso_vg_32"].properties(temperature)
    assert ours.kinematic_viscosity == pytest.approx(paper.kinematic_viscosity, rel=0.09)
    assert ours.density == pytest.approx(paper.density, rel=0.01)
    assert ours.specific_heat_capacity == pytest.approx(paper.specific_heat_capacity, rel=0.02)
    assert ours.thermal_conductivity == pytest.approx(paper.thermal_conductivity, rel=0.05)


def test_glycol_goes_from_water_on_as_its_fraction_grows() -> None:
    fluids = [COOLANTS["water"], *(COOLANTS[f"ethylene_glycol_{x}"] for x in FRACTIONS)]
    at_20 = [fluid.properties(20.0 + CELSIUS) for fluid in fluids]
    for name, sign in (
        ("density", 1),
        ("dynamic_viscosity", 1),
        ("specific_heat_capacity", -1),
        ("thermal_conductivity", -1),
    ):
        values = np.array([float(getattr(item, name)) for item in at_20])
        steps = sign * np.diff(values)
        assert (steps > 0.0).all(), name
        # Smooth: no fraction out of line with its neighbours (the first step leads to 20 %, twice as far).
        even = steps / np.array([2.0, 1.0, 1.0, 1.0])
        assert even.max() < 3.0 * even.min(), name


@pytest.mark.parametrize("name", NAMES)
def test_enthalpy_is_the_integral_of_the_heat_capacity(name: str) -> None:
    fluid = COOLANTS[name]
    temperature = np.linspace(5.0, 35.0, 301) + CELSIUS
    heat_capacity = fluid.properties(temperature).specific_heat_capacity
    rise = np.diff(fluid.specific_enthalpy(temperature[[0, -1]]))[0]
    assert rise == pytest.approx(np.trapezoid(heat_capacity, temperature), rel=1e-6)
    assert fluid.specific_enthalpy(CELSIUS) == pytest.approx(0.0, abs=1e-6)


def test_a_definition_takes_them() -> None:
    spec = load_machine("wu_tan_2016", ["coolant.fluid=ethylene_glycol_30"])
    assert spec.coolant.fluid == "ethylene_glycol_30"
