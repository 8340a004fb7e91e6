"""Study files: what they may hold, every fault at once, and the designs they make."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from spindle_fem.definition.load import find_machine, read_definition
from spindle_fem.errors import FaultsError, SpecError
from spindle_fem.studies.sweep.designs import build_axes, plan_designs, sample_points
from spindle_fem.studies.sweep.prepared_study import prepare_study
from spindle_fem.studies.sweep.study_file import load_study

HEAD = 'schema = "spindle-fem/study/1"\n'
OUTPUTS = '[study]\noutputs = ["temperature.max_degC"]\n'
DEPTHS = '[[parameter]]\npath = "channel.depth"\nvalues = ["5 mm", "0.6 cm"]\n'


@pytest.fixture
def write(tmp_path):
    def written(text):
        path = tmp_path / "study.toml"
        path.write_text(HEAD + text, encoding="utf-8")
        return path

    return written


@pytest.fixture(scope="module")
def content():
    return read_definition(find_machine("small_two_start"))


def designs_of(path, content):
    study = load_study(path)
    return plan_designs(study, build_axes(study, content, path.name))


def test_grid_is_every_combination_in_order(write, content):
    text = DEPTHS + (
        '[[parameter]]\npath = "coolant.inlet_temperature"\nlow = "10 degC"\nhigh = "40 degC"\nnumber = 3\n'
    )
    designs = designs_of(write(text + OUTPUTS), content)
    assert [design.number for design in designs] == [1, 2, 3, 4, 5, 6]
    assert [tuple(design.values.values()) for design in designs] == [
        (depth, temperature) for depth in (0.005, 0.006) for temperature in (10.0, 25.0, 40.0)
    ]
    assert designs[0].overrides == ("channel.depth=5 mm", "coolant.inlet_temperature=283.15 K")


def test_words_whole_numbers_and_speeds(write, content):
    text = (
        '[[parameter]]\npath = "channel.hand"\nvalues = ["right", "left"]\n'
        '[[parameter]]\npath = "channel.starts"\nlow = 1\nhigh = 3\nnumber = 3\n'
        '[study]\noutputs = ["temperature.max_degC"]\nspeeds = ["1000 rpm", "2000 rpm"]\n'
    )
    designs = designs_of(write(text), content)
    assert len(designs) == 12
    assert designs[-1].values["channel.hand"] == "left"
    assert designs[-1].values["channel.starts"] == 3
    assert designs[-1].values["operation.speed"] == pytest.approx(2000 * np.pi / 30)


@pytest.mark.parametrize("kind", ["sobol", "latin_hypercube"])
def test_sample_fills_the_range_evenly(write, content, kind):
    text = (
        '[[parameter]]\npath = "channel.depth"\nlow = "4 mm"\nhigh = "8 mm"\n'
        '[[parameter]]\npath = "channel.hand"\nvalues = ["right", "left"]\n'
        f'[study]\ndesign = "{kind}"\nsize = 16\noutputs = ["temperature.max_degC"]\n'
    )
    designs = designs_of(write(text), content)
    depths = np.sort([design.values["channel.depth"] for design in designs])
    # One design in each sixteenth of the range: both kinds of sample are stratified.
    assert np.floor((depths - 0.004) / 0.004 * 16).astype(int).tolist() == list(range(16))
    assert [design.values["channel.hand"] for design in designs].count("left") == 8
    assert designs_of(write(text), content) == designs


def test_a_sampled_range_crosses_the_grid_of_the_others(write, content):
    text = DEPTHS + (
        '[[parameter]]\npath = "coolant.flow"\nlow = "5 L/min"\nhigh = "10 L/min"\n'
        'sample = "sobol"\nnumber = 4\n'
    )
    designs = designs_of(write(text + OUTPUTS), content)
    assert len(designs) == 8
    assert len({design.values["coolant.flow"] for design in designs}) == 4


@settings(max_examples=25)
@given(size=st.integers(1, 40), dimensions=st.integers(1, 6), seed=st.integers(0, 1000))
def test_a_larger_sobol_sample_keeps_the_smaller_one(size, dimensions, seed):
    small, large = (sample_points("sobol", dimensions, number, seed) for number in (size, size + 20))
    assert np.array_equal(small, large[:size])
    assert np.all((small >= 0.0) & (small < 1.0))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (DEPTHS + "[study]\noutputs = []\n", "study.outputs"),
        (DEPTHS, "study: is missing"),
        (OUTPUTS, "parameter"),
        (DEPTHS + DEPTHS + OUTPUTS, 'names "channel.depth" again'),
        ('[[parameter]]\npath = "channel.depth"\nlow = "5 mm"\n' + OUTPUTS, "high: is missing"),
        (
            '[[parameter]]\npath = "channel.depth"\nlow = "5 mm"\nhigh = "9 mm"\n' + OUTPUTS,
            "number: is missing",
        ),
        (DEPTHS.replace("values", "value") + OUTPUTS, 'Did you mean "values"'),
        (DEPTHS + OUTPUTS + "[search]\ntrials = 3\n", "Add an [[objective]]"),
        (DEPTHS + OUTPUTS.replace("[study]", '[study]\ndesign = "sobol"'), "study.size: is missing"),
        (DEPTHS + OUTPUTS + '[[constraint]]\noutput = "coolant.pressure_drop_Pa"\n', "has no limit"),
        (
            DEPTHS + OUTPUTS + '[[reference]]\nname = "now"\nvalues = {"channel.width" = "8 mm"}\n',
            "channel.depth",
        ),
    ],
)
def test_faults_of_the_file_alone(write, text, said):
    with pytest.raises(FaultsError) as caught:
        load_study(write(text))
    assert said in str(caught.value)
    assert caught.value.exit_status == 2


def test_unknown_schema_and_other_faults_are_told_together(tmp_path):
    path = tmp_path / "s.toml"
    path.write_text('schema = "spindle-fem/study/9"\n' + DEPTHS + "[study]\noutputs = []\n", encoding="utf-8")
    with pytest.raises(FaultsError) as caught:
        load_study(path)
    assert len(caught.value.faults) == 2
    assert "spindle-fem/study/9" in str(caught.value)


def test_faults_against_the_machine_are_told_together(write):
    text = (
        '[[parameter]]\npath = "channel.depht"\nvalues = ["5 mm"]\n'
        '[[parameter]]\npath = "coolant.flow"\nvalues = ["5 kg"]\n'
        '[[parameter]]\npath = "channel.width"\nlow = "9 mm"\nhigh = "6 mm"\nnumber = 2\n'
        '[[parameter]]\npath = "heat.model"\nvalues = ["guess"]\n'
        '[study]\noutputs = ["temperature.max_degc", "bearings.B9.heat_W"]\n'
        '[[objective]]\noutput = "coolant.regime"\n'
    )
    with pytest.raises(FaultsError) as caught:
        prepare_study("small_two_start", write(text))
    message = str(caught.value)
    assert 'Did you mean "depth"?' in message
    assert "wrong dimension" in message
    assert "is not above low" in message
    assert "'guess' is not allowed" in message
    assert 'Did you mean "temperature.max_degC"?' in message
    assert "bearings.B9.heat_W" in message
    assert '"coolant.regime" is a word' in message
    assert len(caught.value.faults) == 7


def test_limit_of_another_dimension_is_refused(write):
    text = DEPTHS + OUTPUTS + '[[constraint]]\noutput = "coolant.pressure_drop_Pa"\nmax = "5 K"\n'
    with pytest.raises(SpecError, match=r"constraint\[1\]\.max"):
        prepare_study("small_two_start", write(text))


def test_study_without_any_possible_design_is_refused(write):
    text = '[[parameter]]\npath = "channel.depth"\nvalues = ["60 mm", "-1 mm"]\n' + OUTPUTS
    with pytest.raises(SpecError, match="none of its 2 designs is possible") as caught:
        prepare_study("small_two_start", write(text))
    assert "breaks through" in str(caught.value)
    assert caught.value.exit_status == 2


def test_tasks_share_a_geometry_and_tell_impossible_designs(write):
    text = (
        '[[parameter]]\npath = "channel.depth"\nvalues = ["5 mm", "60 mm"]\n'
        '[[parameter]]\npath = "coolant.flow"\nvalues = ["5 L/min", "10 L/min"]\n' + OUTPUTS
    )
    tasks = prepare_study("small_two_start", write(text)).tasks
    assert [task.spec is None for task in tasks] == [False, False, True, True]
    assert tasks[0].geometry == tasks[1].geometry != ""
    assert len({task.key for task in tasks}) == 4
    assert "channel.depth" in tasks[2].reason


def test_an_impossible_design_is_so_on_its_own_machine_only(write):
    """A width that its pitch forbids: the verdict must not be taken over for another machine."""
    path = write('[[parameter]]\npath = "channel.width"\nvalues = ["8 mm", "30 mm"]\n' + OUTPUTS)
    tasks = [prepare_study("small_two_start", path, given).tasks for given in ((), ("channel.depth=7mm",))]
    assert tasks[0][1].spec is None
    assert tasks[0][1].key != tasks[1][1].key


def test_the_same_machine_written_otherwise_has_the_same_key(write):
    one = '[[parameter]]\npath = "channel.depth"\nvalues = ["{}", "6 mm"]\n' + OUTPUTS
    keys = [
        prepare_study("small_two_start", write(one.format(text))).tasks[0].key for text in ("5 mm", "0.5 cm")
    ]
    assert keys[0] == keys[1]
    renamed = prepare_study("small_two_start", write(one.format("5 mm")), ["name=another", "title=Another"])
    assert renamed.tasks[0].key == keys[0]
    slower = prepare_study("small_two_start", write(one.format("5 mm")), ["operation.speed=7000 rpm"])
    assert slower.tasks[0].key != keys[0]
    assert slower.tasks[0].geometry == renamed.tasks[0].geometry


def test_the_study_that_ships_is_valid():
    """The paper's question on the reference machine: every design is possible, its optimum among them."""
    prepared = prepare_study(
        "wu_tan_2016", Path(__file__).parents[2] / "studies" / "channel_depth_and_oil.toml"
    )
    assert [task.reason for task in prepared.tasks] == [""] * 36
    assert len({task.geometry for task in prepared.tasks}) == 5
    optimum = prepared.tasks[prepared.references["the paper's optimum"] - 1].spec
    assert optimum.channel.depth == pytest.approx(0.019)
    assert optimum.coolant.inlet_temperature == pytest.approx(304.15)


def test_how_designs_are_meshed_is_one_of_two_words(write):
    assert load_study(write(DEPTHS + OUTPUTS)).study.mesh == "moved"
    assert load_study(write(DEPTHS + OUTPUTS + 'mesh = "new"\n')).study.mesh == "new"
    with pytest.raises(FaultsError, match=r'study\.mesh.*"stretched".*moved, new'):
        load_study(write(DEPTHS + OUTPUTS + 'mesh = "stretched"\n'))
