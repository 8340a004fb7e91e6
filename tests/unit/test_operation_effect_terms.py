"""The one evaluator of effect terms: values, derivatives, and factors on one quantity, which multiply."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest

from spindle_fem.definition.effect_entries import EffectEntry
from spindle_fem.definition.load import load_machine
from spindle_fem.definition.network_load import validate_network_machine
from spindle_fem.effects.framework.term import Term, TermParameter
from spindle_fem.errors import SpecError
from spindle_fem.machine.view.build_view import view_of
from spindle_fem.machine.view.defined_point import at_the_defined_point
from spindle_fem.machine.view.machine_names import MachineNames
from spindle_fem.model.lumped.written_network import build_network
from spindle_fem.model.reduced.defined_effects import active_effects, effects_on, physics_of
from spindle_fem.model.reduced.network_inputs import fast_network
from spindle_fem.model.reduced.reduced_transient import simulate_fast
from spindle_fem.operation.effect_terms import Derivatives, EffectTerms, Instants
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.solvers.mesh_terms import FieldTerms, Physics
from spindle_fem.solvers.prepared_machine import prepare_machine
from tests.support.sample_terms import Closure, Fading, Feedback, Friction, LaterFriction
from tests.unit.test_reduced_network import MACHINE, written

ENTRIES = [
    EffectEntry(effect="natural_convection", component="housing", parameters={"convective_share": 0.8}),
    EffectEntry(effect="radiation", component="housing", parameters={"radiative_share": 1.5}),
]


class Follows(Term):
    """A factor that follows a temperature and a memory."""

    parameters = (TermParameter("size", 1.3),)
    n_states = 1

    def __init__(self, name, coefficients, reads, bearings=()):
        self.name, self.coefficients, self.reads, self.bearings = name, coefficients, reads, bearings

    def of(self, context, rows):
        size = context.parameters["size"] * (1.0 + 0.01 * (context.temperatures[0] - 295.0))
        return np.tile(size + 0.1 * context.state[0], (rows, 1))

    def factor(self, context):
        return self.of(context, len(self.coefficients))

    def friction(self, context):
        return self.of(context, len(self.bearings))

    def initial_state(self, parameters):
        return np.array([0.4])

    def advance(self, context, step):
        return context.state + step * 1e-4 * (context.temperatures - 295.0) * context.parameters["size"]


class Together(Term):
    """Two terms of one coefficient as a single term, whose factor is the product."""

    name = "together"

    def __init__(self, first, second):
        self.first, self.second = first, second
        self.coefficients, self.reads = first.coefficients, (*first.reads, *second.reads)
        assert first.coefficients == second.coefficients

    def factor(self, context):
        found = 1.0
        first = 0
        for term in (self.first, self.second):
            values = {
                name: np.full(context.temperatures.shape[-1], value, dtype=complex)
                for name, value in term.values({}).items()
            }
            rows = slice(first, first + len(term.reads))
            own = type(context)(
                context.time, context.inputs, context.temperatures[rows], context.state, values
            )
            found, first = found * term.factor(own), rows.stop
        return found


def pair(name="conductance"):
    return (
        Follows("first", (name, "other"), ("a", "b"), ("F1",)),
        Follows("second", ("third", name), ("b",), ("F2", "F1")),
    )


def asked(terms, values, sensed, states, derivatives=()):
    instants = Instants(np.array([3.0, 7.0]), {"speed": np.array([100.0, 200.0])})
    return EffectTerms(terms, values, derivatives).at(instants, sensed, states)


SENSED = np.array([[301.0, 296.0, 305.0], [299.0, 303.0, 294.0]])
STATES = np.array([[0.4, 0.7], [0.1, -0.2]])


def test_factors_on_one_quantity_multiply():
    answers = asked(pair(), {}, SENSED, STATES)
    names = EffectTerms(pair(), {}).coefficients
    assert names == ("conductance", "other", "third")
    first = 1.3 * (1.0 + 0.01 * (SENSED[:, 0] - 295.0)) + 0.1 * STATES[:, 0]
    second = 1.3 * (1.0 + 0.01 * (SENSED[:, 2] - 295.0)) + 0.1 * STATES[:, 1]
    expected = np.column_stack((first * second, first, second))
    assert answers.factor.value == pytest.approx(expected, rel=1e-14)
    assert answers.friction.value == pytest.approx(np.column_stack((first * second, second)), rel=1e-14)


def test_every_derivative_of_the_product_is_exact():
    names = ("second.size", "first.size", "machine")
    found = asked(pair(), {}, SENSED, STATES, names)

    def moved(sensed=SENSED, states=STATES, **values):
        answers = asked(pair(), {f"{k}.size": v for k, v in values.items()}, sensed, states)
        return np.hstack((answers.factor.value, answers.friction.value))

    step, columns = 1e-6, []
    for column in range(3):
        change = step * np.eye(3)[column]
        columns.append((moved(SENSED + change) - moved(SENSED - change)) / (2.0 * step))
    for column in range(2):
        change = step * np.eye(2)[column]
        columns.append((moved(states=STATES + change) - moved(states=STATES - change)) / (2.0 * step))
    for name in ("second", "first"):
        ends = [moved(**{name: 1.3 * np.exp(sign * step)}) for sign in (1.0, -1.0)]
        columns.append((ends[0] - ends[1]) / (2.0 * step))
    columns.append(np.zeros_like(columns[0]))
    by = np.concatenate((found.factor.by, found.friction.by), axis=1)
    assert by == pytest.approx(np.stack(columns, axis=2), rel=1e-7, abs=1e-9)


def test_one_instant_is_one_of_many_and_less_may_be_asked():
    terms = (Feedback(), Closure(), Fading(), Friction(), LaterFriction())
    names = tuple(name for term in terms for name in term.names())
    evaluator = EffectTerms(terms, {}, names)
    random = np.random.default_rng(2)
    sensed, states = (
        300.0 + random.normal(size=(4, evaluator.n_sensed)),
        np.full((4, evaluator.n_states), 0.7),
    )
    inputs = {"speed": np.array([0.0, 100.0, 200.0, 300.0]), "ambient": np.full(4, 293.0)}
    many = Instants(np.arange(4.0), inputs)
    whole = evaluator.at(many, sensed, states)
    for kind in (Derivatives.NONE, Derivatives.STATE):
        part = evaluator.at(many, sensed, states, kind)
        for name in ("heat", "friction", "factor"):
            one, other = getattr(part, name), getattr(whole, name)
            assert np.array_equal(one.value, other.value)
            assert np.array_equal(one.by, other.by[:, :, : one.by.shape[2]])
    assert part.heat.by.shape[2] == evaluator.n_sensed + evaluator.n_states
    for row in range(4):
        at = Instants(float(row), {name: float(values[row]) for name, values in inputs.items()})
        single = evaluator.at(at, sensed[[row]], states[[row]])
        for name in ("heat", "friction", "factor"):
            one, other = getattr(single, name), getattr(whole, name)
            assert one.value[0] == pytest.approx(other.value[row], rel=1e-14)
            assert one.by[0] == pytest.approx(other.by[row], rel=1e-13, abs=1e-16)


def test_a_term_that_scales_something_twice_is_refused():
    with pytest.raises(SpecError, match="coefficients twice"):
        EffectTerms((Follows("odd", ("same", "same"), ("a",)),), {})


# ------------------------------------------------------------------- the same on every model
def of_definition(terms):
    return [next(term for term in terms if name in term.name) for name in ("natural_convection", "radiation")]


def same_with_the_product(simulate, terms):
    """Two terms on one film are one term with the product, and more than either alone and than none."""
    first, second = terms
    both, product = simulate((first, second)), simulate((Together(first, second),))
    alone = [simulate(part) for part in ((), (first,), (second,))]
    assert np.abs(both - product).max() < 1e-9
    assert min(np.abs(both - other).max() for other in alone) > 1e-3


def test_two_effects_on_one_film_multiply_in_the_reduced_model(fast, spec, steps):
    names = replace(MachineNames.of(spec), place_names=fast.model.place_names)
    effects = active_effects(ENTRIES, view_of(names, at_the_defined_point(spec)))

    def simulate(terms):
        return simulate_fast(fast, steps, 293.15, terms=terms).temperature

    same_with_the_product(simulate, of_definition(effects.terms))


def test_two_effects_on_one_link_multiply_in_a_written_network(tmp_path):
    network = fast_network(build_network(validate_network_machine(tomllib.loads(MACHINE), "test").network))
    recording = written(tmp_path)
    entries = [entry.model_copy(update={"component": "body|ambient"}) for entry in ENTRIES]
    terms = of_definition(effects_on(entries, network, recording).terms)
    drive = network.inputs.drive(recording)

    def simulate(terms):
        return simulate_fast(network, drive, 297.0, terms=terms).temperature

    same_with_the_product(simulate, terms)


def test_two_effects_on_one_film_multiply_in_the_finite_element_model():
    spec = load_machine("recorded_spindle", ["mesh.preset=coarse", "mesh.order=1"])
    machine = prepare_machine(spec.model_copy(update={"effects": tuple(ENTRIES)}))
    physics = physics_of(machine)
    point = OperatingPoint.of(spec)
    lumped = tuple(f"{bearing.name}.balls" for _, bearing in spec.bearings)
    temperature = np.full(machine.operators.n_unknowns, 318.0)

    def factors(terms):
        own = FieldTerms(machine, lumped, Physics(tuple(terms)))
        return own.steady(point, temperature, np.full(len(lumped), 318.0)).coefficients

    both = factors(physics.terms)
    first, second = (factors((term,)) for term in physics.terms)
    assert set(both) == set(first) == set(second)
    for name, value in both.items():
        assert value == pytest.approx(first[name] * second[name], rel=1e-12)
        assert first[name] > 1.05
        assert second[name] > 1.05
