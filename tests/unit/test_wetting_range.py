"""Range of inner rings where nobody says how far grease wets the balls."""

import re
from dataclasses import replace

import pytest

from spindle_fem.definition.load import load_machine
from spindle_fem.studies import wetting_range
from spindle_fem.studies.wetting_range import with_wetting_range
from tests.support.made_result import make_result


def said(machine, *overrides):
    result = make_result(machine)
    spec = load_machine(machine, overrides)
    found = with_wetting_range(replace(result, spec=spec))
    return [item.text for item in found.warnings if item.code == "wetting_assumed"]


def test_inner_rings_have_a_range_where_wetting_is_not_given():
    (text,) = said("motor_spindle")
    assert "(grease.wetted_share); 30 % is taken" in text
    found = re.findall(r"(\w+) (\d+) to (\d+) °C \(here 37\)", text)
    assert [name for name, *_ in found] == ["F1", "F2", "R1", "R2"]
    # the network: 4.5 to 6.7 K cooler wetted all round, 5.0 to 7.0 K warmer by contacts alone
    for _, low, high in found:
        assert 29 <= int(low) <= 34
        assert 40 <= int(high) <= 45


def test_a_fuller_bearing_is_taken_so():
    (text,) = said("motor_spindle", "grease.free_volume_fill=0.5")
    assert "50 % is taken" in text


@pytest.mark.parametrize(
    ("machine", "overrides"),
    [("motor_spindle", ["grease.wetted_share=0.3"]), ("wu_tan_2016", []), ("externally_driven", [])],
)
def test_nothing_is_said_where_wetting_is_given_or_hardly_matters(machine, overrides):
    assert said(machine, *overrides) == []


def test_ends_that_have_no_state_are_told(monkeypatch):
    from spindle_fem.errors import NoSteadyStateError

    genuine = wetting_range._inner_rings

    def without_an_end(spec, share):
        if share == 0.0:
            raise NoSteadyStateError("preload", "it runs away.", "Cool it.")
        return genuine(spec, share)

    monkeypatch.setattr(wetting_range, "_inner_rings", without_an_end)
    (text,) = said("motor_spindle")
    assert "could not be worked out: " in text
    assert "it runs away" in text
