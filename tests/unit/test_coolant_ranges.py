"""Refusal outside the range of a source, and coded warnings."""

import numpy as np
import pytest

from spindle_fem.errors import OutOfValidityError
from spindle_fem.validity import NOT_NEGATIVE, POSITIVE, CodedWarning, range_fault, require_range


def test_limits_themselves_are_allowed():
    require_range("here", value=([1.0, 2.0], 1.0, 2.0))


def test_every_offending_quantity_is_named():
    with pytest.raises(OutOfValidityError) as caught:
        require_range("here", how_to_fix="Do that.", first=(3.0, 0.0, 1.0), second=(-1.0, 0.0, np.inf))
    assert caught.value.where == "here"
    assert str(caught.value) == (
        "here: first is 3, allowed 0 to 1; second is -1, allowed at least 0. Do that."
    )


def test_worst_value_and_count_of_an_array():
    assert range_fault("x", [0.5, 9.0, -3.0], 0.0, 1.0) == "x is 9, allowed 0 to 1 (2 of 3 values outside)"
    assert range_fault("x", 5.0, -np.inf, 1.0) == "x is 5, allowed at most 1"


def test_nan_is_outside_every_range():
    with pytest.raises(OutOfValidityError, match="x is nan"):
        require_range("here", x=([1.0, np.nan], -np.inf, np.inf))


def test_coded_warning_is_frozen_and_hashable():
    warning = CodedWarning("a_code", "A text.")
    assert {warning: 1}[CodedWarning("a_code", "A text.")] == 1
    with pytest.raises(AttributeError):
        warning.code = "other"


@pytest.mark.parametrize(
    ("value", "limits", "text"),
    [
        (0.0, POSITIVE, "x is 0, allowed above 0"),
        (-1.0, NOT_NEGATIVE, "x is -1, allowed at least 0"),
        (-1.0, (POSITIVE[0], 2.0), "x is -1, allowed above 0, at most 2"),
        (np.inf, (-POSITIVE[1], POSITIVE[1]), "x is inf, allowed any finite number"),
        (np.inf, POSITIVE, "x is inf, allowed above 0"),
    ],
)
def test_open_ranges_read_as_sentences(value, limits, text):
    assert range_fault("x", value, *limits) == text
