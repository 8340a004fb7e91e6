"""Preload followed in the fast model: the response between sampled states, and where it is sampled."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from spindle_fem.definition.load import load_machine
from spindle_fem.effects.framework.term import TermContext
from spindle_fem.errors import ConvergenceError
from spindle_fem.model.reduced.followed_preload import MountedRun, sample_preload
from spindle_fem.model.reduced.sampled_response import SampledResponse
from spindle_fem.operation.friction_map import FrictionMap
from spindle_fem.operation.mounted_states import MountedStates
from tests.support.lumped_spindle import lumped_model

RPM = np.pi / 30.0
STEP = 1e-30


# ------------------------------------------------------------------ between samples
def curved(states):
    """Two smooth quantities of states that differ in three directions of seven."""
    a, b, c = states[:, 0] + states[:, 1], states[:, 2], states[:, 3] - states[:, 6]
    return np.column_stack((np.exp(0.2 * a) + 0.05 * b * c, 3.0 - a + 2.0 * c))


def some_states(number, seed):
    mixed = np.random.default_rng(11).normal(size=(3, 7))
    return np.random.default_rng(seed).uniform(-1.5, 1.5, (number, 3)) @ mixed


def response_through(number):
    states = some_states(number, 1)
    return SampledResponse.through(states, np.zeros((number, 2)), curved(states))


def answered(response, states):
    coordinates = (states - response.middle) @ response.directions
    return response.at(coordinates, np.zeros((len(states), 2)))


def test_it_goes_through_its_samples_in_as_few_directions_as_they_have():
    response = response_through(60)
    assert response.directions.shape == (7, 3)
    assert answered(response, some_states(60, 1))[0] == pytest.approx(curved(some_states(60, 1)), abs=1e-4)


def test_between_samples_it_errs_less_the_more_there_are_and_not_at_all_in_a_straight_line():
    others = some_states(50, 2)
    few, many = (np.abs(answered(response_through(n), others)[0] - curved(others)) for n in (15, 120))
    assert many[:, 0].max() < 0.2 * few[:, 0].max()
    assert max(few[:, 1].max(), many[:, 1].max()) < 1e-5


def test_its_derivatives_are_those_of_differences():
    response, states = response_through(60), some_states(5, 3)
    coordinates, none = (states - response.middle) @ response.directions, np.zeros((5, 2))
    slope = response.at(coordinates, none)[1]
    for axis, step in enumerate(1e-5 * np.eye(3)):
        ends = [response.at(coordinates + side * step, none)[0] for side in (1.0, -1.0)]
        assert slope[:, :, axis] == pytest.approx((ends[0] - ends[1]) / 2e-5, rel=1e-4, abs=1e-6)


def test_inputs_that_never_differ_are_left_out():
    states = some_states(40, 1)
    inputs = np.column_stack((np.linspace(0.0, 2.0, 40), np.full(40, 7.0)))
    response = SampledResponse.through(states, inputs, curved(states) + inputs[:, :1])
    assert response.fixed.tolist() == [0]
    found = response.at((states - response.middle) @ response.directions, inputs)[0]
    assert found == pytest.approx(curved(states) + inputs[:, :1], abs=1e-5)


# ------------------------------------------------------------------ bearings of a machine
@pytest.fixture(scope="module")
def spec():
    return load_machine("wu_tan_2016")


@pytest.fixture(scope="module")
def friction(spec):
    """A map without any content: what is sampled is then the bearings' own."""
    names = tuple(bearing.name for _, bearing in spec.bearings)
    speeds = np.array([10.0, 400.0])
    still = np.zeros((1, len(names), 3, 4))
    turning = CubicSpline(np.log(speeds), np.zeros((2, *still.shape)))
    return FrictionMap(names, speeds, np.array([1750.0]), turning, still, None, {})


