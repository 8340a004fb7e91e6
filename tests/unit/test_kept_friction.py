"""States of a friction map in the cache: the same once more, refusals included, and solved once."""

import numpy as np
import pytest

from spindle_fem.definition.load import load_machine
from spindle_fem.errors import NoEquilibriumError
from spindle_fem.operation import kept_friction
from spindle_fem.operation.bearing_heat import BearingMechanics
from spindle_fem.operation.friction_map import tabulate_friction

RPM = np.pi / 30.0


@pytest.fixture
def solved(tmp_path, monkeypatch):
    """How often bearings were solved; balls slide below 10 °C at 150 to 200 rpm."""
    monkeypatch.setattr(kept_friction, "cache_directory", lambda: tmp_path)
    solve, count = BearingMechanics.over_film_temperature, []

    def counted(self, point, kelvin):
        count.append(point.speed)
        if 150.0 * RPM < point.speed < 200.0 * RPM and np.min(kelvin) < 283.15:
            raise NoEquilibriumError("F1", "gross sliding.", "Raise preload.")
        return solve(self, point, kelvin)

    monkeypatch.setattr(BearingMechanics, "over_film_temperature", counted)
    return count


def test_a_map_is_solved_once_for_a_machine_and_what_no_bearing_feels_does_not_matter(solved):
    spec = load_machine("groove_spindle")
    first = tabulate_friction(spec, 4500.0 * RPM, (50.0,), kept_friction.kept_friction)
    before = len(solved)
    finer = load_machine("groove_spindle", ["mesh.preset=fine"])
    again = tabulate_friction(finer, 4500.0 * RPM, (50.0,), kept_friction.kept_friction)
    assert len(solved) == before
    film = np.full(2, 311.0)
    for speed in (90.0 * RPM, 2000.0 * RPM):
        assert again.heat(speed, 50.0, film).tolist() == first.heat(speed, 50.0, film).tolist()
    assert [(state, str(error)) for state, error in again.refused.items()] == [
        (state, str(error)) for state, error in first.refused.items()
    ]
    with pytest.raises(NoEquilibriumError, match=r"gross sliding.*near 180 rpm"):
        again.require_complete()


@pytest.mark.parametrize(
    ("override", "highest", "thrust"),
    [("bearing_set.both.preload=140 N", 4500.0, 50.0), ("", 4400.0, 50.0), ("", 4500.0, 60.0)],
)
def test_another_machine_speed_or_thrust_is_solved_anew(solved, override, highest, thrust):
    tabulate_friction(load_machine("groove_spindle"), 4500.0 * RPM, (50.0,), kept_friction.kept_friction)
    before = len(solved)
    other = load_machine("groove_spindle", [override] if override else [])
    tabulate_friction(other, highest * RPM, (thrust,), kept_friction.kept_friction)
    assert len(solved) > before
