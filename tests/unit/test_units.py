"""Quantities: text with a unit in, SI floats out, and every way to get it wrong."""

from __future__ import annotations

import math

import pytest

from spindle_fem.errors import UnitError
from spindle_fem.units import _USUAL, Uncertain, quantity_example, registry, to_si, uncertain_to_si


@pytest.mark.parametrize(
    ("text", "unit", "expected"),
    [
        ("19 mm", "m", 0.019),
        ("19mm", "m", 0.019),
        ("  1.9e1   mm ", "m", 0.019),
        (".5 m", "m", 0.5),
        ("\N{MINUS SIGN}3 mm", "m", -0.003),
        ("3000 rpm", "rad/s", 3000.0 * 2.0 * math.pi / 60.0),
        ("3000 1/min", "1/s", 50.0),
        ("20 L/min", "m**3/s", 20.0e-3 / 60.0),
        ("15 deg", "rad", math.radians(15.0)),
        ("15 °", "rad", math.radians(15.0)),
        ("10 W/(m²·K)", "W/m**2/K", 10.0),
        ("10 W/m^2/K", "W/m**2/K", 10.0),
        ("21 cSt", "m**2/s", 21.0e-6),
        ("21 mm²/s", "m**2/s", 21.0e-6),
        ("1.8e-8 1/Pa", "1/Pa", 1.8e-8),
        ("2 bar", "Pa", 2.0e5),
        ("5 percent", "", 0.05),
        ("5 %", "", 0.05),
        ("0.9 W/W", "", 0.9),
        ("7", "", 7.0),
        (7, "", 7.0),
    ],
)
def test_quantities_in_their_customary_units(text, unit, expected):
    assert to_si(text, unit, where="key") == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("text", ["10 W/m**2/degC", "10 W/m²/°C", "10 W/(m**2*degC)", "10 W/m**2/delta_degC"])
def test_celsius_in_a_compound_unit_is_a_difference(text):
    # Read as an expression, pint divides by 1 °C = 274.15 K and gives 0.0365 W/(m²·K).
    assert to_si(text, "W/m**2/K", where="film") == pytest.approx(10.0, rel=1e-12)


@pytest.mark.parametrize(
    ("text", "kelvin"),
    [("15 degC", 288.15), ("15°C", 288.15), ("288.15 K", 288.15), ("-5 degC", 268.15), ("59 degF", 288.15)],
)
def test_temperatures_count_from_absolute_zero(text, kelvin):
    assert to_si(text, "K", where="inlet", kind="temperature") == pytest.approx(kelvin, abs=1e-9)


@pytest.mark.parametrize("text", ["5 K", "5 delta_degC", "9 delta_degF"])
def test_differences_have_no_zero(text):
    assert to_si(text, "K", where="rise", kind="temperature_difference") == pytest.approx(5.0, rel=1e-12)


def test_quantities_from_python_are_read_like_text():
    quantity = registry().Quantity(19.0, "mm")
    assert to_si(quantity, "m", where="depth") == pytest.approx(0.019, rel=1e-12)
    with pytest.raises(UnitError, match="a unit is needed"):
        to_si(registry().Quantity(19.0, ""), "m", where="depth")


@pytest.mark.parametrize(
    ("value", "unit", "kind", "parts"),
    [
        (19, "m", "quantity", ("depth", "bare number 19", '"19 mm"')),
        ("19", "m", "quantity", ('bare number "19"', "a unit is needed")),
        ("5 degC", "K", "temperature_difference", ("5 degC", "a difference is needed", "delta_degC")),
        ("5 degF", "K", "temperature_difference", ("a difference is needed",)),
        ("5 delta_degC", "K", "temperature", ("a temperature is needed", "degC")),
        ("-300 degC", "K", "temperature", ("below absolute zero", "-273.15 degC")),
        ("50 Hz", "rad/s", "quantity", ("50 Hz", "wrong dimension", '"3000 rpm"')),
        ("5 rad", "", "quantity", ("5 rad", "wrong dimension", "a pure number")),
        ("5 kg", "m", "quantity", ("5 kg", "wrong dimension", "units of m")),
        ("5 mmm", "m", "quantity", ('unknown unit "mmm"',)),
        ("5 m)", "m", "quantity", ('unknown unit "m)"',)),
        ("5 m**400", "m", "quantity", ('unknown unit "m**400"',)),
        ("1,5 mm", "m", "quantity", ('unknown unit ",5 mm"',)),
        ("2 mm * 3", "m", "quantity", ("unknown unit",)),
        ("__import__('os')", "m", "quantity", ("cannot be read", '"19 mm"')),
        ("1 __import__('os')", "m", "quantity", ("unknown unit",)),
        ("", "m", "quantity", ("cannot be read",)),
        ("nan mm", "m", "quantity", ("cannot be read",)),
        (math.nan, "", "quantity", ("not finite",)),
        ("1e999 mm", "m", "quantity", ("not finite",)),
        (True, "", "quantity", ("True is not a quantity",)),
        (None, "m", "quantity", ("None is not a quantity",)),
        (["1 mm"], "m", "quantity", ("is not a quantity",)),
        ({"value": "1 mm"}, "m", "quantity", ("is not a quantity",)),
    ],
)
def test_what_is_no_quantity_is_refused_with_an_example(value, unit, kind, parts):
    with pytest.raises(UnitError) as caught:
        to_si(value, unit, where="channel.depth", kind=kind)
    assert all(part in str(caught.value) for part in ("channel.depth", *parts)), str(caught.value)
    assert caught.value.exit_status == 2


