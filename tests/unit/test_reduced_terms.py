"""Terms of effects in the fast model: exact derivatives, marching, and what equals what."""

import numpy as np
import pytest

from spindle_fem.effects.catalogue.coolant_bypass import BypassTerm
from spindle_fem.effects.framework.term import CHANNEL_FILM, Term, TermParameter
from spindle_fem.errors import ConvergenceError, OutOfValidityError, SpecError
from spindle_fem.model.reduced import added_heat, term_march
from spindle_fem.model.reduced.drive import STANDARD, make_drive
from spindle_fem.model.reduced.reduced_transient import TransientRun, simulate_fast
from spindle_fem.model.reduced.run_operators import run_operators
from spindle_fem.model.reduced.term_march import TermMarch
from spindle_fem.operation.effect_terms import Derivatives
from tests.support.lumped_spindle import drive_of
from tests.support.sample_terms import FRICTIONS, SHIFTED, TERMS, Feedback

of_terms = pytest.mark.parametrize(
    "terms",
    [TERMS, SHIFTED, FRICTIONS],
    ids=["everything", "shifted fluid of a scaled film", "friction of friction"],
)


@of_terms
def test_derivatives_with_terms_are_those_of_differences(fast, spec, short_drive, monkeypatch, terms):
    # Derivatives are those at Newton's last but one iterate: exact to its last change.
    for module in (added_heat, term_march):
        monkeypatch.setattr(module, "TEMPERATURE_TOLERANCE", 1e-7)
    owned = {name: item for term in terms for name, item in term.names().items()}
    names = (
        *owned,
        "film.outside",
        "joint.front_outer_ring_seats",
        "heat_capacity_factor",
        "coolant.film_factor",
        "film.flange_back",
        "heat.front",
        "heat.inner_share",
    )
    run = simulate_fast(fast, short_drive, 293.15, terms=terms, derivatives=names)
    for column, name in enumerate(names):
        item = owned.get(name)
        value = 1.0 if item is None else item.value
        width = 1e-5 * value
        ends = [
            simulate_fast(
                fast, short_drive, 293.15, terms=terms, parameters={name: value + sign * width}
            ).temperature
            for sign in (1.0, -1.0)
        ]
        difference = (ends[0] - ends[1]) / (2.0 * width)
        if item is None or item.logarithmic:
            difference = difference * value
        size = np.abs(difference).max()
        assert size > 1e-4, name
        assert np.abs(run.sensitivity[:, :, column] - difference).max() < 2e-5 * max(size, 1.0), name


def answering_run(fast, drive, terms, parameters=None):
    names = (*(name for term in terms for name in term.names()), "film.outside", "heat_capacity_factor")
    return TransientRun(fast, drive, parameters or {}, names, terms)


@of_terms
@pytest.mark.parametrize("near", [False, True], ids=["from nothing", "from another run"])
def test_the_whole_run_at_once_is_the_run_step_by_step(fast, steps, monkeypatch, terms, near):
    other = simulate_fast(fast, steps, 293.15, terms=terms, parameters={"film.outside": 2.0}).states
    run = answering_run(fast, steps, terms)
    step_by_step = []
    monkeypatch.setattr(
        TermMarch,
        "_step_by_step",
        lambda self, march=TermMarch._step_by_step: step_by_step.append(march(self)) or step_by_step[-1],
    )
    states, tracks = run.march(293.15, other if near else None)
    assert not step_by_step
    monkeypatch.setattr(term_march, "MOST_ROUNDS", 0)
    expected, stepped = run.march(293.15)
    assert len(step_by_step) == 1
    assert np.abs(states - expected).max() < 1e-5
    assert np.abs(other - expected).max() > 0.1
    assert np.abs(tracks.added() - stepped.added()).max() < 1e-4 * np.abs(stepped.added()).max()
    by = [run.tangents(run.forcing_of(states, t), t, explicit=True) for t in (tracks, stepped)]
    size = np.abs(by[1]).max(axis=(0, 1))
    assert np.all(np.abs(by[0] - by[1]).max(axis=(0, 1)) < 1e-4 * size)
    for name in ("start_by", "end_by"):
        assert getattr(tracks, name) == pytest.approx(getattr(stepped, name), rel=1e-3, abs=1e-3)


