"""Lengths with a tolerance: how they read, what is refused, and that they write back."""

import pickle

import pytest

from spindle_fem.definition.load import load_machine
from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.definition.tolerances import TolerancedLength
from spindle_fem.errors import SpindleFemError
from spindle_fem.model.reduced.reduced_cache import reduced_digest

BODY = "part.housing.segment.front_body.outer_diameter="


def body(*overrides):
    [housing] = [part for part in load_machine("recorded_spindle", overrides).part if part.name == "housing"]
    return housing.segment[1].outer_diameter


@pytest.mark.parametrize(
    ("text", "sigma"),
    [
        ("300 mm", None),
        ("{value = '300 mm', sigma = '1 mm'}", 1e-3),
        ("{value = '300 mm', sigma_rel = 0.01}", 3e-3),
        ("{value = '300 mm', sigma = '0 mm'}", 0.0),
    ],
)
def test_a_length_may_say_how_far_it_may_be_off(text, sigma):
    found = body(BODY + text)
    assert found == 0.3
    assert found.sigma == (sigma if sigma is None else pytest.approx(sigma))
    assert pickle.loads(pickle.dumps(found)).sigma == found.sigma


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("300", "unit"),
        ("{value = 300, sigma = '1 mm'}", "unit"),
        ("{value = '300 mm', sigma = 1}", "unit"),
        ("{value = '300 mm', sigma = '-1 mm'}", "0 or more"),
        ("{value = '300 mm', width = '1 mm'}", "is not a quantity"),
        ("{value = '-300 mm', sigma = '1 mm'}", "above 0"),
    ],
)
def test_what_makes_no_length_is_refused(text, told):
    with pytest.raises(SpindleFemError, match=told):
        body(BODY + text)


def test_a_tolerance_is_written_back_and_asks_for_no_new_basis():
    plain = load_machine("recorded_spindle")
    known = load_machine("recorded_spindle", (BODY + "{value = '300 mm', sigma = '1 mm'}",))
    again = MachineSpec.model_validate(known.model_dump(mode="json", by_alias=True, exclude_none=True))
    [housing] = [part for part in again.part if part.name == "housing"]
    assert housing.segment[1].outer_diameter.sigma == 1e-3
    # Only what the basis depends on; marks tell where values come from.
    same = known.model_copy(update={"part": _unmarked(known)})
    assert reduced_digest(same, {}) == reduced_digest(plain.model_copy(update={"part": _unmarked(plain)}), {})


def _unmarked(spec):
    return tuple(
        part.model_copy(update={"segment": tuple(s.model_copy(update={"marks": {}}) for s in part.segment)})
        for part in spec.part
    )


def test_arithmetic_gives_plain_numbers():
    assert type(0.5 * TolerancedLength(0.3, 1e-3)) is float
