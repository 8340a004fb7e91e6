"""Range of speeds of a machine: what charts, models and searches take from it."""

from __future__ import annotations

import numpy as np
import pytest

from spindle_fem.definition.load import load_machine
from spindle_fem.errors import BadInputError
from spindle_fem.model.reduced.build_reduced import ReductionOptions
from spindle_fem.operation.operating_limits import operation_warnings, require_possible_operation
from spindle_fem.studies.heat_study import usual_speeds

RPM = np.pi / 30.0


def spindle(tmp_path, operation: str):
    path = tmp_path / "machine.toml"
    path.write_text(
        'schema = "spindle-fem/machine/1"\nbase = "motor_spindle"\nname = "ranged"\n'
        f"[operation]\n{operation}\n"
    )
    return load_machine(path)


def test_charts_go_over_the_range_with_its_ends(tmp_path) -> None:
    spec = spindle(tmp_path, 'speed = "8000 rpm"\nspeed_range = ["600 rpm", "12600 rpm"]')
    rpm = np.array(usual_speeds(spec)) / RPM
    assert rpm == pytest.approx([600, 2100, 3600, 5100, 6600, 8100, 9600, 11000, 12600])
    from_rest = spindle(tmp_path, 'speed = "8000 rpm"\nspeed_range = ["0 rpm", "9000 rpm"]')
    assert np.array(usual_speeds(from_rest)) / RPM == pytest.approx(np.arange(1000, 9001, 1000))


def test_without_a_range_charts_go_half_as_fast_again(tmp_path) -> None:
    rpm = np.array(usual_speeds(spindle(tmp_path, 'speed = "6000 rpm"'))) / RPM
    assert rpm == pytest.approx(np.arange(1000, 9001, 1000))


def test_fast_models_reach_the_end_of_the_range(tmp_path) -> None:
    spec = spindle(tmp_path, 'speed = "8000 rpm"\nspeed_range = ["500 rpm", "12000 rpm"]')
    assert ReductionOptions().highest_speed_of(spec) == pytest.approx(12000 * RPM)
    assert ReductionOptions(highest_speed=1.0).highest_speed_of(spec) == 1.0
    assert spindle(tmp_path, 'speed = "8000 rpm"').highest_speed == pytest.approx(8000 * RPM)
    table = load_machine("recorded_spindle")
    assert table.highest_speed == max(table.heat.table.speed[-1], table.operation.speed)


def test_a_speed_outside_the_range_is_warned_of_and_rest_is_none(tmp_path) -> None:
    spec = spindle(tmp_path, 'speed = "8000 rpm"\nspeed_range = ["500 rpm", "7000 rpm"]')
    (warning,) = operation_warnings(spec, spec.operation.speed)
    assert warning.code == "speed_outside_range"
    assert "8000 rpm lie outside operation.speed_range, 500 to 7000 rpm" in warning.text
    assert not operation_warnings(spec, 7000 * RPM)
    assert not operation_warnings(spec, 0.0)


def test_a_range_that_no_bearing_reaches_or_that_does_not_grow_is_refused(tmp_path) -> None:
    with pytest.raises(BadInputError, match="speed_range: its entries do not grow"):
        spindle(tmp_path, 'speed_range = ["500 rpm", "400 rpm"]')
    spec = spindle(tmp_path, 'speed_range = ["500 rpm", "400000 rpm"]')
    with pytest.raises(BadInputError, match=r"operation\.speed_range: 400000 rpm"):
        require_possible_operation(spec)