def test_a_run_that_is_known_takes_one_round(fast, steps, monkeypatch):
    rounds = []
    plain = TermMarch._evaluate

    def evaluate(self, *own):
        rounds.append(own[-1])
        return plain(self, *own)

    monkeypatch.setattr(TermMarch, "_evaluate", evaluate)
    run = answering_run(fast, steps, TERMS)
    states, _ = run.march(293.15)
    assert rounds.count(Derivatives.STATE) > 1
    rounds.clear()
    again, _ = run.march(293.15, states)
    assert rounds == [Derivatives.ALL]
    assert np.abs(again - states).max() < 1e-6


def test_a_run_begins_from_the_machine_without_its_terms(fast, steps, monkeypatch):
    """From a uniform field, feedback that is strong there alone would run away in the first round."""
    begun = []
    plain = TermMarch._at_once
    monkeypatch.setattr(
        TermMarch,
        "_at_once",
        lambda self, near, close: begun.append((near, close)) or plain(self, near, close),
    )
    simulate_fast(fast, steps, 293.15, terms=(Feedback(),))
    ((near, close),) = begun
    np.testing.assert_allclose(near, simulate_fast(fast, steps, 293.15).states, atol=1e-9)
    assert not close


def test_a_range_that_the_first_rounds_leave_is_marched_step_by_step(fast, steps):
    class Narrow(Feedback):
        def heat(self, context):
            if np.ndim(context.time):
                raise OutOfValidityError("law", "left.", "")
            return super().heat(context)

    expected = simulate_fast(fast, steps, 293.15, terms=(Feedback(),)).states
    assert np.abs(simulate_fast(fast, steps, 293.15, terms=(Narrow(),)).states - expected).max() < 1e-5


def test_a_run_takes_from_another_what_both_have_in_common(fast, steps):
    run = TransientRun(fast, steps, {"film.outside": 1.3}, (), ())
    same = TransientRun(fast, steps, {"film.outside": 1.3, "heat.front": 2.0}, ("heat.front",), (), like=run)
    assert all(same.propagators[key] is run.propagators[key] for key in run.groups)
    for changed in ({"film.outside": 1.4}, {"film.outside": 1.3, "heat_capacity_factor": 1.01}):
        other = TransientRun(fast, steps, changed, (), (), like=run)
        alone = TransientRun(fast, steps, changed, (), ())
        for key in run.groups:
            assert np.array_equal(other.propagators[key].advance, alone.propagators[key].advance)
            assert not np.array_equal(other.propagators[key].advance, run.propagators[key].advance)


def test_operating_points_that_hardly_differ_have_the_same_operators(fast, steps):
    class Transition(Term):
        """A film that changes where the oil warms."""

        name = "transition"
        parameters = (TermParameter("excess", 0.0, 0.3, logarithmic=False),)

        def operating_factor(self, point, parameters):
            share = 1.0 / (1.0 + np.exp(-(point.coolant_inlet_temperature - 289.0) / 0.1))
            return {"channel.film": 1.0 + parameters["excess"] * share}

    times = np.arange(0.0, 7200.0, 20.0)
    drive = drive_of(times, np.where(times < 3000, 3000.0, 1500.0), inlet=289.0 + 4.0 * np.sin(times / 900.0))
    names = ("film.outside", "coolant.film_factor")
    exact = TransientRun(fast, drive, {}, names, ())
    merged = TransientRun(fast, drive, {}, names, (), same_within=5e-3)
    assert len(set(exact.step_class.tolist())) == len(set(drive.step_class.tolist())) > 6
    speeds = np.round([point.speed for point in drive.points], 6)
    assert len(set(merged.step_class.tolist())) == len(set(speeds.tolist())) == 2
    assert np.array_equal(speeds[merged.built.owner], speeds)
    a, b = exact.solve(293.15), merged.solve(293.15)
    assert 0.0 < np.abs(a.temperature - b.temperature).max() < 5e-3 * np.ptp(a.temperature)
    assert np.abs(a.sensitivity - b.sensitivity).max() < 2e-2 * np.abs(a.sensitivity).max()
    # What a term would do counts even where its amplitude is nothing.
    asked = TransientRun(fast, drive, {}, ("transition.excess",), (Transition(),), same_within=5e-3)
    assert len(set(asked.step_class.tolist())) > 4
    unasked = TransientRun(fast, drive, {}, (), (Transition(),), same_within=5e-3)
    assert len(set(unasked.step_class.tolist())) == 2


