"""Laws of single effects against values worked out by hand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spindle_fem.effects.catalogue.ambient_drift import HUMP, RAMP, STEADY, DriftTerm
from spindle_fem.effects.catalogue.coolant_film import TransitionTerm
from spindle_fem.effects.catalogue.coolant_heating import CoolantHeatingTerm
from spindle_fem.effects.catalogue.gap_closure import GapClosureTerm
from spindle_fem.effects.catalogue.grease_churning import GreaseChurningTerm
from spindle_fem.effects.catalogue.heat_capacity import ContactCapacityTerm
from spindle_fem.effects.catalogue.heat_split import HeatSplitTerm
from spindle_fem.effects.catalogue.mount_sink import MountSinkTerm
from spindle_fem.effects.catalogue.natural_convection import NaturalConvectionTerm
from spindle_fem.effects.catalogue.radiation import RadiationTerm
from spindle_fem.effects.catalogue.starvation import StarvationTerm
from spindle_fem.effects.catalogue.thermal_preload import NAME, ThermalPreloadTerm
from spindle_fem.effects.catalogue.unrecorded_cooling import CoolingTerm
from spindle_fem.effects.catalogue.viscosity_heat import ViscosityHeatTerm, Walther
from spindle_fem.effects.framework.laws import (
    amplitude,
    linear,
    power,
    relaxed,
    shape,
    smooth_step,
    softplus,
    switched,
)
from spindle_fem.effects.framework.machine_view import ChannelFlow, FrictionTable, RecordedQuantity
from spindle_fem.effects.framework.speed_heat import SpeedHeatTerm
from spindle_fem.effects.framework.spread import Spread
from spindle_fem.effects.framework.term import TermContext
from spindle_fem.effects.framework.unrecorded import Followed, InIntervals, UnrecordedHeatTerm
from spindle_fem.physics.surroundings.still_air import STEFAN_BOLTZMANN

RPM = np.pi / 30.0


def context(term, *, temperatures=(), state=(), time=0.0, inputs=None, **given):
    own = {item.name: item.value for item in term.parameters} | given
    return TermContext(
        time,
        {"speed": 100.0, "thrust": 1750.0, "ambient": 293.15} | (inputs or {}),
        np.array(temperatures, dtype=complex).reshape(len(term.reads), 1),
        np.array(state, dtype=complex).reshape(term.n_states, 1),
        {name: np.array([value + 0j]) for name, value in own.items()},
    )


# ------------------------------------------------------------------ building blocks
@given(st.floats(-2000.0, 2000.0))
def test_smooth_laws_keep_their_bounds(x):
    assert 0.0 <= smooth_step(x).real <= 1.0
    assert softplus(x).real >= max(x, 0.0)
    assert softplus(x).real - max(x, 0.0) <= np.log(2.0) + 1e-12


def test_smooth_laws_are_right_in_complex_steps():
    x = np.linspace(-40.0, 40.0, 9)
    assert softplus(x + 1e-30j).imag / 1e-30 == pytest.approx(smooth_step(x).real, rel=1e-10, abs=0.0)
    assert power(np.array([0.0, 2.0]), 3.0 + 1e-30j).imag / 1e-30 == pytest.approx([0.0, 8.0 * np.log(2.0)])


@given(st.floats(0.1, 1e4), st.floats(0.1, 1e4), st.floats(1.0, 1e4))
def test_two_short_relaxations_are_one_long_one(first, second, lag):
    at_once = relaxed(3.0, 8.0, first + second, lag)
    assert relaxed(relaxed(3.0, 8.0, first, lag), 8.0, second, lag) == pytest.approx(at_once)


def test_switching_is_a_lag_with_soft_edges():
    time = np.array([-500.0, 1000.0, 4000.0, 9000.0])
    on = switched(time, 0.0, 5000.0, 300.0, 1e-3).real
    expected = [0.0, 1 - np.exp(-1000 / 300), 1 - np.exp(-4000 / 300), np.exp(-4000 / 300)]
    assert on == pytest.approx(expected, abs=1e-6)
    # A lag as long as the edge's width makes the edge logistic.
    early = np.array([-40.0, 0.0, 40.0])
    assert switched(early, 0.0, 1e6, 20.0, 20.0).real == pytest.approx(smooth_step(early / 20.0).real)


# ------------------------------------------------------------------ bearings
def test_preload_follows_the_power_of_the_lagged_difference():
    term = ThermalPreloadTerm("t", ("F1", "F2"), ("i1", "i2"), ("o1", "o2"))
    own = {NAME: 0.2, "exponent": 1.5, "width": 0.1, "lag": 600.0}
    factor = term.friction(context(term, temperatures=[0] * 4, state=[20.0], **own)).real
    assert factor[:, 0] == pytest.approx(1.0 + 0.2 * 2.0**1.5)
    slack = term.friction(context(term, temperatures=[0] * 4, state=[-20.0], **own)).real
    assert slack == pytest.approx(1.0)
    moved = term.advance(context(term, temperatures=[310, 312, 303, 305], state=[1.0], **own), 600.0)
    assert moved[0, 0].real == pytest.approx(7.0 - 6.0 * np.exp(-1.0))


def test_a_mass_behind_a_contact_takes_its_heat_and_gives_it_back():
    """Capacity times rise, whatever the contact: an energy balance over a step of the place's temperature."""
    term = ContactCapacityTerm("mass", ("a", "b"), 1000.0)
    own = {"capacity": 2000.0, "contact_time": 500.0}
    state, taken, step = np.zeros((2, 1)), 0.0, 1.0
    cold = context(term, temperatures=(290.0, 294.0), state=state, **own)
    assert np.abs(term.heat(cold)).max() == 0.0
    state = term.advance(cold, step)
    for _ in range(8000):
        warm = context(term, temperatures=(300.0, 304.0), state=state.real, **own)
        taken -= step * term.heat(warm).real.sum()
        state = term.advance(warm, step)
    assert state[0].real == pytest.approx(302.0, abs=1e-5)
    # heat is taken at the start of each step: half a step of it too much
    assert taken == pytest.approx(2000.0 * 10.0, rel=0.51 * step / own["contact_time"])


