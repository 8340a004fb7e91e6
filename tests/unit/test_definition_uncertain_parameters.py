"""Uncertain parameters: what the recorded spindle carries, and machines with factors applied."""

from __future__ import annotations

import math

import pytest

from spindle_fem.definition.load import load_machine, validate
from spindle_fem.definition.uncertain_parameters import (
    UncertainParameter,
    coefficient_value,
    uncertain_parameters,
    with_parameters,
)
from spindle_fem.errors import SpecError

RECORDED = load_machine("recorded_spindle")

# The last section of the reference spindle: one standard deviation of the logarithm.
STATED = {
    "heat.front": 0.10,
    "heat.rear": 0.10,
    "coolant.film_factor": 0.15,
    "joint.inner_ring_seats": 0.30,
    "joint.front_outer_ring_seats": 0.40,
    "joint.rear_outer_ring_seats": 0.40,
    "joint.axial_contacts": 0.30,
    "film.outside": 0.30,
    "film.flange_back": 0.50,
    "shaft_end_films": 0.30,
    "gap.air_gap": 0.30,
    "ball_conductance": 0.30,
    "heat.inner_share": 0.10,  # 0.50 ± 0.05
    "heat_capacity_factor": 0.03,
}


def test_the_recorded_spindle_carries_the_stated_uncertainties_and_no_others():
    assert {item.name: item.sigma_log for item in uncertain_parameters(RECORDED)} == STATED


def test_nominal_values_come_with_their_units():
    by_name = {item.name: item for item in uncertain_parameters(RECORDED)}
    assert by_name["film.flange_back"] == UncertainParameter(
        "film.flange_back", ("film.flange_back",), ("film.flange_back.coefficient",), 200.0, "W/m**2/K", 0.5
    )
    assert by_name["heat.inner_share"].value == 0.5
    assert by_name["shaft_end_films"] == UncertainParameter(
        "shaft_end_films",
        ("film.nose_end", "film.drive_end"),
        ("film.nose_end.factor", "film.drive_end.factor"),
        1.0,
        "",
        0.3,
    )


@pytest.mark.parametrize("machine", ["recorded_spindle", "wu_tan_2016", "motor_spindle"])
def test_keys_are_those_by_which_a_definition_is_changed(machine):
    spec = load_machine(machine)
    for item in uncertain_parameters(spec):
        for coefficient, key in zip(item.applies_to, item.keys, strict=True):
            value, unit = coefficient_value(spec, coefficient)
            changed = load_machine(machine, [f"{key}={0.9 * value} {unit}".strip()])
            assert coefficient_value(changed, coefficient)[0] == pytest.approx(0.9 * value), key


def test_a_prior_by_bounds_is_a_parameter_like_any_other():
    spec = load_machine(
        "wu_tan_2016", ['film.outside.coefficient={low = "5 W/m**2/K", high = "20 W/m**2/K"}']
    )
    outside = next(item for item in uncertain_parameters(spec) if item.name == "film.outside")
    assert outside.value == pytest.approx(10.0, rel=1e-12)
    assert outside.sigma_log == pytest.approx(math.log(4.0) / (2.0 * 1.6448536269514722), rel=1e-12)


def value_at(spec, name):
    films = {film.name: film for film in spec.film}
    return {
        "heat.front": spec.bearing_set[0].heat_factor,
        "heat.rear": spec.bearing_set[1].heat_factor,
        "ball_row.front": spec.bearing_set[0].ball_row.conductance,
        "ball_row.rear": spec.bearing_set[1].ball_row.conductance,
        "coolant.film_factor": spec.coolant.film_factor,
        "heat.inner_share": spec.heat.inner_share,
        "heat_capacity_factor": spec.heat_capacity_factor,
        "film.outside": films["outside"].coefficient,
        "film.flange_back": films["flange_back"].coefficient,
        "film.nose_end": films["nose_end"].factor,
        "film.drive_end": films["drive_end"].factor,
        "gap.air_gap": spec.gap[0].factor,
        **{f"joint.{joint.name}": joint.conductance for joint in spec.joint},
    }[name].value


@pytest.mark.parametrize("parameter", uncertain_parameters(RECORDED), ids=lambda parameter: parameter.name)
def test_a_factor_reaches_exactly_the_coefficients_of_its_parameter(parameter):
    changed = with_parameters(RECORDED, {parameter.name: 1.25})
    for name in parameter.applies_to:
        assert value_at(changed, name) == pytest.approx(1.25 * value_at(RECORDED, name), rel=1e-12)
    restored = with_parameters(changed, {parameter.name: 0.8})
    for name in parameter.applies_to:
        assert value_at(restored, name) == pytest.approx(value_at(RECORDED, name), rel=1e-12)
    untouched = {one for item in uncertain_parameters(RECORDED) for one in item.applies_to} - {
        *parameter.applies_to
    }
    assert all(value_at(changed, name) == value_at(RECORDED, name) for name in untouched)


def test_factors_on_the_same_coefficient_multiply():
    changed = with_parameters(RECORDED, {"shaft_end_films": 2.0, "film.nose_end": 1.5})
    assert value_at(changed, "film.nose_end") == 3.0
    assert value_at(changed, "film.drive_end") == 2.0


def test_the_machine_itself_stays_as_it_was_and_no_factor_changes_nothing():
    before = RECORDED.model_copy(deep=True)
    with_parameters(RECORDED, {"heat.front": 1.3, "ball_conductance": 0.7})
    assert before == RECORDED
    assert with_parameters(RECORDED, {}) == RECORDED


def test_a_changed_machine_is_still_valid():
    content = with_parameters(RECORDED, dict.fromkeys(STATED, 1.1)).model_dump(
        mode="json", by_alias=True, exclude_none=True
    )
    assert validate(content, "changed").heat.inner_share.value == pytest.approx(0.55, rel=1e-12)


@pytest.mark.parametrize(
    ("factors", "parts"),
    [
        ({"heat.frnt": 1.1}, ("heat.frnt", "no parameter", 'Did you mean "heat.front"')),
        ({"heat.front": 0.0}, ("heat.front", "0.0", "above 0")),
        ({"heat.front": math.nan}, ("heat.front", "nan", "finite")),
        ({"heat.inner_share": 2.5}, ("heat.inner_share", "1.25", "0 to 1")),
    ],
)
def test_factors_that_make_no_machine_are_refused(factors, parts):
    with pytest.raises(SpecError) as caught:
        with_parameters(RECORDED, factors)
    assert all(part in str(caught.value) for part in parts), str(caught.value)