@pytest.fixture(scope="module")
def model(spec):
    """One unknown a part; rings and their seats grow with their own temperature."""
    lumped = lumped_model(spec)
    unit = dict(zip(lumped.place_names, np.asarray(lumped.places), strict=True))
    places = {
        f"{contact}@{side}": unit[part]
        for contact in lumped.contacts
        for side, part in enumerate(contact.removesuffix(":face").split("|"))
    }
    shifts = []
    for _, bearing in spec.bearings:
        inner, outer = (unit[f"{bearing.name}.{side}_ring"] for side in ("inner", "outer"))
        shifts += [
            0.88 * (inner - unit["shaft"]),
            1.0 * unit["housing"] - 1.2 * outer,
            0.95 * inner,
            1.1 * outer,
        ]
    return replace(
        lumped,
        place_names=(*lumped.place_names, *places),
        places=np.vstack((lumped.places, *places.values())),
        ring_shifts=np.array(shifts),
    )


def warming(model, spec, kelvin):
    """A run that warms the turning parts by so many kelvin, the outer rings by half, then slows down."""
    part = 1.0 - np.exp(-np.linspace(0.0, 4.0, 30))
    unit = dict(zip(model.place_names, np.asarray(model.places), strict=True))
    warm = sum(unit[f"{b.name}.{side}"] * w for _, b in spec.bearings for side, w in
               (("inner_ring", 1.0), ("outer_ring", 0.5), ("balls", 0.9)))  # fmt: skip
    unknowns = 293.15 * model.one + kelvin * (part[:, None] * (warm + 0.9 * unit["shaft"]))
    return MountedRun(
        60.0 * np.arange(30),
        unknowns,
        np.where(np.arange(30) < 20, 3000.0, 1500.0) * RPM,
        np.full(30, 1750.0),
    )


@pytest.fixture
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("SPINDLE_FEM_CACHE", str(tmp_path))


def test_it_is_the_bearings_own_mechanics_along_the_run(spec, friction, model, own_cache):
    run = warming(model, spec, 8.0)
    asked = []
    preload, error = sample_preload(spec, model, friction, lambda known: asked.append(known) or [run])
    assert error < 2e-3
    assert asked[0] is None
    assert len(asked) < 6
    mounted = MountedStates(spec, model.contacts, friction)
    rows, offsets = mounted.rows(model)
    read = np.array([preload.read_row(model, name) for name in preload.reads])
    for moment in (7, 23):
        states = rows @ run.unknowns[moment] - offsets
        exact = mounted.at(float(run.speed[moment]), 1750.0, states)
        context = TermContext(
            0.0, {"speed": run.speed[moment], "thrust": 1750.0}, np.zeros((0, 1)), np.zeros((0, 1)), {}
        )
        told = preload.quantities((read @ run.unknowns[moment])[:, None].astype(complex), context)[:, 0].real
        assert told[0] == pytest.approx(exact["front"][0], abs=3e-3)
        assert told[3] == pytest.approx(exact["front"][3], abs=10.0)
    # Warmer inner rings press harder.
    history = preload.preload(model, run)
    assert history[19, 2] > 1.3 * history[0, 2]
    # What was solved is kept for the next time.
    again = []
    sample_preload(spec, model, friction, lambda known: again.append(known) or [run])
    assert again[0] is not None
    assert len(again) == 1
    derivatives_come_through_complex_steps(preload, model, run)


def derivatives_come_through_complex_steps(preload, model, run):
    read = np.array([preload.read_row(model, name) for name in preload.reads]) @ run.unknowns[9]
    inputs = {"speed": 314.0, "thrust": 1750.0}

    def at(columns):
        return preload.quantities(columns, TermContext(0.0, inputs, columns, np.zeros((0, 1)), {}))

    slope = at((read + 1j * STEP * np.eye(len(read))).T).imag / STEP
    ends = [at((read + side * 1e-4 * np.eye(len(read))).T.astype(complex)).real for side in (1.0, -1.0)]
    assert slope == pytest.approx((ends[0] - ends[1]) / 2e-4, rel=1e-3, abs=1e-5)


def test_a_run_that_leaves_every_equilibrium_is_refused(spec, friction, model, own_cache):
    with pytest.raises(
        ConvergenceError, match=r"after 0\.\d+ h at \d+ rpm.*Preload runs away.*thermal_preload=false"
    ):
        sample_preload(spec, model, friction, lambda known: [warming(model, spec, 900.0)])