def test_a_law_of_the_flow_follows_what_a_bypass_leaves_of_it(fast, steps):
    class ByFlow(Term):
        """A film by the square root of the flow, 1 at that of the drive."""

        name = "by_flow"

        def operating_factor(self, point, parameters):
            return {CHANNEL_FILM: (point.coolant_flow / steps.points[0].coolant_flow) ** 0.5}

    bypass, fraction = BypassTerm("bypass"), "bypass.fraction"

    def film(*terms):
        return run_operators(fast, steps.points, {fraction: 0.36}, (), terms).coefficients[0][CHANNEL_FILM]

    assert film(bypass, ByFlow()) == pytest.approx(0.8 * film(bypass))

    def told(share):
        given = {"terms": (ByFlow(), bypass), "parameters": {fraction: share}, "derivatives": (fraction,)}
        return simulate_fast(fast, steps, 293.15, **given)

    difference = (told(0.37).temperature - told(0.35).temperature) / 0.02
    exact = told(0.36).sensitivity[:, :, 0]
    assert np.abs(difference).max() > 1.0
    np.testing.assert_allclose(exact, difference, atol=2e-3 * np.abs(difference).max())


def test_a_constant_factor_as_a_term_is_a_factor_of_the_machine(fast, steps):
    class Constant(Term):
        name = "constant"
        coefficients = ("joint.F1.outer_ring|housing", "film.housing.outside")

        def factor(self, context):
            return np.full((2, context.temperatures.shape[-1]), 1.8, dtype=complex)

    class Operating(Term):
        name = "operating"

        def operating_factor(self, point, parameters):
            return {"joint.F1.outer_ring|housing": 1.8, "film.housing.outside": 1.8}

    factors = {"joint.F1.outer_ring|housing": 1.8, "film.housing.outside": 1.8}
    expected = simulate_fast(fast, steps, 293.15, parameters=factors).temperature
    assert simulate_fast(fast, steps, 293.15, terms=(Operating(),)).temperature == pytest.approx(
        expected, abs=1e-9
    )
    # The first stage of a step takes the moved heat from its ends: the same to second order.
    apart = []
    for step in (20.0, 10.0, 5.0):
        drive = drive_of(np.arange(0.0, 3601.0, step), 3000.0)
        by_factor = simulate_fast(fast, drive, 293.15, parameters=factors).temperature
        by_term = simulate_fast(fast, drive, 293.15, terms=(Constant(),)).temperature
        apart.append(np.abs(by_term - by_factor)[:: round(60.0 / step)].max())
    assert apart[0] < 0.02
    assert np.log2(apart[1] / apart[2]) > 1.7


@pytest.mark.parametrize("reads", [(), ("housing",)], ids=["known before", "within the step"])
def test_heat_that_a_scaled_film_moves_counts_from_its_shifted_fluid(fast, reads):
    class Scaled(Term):
        name = "scaled"
        coefficients = ("film.housing.outside",)

        def factor(self, context):
            return np.full((1, context.temperatures.shape[-1]), 1.8, dtype=complex)

    class Shifted(Term):
        name = "shifted"
        heat_places = ("fluid.housing.outside",)

        def heat(self, context):
            return np.full((1, context.temperatures.shape[-1]), 30.0, dtype=complex)

    shift = Shifted()
    shift.reads = reads
    drive = drive_of(np.linspace(0.0, 1.0e6, 4000), 3000.0)
    factor = {"film.housing.outside": 1.8}
    expected = simulate_fast(fast, drive, 293.15, terms=(shift,), parameters=factor).temperature[-1]
    unscaled = simulate_fast(fast, drive, 293.15, terms=(shift,)).temperature[-1]
    for terms in ((Scaled(), shift), (shift, Scaled())):
        both = simulate_fast(fast, drive, 293.15, terms=terms).temperature[-1]
        assert both == pytest.approx(expected, abs=1e-7)
        assert np.abs(both - unscaled).max() > 0.1


def test_constant_heat_as_a_term_is_heat_of_the_table(fast):
    class Heat(Term):
        name = "heat"
        heat_places = ("F1.inner_raceway", "F1.outer_raceway")

        def heat(self, context):
            return np.full((2, context.temperatures.shape[-1]), 0.5 * 155.0, dtype=complex)

    drive = drive_of(np.arange(0.0, 3600.0, 20.0), 3000.0)
    doubled = simulate_fast(fast, drive, 293.15, parameters={"heat.F1": 2.0}).temperature
    assert simulate_fast(fast, drive, 293.15, terms=(Heat(),)).temperature == pytest.approx(doubled, abs=1e-8)


def scaled_by(factor, name="scaled", reads=()):
    """A term that multiplies the friction of the front bearings; dynamic where it reads something."""

    class Scaled(Term):
        bearings = ("F1", "F2", "F3")

        def friction(self, context):
            return np.full((3, context.temperatures.shape[-1]), factor, dtype=complex)

    Scaled.name, Scaled.reads = name, reads
    return Scaled()