def test_viscosity_is_that_of_the_data_sheet():
    law = Walther(21.0e-6, 4.7e-6)
    assert np.exp(law.log_viscosity(373.15).real) == pytest.approx(4.7)
    # Rises steeply when cold: a factor of about 2.4 from 40 to 20 °C (ISO VG 22 charts: 2.3 to 2.6).
    ratio = np.exp(law.log_viscosity(293.15).real - law.log_viscosity(313.15).real)
    assert 2.2 < ratio < 2.7


def test_friction_halves_where_viscosity_does_with_exponent_one():
    term = ViscosityHeatTerm("t", ("F1",), (("i", "o"),), (20.0e-6, 5.0e-6))
    own = {"viscosity_exponent": 1.0, "nominal_temperature": 313.15}
    factor = term.friction(context(term, temperatures=[375.15, 371.15], **own)).real
    assert factor[0, 0] == pytest.approx(0.25)


def test_grease_counts_only_running_time_and_may_begin_anew():
    once = GreaseChurningTerm("t", ("F1",), "speed", 0.1, restarts=False)
    assert once.initial_state({}) == pytest.approx([0.0])
    run = once.advance(context(once, state=[0.2], time_constant=500.0), 500.0)
    assert run[0, 0].real == pytest.approx(1.2)
    own = {"extra_friction": 0.5, "stretch": 0.8}
    extra = [once.friction(context(once, state=[x], **own))[0, 0].real - 1.0 for x in (0.0, 1.2)]
    assert extra == pytest.approx([0.5, 0.5 * np.exp(-(1.2**0.8))])
    still = {"inputs": {"speed": 0.0}}
    assert once.advance(context(once, state=[0.3], **still), 1e4)[0, 0].real == pytest.approx(0.3)
    again = GreaseChurningTerm("t", ("F1",), "speed", 0.1, restarts=True)
    rested = again.advance(context(again, state=[0.3], settling_time=100.0, **still), 100.0)
    assert rested[0, 0].real == pytest.approx(0.3 * np.exp(-1.0))


