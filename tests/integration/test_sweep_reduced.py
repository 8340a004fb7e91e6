"""Designs that share a mesh: the projected model against full solves, and who answers what."""

import numpy as np
import pytest

from spindle_fem.cache import CACHE_VARIABLE
from spindle_fem.commands.sweep_command import sweep_machine
from spindle_fem.definition.load import load_machine
from spindle_fem.errors import FaultsError
from spindle_fem.model.reduced.build_for_designs import FIRST_TABLES
from spindle_fem.model.reduced.heat_tables import BearingTables
from spindle_fem.model.thermal_model import ThermalModel
from spindle_fem.results.output_folder import MARKER
from spindle_fem.studies.sweep.designs import Design
from spindle_fem.studies.sweep.evaluate_design import Question, TaskBuilder, row_of, solve_checked
from spindle_fem.studies.sweep.fast_backend import (
    LARGEST_ERROR,
    TRUE_ERROR,
    GroupTask,
    answer_group,
    answer_tasks,
    model_of,
)
from spindle_fem.studies.sweep.prepared_study import prepare_study
from spindle_fem.studies.sweep.results_table import RESULTS, read_results
from spindle_fem.studies.sweep.structure import refusal

QUICK = ("mesh.preset=coarse", "mesh.order=1")
STUDY = """
schema = "spindle-fem/study/1"
[[parameter]]
path = "coolant.inlet_temperature"
low = "{inlet[0]} degC"
high = "{inlet[1]} degC"
[[parameter]]
path = "coolant.flow"
low = "{flow[0]} L/min"
high = "{flow[1]} L/min"
[[parameter]]
path = "joint.front_outer_ring_seats.conductance"
low = "{seat[0]} W/m**2/K"
high = "{seat[1]} W/m**2/K"
{further}
[study]
design = "latin_hypercube"
size = {size}
seed = {seed}
backend = "{backend}"
film_uncertainty = {band}
outputs = [{outputs}]
"""
OUTPUTS = (
    "temperature.max_degC", "temperature.min_degC", "derived.largest_ring_difference_K",
    "derived.axial_gradient_K_per_m", "derived.cooler_heat_W", "bearings.F2.temperature_inner_degC",
    "bearings.R1.temperature_ball_degC", "bearings.F1.heat_W", "probes.SP02", "probes.COOLANT_OUT",
    "coolant.film_coefficient_W_m2K.value", "coolant.regime", "coolant.pressure_drop_Pa",
    "energy.heat_out_W.housing.channel_wall", "energy.heat_out_W.housing.outside", "energy.heat_in_W",
)  # fmt: skip
WIDE = {"inlet": (12, 35), "flow": (10, 40), "seat": (2000, 8000)}
INSIDE = {"inlet": (15, 32), "flow": (13, 35), "seat": (2500, 7000)}
SPEEDS = '[[parameter]]\npath = "operation.speed"\nvalues = ["1500 rpm", "3000 rpm"]\n'
FACTORS = (
    '[[parameter]]\npath = "coolant.film_factor"\nlow = {low}\nhigh = {high}\n'
    '[[parameter]]\npath = "bearing_set.front.heat_factor"\nlow = {low}\nhigh = {high}\n'
    '[[parameter]]\npath = "film.outside.coefficient"\nlow = "{air} W/m**2/K"\nhigh = "15 W/m**2/K"\n'
)


def study_file(folder, ranges=WIDE, outputs=OUTPUTS, **settings):
    path = folder / "study.toml"
    chosen = {"size": 40, "seed": 1, "backend": "auto", "band": "false", "further": ""} | settings
    named = ", ".join(f'"{output}"' for output in outputs)
    path.write_text(STUDY.format(**ranges, outputs=named, **chosen), encoding="utf-8")
    return path


def group_of(prepared):
    tasks = prepared.tasks
    assert len({task.structure for task in tasks}) == 1
    return GroupTask(tasks, tasks)


