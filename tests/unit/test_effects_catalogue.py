"""Every effect of the catalogue on a lumped spindle and a small network."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scripts import effects_page
from spindle_fem.effects import catalogue as effects
from spindle_fem.effects import registry
from spindle_fem.effects.framework.card import GROUPS
from spindle_fem.effects.framework.term import TermContext
from spindle_fem.effects.registry import (
    build,
    candidates_for,
    catalogue,
    definition_entry,
    effect_of,
    fixed,
    interval_effects,
)
from spindle_fem.errors import SpecError, UnitError
from spindle_fem.model.reduced.reduced_transient import simulate_fast
from spindle_fem.registry import ADDED
from tests.support.effect_machines import (
    INTERVALS,
    KINDS,
    POINT,
    PROBES,
    _network,
    _spindle,
)


@pytest.fixture(scope="module")
def machines(tmp_path_factory):
    """Both machines by kind: fast model, recording, view, drive."""
    folder = tmp_path_factory.mktemp("machines")
    return {"geometry": _spindle(folder), "network": _network(folder)}


def everything(view):
    """Candidates of all effects, those of intervals at every place in every form."""
    found = list(candidates_for(view))
    for effect in interval_effects():
        for place in effect.places(view):
            found += [effect.over(view, place, INTERVALS, form) for form in effect.interval_forms]
    return found


def amplitude_at(candidate, value):
    """Parameters with the amplitude at a value, shapes at their first start."""
    values = {name: item.value for name, item in candidate.parameters.items()}
    return values | dict(candidate.starts[0]) | {candidate.amplitude: value}


def context_of(term, values, drive, rows, *, seed=1):
    """A term's context at some instants of a drive, with temperatures and states of its own."""
    random = np.random.default_rng(seed)
    inputs = {name: drive.start[rows, i] for i, name in enumerate(drive.names)}
    inputs |= {"ambient": np.full(len(rows), 293.0)}
    temperatures = 300.0 + 15.0 * random.random((len(term.reads), len(rows)))
    state = random.random((term.n_states, len(rows))) * (8.0 if term.n_states else 1.0)
    if term.n_states == 2:
        state[1] += 280.0
    own = {name: np.full(len(rows), value, dtype=complex) for name, value in term.values(values).items()}
    return TermContext(drive.grid[rows], inputs, temperatures.astype(complex), state.astype(complex), own)


def parts_of(term):
    """What a term does, as functions of a context."""
    found = {}
    if term.heat_places:
        found["heat"] = term.heat
    if term.coefficients:
        found["factor"] = term.factor
    if term.bearings:
        found["friction"] = term.friction
    if term.n_states:
        found["advance"] = lambda context: term.advance(context, 20.0)
    return found


# ------------------------------------------------------------------ catalogue


def test_every_file_of_the_catalogue_is_an_effect_of_its_name():
    files = {path.stem for path in Path(effects.__file__).parent.glob("*.py")} - {"__init__"}
    assert set(catalogue()) == files
    for effect in catalogue().values():
        assert effect.kind in ("missing_physics", "parameter", "sensor")
        assert effect.title
        assert effect.check.endswith(".")
        assert effect.card.group in GROUPS
        assert effect.card.law
        assert effect.card.size
        assert effect.card.acts_on


def test_the_page_of_effects_is_up_to_date():
    page = effects_page.PAGE.read_text(encoding="utf-8")
    assert page == effects_page.renewed(page), "run: python -m scripts.effects_page"


def test_a_program_adds_an_effect_of_its_own(monkeypatch):
    monkeypatch.setitem(ADDED, registry.GROUP, {})
    own = type("Own", (type(effect_of("windage")),), {"name": "own"})
    assert registry.register_effect(own) is own
    assert type(effect_of("own")) is own
    with pytest.raises(SpecError, match='there is a "own" already'):
        registry.register_effect(own)


def test_every_effect_is_offered_somewhere(machines):
    offered = {c.effect for kind in KINDS for c in everything(machines[kind][2])}
    assert offered == set(catalogue())


