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
from spindle_fem.inference.verdict import Judgement
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


class Found(SimpleNamespace):
    """A diagnosis, as far as it is looked at."""

    unchanged, null, explanations, notes = "of this machine", "of this fit", "of this heat", ()
    coarseness = 1.0


def suspected(item, value, **more):
    return WrongDirection(item, None, value, 20.0, -5.0, 1e-6, **more)


def diagnosis_of(item, value, verdict="consistent", gain=20.0, **more):
    """What a fit to first order says of a machine whose iron conducts TRUE."""
    fit = fit_of(item, value)
    judgement = Judgement(verdict, 0.5, SimpleNamespace(fit=fit), (), 0.0, "")
    calibrated = SimpleNamespace(fit=fit if more.get("by_calibration") else None)
    return Found(
        final=fit,
        suspected=suspected(item, value, **more),
        judgement=judgement,
        calibrated=calibrated,
        hypotheses=gain,
    )


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
    monkeypatch.setattr(
        redefined_machine, "log_odds", lambda one, other, prior, coarseness: one - other + prior
    )
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
    wrong = suspected(CONDUCTS, 0.9)
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

    first = seen(given)
    first.hypotheses, first.unchanged, first.null = 0.0, "as given", "fit as given"
    machine, found = with_definition_put_right(given, first, seen)
    values = [item.materials["cast_iron"].thermal_conductivity for item in machines_made]
    assert len(values) == redefined_machine.MOST_TIMES
    assert values == sorted(values)
    assert machine.spec is machines_made[-1]
    assert machine.given is given.spec
    value = defined_number(CONDUCTS, machine.spec, found.final.values[CONDUCTS.coordinate]).value
    assert value == pytest.approx(TRUE, rel=0.1)
    assert (found.unchanged, found.null) == ("as given", "fit as given")
    assert found.wrong is first.suspected
    assert found.judgement.verdict == "parameter"
    assert f"it says 22 W/(m·K), the recording {value:.3g} W/(m·K)" in found.judgement.reason


def test_a_wrong_definition_beside_physics_is_a_note(spec, machines_made):
    first = diagnosis_of(CONDUCTS, 0.9, "missing_physics", gain=0.0)
    _, found = with_definition_put_right(
        opened(spec), first, lambda machine: diagnosis_of(CONDUCTS, 0.0, "missing_physics")
    )
    assert found.judgement.verdict == "missing_physics"
    assert found.notes[0].startswith("The definition is off at key: it says")


def test_what_a_calibration_says_needs_no_odds(spec, machines_made):
    first = diagnosis_of(CONDUCTS, 0.9, by_calibration=True)
    again = diagnosis_of(CONDUCTS, 0.0, by_calibration=True)
    _, found = with_definition_put_right(opened(spec), first, lambda machine: again)
    assert found.judgement.verdict == "parameter"
    assert "the calibration" in found.judgement.reason


@pytest.mark.parametrize(("value", "gain"), [(0.0, 7.9), (-0.9, 20.0)])
def test_a_machine_stays_as_it_is_where_another_value_tells_no_more(spec, machines_made, value, gain):
    """By its odds, or as the machine made anew goes back to what was given."""
    given, first = opened(spec), diagnosis_of(CONDUCTS, 0.9, "missing_physics", gain=0.0)
    machine, found = with_definition_put_right(
        given, first, lambda machine: diagnosis_of(CONDUCTS, value, gain=gain)
    )
    assert machine is given
    assert found is first
    assert len(machines_made) == 1


def test_nothing_is_made_anew_where_nothing_is_suspected(spec, machines_made):
    nothing = diagnosis_of(CONDUCTS, 0.9)
    nothing.suspected = None
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
