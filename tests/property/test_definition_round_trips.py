"""Definitions and quantities survive being written and read, whatever their values."""

from __future__ import annotations

import contextlib
import copy
import datetime
import math
import tomllib

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from spindle_fem.definition.field_types import QuantityRule
from spindle_fem.definition.inherit import merge
from spindle_fem.definition.load import load_machine, machine_folder, read_definition, validate, write_machine
from spindle_fem.definition.uncertain_parameters import uncertain_parameters, with_parameters
from spindle_fem.errors import FaultsError, SpecError, UnitError
from spindle_fem.units import Uncertain, registry, to_si, uncertain_to_si

finite = st.floats(min_value=-1e12, max_value=1e12, allow_nan=False)
positive = st.floats(min_value=1e-9, max_value=1e9)
UNITS = {
    "m": ["mm", "um", "in", "m"],
    "rad/s": ["rpm", "rad/s", "deg/s"],
    "W/m**2/K": ["W/m**2/K", "W/m²/°C", "kW/(m²·K)", "W/m**2/delta_degF"],
    "m**3/s": ["L/min", "m**3/h", "gallon/minute"],
    "N": ["N", "kN", "lbf"],
}


@pytest.mark.parametrize("unit", UNITS)
@given(value=positive, data=st.data())
def test_a_quantity_means_the_same_in_every_unit(unit, value, data):
    written = data.draw(st.sampled_from(UNITS[unit]))
    units = registry()
    magnitude = units.Quantity(value, units.parse_units(unit)).to(units.parse_units(written)).magnitude
    assert to_si(f"{magnitude!r} {written}", unit, where="key") == pytest.approx(value, rel=1e-12)


@given(value=finite)
def test_what_is_written_reads_back_exactly(value):
    rule = QuantityRule("m")
    first = rule.read(f"{value!r} m")
    assert rule.read(rule.write(first)) == first
    assert first == pytest.approx(value, rel=1e-12, abs=1e-300)


@given(kelvin=st.floats(min_value=0.0, max_value=5000.0))
def test_temperatures_are_written_in_celsius_without_loss(kelvin):
    rule = QuantityRule("K", "temperature")
    first = rule.read(f"{kelvin!r} K")
    assert rule.read(rule.write(first)) == first


@given(low=positive, ratio=st.floats(min_value=1.001, max_value=1e3))
def test_bounds_and_widths_say_the_same(low, ratio):
    read = uncertain_to_si({"low": f"{low!r} W/K", "high": f"{low * ratio!r} W/K"}, "W/K", where="key")
    again = uncertain_to_si({"value": f"{read.value!r} W/K", "sigma_rel": read.sigma_log}, "W/K", where="key")
    assert again == read
    assert low < read.value < low * ratio


@given(text=st.text(max_size=30))
def test_no_text_makes_the_reader_fail_in_another_way(text):
    with contextlib.suppress(UnitError):
        assert isinstance(to_si(text, "m", where="key"), float)


@settings(max_examples=40)
@given(
    depth=st.floats(min_value=5.0, max_value=30.0),
    width=st.floats(min_value=6.0, max_value=20.0),
    speed=st.floats(min_value=0.0, max_value=4500.0),
    inlet=st.floats(min_value=10.0, max_value=40.0),
    sigma=st.floats(min_value=0.0, max_value=2.0),
)
def test_a_machine_with_any_values_reads_back_equal(depth, width, speed, inlet, sigma):
    spec = load_machine(
        "wu_tan_2016",
        [
            f"channel.depth={depth!r} mm",
            f"channel.width={width!r} mm",
            "channel.pitch=25 mm",
            f"operation.speed={speed!r} rpm",
            f"coolant.inlet_temperature={inlet!r} degC",
            f"coolant.film_factor.sigma_rel={sigma!r}",
        ],
    )
    assert validate(tomllib.loads(write_machine(spec)), "written") == spec
    assert spec.channel.depth == pytest.approx(1e-3 * depth, rel=1e-12)
    assert spec.coolant.film_factor == Uncertain(1.0, pytest.approx(sigma, rel=1e-12))


@settings(max_examples=40)
@given(data=st.data())
def test_factors_and_their_inverses_cancel(data):
    spec = load_machine("recorded_spindle")
    names = [item.name for item in uncertain_parameters(spec)]
    factors = data.draw(st.dictionaries(st.sampled_from(names), st.floats(min_value=0.6, max_value=1.6)))
    there = with_parameters(spec, factors)
    back = with_parameters(there, {name: 1.0 / factor for name, factor in factors.items()})
    before = {item.name: item.value for item in uncertain_parameters(spec)}
    assert {item.name: item.value for item in uncertain_parameters(back)} == pytest.approx(before, rel=1e-12)


tables = st.recursive(
    st.integers() | st.sampled_from(["10 mm", "right"]),
    lambda inner: st.dictionaries(st.sampled_from("abcdef"), inner, max_size=4),
    max_leaves=12,
)


@given(
    base=st.dictionaries(st.sampled_from("abcdef"), tables),
    change=st.dictionaries(st.sampled_from("abcdef"), tables),
)
def test_laying_a_change_over_twice_changes_nothing_more(base, change):
    once = merge(base, change)
    assert merge(once, change) == once
    assert merge(base, {}) == base


@given(path=st.text(alphabet="abcdefghij.[]0123456789_", min_size=1, max_size=20), value=st.text(max_size=10))
def test_no_override_makes_the_loader_fail_in_another_way(path, value):
    assume("=" not in path)
    with pytest.raises(SpecError) as caught:
        load_machine("wu_tan_2016", [f"{path}={value}"])
    assert caught.value.exit_status == 2


def paths_of(node, path=()):
    if path:
        yield path
    entries = node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ()
    for key, entry in entries:
        yield from paths_of(entry, (*path, key))


DEFINITION = read_definition(machine_folder() / "small_two_start.toml")
JUNK = [3, -1, "x", "", True, [], [1], {}, {"name": 3}, math.nan, [{}], "none", [["a"]], 10**400]
JUNK += [{"value": "1 m", "sigma_rel": 0.1}, [{"name": "a"}, {"name": "a"}], datetime.date(2020, 1, 1)]


@settings(max_examples=150)
@given(path=st.sampled_from(list(paths_of(DEFINITION))), junk=st.sampled_from(JUNK))
def test_junk_anywhere_in_a_definition_is_read_or_refused_never_a_crash(path, junk):
    content = copy.deepcopy(DEFINITION)
    node = content
    for key in path[:-1]:
        node = node[key]
    node[path[-1]] = junk
    try:
        validate(content, "junk.toml")
    except FaultsError as error:
        faults = error.faults
    else:
        faults = ()
    assert all(fault.where.startswith("junk.toml: ") and fault.what for fault in faults)