def test_an_effect_that_the_machine_already_has_is_not_offered(machines):
    view = machines["geometry"][2]
    assert "coolant_heating" not in {c.effect for c in candidates_for(view)}
    less = replace(view, has=view.has | {"windage", "thermal_preload @ front_bearings"})
    left = {(c.effect, c.component) for c in candidates_for(less)}
    assert ("windage", "shaft") not in left
    assert ("thermal_preload", "front_bearings") not in left
    assert ("thermal_preload", "rear_bearings") in left


@pytest.mark.parametrize("kind", KINDS)
def test_candidates_are_told_apart_and_well_formed(machines, kind):
    found = everything(machines[kind][2])
    labels = [(c.effect, c.component, c.form) for c in found]
    assert len(set(labels)) == len(labels)
    for candidate in found:
        amplitude = candidate.parameters[candidate.amplitude]
        assert amplitude.value == candidate.null
        assert amplitude.sigma > 0.0
        assert amplitude.low <= candidate.reference <= amplitude.high
        assert candidate.reference != candidate.null
        assert 1 <= len(candidate.starts) <= 12
        for item in candidate.parameters.values():
            assert item.low <= item.value <= item.high, (candidate.label, item)
        for start in candidate.starts:
            assert set(start) <= set(candidate.parameters), candidate.label
            for name, value in start.items():
                assert candidate.parameters[name].low <= value <= candidate.parameters[name].high


# ------------------------------------------------------------------ terms
@pytest.mark.parametrize("kind", KINDS)
def test_without_amplitude_nothing_happens(machines, kind):
    _, _, view, drive = machines[kind]
    rows = np.arange(0, len(drive.steps), 7)
    for candidate in everything(view):
        values = amplitude_at(candidate, candidate.null)
        for term in candidate.terms:
            context = context_of(term, values, drive, rows)
            for name, part in parts_of(term).items():
                if name != "advance":
                    neutral = 0.0 if name == "heat" else 1.0
                    assert np.abs(part(context) - neutral).max() < 1e-12, (candidate.label, name)
            own = term.values(values)
            assert all(f == pytest.approx(1.0) for f in term.operating_factor(POINT, own).values())
            assert all(c == 0.0 for c in term.place_capacity(own).values())


@pytest.mark.parametrize("kind", KINDS)
def test_complex_steps_are_differences(machines, kind):
    _, _, view, drive = machines[kind]
    rows = np.array([10, 40, 90])
    for candidate in everything(view):
        values = amplitude_at(candidate, candidate.reference)
        for term in candidate.terms:
            context = context_of(term, values, drive, rows)
            directions = [("temperatures", i) for i in range(len(term.reads))]
            directions += [("state", i) for i in range(term.n_states)]
            directions += [("parameters", item.name) for item in term.parameters]
            for where, which in directions:
                for name, part in parts_of(term).items():
                    slope = part(_moved(context, where, which, 1e-30j)).imag / 1e-30
                    value = np.abs(getattr(context, where)[which]).max()
                    width = 1e-6 * max(value, 1e-3)
                    upper = part(_moved(context, where, which, width)).real
                    lower = part(_moved(context, where, which, -width)).real
                    difference = (upper - lower) / (2.0 * width)
                    scale = np.abs(difference).max() + np.abs(part(context)).max() / max(value, 1e-3)
                    assert np.abs(slope - difference).max() <= 2e-5 * scale, (candidate.label, name, which)


def _moved(context, where, which, step):
    if where == "parameters":
        return replace(context, parameters={**context.parameters, which: context.parameters[which] + step})
    moved = getattr(context, where).copy()
    moved[which] += step
    return replace(context, **{where: moved})


