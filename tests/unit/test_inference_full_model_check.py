"""What of a fit reaches the finite-element model, and when it is not run at all."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from spindle_fem.definition.load import load_machine
from spindle_fem.effects.registry import candidates_for, effect_of
from spindle_fem.errors import EnergyBalanceError, MeshQualityError, SpecError, WorkerDiedError
from spindle_fem.inference import full_model_check as full_model
from spindle_fem.inference import full_model_runs
from spindle_fem.inference.coordinate_names import MISDESCRIBED_PREFIX, PROBE_PREFIX
from spindle_fem.inference.findings import predictions_at_stamps
from spindle_fem.inference.full_model_check import (
    BegunRuns,
    expected_steps,
    full_model_errors,
    options_for,
    require_choice,
    spec_on,
)
from spindle_fem.inference.full_model_runs import inputs_of_drive, physics_of_fit
from spindle_fem.inference.misdescription import Misdescription
from spindle_fem.inference.predictor import Predictor
from spindle_fem.machine.view.build_view import view_of
from spindle_fem.model.reduced.spindle_inputs import fast_spindle
from spindle_fem.recordings.align import read_recording
from spindle_fem.report.diagnosis_full_model import full_model_sections
from spindle_fem.solvers.input_history import OperatingHistory
from tests.support.lumped_spindle import lumped_model

MANIFEST = """
schema = "spindle-fem/recording/1"
name = "steps"
data = "steps.csv"
time = {column = "t", unit = "s"}
channel = [
{column = "speed", role = "input", hold = "previous", drives = "speed", unit = "rpm"},
{column = "ambient", role = "input", drives = "ambient", unit = "degC"},
{column = "SP01", role = "temperature", probe = "SP01", unit = "degC", sigma = 0.1},
{column = "SP05", role = "temperature", probe = "SP05", unit = "degC", sigma = 0.1},
]
"""


@pytest.fixture(scope="module")
def predictor(tmp_path_factory):
    folder = tmp_path_factory.mktemp("lumped")
    times = np.arange(0.0, 3601.0, 50.0)
    columns = {
        "t": times,
        "speed": np.where((times >= 600.0) & (times < 2500.0), 3000.0, 0.0),
        "ambient": 20.0 + np.sin(times / 900.0),
        "SP01": np.full(times.size, 20.0),
        "SP05": np.full(times.size, 20.0),
    }
    pd.DataFrame(columns).to_csv(folder / "steps.csv", index=False)
    (folder / "steps.toml").write_text(MANIFEST, encoding="utf-8")
    recording = read_recording(folder / "steps.toml")
    spec = load_machine("recorded_spindle")
    return Predictor(fast_spindle(lumped_model(spec), spec), [recording], [np.ones(times.size, dtype=bool)])


@pytest.fixture(scope="module")
def candidates(predictor):
    view = view_of(predictor.fast.names, predictor.recordings[0])
    found = {(c.effect, c.component): c for c in reversed(candidates_for(view))}
    heat = effect_of("unrecorded_heat_source").over(view, "housing", [(900.0, 2000.0)])
    return found | {(heat.effect, heat.component): heat}


def fit_of(members, values):
    return SimpleNamespace(candidates=tuple(members), values=values)


def diagnosis_of(predictor, null, final, unchanged=None):
    return SimpleNamespace(predictor=predictor, unchanged=unchanged or predictor, null=null, stated_fit=final)


def test_a_fit_becomes_terms_values_and_factors(predictor, candidates):
    scale = candidates["heat_scale", "front_bearings"]
    source = candidates["unrecorded_heat_source", "housing"]
    lying = candidates["sensor_offset", "SP05"]
    factor = scale.factors[0].name
    offset = next(name for name in lying.parameters if name.startswith(lying.reading.name))
    values = {factor: 1.1, f"effect:{factor}": 1.5, "film.outside": 0.8, source.amplitude: 80.0, offset: 2.0}
    values |= {"probe.SP01.r": 1e-3, "jump.0.0": 10.0, "within_gap.0.0": 0.4}
    physics = physics_of_fit(predictor, 0, fit_of((scale, source, lying), values))
    assert physics.terms == source.terms
    assert physics.values[source.amplitude] == 80.0
    assert physics.values.keys() == {name for term in source.terms for name in term.names()}
    assert physics.factors == pytest.approx({factor: 1.65, "film.outside": 0.8})


def test_what_acts_in_another_recording_stays_out(predictor, candidates):
    elsewhere = replace(candidates["heat_scale", "front_bearings"], recording=1)
    factor = elsewhere.factors[0].name
    fit = fit_of((elsewhere,), {factor: 1.1, f"effect:{factor}": 1.5})
    assert physics_of_fit(predictor, 0, fit).factors == {factor: 1.1}
    assert physics_of_fit(predictor, 1, fit).factors == pytest.approx({factor: 1.65})


def test_inputs_are_those_of_the_reduced_model_at_every_instant(predictor):
    drive = predictor.drives[0]
    inputs = inputs_of_drive(drive)
    held = dict(zip(inputs.names, inputs.held.tolist(), strict=True))
    assert held["speed"]
    assert not held["ambient"]
    history = OperatingHistory.of(predictor.fast.spec, inputs)
    middle = 0.5 * (drive.grid[:-1] + drive.grid[1:])
    mean = 0.5 * (drive.start + drive.end)
    points = [history.at(time) for time in middle]
    speed, ambient = (mean[:, drive.column(name)] for name in ("speed", "ambient"))
    np.testing.assert_allclose([p.speed for p in points], speed, rtol=1e-12)
    np.testing.assert_allclose([p.ambient_temperature for p in points], ambient, rtol=1e-12)
    assert history.at(600.0).speed > 0.0
    assert history.at(599.9).speed == 0.0


def test_the_coarse_mesh_is_linear_and_without_sizes_of_its_own():
    spec = load_machine("recorded_spindle", ("mesh.preset=normal", "mesh.size_factor=0.7"))
    coarse = spec_on(spec, "coarse").mesh
    assert (coarse.preset, coarse.order, coarse.size_factor, dict(coarse.size)) == ("coarse", 1, 1.0, {})
    assert spec_on(spec, "own") is spec


def test_off_runs_nothing_and_leaves_no_section(predictor):
    machine = SimpleNamespace(is_network=False, spec=predictor.fast.spec)
    found = full_model_errors(diagnosis_of(predictor, fit_of((), {}), fit_of((), {})), machine, mesh="off")
    assert found == {"mesh": "off", "reason": "It was not asked for."}
    assert full_model_sections({"fit": {"full_model": found}}) == []


def test_a_network_has_no_full_model(predictor):
    machine = SimpleNamespace(is_network=True, spec=None)
    found = full_model_errors(diagnosis_of(predictor, fit_of((), {}), fit_of((), {})), machine, mesh="coarse")
    assert found["reason"] == "The machine is a network: it has no finite-element model."
    (section,) = full_model_sections({"fit": {"full_model": found}})
    assert section.blocks[0].text == found["reason"]


def test_unasked_a_network_says_nothing_of_a_full_model(predictor):
    machine = SimpleNamespace(is_network=True, spec=None)
    found = full_model_errors(diagnosis_of(predictor, fit_of((), {}), fit_of((), {})), machine, mesh="auto")
    assert found == {"mesh": "off", "reason": "The machine is a network: it has no finite-element model."}


def test_time_is_followed_as_well_as_the_quietest_channel_can_tell(predictor):
    options = options_for(predictor)
    assert (options.error, options.coupling_tolerance, options.input_resolution) == pytest.approx(
        (0.2, 0.05, 0.2), rel=1e-3
    )
    assert options.energy_tolerance == pytest.approx(0.001, rel=1e-3)
    recording = predictor.recordings[0]
    loud = SimpleNamespace(recordings=(replace(recording, sigma=10.0 * recording.sigma),))
    assert options_for(loud).error == 0.4
    quiet = SimpleNamespace(recordings=(recording, replace(recording, sigma=0.3 * recording.sigma)))
    assert options_for(quiet).error == pytest.approx(0.06, rel=0.01)


def test_unasked_a_full_model_of_very_many_steps_is_not_run(predictor, monkeypatch):
    """Two jumps, an oscillation of the ambient; a limit below what these need."""
    steps = expected_steps(predictor, options_for(predictor))
    assert steps >= 8
    monkeypatch.setattr(full_model, "MOST_STEPS", steps - 1)
    machine = SimpleNamespace(is_network=False, spec=predictor.fast.spec)
    found = full_model_errors(diagnosis_of(predictor, fit_of((), {}), fit_of((), {})), machine, mesh="auto")
    assert found["mesh"] == "auto"
    assert found["reason"] == f"It would take some {steps} time steps a fit; --full-model coarse runs them."


def test_a_mesh_that_fails_is_said_and_costs_no_diagnosis(predictor, monkeypatch):
    def fail(spec):
        raise MeshQualityError("mesh", "inverted.", "Mesh finer.")

    monkeypatch.setattr(full_model, "prepare_machine", fail)
    machine = SimpleNamespace(is_network=False, spec=predictor.fast.spec)
    found = full_model_errors(diagnosis_of(predictor, fit_of((), {}), fit_of((), {})), machine)
    assert found == {"mesh": "coarse", "reason": "It could not be run: mesh: inverted. Mesh finer."}


def test_where_nothing_was_found_one_run_is_both(predictor, monkeypatch):
    runs, kept = [], {}

    def run_fit(machine, predictor, fit, options):
        runs.append(fit)
        return full_model.FullFit(tuple(predictions_at_stamps(predictor, fit)), 7, 1.0)

    prepared = SimpleNamespace(spec=predictor.fast.spec, operators=SimpleNamespace(n_unknowns=3))
    monkeypatch.setattr(full_model, "prepare_machine", lambda spec: prepared)
    monkeypatch.setattr(full_model, "run_fit", run_fit)
    monkeypatch.setattr(full_model, "thread_count", lambda: 1)
    machine = SimpleNamespace(is_network=False, spec=predictor.fast.spec)
    nothing, heat = fit_of((), {"heat.front": 1.1}), fit_of((), {"heat.front": 1.3})
    same = full_model_errors(diagnosis_of(predictor, nothing, nothing), machine, keep=kept.__setitem__)
    assert len(runs) == 1
    assert kept.keys() == {"before", "after"}
    assert same["after"]["channels"] == same["before"]["channels"]
    assert all(row["before_K"] == row["after_K"] == row["change_K"] == 0.0 for row in same["differences"])
    other = full_model_errors(diagnosis_of(predictor, nothing, heat), machine)
    assert len(runs) == 3
    assert other["after"]["train_rmse_K"] != other["before"]["train_rmse_K"]
    # no set leaves anything where none was found
    assert same["left"] is other["left"] is None


def test_a_balance_that_asks_for_a_better_fixed_point_gets_it(predictor, monkeypatch):
    tried = []

    def run_fit(machine, predictor, fit, options):
        tried.append(options.coupling_tolerance)
        if options.coupling_tolerance > needed:
            raise EnergyBalanceError("transient", "heat stored, in and out differ.", "Lower it.")
        return full_model.FullFit(tuple(predictions_at_stamps(predictor, fit)), 7, 1.0)

    prepared = SimpleNamespace(spec=predictor.fast.spec, operators=SimpleNamespace(n_unknowns=3))
    monkeypatch.setattr(full_model, "prepare_machine", lambda spec: prepared)
    monkeypatch.setattr(full_model, "run_fit", run_fit)
    machine = SimpleNamespace(is_network=False, spec=predictor.fast.spec)
    asked = options_for(predictor).coupling_tolerance
    both = diagnosis_of(predictor, fit_of((), {}), fit_of((), {}))
    needed = 0.3 * asked
    found = full_model_errors(both, machine)
    assert found["reason"] is None
    assert found["coupling_tolerance_K"] == tried[-1] == pytest.approx(0.25 * asked)
    before = len(tried)
    needed = 0.01 * asked
    assert full_model_errors(both, machine)["reason"].startswith("It could not be run: transient: heat")
    assert tried[before:] == pytest.approx([asked, 0.25 * asked, 0.0625 * asked])


def test_a_process_that_ends_before_its_time_is_said_and_done_without(predictor, monkeypatch):
    def killed(jobs, number):
        assert len(jobs) == number == 2
        raise WorkerDiedError("full model: after", "its process ended before its time.")

    def run_fit(machine, predictor, fit, options):
        return full_model.FullFit(tuple(predictions_at_stamps(predictor, fit)), 7, 1.0)

    prepared = SimpleNamespace(spec=predictor.fast.spec, operators=SimpleNamespace(n_unknowns=3))
    monkeypatch.setattr(full_model, "prepare_machine", lambda spec: prepared)
    monkeypatch.setattr(full_model, "run_fit", run_fit)
    monkeypatch.setattr(full_model, "thread_count", lambda: 2)
    monkeypatch.setattr(full_model, "in_copies", killed)
    machine = SimpleNamespace(is_network=False, spec=predictor.fast.spec)
    nothing, heat = fit_of((), {"heat.front": 1.1}), fit_of((), {"heat.front": 1.3})
    said = []
    found = full_model_errors(diagnosis_of(predictor, nothing, heat), machine, progress=said.append)
    assert "full model: after: its process ended before its time." in said
    assert said[-2:] == ["full model: before", "full model: after"]
    assert found["after"]["train_rmse_K"] != found["before"]["train_rmse_K"]


def test_a_fit_that_was_begun_is_run_once(predictor, monkeypatch):
    nothing, heat = fit_of((), {"heat.front": 1.1}), fit_of((), {"heat.front": 1.3})
    moved = fit_of((), {"heat.front": 1.1, f"{PROBE_PREFIX}SP01.x": 1e-4})
    ran = []

    def mesh_runs(machine, predictor, fit, options):
        ran.append(fit)
        seen = [predictor.predict(number, fit.values).temperature for number in range(1)]
        return full_model_runs.MeshRuns(tuple(seen), 7, 1.0)

    prepared = SimpleNamespace(spec=predictor.fast.spec, operators=SimpleNamespace(n_unknowns=3))
    prepared_for = []
    monkeypatch.setattr(full_model, "prepare_machine", lambda spec: prepared_for.append(spec) or prepared)
    for module in (full_model, full_model_runs):
        monkeypatch.setattr(module, "mesh_runs", mesh_runs)
    monkeypatch.setattr(full_model, "thread_count", lambda: 2)
    monkeypatch.setattr(full_model, "start_copy", lambda job: job)
    monkeypatch.setattr(full_model, "in_copies", lambda jobs, number: [job() for job in jobs])
    machine = SimpleNamespace(is_network=False, spec=predictor.fast.spec)
    for mesh in ("off", "own"):
        unasked = BegunRuns(machine, mesh)
        unasked.begin(predictor, nothing)
        assert unasked.fits == []
    begun = BegunRuns(machine)
    begun.begin(predictor, nothing)
    (fit,) = begun.fits
    assert fit.serves(moved, "coarse", fit.options)
    assert not fit.serves(heat, "coarse", fit.options)
    assert not fit.serves(nothing, "own", fit.options)
    assert not fit.serves(nothing, "coarse", replace(fit.options, error=0.5))
    diagnosis = diagnosis_of(predictor, nothing, heat)
    with_begun, without = (full_model_errors(diagnosis, machine, begun=item) for item in ((begun,), ()))
    assert repr(with_begun) == repr(without)
    assert ran == [heat, nothing, nothing, heat]
    begun.begin(predictor, heat)
    ran.clear()
    prepared_for.clear()
    assert repr(full_model_errors(diagnosis, machine, begun=[begun])) == repr(without)
    assert ran == [nothing, heat]
    ran.clear()
    full_model_errors(diagnosis_of(predictor, nothing, nothing), machine, begun=[begun])
    assert ran == [nothing]
    assert prepared_for == []


def test_what_drawings_leave_open_counts_as_it_does_without_the_set_before_and_beside_it_after(
    predictor, monkeypatch
):
    coordinate = f"{MISDESCRIBED_PREFIX}width"
    nothing, heat = (fit_of((), {"heat.front": share, coordinate: 1.0}) for share in (1.1, 1.3))

    def opened(kelvin):
        """The machine with a direction that moves every channel by some kelvin."""
        move = np.full((predictor.drives[0].grid.size, 2), kelvin)
        direction = Misdescription("width", "shaft.width", "m", 1.0, "Width.", change=None)
        return predictor.misdescribed_by((direction,), {(0, coordinate): move})

    def mesh_runs(machine, predictor, fit, options):
        plain = {"heat.front": fit.values["heat.front"]}
        return full_model_runs.MeshRuns((predictor.at_places(0, plain).temperature,), 7, 1.0)

    prepared = SimpleNamespace(spec=predictor.fast.spec, operators=SimpleNamespace(n_unknowns=3))
    monkeypatch.setattr(full_model, "prepare_machine", lambda spec: prepared)
    for module in (full_model, full_model_runs):
        monkeypatch.setattr(module, "mesh_runs", mesh_runs)
    monkeypatch.setattr(full_model, "thread_count", lambda: 2)
    monkeypatch.setattr(full_model, "start_copy", lambda job: job)
    machine = SimpleNamespace(is_network=False, spec=predictor.fast.spec)
    without, beside = opened(0.5), opened(2.0)
    begun, kept = BegunRuns(machine), {}
    begun.begin(without, nothing)
    begun.begin(beside, heat)
    diagnosis = diagnosis_of(beside, nothing, heat, unchanged=without)
    found = full_model_errors(diagnosis, machine, begun=[begun], keep=kept.__setitem__)
    for name, plant, fit in (("before", without, nothing), ("after", beside, heat)):
        np.testing.assert_allclose(kept[name][0], predictions_at_stamps(plant, fit)[0], atol=1e-9)
    for row in found["differences"]:
        assert row["before_K"] == pytest.approx(0.0, abs=1e-9)
        assert row["change_K"] == pytest.approx(0.0, abs=1e-9)


def test_a_machine_that_cannot_be_meshed_ahead_is_told_where_errors_are_asked_for(predictor, monkeypatch):
    def refused(spec):
        raise SpecError("mesh", "no mesh.", "Another geometry.")

    monkeypatch.setattr(full_model, "prepare_machine", refused)
    monkeypatch.setattr(full_model, "thread_count", lambda: 2)
    machine = SimpleNamespace(is_network=False, spec=predictor.fast.spec)
    nothing, heat = fit_of((), {"heat.front": 1.1}), fit_of((), {"heat.front": 1.3})
    begun = BegunRuns(machine)
    begun.prepare()
    begun.begin(predictor, nothing)
    assert begun.fits == []
    found = full_model_errors(diagnosis_of(predictor, nothing, heat), machine, begun=[begun])
    assert found["reason"] == "It could not be run: mesh: no mesh. Another geometry."


def test_a_difference_of_the_meshes_is_not_one_of_what_was_found(predictor, monkeypatch):
    """A full model that reads 0.4 K more throughout, and 0.1 K more of what the fits differ by."""
    nothing, heat = fit_of((), {"heat.front": 1.1}), fit_of((), {"heat.front": 1.3})

    def run_fit(machine, predictor, fit, options):
        beside = 0.4 if fit is nothing else 0.5
        return full_model.FullFit(
            tuple(item + beside for item in predictions_at_stamps(predictor, fit)), 7, 1.0
        )

    prepared = SimpleNamespace(spec=predictor.fast.spec, operators=SimpleNamespace(n_unknowns=3))
    monkeypatch.setattr(full_model, "prepare_machine", lambda spec: prepared)
    monkeypatch.setattr(full_model, "run_fit", run_fit)
    monkeypatch.setattr(full_model, "thread_count", lambda: 1)
    machine = SimpleNamespace(is_network=False, spec=predictor.fast.spec)
    found = full_model_errors(diagnosis_of(predictor, nothing, heat), machine)
    for row in found["differences"]:
        assert [row[f"{key}_K"] for key in ("before", "after", "change")] == pytest.approx([0.4, 0.5, 0.1])


@pytest.mark.parametrize(("share", "confirmed"), [(1.0, True), (0.5, False)])
def test_a_set_is_held_against_its_own_machine_where_the_mesh_reads_another_machine_otherwise(
    predictor, candidates, monkeypatch, share, confirmed
):
    """A mesh that cools the machine of a set more than the fast model does, with the set and without it."""
    heat = candidates["unrecorded_heat_source", "housing"]
    # the film takes up, with nothing missing, what the set explains
    nothing, other = fit_of((), {"coolant.film_factor": 0.8}), {"coolant.film_factor": 1.5}
    found = fit_of((heat,), other | {heat.amplitude: 200.0})
    found.without_candidates = fit_of((), other)
    ran = []

    def run_fit(machine, predictor, fit, options):
        ran.append(fit)
        film = {name: value for name, value in fit.values.items() if name in other}
        (bare,) = predictions_at_stamps(predictor, fit_of((), film))
        (whole,) = predictions_at_stamps(predictor, fit)
        colder = 0.0 if fit is nothing else -0.2 * (bare - bare[0])
        return full_model.FullFit((bare + colder + share * (whole - bare),), 7, 1.0)

    (truth,) = predictions_at_stamps(predictor, found)
    read = replace(predictor.recordings[0], temperature=truth)
    seen = Predictor(predictor.fast, [read], [np.ones(len(truth), dtype=bool)])
    prepared = SimpleNamespace(
        spec=SimpleNamespace(mesh=SimpleNamespace(preset="coarse", order=1)),
        operators=SimpleNamespace(n_unknowns=3),
    )
    monkeypatch.setattr(full_model, "prepare_machine", lambda spec: prepared)
    monkeypatch.setattr(full_model, "run_fit", run_fit)
    monkeypatch.setattr(full_model, "thread_count", lambda: 1)
    machine = SimpleNamespace(is_network=False, spec=predictor.fast.spec)
    left = full_model_errors(diagnosis_of(seen, nothing, found), machine)["left"]
    assert ran == [nothing, found, found.without_candidates]
    assert left["fast"] < 0.1
    assert (left["full"] < 1.0) == confirmed


def test_recorded_heat_goes_into_the_full_model(predictor):
    drive = predictor.drives[0]
    heat = np.full((len(drive.start), 1), 40.0)
    heated = replace(
        drive,
        names=(*drive.names, "heat.housing"),
        start=np.hstack((drive.start, heat)),
        end=np.hstack((drive.end, heat)),
    )
    history = OperatingHistory.of(predictor.fast.spec, inputs_of_drive(heated))
    (term,) = history.given_heat()
    assert term.heat_places == ("housing",)
    assert history.at(0.0).extra_heat == {"housing": 40.0}


def test_a_covariate_reaches_the_full_model_where_a_term_follows_it(predictor):
    drive = predictor.drives[0]
    load = np.linspace(10.0, 70.0, len(drive.start))[:, None]
    beside = replace(
        drive,
        names=(*drive.names, "covariate.load", "covariate.other"),
        start=np.hstack((drive.start, load, load)),
        end=np.hstack((drive.end, load, load)),
    )
    inputs = inputs_of_drive(beside, {"covariate.load"})
    assert inputs.names == (*drive.names, "covariate.load")
    assert inputs_of_drive(beside).names == drive.names
    history = OperatingHistory.of(predictor.fast.spec, inputs)
    middle = 0.5 * (drive.grid[5] + drive.grid[6])
    seen = history.at(middle).inputs
    assert seen["covariate.load"] == pytest.approx(load[5, 0])
    assert seen["speed"] == history.at(middle).speed
    assert history.given_heat() == ()


def test_another_mesh_is_refused():
    with pytest.raises(SpecError, match=r"'fine'.*Allowed: auto, off, coarse, own"):
        require_choice("fine")