@pytest.mark.parametrize(("exponent", "faster"), [(0.0, 1.0), (1.0, 1.5), (0.5, 1.5**0.5)])
def test_grease_is_run_in_by_time_or_by_revolutions(exponent, faster):
    term = GreaseChurningTerm("t", ("F1",), "speed", 0.1, restarts=False, revolutions=True)
    own = {"time_constant": 600.0, "speed_exponent": exponent}
    run = term.advance(context(term, state=[0.0], inputs={"speed": -4500.0 * RPM}, **own), 600.0)
    assert run[0, 0].real == pytest.approx(faster)


def test_starvation_is_half_at_its_onset():
    term = StarvationTerm("t", ("F1",), "speed", 400.0)
    own = {"friction_change": 0.6, "onset_speed": 100.0, "width": 5.0, "lag": 200.0}
    settled = 1e5
    for speed, factor in ((100.0, 1.3), (-400.0, 1.6)):
        share = term.advance(context(term, inputs={"speed": speed}, state=[0.0], **own), settled)
        starved = context(term, inputs={"speed": speed}, state=share[:, 0].real, **own)
        assert term.friction(starved)[0, 0].real == pytest.approx(factor)
    begun = term.advance(context(term, inputs={"speed": 400.0}, state=[0.0], **own), 200.0)
    assert begun[0, 0].real == pytest.approx(1.0 - np.exp(-1.0))
    # 2000 rpm beyond the onset, 0.3 more for every 1000 rpm.
    own |= {"onset_speed": 400.0 - 2000.0 * RPM, "growth_per_1000rpm": 0.3}
    more = term.advance(context(term, inputs={"speed": 400.0}, state=[0.0], **own), settled)
    assert more[0, 0].real == pytest.approx(1.6)


def test_a_moved_share_keeps_the_heat():
    table = FrictionTable((0.0, 100.0, 200.0), (0.0, 50.0, 150.0), 0.1, 1750.0)
    term = HeatSplitTerm("t", {"F1": table}, 0.8)
    at = context(term, inputs={"speed": 150.0, "thrust": 3500.0}, inner_share_change=0.1)
    heat = term.heat(at).real[:, 0]
    assert term.heat_places == ("F1.inner_raceway", "F1.outer_raceway")
    assert heat == pytest.approx([0.1 * 0.8 * 110.0, -0.1 * 0.8 * 110.0])


# ------------------------------------------------------------------ heat by speed
def test_heat_follows_its_power_of_speed():
    seal = SpeedHeatTerm("t", ("nose",), "speed", ("heat_per_1000rpm", 30.0, 1000.0 * RPM), (1.0, 0.1))
    at = context(seal, inputs={"speed": 2500.0 * RPM}, heat_per_1000rpm=20.0)
    assert seal.heat(at)[0, 0].real == pytest.approx(50.0)
    air = SpeedHeatTerm("t", ("a", "b"), "speed", ("heat_at_4500rpm", 90.0, 4500.0 * RPM), (3.0, 0.1))
    at = context(air, inputs={"speed": 2250.0 * RPM}, heat_at_4500rpm=80.0)
    assert air.heat(at).real[:, 0] == pytest.approx([5.0, 5.0])
    late = SpeedHeatTerm("t", ("d",), "speed", ("heat_at_3000rpm", 90.0, 3000.0 * RPM), (1.0, 0.1), lag=900.0)
    at = context(late, inputs={"speed": 3000.0 * RPM}, state=[0.2], lag=900.0, heat_at_3000rpm=50.0)
    assert late.heat(at)[0, 0].real == pytest.approx(10.0)
    assert late.advance(at, 900.0)[0, 0].real == pytest.approx(1.0 - 0.8 * np.exp(-1.0))


# ------------------------------------------------------------------ surroundings
def test_a_lip_gives_more_heat_until_it_has_run_in():
    size = ("heat_per_1000rpm", 10.0, 1000.0 * RPM)
    term = SpeedHeatTerm("seal", ("nose",), "speed", size, exponent=(1.0, 0.08), runs_in=True)
    given = {"heat_per_1000rpm": 20.0, "more_when_new": 0.5, "run_in_time": 3000.0}
    heat = [
        term.heat(context(term, time=time, inputs={"speed": 2000.0 * RPM}, **given))[0, 0].real
        for time in (0.0, 3000.0, 1e6)
    ]
    assert heat == pytest.approx([40.0 * 1.5, 40.0 * (1.0 + 0.5 / np.e), 40.0])


