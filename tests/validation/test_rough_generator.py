import gzip

import numpy as np
import pytest

from validation import machine
from validation.finite_volume import assemble
from validation.generate_rough import choose, draw_case, make_case, with_twins
from validation.kept_back import repeats, write_other_run
from validation.machine import Deviation, build_grid
from validation.reduction import load_reduced
from validation.rough import AsMounted, draw_deviation
from validation.stepping import Drive, nominal_machine, run

SMALL = {"sectors": 8, "size": 60, "draws": 1}
SHAPE = Deviation(0.02, 1e-3, -2e-3, (0.1,), ((1e-3, 1e-3),) * 5)


@pytest.fixture(scope="module")
def shapes(tmp_path_factory):
    cache = tmp_path_factory.mktemp("cache")
    return load_reduced(cache, **SMALL), load_reduced(cache, **SMALL, deviation=SHAPE)


def test_housing_grows_outwards_and_nothing_else_moves():
    drawn, grown = (assemble(build_grid(8, deviation=d)) for d in (machine.AS_DRAWN, Deviation(outer=0.03)))
    mean = {name: drawn.readings[f"mean:{name}"] @ drawn.capacity for name in ("shaft", "F1.outer")}
    assert mean == pytest.approx({n: grown.readings[f"mean:{n}"] @ grown.capacity for n in mean})
    area = {
        n: (drawn.film_groups[n].sum(), grown.film_groups[n].sum()) for n in ("outside:middle", "nose_end")
    }
    assert area["nose_end"][0] == pytest.approx(area["nose_end"][1])
    assert 1.02 < area["outside:middle"][1] / area["outside:middle"][0] < 1.06


def test_film_along_the_helix_keeps_the_area_by_cosines():
    drawn, uneven = (
        assemble(build_grid(8, deviation=d)).wall for d in (machine.AS_DRAWN, Deviation(film=(0.1,)))
    )
    assert uneven.sum() == pytest.approx(drawn.sum(), rel=1e-6)
    assert uneven[:, 0].sum() > 1.05 * drawn[:, 0].sum()


def test_shape_and_mounting_change_what_is_read(shapes):
    n = 300
    drive = Drive(
        10.0 * np.arange(n), np.full(n, 3000.0), np.full(n, 1750.0), np.full(n, 20.0), np.full(n, 15.0)
    )
    drawn, deviating = (run(model, drive, nominal_machine()).readings for model in shapes)
    hung = AsMounted(tool_kg=3.0, bracket=1.0, top=2.0, ball=0.2, shape={"F": ((0.04, 1.0),)})
    mounted = run(shapes[0], drive, nominal_machine(), (hung,)).readings
    for other in (deviating, mounted):
        assert 0.01 < np.abs(other - drawn)[-1].max() < 2.0


@pytest.mark.slow
def test_case_says_what_structure_leaves(shapes, tmp_path):
    answer = make_case(tmp_path, shapes[0], [(SHAPE, shapes[1])], 4, 1)
    assert answer["family"] == "consistent"
    assert answer["noise"]["total_K"] == pytest.approx(
        np.hypot(answer["noise"]["sensor_K"], answer["noise"]["structure_K"])
    )
    table = gzip.decompress((tmp_path / "inputs" / "case_0001" / "recording.csv.gz").read_bytes()).decode()
    header = table.splitlines()[0].split(",")
    assert header[1 : 1 + len(answer["channels"])] == answer["channels"]
    assert 0.0 < max(answer["structure"]["refitted_residual_K"].values()) < 1.0


@pytest.mark.slow
def test_a_further_run_is_of_the_same_machine_in_another_cycle(shapes, tmp_path):
    case = draw_case(shapes[0], [(SHAPE, shapes[1])], 4, 2)
    times, shown = write_other_run(tmp_path / "case_0002", case, 4, 2)
    assert (tmp_path / "case_0002" / "recording.toml").exists()
    np.testing.assert_array_equal(write_other_run(tmp_path / "again", case, 4, 2)[1], shown)
    first = case.readings(case.plans[0])
    assert shown.shape != first.shape or np.abs(shown - first).max() > 1.0
    assert times.size == len(shown)


def test_what_belongs_to_the_hours_of_one_recording_is_not_repeated():
    assert repeats({"effects": [{"effect": "mount_sink", "intervals": None}]})
    assert not repeats({"effects": [{"effect": "unrecorded_cooling", "intervals": [[0.0, 60.0]]}]})
    assert not repeats({"effects": [{"effect": "mount_sink"}, {"effect": "sensor_drift"}]})


def test_families_come_in_turn():
    drawn = [choose(n, np.random.default_rng(n)) for n in range(1, 81)]
    assert sum(family == "consistent" for family, _ in drawn) == 20
    assert {len(e) for family, e in drawn if family == "triple"} == {3}
    assert {family for family, _ in drawn} == {
        "consistent", "single", "pair", "triple", "sensor_beside", "outside_catalogue",
    }  # fmt: skip


def test_what_reads_like_the_truth_makes_a_case_ambiguous():
    judged = {"acceptable_sets": [], "indistinguishable": [{"effect": "seal_friction", "component": "nose"}]}
    effect = type("E", (), {"effect": "windage", "acceptable": ["shaft"]})()
    found = with_twins([effect], judged)
    assert found["verdict"] == "ambiguous"
    assert found["acceptable_sets"] == [[{"effect": "seal_friction", "components": ["nose"]}]]


def test_deviations_stay_within_tolerances():
    drawn = [draw_deviation(np.random.default_rng(k)) for k in range(50)]
    assert max(abs(d.outer) for d in drawn) <= 0.03
    assert max(abs(d.shift) for d in drawn) <= 2.5e-3
