"""A wrong definition is put right: the number that its recordings show, by machines made anew."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from spindle_fem.definition.load import load_machine
from spindle_fem.definition.tolerances import TolerancedLength
from spindle_fem.errors import SpecError
from spindle_fem.inference import redefined_machine
from spindle_fem.inference.heat_misdescriptions import Conductivity, SpeedShape
from spindle_fem.inference.misdescription import Misdescription
from spindle_fem.inference.opened_machine import DiagnosedMachine
from spindle_fem.inference.redefined_machine import with_definition_put_right
from spindle_fem.inference.structural_misdescriptions import StructuralChange
from spindle_fem.inference.wrong_definition import (
    WIDER,
    Redefined,
    WrongDirection,
    defined_number,
    departure,
    open_directions,
)

CONDUCTS = Misdescription("iron", "key", "", 0.05, "", Conductivity("cast_iron"))
DEEPER = Misdescription(
    "depth", "channel.depth", "mm", 1.0, "", StructuralChange("depth", 1e-3, (("depth", 1.0),))
)
TRUE = 50.0  # W/(m·K), as the machine conducts that all recordings here are of


@pytest.fixture(scope="module")
def spec():
    return load_machine("recorded_spindle")


def conducting(spec, value):
    own = spec.materials["cast_iron"].model_copy(update={"thermal_conductivity": value})
    return spec.model_copy(update={"materials": {**spec.materials, "cast_iron": own}})


def opened(spec):
    return DiagnosedMachine("one", spec, None, None, None, (), ())


def fit_of(item, value, width=0.02):
    return SimpleNamespace(
        values={item.coordinate: value},
        stated_sigmas=None,
        interval=lambda name, times, sigmas: (value - times * width, value + times * width),
    )


def diagnosis_of(item, value, verdict="parameter", candidates=()):
    """What a fit to first order says of a machine whose iron conducts TRUE."""

    return SimpleDiagnosis(
        final=fit_of(item, value),
        wrong=WrongDirection(item, None, 20.0, 1e-6, within="as given"),
        judgement=SimpleNamespace(
            verdict=verdict, chosen=SimpleNamespace(fit=SimpleNamespace(candidates=candidates))
        ),
    )


class SimpleDiagnosis(SimpleNamespace):
    """With what :func:`dataclasses.replace` needs."""

    unchanged, null, explanations, notes = "of this machine", "of this fit", "of this heat", ()


@pytest.fixture
def machines_made(monkeypatch):
    made = []

    def with_definition(machine, spec, progress):
        made.append(spec)
        return replace(machine, spec=spec)

    def changed(item, **values):
        return (
            replace(item, **values)
            if isinstance(item, DiagnosedMachine)
            else type(item)(**{**vars(item), **values})
        )

    monkeypatch.setattr(redefined_machine, "with_definition", with_definition)
    monkeypatch.setattr(redefined_machine, "replace", changed)
    return made


def test_a_number_of_a_definition_is_changed_to_what_a_direction_says(spec):
    own = spec.materials["cast_iron"].thermal_conductivity
    assert defined_number(CONDUCTS, spec).value == own
    assert defined_number(CONDUCTS, spec, np.log(2.0)).value == pytest.approx(2.0 * own)
    depth = defined_number(DEEPER, spec).value
    assert depth == pytest.approx(1e3 * spec.channel.depth)
    measured = spec.model_copy(
        update={"channel": spec.channel.model_copy(update={"depth": TolerancedLength(0.01, 1e-5)})}
    )
    deeper = DEEPER.change.redefined(measured, 2.0)
    assert deeper.channel.depth == pytest.approx(0.012)
    assert deeper.channel.depth.sigma == 1e-5
    # a shape over speed is many numbers of a table
    assert defined_number(replace(CONDUCTS, change=SpeedShape(("F1",), (0.0, 1.0), (1.0, 1.0))), spec) is None


def test_how_far_a_machine_is_from_its_definition_counts_from_the_given_one(spec):
    given = conducting(spec, 20.0)
    machine = replace(opened(conducting(spec, 40.0)), redefined=Redefined(given, None))
    assert departure(CONDUCTS, machine, np.log(1.25)) == pytest.approx(1.5)
    deeper = replace(opened(DEEPER.change.redefined(spec, 3.0)), redefined=Redefined(spec, None))
    assert departure(DEEPER, deeper, -0.5) == pytest.approx(2.5)


def test_what_was_put_right_stays_open_as_widely_as_a_wrong_definition(spec):
    wrong = WrongDirection(CONDUCTS, None, 20.0, 1e-6)
    wider, other = open_directions((CONDUCTS, DEEPER), Redefined(spec, wrong))
    assert wider.sigma == pytest.approx(WIDER * CONDUCTS.sigma)
    assert other is DEEPER
    assert open_directions((CONDUCTS, DEEPER), None) == (CONDUCTS, DEEPER)


def test_a_machine_is_made_anew_until_its_recordings_ask_for_no_other_value(spec, machines_made):
    given = opened(conducting(spec, 22.0))

    def seen(machine):
        # far off, what a fit to first order asks for is half of what is needed
        own = machine.spec.materials["cast_iron"].thermal_conductivity
        return diagnosis_of(CONDUCTS, 0.5 * np.log(TRUE / own))

    machine, found = with_definition_put_right(given, seen(given), seen)
    values = [item.materials["cast_iron"].thermal_conductivity for item in machines_made]
    assert len(values) == redefined_machine.MOST_TIMES
    assert values == sorted(values)
    assert machine.spec is machines_made[-1]
    assert machine.given is given.spec
    assert defined_number(
        CONDUCTS, machine.spec, found.final.values[CONDUCTS.coordinate]
    ).value == pytest.approx(TRUE, rel=0.1)
    assert (found.unchanged, found.null) == ("of this machine", "as given")


@pytest.mark.parametrize(("verdict", "candidates"), [("consistent", ()), ("missing_physics", ("heat",))])
def test_a_machine_stays_as_it_is_where_another_value_is_not_what_is_wrong(
    spec, machines_made, verdict, candidates
):
    given, first = opened(spec), diagnosis_of(CONDUCTS, 0.9, "missing_physics", ("heat",))
    machine, found = with_definition_put_right(
        given, first, lambda machine: diagnosis_of(CONDUCTS, 0.0, verdict, candidates)
    )
    assert machine is given
    assert found is first
    assert len(machines_made) == 1


def test_nothing_is_made_anew_within_a_prior_or_where_no_key_has_a_number(spec, machines_made):
    shape = replace(CONDUCTS, change=SpeedShape(("F1",), (0.0, 1.0), (1.0, 1.0)))
    for item, value in ((CONDUCTS, 0.1), (shape, 0.9)):
        first = diagnosis_of(item, value)
        assert with_definition_put_right(opened(spec), first, None)[1] is first
    nothing = diagnosis_of(CONDUCTS, 0.9)
    nothing.wrong = None
    assert with_definition_put_right(opened(spec), nothing, None)[1] is nothing
    assert not machines_made


def test_a_machine_that_cannot_be_made_anew_is_said_so(spec, machines_made):
    def refused(machine):
        raise SpecError("channel.depth", "deeper than the wall.", "Allowed: less.")

    first = diagnosis_of(DEEPER, 9.0)
    machine, found = with_definition_put_right(opened(spec), first, refused)
    assert machine.spec is spec
    assert "channel.depth" in found.notes[0]
    assert found.final is first.final