def test_an_outside_film_is_nominal_at_ten_kelvin_where_it_carries_all():
    term = NaturalConvectionTerm("t", ("film.a",), ("a",), ("ambient",), ())
    term.parameters = parameters = _film_parameters("convective_share", exponent=0.25)
    assert parameters
    own = {"convective_share": 1.0, "carried_share": 1.0, "exponent": 0.25}
    at_ten = term.factor(context(term, temperatures=[303.15], **own))[0, 0].real
    assert at_ten == pytest.approx(1.0, abs=2e-3)
    wider = term.factor(context(term, temperatures=[293.15 + 160.0], **own))[0, 0].real
    assert wider == pytest.approx(0.5 * (1.0 + 2.0), rel=1e-3)
    below = term.factor(context(term, temperatures=[293.15 - 160.0], **own))[0, 0].real
    assert below == pytest.approx(wider)


def test_radiation_on_top_is_stefan_and_boltzmann():
    term = RadiationTerm("t", ("film.a",), ("a",), ("ambient",), ())
    term.parameters = _film_parameters("radiative_share")
    # A black wall beside a film of 10 W/(m²·K): the share is its film at 10 K over 10.
    film = STEFAN_BOLTZMANN * (303.15**4 - 293.15**4) / 10.0
    own = {"radiative_share": film / 10.0, "carried_share": 0.0}
    factor = term.factor(context(term, temperatures=[353.15], **own))[0, 0].real
    loss = 10.0 * (353.15 - 293.15) + STEFAN_BOLTZMANN * (353.15**4 - 293.15**4)
    assert factor * 10.0 * 60.0 == pytest.approx(loss)


def _film_parameters(name, **others):
    from spindle_fem.effects.framework.laws import amplitude, linear

    extra = tuple(linear(key, value, 0.1) for key, value in others.items())
    return (amplitude(name, 1.0), *extra, linear("carried_share", 1.0, 0.1))


def test_a_seat_is_open_cold_and_closed_warm():
    term = GapClosureTerm("t", ("joint.a", "joint.b"), ("ring",), ("bore",))
    own = {"opening": 0.95, "closing_difference": 8.0, "width": 0.5, "lag": 600.0}

    def factor(excess, seconds):
        seen = context(term, temperatures=[300.0 + excess, 300.0], state=[0.0], **own)
        state = term.advance(seen, seconds)[:, 0].real
        return term.factor(context(term, temperatures=[300, 300], state=state, **own)).real[:, 0]

    assert factor(-10.0, 1e6) == pytest.approx(0.05)
    assert factor(8.0, 1e6) == pytest.approx(1.0 - 0.95 / 2.0)
    assert factor(30.0, 1e6) == pytest.approx(1.0)
    assert factor(30.0, 600.0) == pytest.approx(1.0 - 0.95 * np.exp(-1.0))
    own["closed"] = 0.4
    assert factor(-10.0, 1e6) == pytest.approx(0.4 * 0.05)
    assert factor(30.0, 1e6) == pytest.approx(0.4)


def test_a_ring_remembers_where_it_began():
    term = GapClosureTerm("t", ("joint.a",), ("r1", "r2"), ())
    own = {"closing_difference": 10.0, "width": 2.0, "lag": 100.0}
    seen = context(term, temperatures=[299.0, 301.0], state=[0.0, 0.0], **own)
    closed, began = term.advance(seen, 1e5)[:, 0].real
    assert (closed, began) == (pytest.approx(1.0 / (1.0 + np.exp(5.0))), pytest.approx(300.0))
    later = context(term, temperatures=[309.0, 311.0], state=[0.0, 300.0], **own)
    assert term.advance(later, 100.0)[:, 0].real == pytest.approx([0.5 * (1.0 - np.exp(-1.0)), 300.0])


