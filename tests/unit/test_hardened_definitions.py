"""Faults that spoilt definitions have shown (`make hardening`): each is refused with a reason now."""

import numpy as np
import pytest
import tomli_w

from spindle_fem.commands.checked_machine import load_buildable
from spindle_fem.definition.load import find_machine, read_toml
from spindle_fem.errors import SpecError, SpindleFemError
from spindle_fem.inference.change_points import _beside, _evidence
from spindle_fem.physics.bearings.bearing_tables import read_document
from tests.support.valid_definition import VALID


def refused(tmp_path, old, new, overrides=()):
    """Message of a valid definition with one change."""
    assert old in VALID
    file = tmp_path / "spoilt.toml"
    file.write_text(VALID.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(SpecError) as caught:
        load_buildable(file, overrides)
    return str(caught.value)


@pytest.mark.parametrize("read", [read_toml, read_document])
def test_a_file_that_is_nested_without_end_is_refused(tmp_path, read):
    file = tmp_path / "deep.toml"
    file.write_text("name = " + 5000 * "[" + 5000 * "]", encoding="utf-8")
    with pytest.raises(SpecError, match=r"deep\.toml"):
        read(file)


def test_a_value_that_is_nested_without_end_is_refused(tmp_path):
    assert "channel.depth" in refused(tmp_path, "", "", [f"channel.depth={5000 * '['}"])


def test_sets_of_bearings_are_not_assembled_of_faulty_materials(tmp_path):
    text = refused(tmp_path, '"470 J/kg/K"', '"3 furlong"')
    assert "1 fault" in text
    assert "materials.steel.specific_heat_capacity" in text


def test_oil_thinner_than_its_law_of_temperature_is_refused(tmp_path):
    assert "kinematic_viscosity_100" in refused(tmp_path, '"5 mm**2/s"', '"0.2 mm**2/s"')


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda tables: tables["bearing_set"][1]["bearing"][1].pop("z"), "bearing_set"),
        (lambda tables: tables["bearing_set"][1].pop("name"), "bearing_set"),
        (lambda tables: tables["bearing_set"].__setitem__(0, [1, "two"]), "bearing_set"),
        (
            lambda tables: tables["part"][0]["segment"][0].update(outer_diameter="60 parsec"),
            "is the unit right",
        ),
    ],
)
def test_what_rules_complete_may_be_spoilt(tmp_path, change, told):
    tables = read_toml(find_machine("router_spindle"))
    change(tables)
    file = tmp_path / "spoilt.toml"
    file.write_text(tomli_w.dumps(tables), encoding="utf-8")
    with pytest.raises(SpindleFemError, match=told):
        load_buildable(file, ())


def test_steps_that_read_alike_within_rounding_have_an_evidence():
    answers = np.array([[1e14, 0.5], [1e14, 0.5], [0.3, 0.1]])
    evidence = _evidence(answers @ answers.T, answers @ [1.0, 1.0], [0, 1])
    assert np.isfinite(evidence)


def test_what_huge_steps_that_read_alike_leave_is_a_number():
    left = _beside(np.full((40, 40), 2.0**100), np.full(40, 2.0**50), [10, 20])
    assert all(np.isfinite(part).all() for part in left)