def test_scaled_friction_is_heat_of_the_table(fast):
    drive = drive_of(np.arange(0.0, 3600.0, 20.0), 3000.0)
    heat = {"heat.R1": 1.2}
    scaled = simulate_fast(fast, drive, 293.15, parameters={"heat.front": 1.5, **heat}).temperature
    by_term = simulate_fast(fast, drive, 293.15, terms=(scaled_by(1.5),), parameters=heat).temperature
    assert by_term == pytest.approx(scaled, abs=1e-8)


@pytest.mark.parametrize("reads", [((), ()), (("housing",), ()), (("housing",), ("housing",))])
def test_what_scales_one_friction_multiplies(fast, reads):
    drive = drive_of(np.arange(0.0, 3600.0, 20.0), 3000.0)
    whole = simulate_fast(fast, drive, 293.15, parameters={"heat.front": 1.8}).temperature
    terms = tuple(scaled_by(f, str(f), own) for f, own in zip((1.5, 1.2), reads, strict=True))
    assert simulate_fast(fast, drive, 293.15, terms=terms).temperature == pytest.approx(whole, abs=1e-8)


def test_heat_that_a_recording_gives_enters_where_its_name_says(fast):
    times = np.arange(0.0, 3600.0, 20.0)
    plain = drive_of(times, 3000.0)
    values = np.column_stack([np.repeat(plain.start[:1], times.size, axis=0), np.full(times.size, 155.0)])
    held = np.ones(6, dtype=bool)
    drive = make_drive(times, (*STANDARD, "heat.F1.inner_raceway"), values, held)
    more = simulate_fast(fast, drive, 293.15).temperature

    class Same(Term):
        name = "same"
        heat_places = ("F1.inner_raceway",)

        def heat(self, context):
            return np.full((1, context.temperatures.shape[-1]), 155.0, dtype=complex)

    assert more == pytest.approx(simulate_fast(fast, plain, 293.15, terms=(Same(),)).temperature, abs=1e-9)
    assert more[-1, 0] > simulate_fast(fast, plain, 293.15).temperature[-1, 0] + 0.5
    lost = make_drive(times, (*STANDARD, "heat.oven"), values, held)
    with pytest.raises(SpecError, match='puts heat into "oven"'):
        simulate_fast(fast, lost, 293.15)


def test_a_term_that_runs_away_is_refused_with_its_time(fast):
    class Runaway(Term):
        name = "runaway"
        heat_places = ("F1.inner_raceway",)
        reads = ("F1.inner_ring",)

        def heat(self, context):
            return np.exp(context.temperatures - 293.0)

    drive = drive_of(np.arange(0.0, 3600.0, 20.0), 3000.0)
    with pytest.raises(ConvergenceError, match=r"t = .* terms of the fast model"):
        simulate_fast(fast, drive, 293.15, terms=(Runaway(),))


def test_a_term_that_runs_away_late_is_refused_before_the_machine_is_molten(fast):
    """What it remembers answers a step later, so that every step has a state, each hotter than the last."""

    class Late(Term):
        name = "late"
        n_states = 1
        heat_places = ("F1.inner_raceway",)
        reads = ("F1.inner_ring",)

        def heat(self, context):
            return 2e4 * context.state

        def advance(self, context, step):
            return context.temperatures - 293.15

    drive = drive_of(np.arange(0.0, 3600.0, 20.0), 3000.0)
    with pytest.raises(ConvergenceError, match=r"t = .* run away to \d{4} K"):
        simulate_fast(fast, drive, 293.15, terms=(Late(),))


def wrong(**attributes):
    return type("Wrong", (Term,), {"name": "wrong", **attributes})()


@pytest.mark.parametrize(
    ("term", "message"),
    [
        (wrong(heat_places=("F1.inner_racewya",)), 'puts heat into "F1.inner_racewya".*inner_raceway'),
        (wrong(heat_places=("cover",), reads=("nowhere",)), 'reads "nowhere"'),
        (wrong(coefficients=("joint.none",)), 'scales "joint.none"'),
        (wrong(operating_factor=lambda self, point, values: {"film.none": 1.0}), 'scales "film.none"'),
        (wrong(place_capacity=lambda self, values: {"lathe": 1.0}), 'names "lathe"'),
    ],
)
def test_terms_that_name_what_is_not_there_are_refused(fast, steps, term, message):
    with pytest.raises(SpecError, match=message):
        simulate_fast(fast, steps, 293.15, terms=(term,))