def test_each_ring_closes_its_own_seat_and_all_of_them_a_spacers():
    owners = ((0,), (1,), (0, 1))
    term = GapClosureTerm("t", ("joint.a", "joint.b", "joint.spacer"), ("r1", "r2"), ("bore",), owners)
    own = {"opening": 0.9, "closing_difference": 8.0, "width": 0.5, "lag": 100.0}
    seen = context(term, temperatures=[300.0, 320.0, 300.0], state=[0.0, 0.0], **own)
    closed = term.advance(seen, 1e5)[:, 0].real
    assert closed == pytest.approx([0.0, 1.0], abs=1e-6)
    factor = term.factor(context(term, temperatures=[300.0, 320.0, 300.0], state=closed, **own)).real[:, 0]
    assert factor == pytest.approx([0.1, 1.0, 0.55], abs=1e-6)


def test_a_room_drifts_from_one_instant_to_another():
    term = DriftTerm("t", ("film.a", "film.b"), RAMP, ())
    own = {"change": -6.0, "start": 3000.0, "ramp_time": 3000.0}
    shifts = [term.heat(context(term, time=time, **own)).real[:, 0] for time in (0.0, 4500.0, 9000.0)]
    assert term.heat_places == ("fluid.a", "fluid.b")
    assert np.array(shifts)[:, 0] == pytest.approx([0.0, -3.0, -6.0], abs=1e-9)
    steady = DriftTerm("t", ("link.x",), STEADY, ())
    assert steady.heat(context(steady, time=3600.0, rate=1.0 / 3600.0))[0, 0].real == pytest.approx(1.0)


# ------------------------------------------------------------------ coolant
def test_a_hump_of_the_room_comes_and_goes():
    parameters = (
        linear("change", 0.0, 3.0, "K"),
        linear("middle", 9000.0, 1.0, "s"),
        shape("spread", 1e3, 0.5),
    )
    term = DriftTerm("drift", ("film.housing.outside",), HUMP, parameters)
    at = [
        term.heat(context(term, time=time, change=2.0))[0, 0].real for time in (0.0, 8000.0, 9000.0, 18000.0)
    ]
    assert at == pytest.approx([0.0, 2.0 * np.exp(-0.5), 2.0, 0.0], abs=1e-12)


def test_the_channels_reynolds_number_is_the_reference_ones():
    channel = ChannelFlow("iso_vg_32", 0.010909, 0.010 * 0.012)
    # reference/spindle.md: about 292 at 15 °C and 20 L/min.
    assert channel.reynolds_number(20e-3 / 60, 288.15) == pytest.approx(292.0, rel=0.01)
    term = TransitionTerm("t", channel, (290.0, 850.0))
    assert term.law(2000.0, {"film_increase": 2.0, "onset_reynolds": 600.0, "width": 50.0}) == pytest.approx(
        3.0
    )
    assert term.law(600.0, {"film_increase": 2.0, "onset_reynolds": 600.0, "width": 50.0}) == pytest.approx(
        2.0
    )


def test_coolant_warms_by_what_it_took_before():
    term = CoolantHeatingTerm("t", ("link.a", "link.b", "link.c"), ("a", "b", "c"), 290.0, (2.0, 3.0, 1.0))
    heat = term.heat(context(term, temperatures=[310.0, 330.0], warming_per_watt=0.01)).real[:, 0]
    first = 0.01 * 2.0 * 20.0
    second = first + 0.01 * 3.0 * (40.0 - first)
    assert term.heat_places == ("fluid.b", "fluid.c")
    assert heat == pytest.approx([first, second])


@pytest.mark.parametrize("at_once", [0.0, 0.3, 1.0])
def test_a_frame_is_away_at_once_and_builds_up_the_rest(at_once):
    term = MountSinkTerm("t", ("film.back",), warming=True)
    own = {"temperature_above_ambient": -8.0, "warm_up_time": 3000.0, "share_at_once": at_once}
    shift = [term.heat(context(term, time=t, **own))[0, 0].real for t in (0.0, 3000.0, 1e6)]
    later = at_once + (1.0 - at_once) * (1.0 - np.exp(-1.0))
    assert shift == pytest.approx([-8.0 * at_once, -8.0 * later, -8.0])