def worst_temperature(rows, tasks, question, solved):
    """Largest difference of any temperature to the full solves, and of the other numbers relative.

    ``solved`` keeps the full solves' rows by key for the next who asks.
    """
    by_key = {task.key: task for task in tasks}
    temperature, other = 0.0, 0.0
    for row in rows:
        task = by_key[row["key"]]
        if task.key not in solved:
            solved[task.key] = row_of(task, question, solve_checked(task))
        exact = solved[task.key]
        for column in question.columns:
            if isinstance(exact[column], str):
                assert row[column] == exact[column]
                continue
            difference = abs(row[column] - exact[column])
            if column.partition("@")[0].endswith(("_degC", "_K", "SP02", "COOLANT_OUT")):
                temperature = max(temperature, difference)
            else:
                other = max(other, difference / max(abs(exact[column]), 10.0))
    return temperature, other


@pytest.fixture(scope="module", autouse=True)
def own_cache(tmp_path_factory):
    """Models of earlier runs would bring their checked designs' rows no more."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(CACHE_VARIABLE, str(tmp_path_factory.mktemp("cache")))
        yield


@pytest.fixture(scope="module")
def by_table(tmp_path_factory):
    """The recorded spindle: a model for 40 designs, and 20 others inside their range."""
    place = tmp_path_factory.mktemp("by_table")
    prepared = prepare_study(
        "recorded_spindle", study_file(place, further=FACTORS.format(low=0.7, high=1.4, air=6)), QUICK
    )
    rows = answer_group(group_of(prepared), prepared.question)
    others = prepare_study(
        "recorded_spindle",
        study_file(place, INSIDE, size=20, seed=7, further=FACTORS.format(low=0.8, high=1.2, air=8)),
        QUICK,
    )
    return prepared, rows, others


def cached_model(prepared):
    model, rows, tables = model_of(group_of(prepared), prepared.question)
    assert rows == []  # from the cache
    return model, tables


@pytest.fixture(scope="module")
def solved():
    """Rows of full solves by key."""
    return {}


@pytest.mark.parametrize("number", [5, pytest.param(20, marks=pytest.mark.slow)])
def test_every_temperature_of_designs_not_used_to_build_is_within_20_mk(by_table, solved, number):
    prepared, _, others = by_table
    model, tables = cached_model(prepared)
    rows = answer_tasks(model, tables, others.tasks, others.question)
    assert len(rows) == 20
    rows = rows[:number]
    temperature, other = worst_temperature(rows, others.tasks, others.question, solved)
    assert temperature < 0.02
    assert other < 1e-3


def test_each_row_says_what_answered_it_and_three_were_solved_in_full(by_table):
    prepared, rows, _ = by_table
    backends = [row["backend"] for row in rows]
    assert (len(rows), backends.count("full"), backends.count("reduced")) == (40, 3, 37)
    model, _ = cached_model(prepared)
    assert {row["key"] for row in rows if row["backend"] == "full"} == set(model.checked)
    for row in rows:
        if row["backend"] == "full":
            assert row["error_estimate_K"] is None
        else:
            assert model.errors[TRUE_ERROR] * 0.99 <= row["error_estimate_K"] <= LARGEST_ERROR


def test_an_estimate_is_no_smaller_than_the_error(by_table, solved):
    prepared, _, others = by_table
    model, tables = cached_model(prepared)
    for row in answer_tasks(model, tables, others.tasks[:5], others.question):
        temperature, _ = worst_temperature([row], others.tasks, others.question, solved)
        assert temperature <= row["error_estimate_K"]


def test_a_design_outside_the_range_gets_no_answer(by_table, tmp_path):
    prepared, _, _ = by_table
    model, tables = cached_model(prepared)
    outside = {"inlet": (15, 32), "flow": (120, 130), "seat": (2500, 7000)}
    far = prepare_study(
        "recorded_spindle",
        study_file(tmp_path, outside, size=2, further=FACTORS.format(low=0.8, high=1.2, air=8)),
        QUICK,
    )
    assert answer_tasks(model, tables, far.tasks, far.question) == []


@pytest.mark.slow
def test_heat_and_films_that_follow_the_temperature(tmp_path):
    """The reference spindle: friction, ball contacts and oil at their own temperature, wetted ports."""
    prepared = prepare_study(
        "wu_tan_2016",
        study_file(tmp_path, size=8, backend="reduced", band="true", further=SPEEDS),
        (*QUICK, "heat.thermal_preload=false"),
    )
    rows = answer_group(group_of(prepared), prepared.question)
    assert len(rows) == 8
    reduced = [row for row in rows if row["backend"] == "reduced"]
    assert len(reduced) == 5
    temperature, other = worst_temperature(reduced[:2], prepared.tasks, prepared.question, {})
    assert temperature < 0.02
    assert other < 1e-3


@pytest.mark.usefixtures("unpictured")
@pytest.mark.slow
def test_a_sweep_is_the_same_however_it_runs_and_resumes(tmp_path):
    outputs = ("temperature.max_degC", "probes.SP02")
    path = study_file(tmp_path, outputs=outputs, size=34)
    summary = sweep_machine("recorded_spindle", path, tmp_path / "serial", QUICK)
    assert summary["backends"]["reduced"] == 31
    assert summary["backends"]["largest_error_estimate_K"] <= LARGEST_ERROR
    whole = (tmp_path / "serial" / RESULTS).read_bytes()
    sweep_machine("recorded_spindle", path, tmp_path / "processes", QUICK, jobs=2)
    assert (tmp_path / "processes" / RESULTS).read_bytes() == whole
    stopped = tmp_path / "stopped"
    stopped.mkdir()
    lines = whole.splitlines(keepends=True)
    (stopped / RESULTS).write_bytes(b"".join(lines[:12]))
    (stopped / MARKER).write_text("stopped", encoding="utf-8")
    sweep_machine("recorded_spindle", path, stopped, QUICK)
    assert (stopped / RESULTS).read_bytes() == whole


@pytest.mark.usefixtures("unpictured")
def test_few_designs_are_solved_in_full(tmp_path):
    path = study_file(tmp_path, size=2, outputs=("temperature.max_degC",))
    sweep_machine("recorded_spindle", path, tmp_path / "out", QUICK)
    assert [row["backend"] for row in read_results(tmp_path / "out")] == ["full", "full"]


def test_what_only_a_full_solve_has_is_refused_for_the_reduced_backend(tmp_path):
    path = study_file(tmp_path, backend="reduced", outputs=("energy.imbalance_relative",))
    words = r'is "reduced", but only full solves have energy\.imbalance_relative'
    with pytest.raises(FaultsError, match=words):
        prepare_study("recorded_spindle", path, QUICK)


def test_machines_that_no_projected_model_can_answer(tmp_path):
    path = study_file(tmp_path, size=2, backend="reduced")
    prepared = prepare_study("wu_tan_2016", path, QUICK)
    assert [task.structure for task in prepared.tasks] == ["", ""]
    assert "each place of its surface" in refusal(load_machine("small_two_start"))
    assert "preload follows" in refusal(load_machine("wu_tan_2016"))
    assert refusal(load_machine("wu_tan_2016", ["heat.thermal_preload=false"])) == ""


def test_a_model_comes_back_from_disk(by_table, tmp_path):
    model, _ = cached_model(by_table[0])
    model.save(tmp_path / "model.npz")
    again = ThermalModel.load(tmp_path / "model.npz")
    assert again.checked == model.checked
    assert again.gap_radii == model.gap_radii
    assert np.array_equal(again.operators, model.operators)
    (tmp_path / "model.npz").write_bytes(b"damaged")
    assert ThermalModel.load(tmp_path / "model.npz") is None
    assert ThermalModel.load(tmp_path / "none.npz") is None


def test_a_structure_is_what_the_mesh_and_the_operators_depend_on(by_table):
    builder = by_table[0].builder
    question = Question(("temperature.max_degC",), False)
    content = builder._content

    def structure(*overrides):
        return TaskBuilder(content, question).task(Design(1, overrides, {})).structure

    base = structure()
    for free in (
        "operation.speed=500 rpm",
        "coolant.flow=12 L/min",
        "materials.cast_iron.density=7 g/cm**3",
    ):
        assert structure(free) == base
    for bound in (
        "channel.depth=12 mm",
        "coolant.film_model=helical",
        "probe.SP01.r=97 mm",
        "heat.model=skf",
    ):
        assert structure(bound) != base


def test_tables_of_heat_are_made_wider_where_they_end(by_table):
    prepared, _, others = by_table
    model, _ = cached_model(prepared)
    narrow = BearingTables(FIRST_TABLES[0], FIRST_TABLES[0] + 5.0)
    rows = answer_tasks(model, narrow, others.tasks[:2], others.question)
    assert len(rows) == 2
    assert narrow.high > FIRST_TABLES[0] + 10.0
