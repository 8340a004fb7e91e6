"""What a simulation says of inputs that leave the range of its reduced model."""

from types import SimpleNamespace

import pytest

from spindle_fem.studies.simulate import _beyond_words, _outside_range


class Fast:
    """A model of two coefficients, both equal to what the point says."""

    model = SimpleNamespace(ranges={"channel.film": (100.0, 200.0), "gap.air": (5.0, 10.0)})
    table = SimpleNamespace(factors=dict)

    def __init__(self):
        self.model.outside_range = lambda values: tuple(
            name
            for name, value in values.items()
            if not self.model.ranges[name][0] <= value <= self.model.ranges[name][1]
        )

    def coefficients(self, point, factors):
        return {"channel.film": point, "gap.air": 7.0}


def test_the_farthest_step_beyond_either_end_is_told():
    drives = [SimpleNamespace(points=(150.0, 210.0)), SimpleNamespace(points=(80.0, 201.0))]
    predictor = SimpleNamespace(
        fast=Fast(), drives=drives, effects=SimpleNamespace(times_parameters=lambda given: given)
    )
    found = _outside_range(predictor, {})
    assert found == {"channel.film": pytest.approx(0.25)}
    assert "channel.film by 25 %" in _beyond_words(found)
    assert "coolant.film_factor" in _beyond_words(found)
    assert "coolant" not in _beyond_words({"gap.air": 0.031})
