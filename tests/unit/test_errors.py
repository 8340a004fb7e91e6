"""Every error names place, fault and remedy, and maps to an exit status."""

from __future__ import annotations

import inspect

import pytest

from spindle_fem import errors

CLASSES = [
    item
    for _, item in inspect.getmembers(errors, inspect.isclass)
    if issubclass(item, errors.SpindleFemError) and item is not errors.FaultsError
]


@pytest.mark.parametrize("error_class", CLASSES)
def test_an_error_shows_place_fault_and_remedy_in_this_order(error_class):
    error = error_class("loads.films[2]", "names nothing.", "Allowed: something.")
    assert str(error) == "loads.films[2]: names nothing. Allowed: something."
    assert (error.where, error.what, error.how_to_fix) == (
        "loads.films[2]",
        "names nothing.",
        "Allowed: something.",
    )


def test_an_error_without_place_or_remedy_has_no_loose_ends():
    assert str(errors.SpecError("", "nothing given.")) == "nothing given."


@pytest.mark.parametrize("error_class", CLASSES)
def test_bad_input_exits_with_two_and_the_rest_with_one(error_class):
    expected = 2 if issubclass(error_class, errors.BadInputError) else 1
    assert error_class.exit_status == expected


@pytest.mark.parametrize(
    "error_class",
    [
        errors.SpecError,
        errors.UnknownKeyError,
        errors.UnitError,
        errors.GeometryError,
        errors.UnknownSurfaceError,
        errors.RecordingError,
        errors.FaultsError,
    ],
)
def test_what_a_user_can_mend_in_a_file_is_bad_input(error_class):
    assert error_class.exit_status == 2


def test_several_faults_are_counted_and_listed_in_order():
    faults = [errors.SpecError("a", "is wrong."), errors.UnitError("b", "is bare.")]
    error = errors.FaultsError("machine.toml", faults)
    assert error.faults == tuple(faults)
    assert str(error) == "machine.toml: 2 faults\n  - a: is wrong.\n  - b: is bare."
    assert str(errors.FaultsError("machine.toml", faults[:1])).startswith("machine.toml: 1 fault\n")


def test_a_near_miss_is_offered_and_a_far_one_is_not():
    allowed = ["housing.channel_wall", "housing.outside"]
    assert errors.did_you_mean("housing.chanel_wall", allowed).startswith(
        'Did you mean "housing.channel_wall"? Allowed: housing.channel_wall, housing.outside.'
    )
    assert errors.did_you_mean("x", allowed) == "Allowed: housing.channel_wall, housing.outside."
    assert errors.did_you_mean("x", []) == "Allowed: nothing."