# ------------------------------------------------------------------ unrecorded
def heat_in(spread, *intervals):
    return UnrecordedHeatTerm("t", amplitude("heat", 50.0, "W"), spread, InIntervals(intervals))


def heat_following(**quantity):
    law = Followed(
        RecordedQuantity(
            **({"name": "q", "input": "q", "highest": 200.0, "varies": 1.0, "levels": ()} | quantity)
        )
    )
    return UnrecordedHeatTerm("t", amplitude("heat", 50.0, "W"), Spread(("a", "b")), law)


def marched(term, series, step=60.0, **own):
    """Heat of all places before each step of inputs that hold over it, W."""
    state, found = np.zeros(term.n_states), []
    for number, value in enumerate(series):
        seen = context(term, state=state, time=number * step, inputs={"q": value}, **own)
        found.append(term.heat(seen).real.sum())
        state = term.advance(seen, step)[:, 0].real
    return np.array(found)


def test_heat_follows_a_power_of_what_was_recorded_with_a_lag():
    heat = marched(heat_following(), np.full(400, -100.0), heat=80.0, exponent=2.0, lag=600.0)
    # A quarter of 80 W at half the highest load, whatever its sign.
    assert heat[0] == 0.0
    assert heat[10] == pytest.approx(20.0 * (1.0 - np.exp(-1.0)), rel=1e-9)
    assert heat[-1] == pytest.approx(20.0, rel=1e-9)


def test_heat_above_an_onset_begins_there_and_is_whole_at_the_reference():
    law = {"heat": 80.0, "exponent": 1.0, "lag": 600.0, "onset": 100.0}
    ends = [marched(heat_following(), np.full(400, value), **law)[-1] for value in (90.0, 150.0, 200.0)]
    assert ends == pytest.approx([0.0, 40.0, 80.0], rel=1e-9)


def test_heat_follows_changes_of_the_squared_speed_up_and_down_alike():
    series = np.concatenate((np.full(300, 200.0), np.full(300, 100.0)))
    heat = marched(heat_following(changes=True), series, step=20.0, heat=80.0, lag=600.0)
    # Each change turns over what 600 s of the heat are, times the change of (q / q0)^2.
    assert heat[300] == pytest.approx(80.0 * 0.75, rel=1e-3)
    assert heat[[299, -1]] == pytest.approx(0.0, abs=0.01)
    assert 20.0 * heat[300:].sum() / (80.0 * 600.0) == pytest.approx(0.75, rel=0.02)


def test_the_size_of_a_law_is_its_mean_while_on():
    levels = (200.0, 100.0, 100.0, 50.0)
    own = {"reference": 200.0, "exponent": 2.0, "onset": 0.0}
    assert heat_following(levels=levels).on.mean_share(own) == pytest.approx((1.0 + 0.5 + 0.0625) / 4.0)
    above = heat_following(levels=levels).on.mean_share(own | {"onset": 100.0})
    assert above == pytest.approx((1.0 + 0.0 + 0.0) / 4.0)
    # A pulse of 600 s that is followed down to a twentieth, by quadrature.
    time = np.linspace(0.0, 600.0 * np.log(20.0), 200_001)
    pulse = np.trapezoid(np.exp(-time / 600.0), time) / time[-1]
    squares = (200.0**2, 0.75 * 200.0**2)
    mean = heat_following(levels=squares, changes=True).on.mean_share({"reference": 200.0})
    assert mean == pytest.approx(pulse * 0.875, rel=1e-6)


def test_a_law_keeps_what_it_refers_to():
    own = {item.name: item for item in heat_following(unit="newton").parameters}
    assert (own["reference"].value, own["reference"].sigma, own["reference"].unit) == (200.0, 0.0, "newton")


def test_an_unrecorded_source_gives_its_heat_while_on():
    term = heat_in(Spread(("a", "b")), (1000.0, 3000.0), (6000.0, 9000.0))
    own = {"heat": 40.0, "factor_2": 0.9, "lag": 100.0}
    total = [term.heat(context(term, time=t, **own)).real.sum() for t in (0.0, 2700.0, 5500.0, 8700.0, 2e4)]
    assert total == pytest.approx([0.0, 40.0, 0.0, 36.0, 0.0], abs=1e-4)


