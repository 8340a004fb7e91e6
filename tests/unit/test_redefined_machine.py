"""A wrong definition is put right: the number that its recordings show, by machines made anew."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from spindle_fem.definition.load import load_machine
from spindle_fem.definition.tolerances import TolerancedLength
from spindle_fem.effects.framework.effect import Reported
from spindle_fem.errors import SpecError
from spindle_fem.inference import redefined_machine, wrong_definition
from spindle_fem.inference.belief import THETA_BOUND, Belief, Coordinate
from spindle_fem.inference.freed_priors import TIMES_OFF, WIDER, without_prior
from spindle_fem.inference.heat_misdescriptions import Conductivity, SpeedShape, with_material
from spindle_fem.inference.misdescription import Misdescription
from spindle_fem.inference.opened_machine import DiagnosedMachine
from spindle_fem.inference.redefined_machine import with_definition_put_right
from spindle_fem.inference.structural_misdescriptions import MaterialCapacity, StructuralChange
from spindle_fem.inference.uncertain_numbers import uncertain_numbers
from spindle_fem.inference.verdict import Judgement
from spindle_fem.inference.wrong_definition import (
    Redefined,
    WrongDirection,
    defined_number,
    departure,
    is_beyond_prior,
    known_of,
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


def fit_at(values, width=0.02):
    names = list(values)

    def interval(name, times, sigmas):
        half = times * width * sigmas[names.index(name)]
        return values[name] - half, values[name] + half

    coordinates = [SimpleNamespace(name=name) for name in names]
    sigmas = np.ones(len(names))
    return SimpleNamespace(values=values, coordinates=coordinates, stated_sigmas=sigmas, interval=interval)


def fit_of(item, value, width=0.02):
    return fit_at({item.coordinate: value}, width)


class Found(SimpleNamespace):
    """A diagnosis, as far as it is looked at."""

    unchanged, null, explanations, notes = "of this machine", "of this fit", "of this heat", ()
    coarseness, predictor = 1.0, SimpleNamespace(misdescribed=())


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


def settled(*told, **more):
    """As it says of a machine in whose definition it suspects nothing else."""
    found = diagnosis_of(*told, **more)
    found.suspected = None
    return found


@pytest.fixture
def machines_made(monkeypatch):
    made = []

    def with_definition(machine, spec, progress):
        made.append(spec)
        return replace(machine, spec=spec)

    def changed(item, **values):
        return (
            replace(item, **values)
            if isinstance(item, DiagnosedMachine | WrongDirection)
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
    machine = replace(opened(conducting(spec, 40.0)), redefined=Redefined(given, ()))
    assert departure(CONDUCTS, machine, np.log(1.25)) == pytest.approx(np.log(2.5))
    assert CONDUCTS.told(np.log(2.5)) == pytest.approx(1.5)
    deeper = replace(opened(DEEPER.change.redefined(spec, 3.0)), redefined=Redefined(spec, ()))
    assert departure(DEEPER, deeper, -0.5) == pytest.approx(2.5)


MOUNT = next(i for i in uncertain_numbers(load_machine("recorded_spindle")) if i.name == "film.flange_back")


def test_the_interval_that_is_stated_is_the_one_that_is_judged(spec):
    machine = opened(spec)
    for width, beyond in ((0.05, True), (0.07, False)):
        assert is_beyond_prior(suspected(CONDUCTS, 0.3), machine, fit_of(CONDUCTS, 0.3, width)) == beyond


def test_a_value_with_a_prior_is_a_number_of_the_definition_in_the_logarithm_of_its_factor(spec):
    assert MOUNT.key == "film.flange_back.coefficient"
    assert MOUNT.coordinate == MOUNT.name
    assert defined_number(MOUNT, spec) == Reported(200.0, "W/(m²·K)")
    softer = MOUNT.change.redefined(spec, np.log(0.1))
    assert defined_number(MOUNT, softer).value == pytest.approx(20.0)
    machine = replace(opened(softer), redefined=Redefined(spec, ()))
    assert departure(MOUNT, machine, np.log(0.5)) == pytest.approx(np.log(0.05))
    # half as much again is within what the prior leaves open, a tenth of it is not
    wrong = suspected(MOUNT, np.log(0.1))
    assert not is_beyond_prior(wrong, opened(spec), fit_of(MOUNT, 1.5))
    assert is_beyond_prior(wrong, opened(spec), fit_of(MOUNT, 0.1))


def test_a_common_factor_is_told_by_the_first_value_that_it_multiplies(spec):
    both = next(i for i in uncertain_numbers(spec) if i.name == "ball_conductance")
    assert both.key == "bearing_set.front.ball_row.conductance, bearing_set.rear.ball_row.conductance"
    changed = both.change.redefined(spec, np.log(2.0))
    assert both.change.quantity(changed) == Reported(8.0, "W/K")
    assert [group.ball_row.conductance.value for group in changed.bearing_set] == pytest.approx([8.0, 6.0])


def test_what_was_put_right_stays_open_as_widely_as_a_wrong_definition(spec, monkeypatch):
    share = next(i for i in uncertain_numbers(spec) if i.name == "heat.inner_share")
    belief = Belief.prior(
        [
            Coordinate(MOUNT.coordinate, 1.0, 0.5, True, -THETA_BOUND, THETA_BOUND),
            Coordinate(share.coordinate, 1.0, 0.1, True, -THETA_BOUND, 2.2),
            Coordinate(CONDUCTS.coordinate, 0.0, 0.05, False, -THETA_BOUND, THETA_BOUND),
        ]
    )
    monkeypatch.setattr(wrong_definition, "known_before", lambda predictor: belief)
    assert known_of(None, None) is belief
    for row, (item, value, mean) in enumerate(
        (
            (MOUNT, np.log(0.1), np.log(10.0) / 0.5),
            (share, 0.0, 0.0),
            (CONDUCTS, np.log(2.0), -np.log(2.0) / 0.05),
        )
    ):
        tried = SimpleNamespace(fast=SimpleNamespace(spec=item.change.redefined(spec, value)))
        opened = known_of(tried, Redefined(spec, (suspected(item, 0.9),)))
        widths = np.sqrt(np.diag(np.linalg.inv(opened.root.T @ opened.root)))
        assert widths[row] == pytest.approx(np.log(TIMES_OFF) / 0.5 if item is MOUNT else WIDER, rel=0.03)
        assert np.delete(widths, row) == pytest.approx(1.0)
        # what is left of the prior is about the given value; a fit begins at the one that is tried
        assert opened.mean[row] == pytest.approx(mean)
        assert not opened.start.any()
    # a share has its own bound
    bounds = [without_prior(belief, row).coordinates[row] for row in range(3)]
    assert (bounds[1].low, bounds[1].high) == (-WIDER * THETA_BOUND, 2.2)
    assert bounds[0].at(bounds[0].high) == pytest.approx(TIMES_OFF**THETA_BOUND)
    assert bounds[2].high == WIDER * THETA_BOUND


def test_a_machine_is_made_anew_until_its_recordings_ask_for_no_other_value(spec, machines_made):
    given = opened(conducting(spec, 22.0))

    def seen(machine):
        # far off, what a fit to first order asks for is half of what is needed
        own = machine.spec.materials["cast_iron"].thermal_conductivity
        return (diagnosis_of if machine is given else settled)(CONDUCTS, 0.5 * np.log(TRUE / own))

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
    assert found.wrong == (first.suspected,)
    assert found.judgement.verdict == "parameter"
    assert f"it says 22 W/(m·K), the recording {value:.3g} W/(m·K)" in found.judgement.reason


@pytest.mark.parametrize("capacity", [900.0, 500.0])
def test_another_material_has_another_heat_capacity_too(spec, machines_made, capacity):
    """Both are open once one of them is suspected; what turns out as the definition has it is not told."""
    holds = Misdescription("heat", "capacity", "", 0.02, "", MaterialCapacity("heat", material="cast_iron"))
    other = Misdescription("steel", "capacity", "", 0.02, "", MaterialCapacity("steel", material="steel"))
    given = opened(
        with_material(conducting(spec, 150.0), "cast_iron", "specific_heat_capacity", capacity / 500.0)
    )

    def seen(machine):
        own = machine.spec.materials["cast_iron"]
        off, short = np.log(TRUE / own.thermal_conductivity), 500.0 / own.specific_heat_capacity - 1.0
        if machine.redefined is None:
            # as long as its prior holds the capacity the conductivity stands for it
            off, short = off + 0.3 * short, 0.0
        values = {CONDUCTS.coordinate: off, holds.coordinate: short}
        fit = fit_at(values)
        found = (diagnosis_of if machine is given else settled)(CONDUCTS, off, by_calibration=True)
        found.final, found.calibrated = fit, SimpleNamespace(fit=fit)
        found.judgement = replace_chosen(found.judgement, fit)
        found.predictor = SimpleNamespace(misdescribed=(CONDUCTS, holds, other))
        return found

    machine, found = with_definition_put_right(given, seen(given), seen)
    assert [item.direction for item in machine.redefined.wrong] == [CONDUCTS, holds]
    assert [item.direction for item in found.wrong] == [CONDUCTS, holds][: 2 if capacity == 900.0 else 1]
    # either counts from the definition as given, told or not
    off = [np.log(TRUE / 150.0) / CONDUCTS.sigma, np.log(500.0 / capacity) / holds.sigma]
    assert [found.put_right[item.coordinate] for item in (CONDUCTS, holds)] == pytest.approx(off, abs=1.0)
    own = machine.spec.materials["cast_iron"]
    assert own.thermal_conductivity == pytest.approx(TRUE, rel=0.05)
    assert own.specific_heat_capacity == pytest.approx(500.0, rel=0.05)
    assert "key: it says 150 W/(m·K)" in found.judgement.reason
    assert ("and at capacity: it says 900 J/(kg·K)" in found.judgement.reason) == (capacity == 900.0)


def test_a_second_number_is_followed_beside_the_first(spec, machines_made):
    """What the first stood for in part is settled once the second is followed too."""
    coefficient = MOUNT.change.quantity(spec).value
    given = opened(MOUNT.change.redefined(conducting(spec, 150.0), np.log(0.1)))

    def seen(machine):
        known = [] if machine.redefined is None else machine.redefined.wrong
        short = coefficient / MOUNT.change.quantity(machine.spec).value
        off = np.log(TRUE / machine.spec.materials["cast_iron"].thermal_conductivity)
        # until the mount is followed the conductivity goes too far
        off += 0.1 * np.log(short) if len(known) < 2 else 0.0
        values = {CONDUCTS.coordinate: off, MOUNT.coordinate: short}
        fit = fit_at(values)
        found = (settled if len(known) == 2 else diagnosis_of)(CONDUCTS, off, by_calibration=True)
        found.final, found.calibrated = fit, SimpleNamespace(fit=fit)
        found.judgement = replace_chosen(found.judgement, fit)
        if len(known) == 1:
            found.suspected = suspected(MOUNT, np.log(short), by_calibration=True)
        return found

    machine, found = with_definition_put_right(given, seen(given), seen)
    assert [item.direction for item in found.wrong] == [CONDUCTS, MOUNT]
    assert machine.spec.materials["cast_iron"].thermal_conductivity == pytest.approx(TRUE, rel=0.05)
    assert MOUNT.change.quantity(machine.spec).value == pytest.approx(coefficient, rel=0.05)
    assert f"and at {MOUNT.key}: it says {coefficient / 10.0:.3g} W/(m²·K)" in found.judgement.reason


def replace_chosen(judgement, fit):
    return replace(judgement, chosen=SimpleNamespace(fit=fit))


def test_a_wrong_definition_beside_physics_leaves_the_verdict(spec, machines_made):
    first = diagnosis_of(CONDUCTS, 0.9, "missing_physics", gain=0.0)
    _, found = with_definition_put_right(
        opened(spec), first, lambda machine: settled(CONDUCTS, 0.0, "missing_physics")
    )
    assert found.judgement.verdict == "missing_physics"
    assert found.wrong == (first.suspected,)


@pytest.mark.parametrize(("by", "words"), [("calibration", "the calibration"), ("interval", "the recording")])
def test_what_a_calibration_or_an_interval_says_needs_no_odds(spec, machines_made, by, words):
    first = diagnosis_of(CONDUCTS, 0.9, **{f"by_{by}": True})
    again = settled(CONDUCTS, 0.0, **{f"by_{by}": True})
    _, found = with_definition_put_right(opened(spec), first, lambda machine: again)
    assert found.judgement.verdict == "parameter"
    assert words in found.judgement.reason


@pytest.mark.parametrize(("value", "gain"), [(0.0, 7.9), (-0.9, 20.0)])
def test_a_machine_stays_as_it_is_where_another_value_tells_no_more(spec, machines_made, value, gain):
    """By its odds, or as the machine made anew goes back to what was given."""
    given, first = opened(spec), diagnosis_of(CONDUCTS, 0.9, "missing_physics", gain=0.0)
    machine, found = with_definition_put_right(
        given, first, lambda machine: settled(CONDUCTS, value, gain=gain)
    )
    assert machine is given
    assert found is first
    assert len(machines_made) == 1


def test_nothing_is_made_anew_where_nothing_is_suspected(spec, machines_made):
    nothing = diagnosis_of(CONDUCTS, 0.9)
    nothing.suspected = None
    assert with_definition_put_right(opened(spec), nothing, None)[1] is nothing
    assert not machines_made


def test_what_is_foreseen_too_far_is_tried_nearer(spec, monkeypatch, machines_made):
    """9 mm deeper goes through the wall, half as much does not."""
    within = redefined_machine.with_definition

    def with_definition(machine, changed, progress):
        if changed.channel.depth > spec.channel.depth + 5e-3:
            raise SpecError("channel.depth", "deeper than the wall.", "Allowed: less.")
        return within(machine, changed, progress)

    monkeypatch.setattr(redefined_machine, "with_definition", with_definition)
    machine, found = with_definition_put_right(
        opened(spec), diagnosis_of(DEEPER, 9.0, by_calibration=True), lambda machine: settled(DEEPER, 0.0)
    )
    assert machine.spec.channel.depth == pytest.approx(spec.channel.depth + 4.5e-3)
    assert found.judgement.verdict == "parameter"


def test_a_machine_that_cannot_be_made_anew_is_said_so(spec, machines_made):
    def refused(machine):
        raise SpecError("channel.depth", "deeper than the wall.", "Allowed: less.")

    first = diagnosis_of(DEEPER, 9.0)
    machine, found = with_definition_put_right(opened(spec), first, refused)
    assert machine.spec is spec
    assert "channel.depth" in found.notes[0]
    assert found.final is first.final