@pytest.mark.parametrize("kind", KINDS)
def test_instants_together_are_instants_one_by_one(machines, kind):
    _, _, view, drive = machines[kind]
    rows = np.arange(3, len(drive.steps), 17)
    for candidate in everything(view):
        values = amplitude_at(candidate, candidate.reference)
        for term in candidate.terms:
            context = context_of(term, values, drive, rows)
            for name, part in parts_of(term).items():
                together = part(context)
                for i in range(len(rows)):
                    one = TermContext(
                        float(context.time[i]),
                        {key: float(value[i]) for key, value in context.inputs.items()},
                        context.temperatures[:, [i]],
                        context.state[:, [i]],
                        {key: value[[i]] for key, value in context.parameters.items()},
                    )
                    alone = part(one)
                    assert alone.shape == (together.shape[0], 1), (candidate.label, name)
                    assert alone[:, 0] == pytest.approx(together[:, i], rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_every_candidate_runs_and_moves_the_machine(machines, kind):
    fast, recording, view, drive = machines[kind]
    plain = _run(fast, recording, drive, (), {})
    for candidate in everything(view):
        values = amplitude_at(candidate, candidate.reference)
        if candidate.reading is not None and not candidate.terms:
            continue
        run = _run(fast, recording, drive, candidate.terms, values)
        moved = np.abs(run - plain).max()
        assert np.isfinite(run).all(), candidate.label
        assert moved > 1e-5, candidate.label


def _run(fast, recording, drive, terms, values):
    start = 293.15
    if fast.network is not None:
        start = fast.inputs.start(recording, drive)
    return simulate_fast(fast, drive, start, parameters=values, terms=terms).temperature


def test_heat_warms_and_losses_cool(machines):
    fast, recording, view, drive = machines["geometry"]
    plain = _run(fast, recording, drive, (), {})
    wanted = {effect.name for effect in catalogue().values() if effect.card.makes is not None}
    assert {"seal_friction", "unrecorded_cooling"} <= wanted
    seen = set()
    for candidate in everything(view):
        makes = effect_of(candidate.effect).card.makes
        if makes is None or candidate.component != makes.at or not candidate.terms:
            continue
        if "curvature" in candidate.form:
            continue
        run = _run(fast, recording, drive, candidate.terms, amplitude_at(candidate, candidate.reference))
        sign = {"warmer": 1.0, "colder": -1.0}[makes.way]
        assert sign * (run - plain)[:, PROBES.index(makes.probe)].mean() > 0.0, candidate.label
        seen.add(candidate.effect)
    assert seen == wanted


def test_more_capacity_follows_more_slowly(machines):
    fast, recording, view, drive = machines["geometry"]
    plain = _run(fast, recording, drive, (), {})
    housing = next(c for c in candidates_for(view) if (c.effect, c.component) == ("heat_capacity", "housing"))
    run = _run(fast, recording, drive, housing.terms, {housing.amplitude: 50000.0})
    early = drive.times < 2700.0
    assert (run - plain)[early, 3].mean() < -0.1


# ------------------------------------------------------------------ reports
@pytest.mark.parametrize("kind", KINDS)
def test_findings_carry_the_agreed_names_and_units(machines, kind):
    for candidate in everything(machines[kind][2]):
        effect = effect_of(candidate.effect)
        reported = effect.report(candidate, amplitude_at(candidate, candidate.reference))
        for name, unit in effect.card.states.items():
            assert reported[name].unit == unit, candidate.label
        if candidate.effect == "unrecorded_cooling":
            assert "conductance" in reported or "heat" in reported
        if candidate.form == "fouling":
            assert set(reported) == {"factor"}
        assert all(np.isfinite(item.value) for item in reported.values())
        sentence = effect.statement(candidate, reported)
        assert sentence[0] == sentence[0].upper(), sentence
        assert sentence.endswith("."), sentence


def test_values_come_out_in_the_units_of_engineers(machines):
    view = machines["geometry"][2]

    def reported(effect, form, **values):
        candidate = next(c for c in candidates_for(view) if c.effect == effect and c.form == form)
        own = {
            outer: values[item.name] for outer, item in candidate.parameters.items() if item.name in values
        }
        return catalogue()[effect].report(candidate, own)

    assert reported("starvation", "", onset_speed=100.0 * np.pi)["onset_speed"].value == pytest.approx(3000.0)
    assert reported("sensor_drift", "", rate=1.0 / 3600.0)["rate"].value == pytest.approx(1.0)
    split = {"heat.inner_share": 1.2}
    candidate = next(c for c in candidates_for(view) if c.form == "every bearing")
    assert catalogue()["heat_split"].report(candidate, split)["inner_share_change"].value == pytest.approx(
        0.1
    )
    transition = reported("coolant_film", "transition", film_increase=2.0, onset_reynolds=640.0)
    assert transition["factor_above"].value == pytest.approx(3.0)


def test_heat_of_one_bearing_is_shared_by_its_raceways(machines):
    view = machines["geometry"][2]
    candidate = catalogue()["unrecorded_heat_source"].over(view, "F2", [(1000.0, 3000.0)])
    assert candidate.component == "F2"
    (term,) = candidate.terms
    assert term.heat_places == ("F2.inner_raceway", "F2.outer_raceway", "F2.outer_raceway")
    own = {item.name: np.array([item.value + 0j]) for item in term.parameters}
    own |= {"heat": np.array([40.0 + 0j]), "focus": np.array([0.5 + 0j]), "lag": np.array([100.0 + 0j])}
    heat = term.heat(TermContext(2700.0, {}, np.zeros((0, 1)), np.zeros((0, 1)), own)).real[:, 0]
    assert heat == pytest.approx([10.0, 10.0, 20.0], abs=1e-4)


def test_heat_while_on_is_the_mean_over_the_intervals(machines):
    effect = catalogue()["unrecorded_heat_source"]
    candidate = effect.over(machines["geometry"][2], "housing", [(0.0, 100.0), (200.0, 500.0)])
    name = candidate.terms[0].name
    values = {f"{name}.heat": 40.0, f"{name}.factor_1": 0.8, f"{name}.factor_2": 1.0}
    assert effect.report(candidate, values)["heat"].value == pytest.approx(40.0 * 0.95)
    assert effect.intervals(candidate, {f"{name}.end_2": 510.0}) == [(0.0, 100.0), (200.0, 510.0)]


# ------------------------------------------------------------------ definitions
@pytest.mark.parametrize("kind", KINDS)
def test_an_entry_of_a_definition_builds_the_same_effect_again(machines, kind):
    _, _, view, drive = machines[kind]
    rows = np.array([10, 40, 90])
    for candidate in everything(view):
        values = amplitude_at(candidate, candidate.reference)
        entry = definition_entry(candidate, values)
        assert all(isinstance(text, str) for text in entry["parameters"].values())
        again = build(
            entry["effect"],
            entry["component"],
            entry.get("form", ""),
            entry["parameters"],
            view,
            entry.get("intervals", ()),
        )
        assert not again.free
        assert again.label == candidate.label
        for outer, item in again.parameters.items():
            assert item.value == pytest.approx(values[outer], rel=1e-9, abs=1e-9), (candidate.label, outer)
        for term, other in zip(candidate.terms, again.terms, strict=True):
            ours, theirs = (context_of(t, v, drive, rows) for t, v in ((term, values), (other, {})))
            for name, part in parts_of(term).items():
                assert parts_of(other)[name](theirs) == pytest.approx(part(ours), rel=1e-7, abs=1e-9)


def test_building_says_what_is_wrong(machines):
    view = machines["geometry"][2]
    good = {"friction_increase_at_10K": "0.1"}
    assert build("thermal_preload", "front_bearings", "", good, view).effect == "thermal_preload"
    for change, error, message in (
        ({"effect": "thermal_preloud"}, SpecError, 'Did you mean "thermal_preload"'),
        ({"component": "front_bearing"}, SpecError, 'cannot have thermal_preload.*"front_bearings"'),
        ({"form": "odd"}, SpecError, "form.*'odd'|\"odd\" is unknown"),
        ({"values": {}}, SpecError, '"friction_increase_at_10K" is missing'),
        ({"values": {**good, "lagg": "3 s"}}, SpecError, '"lagg" is unknown'),
        ({"values": {"friction_increase_at_10K": "0.08 W"}}, UnitError, "wrong dimension"),
        ({"values": {"friction_increase_at_10K": "-0.08"}}, SpecError, "Allowed: 0 to 20"),
        ({"intervals": [("0 s", "5 s")]}, SpecError, "takes none"),
    ):
        given = {"effect": "thermal_preload", "component": "front_bearings", "form": "", "values": good}
        with pytest.raises(error, match=message):
            build(**(given | change), view=view)
    heat = {"heat": "30 W"}
    with pytest.raises(SpecError, match="has none"):
        build("unrecorded_heat_source", "flange", "", heat, view)
    with pytest.raises(SpecError, match="growing"):
        build("unrecorded_heat_source", "flange", "", heat, view, [("9 s", "5 s")])
    two = build("unrecorded_heat_source", "flange", "", heat, view, [("5 s", "9 s"), (20.0, 30.0)])
    assert catalogue()["unrecorded_heat_source"].intervals(two, {}) == [(5.0, 9.0), (20.0, 30.0)]


def test_an_entry_holds_on_recordings_that_could_not_have_shown_it(machines):
    view = machines["geometry"][2]
    quiet = replace(
        view,
        duration=100.0,
        highest_speed=0.0,
        lowest_speed=0.0,
        reynolds=(290.0, 290.0),
        input_scale={**view.input_scale, "speed": 0.0},
    )
    offered = {(c.effect, c.form) for c in candidates_for(quiet)}
    assert ("coolant_film", "transition") not in offered
    assert "chiller_cycling" not in {effect for effect, _ in offered}
    for candidate in everything(view):
        values = amplitude_at(candidate, candidate.reference)
        entry = definition_entry(candidate, values)
        again = build(
            entry["effect"],
            entry["component"],
            entry.get("form", ""),
            entry["parameters"],
            quiet,
            entry.get("intervals", ()),
        )
        for outer, item in again.parameters.items():
            assert item.value == pytest.approx(values[outer], rel=1e-9, abs=1e-9), (candidate.label, outer)


def test_fixing_leaves_the_candidate_itself_free(machines):
    candidate = next(c for c in candidates_for(machines["geometry"][2]) if c.effect == "windage")
    held = fixed(candidate, {"heat_at_4500rpm": 12.0})
    assert candidate.free
    assert not held.free
    assert held.parameters[held.amplitude].value == 12.0


# ------------------------------------------------------------------ views
def test_a_view_names_what_the_machine_has(machines):
    view = machines["geometry"][2]
    assert view.sets["front_bearings"] == ("F1", "F2", "F3")
    assert view.films["flange"] == ("film.housing.flange_back",)
    assert view.films["nose"] == ("film.shaft.nose_end",)
    assert set(view.joint_coefficients["rear_bearings"]) == {
        "joint.R1.outer_ring|housing",
        "joint.R2.outer_ring|housing",
        "joint.housing|rear_outer_spacer",
    }
    assert view.outlets == ("COOLANT_OUT_degC",)
    assert view.probes["SP01_degC"] == "SP01"
    assert view.highest_speed == pytest.approx(4000.0 * np.pi / 30.0)
    assert view.lowest_speed == pytest.approx(1500.0 * np.pi / 30.0)
    assert 280.0 < view.reynolds[0] < 300.0 < 500.0 < view.reynolds[1]
    assert view.parameters["film.outside"] == pytest.approx(0.3)
    assert view.has == {"coolant_heating"}


def test_a_network_is_seen_by_its_nodes_links_and_sources(machines):
    view = machines["network"][2]
    assert view.films == {
        "body|ambient": ("link.body|ambient",),
        "jacket|coolant": ("link.jacket|coolant",),
        "body|coolant": ("link.body|coolant",),
    }
    assert view.speeds("body.speed") == ("speed",)
    assert view.speeds("winding.power") == ()
    assert view.running("winding.power") == ("power",)
    assert view.fluids["link.body|ambient"] == "ambient"
    assert view.fluids["link.jacket|coolant"] == pytest.approx(291.15)
    assert view.coolant_links == {"coolant": ("link.jacket|coolant", "link.body|coolant")}
    assert view.joint_coefficients == {
        "winding|body": ("link.winding|body",),
        "body|jacket": ("link.body|jacket",),
    }
    assert view.component("winding.power") == "winding"
    assert view.typical_heat == pytest.approx(0.8 * 120.0 + 15.0 * 1.5)


def test_a_conductance_of_a_network_may_be_right_at_larger_differences(machines):
    """Below them it is less than its nominal value: a film calibrated at 30 K and used at 5 K."""

    def offered(kind):
        return [c for c in candidates_for(machines[kind][2]) if c.effect == "natural_convection"]

    by_name = {p.name: p for c in offered("network") for p in c.parameters.values()}
    # growth at 30 K with the power of a half
    assert by_name["carried_share"].high > (30.0 / 10.0) ** 0.5
    for candidate in offered("network"):
        starts = [value for start in candidate.starts for value in start.values()]
        assert sorted(starts) == [1.0, 1.6]
    (housing,) = offered("geometry")
    assert next(p for p in housing.parameters.values() if p.name == "carried_share").high == 1.0