def test_heat_beside_a_gap_is_shared_by_both_walls():
    size = ("heat_at_4500rpm", 50.0, 471.0)
    term = SpeedHeatTerm("t", ("a", "b"), "speed", size, (3.0, 0.15), beside=("c",))
    own = {"heat_at_4500rpm": 80.0, "exponent": 3.0, "share_beside": 0.25}
    heat = term.heat(context(term, inputs={"speed": 471.0}, **own)).real[:, 0]
    assert heat == pytest.approx([30.0, 30.0, 20.0])


def test_what_heats_one_side_gives_the_same_heat_there():
    term = heat_in(Spread(("a",), ("up.a", "across.a")), (1000.0, 3000.0))
    own = {"heat": 40.0, "up": 0.5, "across": -0.25, "lag": 100.0}
    heat = term.heat(context(term, time=2700.0, **own)).real[:, 0]
    # A pattern 1 + 2 (up cos + across sin): the mean is the heat, half a squared cosine is left of each side.
    angle = np.linspace(0.0, 2.0 * np.pi, 72, endpoint=False)
    pattern = heat[0] + heat[1] * np.cos(angle) + heat[2] * np.sin(angle)
    assert pattern.mean() == pytest.approx(40.0, abs=1e-4)
    assert (pattern * np.cos(angle)).mean() == pytest.approx(0.5 * 40.0, abs=1e-4)
    assert (pattern * np.sin(angle)).mean() == pytest.approx(-0.25 * 40.0, abs=1e-4)


def test_a_loss_of_one_side_follows_the_temperature_there():
    term = CoolingTerm(
        "t",
        amplitude("conductance", 5.0, "W/K"),
        Spread(("a",), ("up.a", "across.a")),
        InIntervals(((1000.0, 3000.0),)),
        290.0,
    )
    own = {"conductance": 3.0, "up": 1.0, "across": 0.0, "lag": 100.0}
    # Field 300 + 10 cos: means of T, T cos, T sin.
    heat = term.heat(context(term, time=2700.0, temperatures=[300.0, 5.0, 0.0], **own)).real[:, 0]
    assert heat == pytest.approx([-60.0, -120.0, 0.0], abs=1e-3)


def test_heat_of_a_ring_is_drawn_to_its_spot_and_to_a_side():
    term = heat_in(Spread(("ring",), ("up", "across"), "spot"), (1000.0, 3000.0))
    assert term.heat_places == ("ring", "spot", "up", "across")
    own = {"heat": 40.0, "focus": 0.25, "up": 0.5, "across": -0.1, "lag": 100.0}
    heat = term.heat(context(term, time=2700.0, **own)).real[:, 0]
    assert heat == pytest.approx([30.0, 10.0, 40.0, -8.0], abs=1e-4)


def test_a_loss_of_a_ring_follows_the_temperature_where_it_is():
    spread = Spread(("ring",), ("up", "across"), "spot")
    term = CoolingTerm(
        "t", amplitude("conductance", 5.0, "W/K"), spread, InIntervals(((1000.0, 3000.0),)), 290.0
    )
    own = {"conductance": 2.0, "focus": 0.25, "up": 0.5, "across": 0.0, "lag": 100.0}
    heat = term.heat(context(term, time=2700.0, temperatures=[300.0, 320.0, 4.0, 1.0], **own)).real[:, 0]
    # Met: 0.75 · 300 + 0.25 · 320 + 2 · 0.5 · 4 = 309 K.
    assert heat == pytest.approx([-28.5, -9.5, -38.0, 0.0], abs=1e-3)


def test_edges_of_neighbouring_intervals_cannot_cross():
    term = heat_in(Spread(("a",)), (0.0, 100.0), (140.0, 900.0), (950.0, 1000.0))
    own = {item.name: item for item in term.parameters}
    for number in (1, 2):
        assert own[f"end_{number}"].high <= own[f"start_{number + 1}"].low
    for number in (1, 2, 3):
        assert own[f"start_{number}"].high < own[f"end_{number}"].low