def test_a_prior_by_width_is_one_sigma_of_the_logarithm():
    assert uncertain_to_si({"value": "4 W/K", "sigma_rel": 0.3}, "W/K", where="link") == Uncertain(4.0, 0.3)


def test_a_prior_by_bounds_holds_ninety_per_cent_between_them():
    prior = uncertain_to_si({"low": "0.1 W/K", "high": "5 W/K"}, "W/K", where="link")
    assert prior.value == pytest.approx(math.sqrt(0.5), rel=1e-12)

    def share_below(bound: float) -> float:
        return 0.5 * (1.0 + math.erf(math.log(bound / prior.value) / (prior.sigma_log * math.sqrt(2.0))))

    assert share_below(0.1) == pytest.approx(0.05, abs=1e-9)
    assert share_below(5.0) == pytest.approx(0.95, abs=1e-9)


def test_a_plain_quantity_is_fixed():
    assert uncertain_to_si("3 W/K", "W/K", where="link").is_fixed
    assert not uncertain_to_si({"value": "3 W/K", "sigma_rel": 0.1}, "W/K", where="link").is_fixed


@pytest.mark.parametrize(
    ("value", "parts"),
    [
        ({"value": "3 W/K"}, ("keys ['value'] do not make a value", "sigma_rel")),
        ({"value": "3 W/K", "low": "1 W/K"}, ("do not make a value",)),
        ({"value": 3, "sigma_rel": 0.1}, ("link.value", "bare number 3")),
        ({"value": "3 W/K", "sigma_rel": 30}, ("link.sigma_rel", "30", "30 % is 0.3")),
        ({"value": "3 W/K", "sigma_rel": -0.1}, ("link.sigma_rel", "-0.1")),
        ({"value": "-3 W/K", "sigma_rel": 0.1}, ("-3", "above 0")),
        ({"low": "3 W/K", "high": "1 W/K"}, ("low 3 and high 1", "0 < low < high")),
        ({"low": "0 W/K", "high": "1 W/K"}, ("0 < low < high",)),
        ({}, ("do not make a value",)),
    ],
)
def test_what_is_no_prior_is_refused(value, parts):
    with pytest.raises(UnitError) as caught:
        uncertain_to_si(value, "W/K", where="link")
    assert all(part in str(caught.value) for part in parts), str(caught.value)


@pytest.mark.parametrize("unit", ["m", "rad", "rad/s", "m**3/s", "K", "W/m**2/K", "1/Pa"])
def test_the_examples_in_messages_can_be_read(unit):
    assert to_si(quantity_example(unit).strip('"'), unit, where="example") > 0.0


def test_usual_units_are_read_as_pint_reads_them():
    units = registry()
    for (written, unit), factor in _USUAL.items():
        for number in (1.0, 19.0, 0.1, 7.3e-5, 123456.789, -2.7):
            exact = units.Quantity(number, units.parse_units(written)).to(unit).magnitude
            assert number * factor == exact == to_si(f"{number!r} {written}", unit, where="k"), written
    for number in (-40.0, 15.0, 17.6, 36.66):
        exact = units.Quantity(number, "degC").to("K").magnitude
        assert to_si(f"{number} degC", "K", where="k", kind="temperature") == exact
