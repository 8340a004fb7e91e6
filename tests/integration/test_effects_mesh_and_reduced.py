"""Effects of the catalogue in the finite-element model: against the fast model, and in the steady state."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from spindle_fem.effects.catalogue.coolant_film import TransitionTerm
from spindle_fem.effects.catalogue.heat_capacity import ContactCapacityTerm
from spindle_fem.effects.catalogue.thermal_preload import PreloadMechanicsTerm, ThermalPreloadTerm
from spindle_fem.effects.framework.laws import amplitude
from spindle_fem.effects.framework.machine_view import ChannelFlow
from spindle_fem.effects.framework.spread import Spread
from spindle_fem.effects.framework.term import Term, TermParameter
from spindle_fem.effects.framework.unrecorded import InIntervals, UnrecordedHeatTerm
from spindle_fem.errors import SpecError
from spindle_fem.model.mesh.equations import assemble_capacity
from spindle_fem.model.reduced.drive import STANDARD, make_drive
from spindle_fem.model.reduced.reduced_transient import simulate_fast
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.physics.coolant.channel_section import ChannelSection
from spindle_fem.recordings.input_samples import InputHistory
from spindle_fem.solvers.coupled_steady import solve_coupled
from spindle_fem.solvers.machine_transient import TransientOptions, simulate_full
from spindle_fem.solvers.mesh_terms import Physics, steady_physics, with_capacity, with_factors
from spindle_fem.solvers.readings import ReadingRows
from tests.support.set_response import set_response

RPM = np.pi / 30.0
HOUR = 3600.0
LITRE_PER_MINUTE = 1e-3 / 60.0


@pytest.fixture(scope="module")
def machine(small):
    return small


@pytest.fixture(scope="module")
def fast(small_fast):
    return small_fast


def preload():
    bearings = ("F1", "F2", "F3")
    sides = (tuple(f"{name}.{side}_ring" for name in bearings) for side in ("inner", "outer"))
    return ThermalPreloadTerm("preload", bearings, *sides)


def mechanics():
    bearings = ("R1", "R2")
    sides = (tuple(f"{name}.{side}_ring" for name in bearings) for side in ("inner", "outer"))
    return PreloadMechanicsTerm("mechanics", *sides, set_response(bearings))


def of_size(term, size, **others):
    """A term whose effect has a size, with other parameters."""
    named = {f"{term.name}.{name}": value for name, value in others.items()}
    return Physics((term,), {f"{term.name}.{term.parameters[0].name}": size} | named)


def transition(machine):
    channel = machine.spec.channel
    section = ChannelSection(
        channel.inner_radius, channel.depth, channel.width, channel.pitch, channel.turns, channel.starts
    )
    area = channel.depth * channel.width * channel.starts
    flow = ChannelFlow(machine.spec.coolant.fluid, section.hydraulic_diameter, area)
    low, high = (flow.reynolds_number(litres * LITRE_PER_MINUTE, 290.15) for litres in (12.0, 24.0))
    return TransitionTerm("transition", flow, (low, high))


def inputs_over(times, **changed):
    flow = np.where(times < 0.4 * HOUR, 12.0, 24.0) * LITRE_PER_MINUTE
    columns = {
        "speed": np.where(times < 0.75 * HOUR, 3000.0, 1500.0) * RPM,
        "thrust": 1750.0,
        "ambient": 293.15 + np.sin(times / 3000.0),
        "coolant_inlet": 290.15,
        "coolant_flow": flow,
    } | changed
    values = np.column_stack([np.broadcast_to(columns[name], times.shape) for name in STANDARD])
    return values, np.array([True, True, False, False, True])


def by_full_model(machine, times, physics):
    values, held = inputs_over(times)
    inputs = InputHistory(times, STANDARD, values, held)
    return simulate_full(machine, inputs, options=TransientOptions(error=0.005), physics=physics)


def by_fast_model(fast, times, physics):
    values, held = inputs_over(times)
    # A step over a jump of the speed is of first order where friction feeds back: 10 s leave 0.025 K,
    # 2 s 0.003 K.
    drive = make_drive(times, STANDARD, values, held, largest_step=2.0)
    given = {**physics.values, **physics.factors}
    return simulate_fast(fast, drive, 293.15, terms=physics.terms, parameters=given).temperature


TIMES = np.arange(0.0, HOUR + 1.0, 30.0)


@pytest.mark.slow
def test_catalogue_terms_agree_with_the_fast_model_at_every_probe(machine, fast):
    place = Spread(("housing.front_body",), ("up.housing.front_body", "across.housing.front_body"))
    on = InIntervals([(0.2 * HOUR, 0.5 * HOUR), (0.6 * HOUR, 0.9 * HOUR)])
    source = UnrecordedHeatTerm("source", amplitude("heat", 60.0, "W"), place, on)
    each = {
        "preload": of_size(preload(), 0.4),
        "mechanics": of_size(mechanics(), 1.0),
        "source": of_size(source, 80.0, lag=60.0, up=0.5, across=-0.3),
        "transition": of_size(transition(machine), 2.0),
    }
    without = by_fast_model(fast, TIMES, Physics())
    for name, physics in each.items():
        assert np.abs(by_fast_model(fast, TIMES, physics) - without).max() > 0.3, name
    terms = tuple(term for physics in each.values() for term in physics.terms)
    values = {name: value for physics in each.values() for name, value in physics.values.items()}
    together = Physics(terms, values)
    full = by_full_model(machine, TIMES, together)
    assert np.abs(full.readings - by_fast_model(fast, TIMES, together)).max() < 0.05
    assert full.energy.imbalance_relative < 1e-8


class Everything(Term):
    """Every way in which a term can act, each large enough to see."""

    name = "everything"
    parameters = (TermParameter("strength", 1.0, 1.0, logarithmic=False),)
    heat_places = ("fluid.housing.outside", "fluid.coolant_inlet", "R1.balls")
    reads = ("housing",)

    def __init__(self, joint, gap):
        self.coefficients = (
            joint,
            gap,
            "film.housing.flange_back",
            "balls.R1.outer",
            "conductivity.steel_42CrMo4",
        )
        self.bearings = ("R1", "R2")

    def heat(self, context):
        one = np.ones(context.temperatures.shape[-1], dtype=complex)
        strength = context.parameters["strength"]
        return np.array([4.0 * one, 1.5 * np.sin(context.time / 900.0) * one, 20.0 * one]) * strength

    def factor(self, context):
        warm = 0.02 * (context.temperatures[0] - 293.15) * context.parameters["strength"]
        return np.array([0.5 + warm, 2.0 + warm, 3.0 + warm, 0.6 + warm, 0.9 + 0.0 * warm])

    def friction(self, context):
        return np.full((2, context.temperatures.shape[-1]), 1.4 + 0.0j)

    def operating_factor(self, point, parameters):
        return {"coolant.flow": 0.8, "channel.film": 1.3, "joint." + self.coefficients[0][6:]: 1.2}

    def place_capacity(self, parameters):
        return {"R1.balls": 20.0}

    def place_conductance(self, parameters):
        return {"shaft": 3.0}


def everything(machine):
    joint = next(n for n in machine.mesh.joints if "housing" in n and "R1.outer_ring" in n)
    return Everything(f"joint.{joint}", f"gap.{machine.spec.gap[0].name}")


@pytest.mark.slow
def test_every_way_of_acting_agrees_with_the_fast_model(machine, fast):
    times = TIMES[: len(TIMES) // 2]
    factors = {"heat.front": 1.2, "heat.inner_share": 0.9, "coolant.film_factor": 0.7}
    physics = Physics((everything(machine),), {}, factors)
    without = by_fast_model(fast, times, Physics())
    quick = by_fast_model(fast, times, physics)
    full = by_full_model(machine, times, physics).readings
    assert np.all(np.abs(quick - without).max(axis=0) > 0.2)
    assert np.abs(full - quick).max() < 0.05


def test_added_mass_adds_exactly_its_capacity(machine):
    storage = assemble_capacity(machine.problem(machine.builder.at(*uniform_point(machine))[0]))[0]
    ones = np.ones(storage.shape[0])
    inside = machine.operators.mesh.points[: len(ones), 2] < 0.1
    scale = with_capacity(storage, ones, inside, 5000.0)
    scale = with_capacity(storage, scale, ~inside, 700.0)
    root = np.sqrt(scale)
    assert root @ (storage @ root) == pytest.approx(ones @ (storage @ ones) + 5700.0, rel=1e-12)
    assert np.ptp(scale[inside]) == 0.0
    assert scale.min() >= 1.0


def test_a_mass_behind_a_contact_is_right_in_steps_much_longer_than_its_lag(machine):
    times = np.arange(0.0, 1.5 * HOUR, 60.0)
    inputs = InputHistory(times, STANDARD, *inputs_over(times, speed=3000.0 * RPM, ambient=293.15))
    mass = of_size(ContactCapacityTerm("mass", ("housing",), 1.0), 2.0e4, contact_time=120.0)

    def delay(error):
        options = TransientOptions(error=error, error_norm="mean")
        without = simulate_full(machine, inputs, options=options)
        run = simulate_full(machine, inputs, options=options, physics=mass)
        return without.reading("SP01") - run.reading("SP01"), np.diff(run.steps.times).max()

    expected, _ = delay(0.01)
    found, longest = delay(0.2)
    assert longest > 5.0 * 120.0
    assert expected.max() > 0.2
    assert np.abs(found - expected).max() < 0.2 * expected.max()


def uniform_point(machine):
    point = OperatingPoint.of(machine.spec)
    field = np.full(machine.operators.n_unknowns, point.ambient_temperature)
    return point, machine.field_state(field, {})


def test_the_steady_state_is_where_the_transient_ends(machine, fast):
    physics = replace(of_size(preload(), 0.1), factors={"coolant.film_factor": 0.7})
    point = OperatingPoint.of(machine.spec)
    changed, rest = with_factors(machine, physics)
    steady = solve_coupled(changed, point, beyond=steady_physics(changed, rest))
    times = np.linspace(0.0, 400.0 * HOUR, 4001)
    columns = {"speed": point.speed, "thrust": point.thrust, "ambient": point.ambient_temperature}
    columns |= {"coolant_inlet": point.coolant_inlet_temperature, "coolant_flow": point.coolant_flow}
    values, held = inputs_over(times, **columns)
    drive = make_drive(times, STANDARD, values, held, largest_step=360.0)
    given = {**physics.values, **physics.factors}
    run = simulate_fast(fast, drive, point.ambient_temperature, terms=physics.terms, parameters=given)
    rows = ReadingRows.of(machine, steady.solution.problem.lumped_names)
    unknowns = np.concatenate((steady.solution.temperature, steady.solution.lumped_temperature))
    readings = (rows.rows @ unknowns)[: len(fast.model.probe_names)]
    expected = run.temperature[-1, [fast.channels.index(name) for name in fast.model.probe_names]]
    np.testing.assert_allclose(readings, expected, atol=0.02)
    plain = solve_coupled(machine, point).solution
    assert np.abs(rows.rows @ np.concatenate((plain.temperature, plain.lumped_temperature)))[0] > 0.0
    assert np.abs(plain.temperature - steady.solution.temperature).max() > 1.0


def test_places_and_coefficients_that_do_not_exist_are_refused(machine):
    inputs = InputHistory(TIMES, STANDARD, *inputs_over(TIMES))
    for change, message in (
        ({"reads": ("housinh",)}, 'reads "housinh".*housing'),
        ({"heat_places": ("fluid.nowhere",)}, r'puts heat into "fluid\.nowhere"'),
        ({"coefficients": ("joint.nowhere",)}, r'scales "joint\.nowhere"'),
        ({"bearings": ("F9",)}, 'scales the friction of "F9"'),
    ):
        term = Term()
        term.name = "odd"
        for name, value in change.items():
            setattr(term, name, value)
        with pytest.raises(SpecError, match=message):
            simulate_full(machine, inputs, physics=Physics((term,)))
    with pytest.raises(SpecError, match="same name"):
        simulate_full(machine, inputs, physics=Physics((preload(), preload())))
    with pytest.raises(SpecError, match=r"heat\.fromt"):
        simulate_full(machine, inputs, physics=Physics((), {}, {"heat.fromt": 1.1}))


@pytest.mark.slow
def test_what_terms_remember_goes_on_into_a_second_run(machine):
    times, middle = np.arange(0.0, 301.0, 30.0), 5
    values, held = inputs_over(times)
    # Both runs choose their own steps: of these much less may be left than of what was remembered.
    physics, options = of_size(preload(), 1.5), TransientOptions(error=0.005)

    def run(part, **more):
        history = InputHistory(times[part], STANDARD, values[part], held)
        return simulate_full(machine, history, options=options, physics=physics, **more)

    whole, first = run(slice(None)), run(slice(None, middle + 1))
    second = run(slice(middle, None), start=first.state, memory=first.memory)
    forgetful = run(slice(middle, None), start=first.state)
    assert np.abs(second.readings[-1] - whole.readings[-1]).max() < 1e-3
    assert np.abs(forgetful.readings[-1] - whole.readings[-1]).max() > 1e-2
    with pytest.raises(SpecError, match="These terms remember 1"):
        run(slice(middle, None), start=first.state, memory=np.zeros(3))
