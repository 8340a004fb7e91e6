"""Limits, dominance, certainty within the film's band, and sensitivities."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from spindle_fem.commands.console import _best_designs
from spindle_fem.definition.load import load_machine
from spindle_fem.errors import SpecError, UnitError
from spindle_fem.studies.sweep.designs import Axis
from spindle_fem.studies.sweep.judge_designs import Limit, certainly_beaten, dominated, judged, rank
from spindle_fem.studies.sweep.outputs import (
    limit_of,
    only_full,
    output_fault,
    output_paths,
    unit_of,
    value_of,
)
from spindle_fem.studies.sweep.sensitivity import neighbours, sensitivities
from spindle_fem.studies.sweep.study_file import Study


def row(number, **values):
    return {
        "design": number,
        "status": "ok",
        "reason": "",
        "feasible": "yes",
        "geometry": str(number),
        **values,
    }


def test_limits_hold_at_every_end_of_the_film():
    limit = Limit("p_Pa", None, 5.0)
    inside = row(1, p_Pa=4.0)
    outside = row(2, p_Pa=4.0) | {"p_Pa@film_low": 6.0, "p_Pa@film_high": 3.0}
    assert judged(inside, [limit]) == {"feasible": "yes", "reason": ""}
    assert judged(outside, [limit]) == {"feasible": "no", "reason": "p_Pa is 6 Pa, allowed at most 5 Pa"}
    assert judged({**inside, "status": "failed", "reason": "hot"}, [limit]) == {
        "feasible": None,
        "reason": "hot",
    }


POINTS = arrays(float, st.tuples(st.integers(1, 12), st.just(2)), elements=st.integers(-5, 5).map(float))


@given(POINTS)
def test_front_by_definition(values):
    beaten = dominated(values)
    for index, value in enumerate(values):
        others = [other for other in values if np.all(other <= value) and np.any(other < value)]
        assert beaten[index] == bool(others)
    assert not beaten.all()


@given(POINTS, st.floats(0.0, 3.0))
def test_a_wider_band_never_makes_more_certain(values, width):
    sure = certainly_beaten(values, values)
    unsure = certainly_beaten(values - width, values + width)
    assert np.all(sure | ~unsure)


def study(film_uncertainty, **directions):
    return Study.model_validate(
        {
            "schema": "spindle-fem/study/1",
            "parameter": [{"path": "x", "values": [1]}],
            "study": {"outputs": ["a_K"], "film_uncertainty": film_uncertainty},
            "objective": [{"output": path, "direction": way} for path, way in directions.items()],
        }
    )


def test_better_only_when_it_is_so_within_the_band():
    band = {"a_K@film_low": 0.0, "a_K@film_high": 0.0}
    rows = [
        row(1, a_K=1.0) | band | {"a_K@film_low": 1.5, "a_K@film_high": 0.5},
        row(2, a_K=1.2) | band | {"a_K@film_low": 1.9, "a_K@film_high": 0.9},
        row(3, a_K=3.0) | band | {"a_K@film_low": 3.5, "a_K@film_high": 2.0},
        row(4, a_K=0.0) | band | {"feasible": "no"},
    ]
    ranking = rank(study(True, a_K="minimize"), rows, 0.0)
    assert [ranking.rows[i]["design"] for i in ranking.front] == [1]
    assert [ranking.rows[i]["design"] for i in ranking.contenders] == [1, 2]
    without = rank(study(False, a_K="minimize"), rows, 0.0)
    assert [without.rows[i]["design"] for i in without.contenders] == [1]
    upwards = rank(study(False, a_K="maximize"), rows, 0.0)
    assert [upwards.rows[i]["design"] for i in upwards.front] == [3]


def test_no_ranking_without_objectives_or_feasible_designs():
    assert rank(study(False), [row(1, a_K=1.0)], 0.03) is None
    assert rank(study(False, a_K="minimize"), [row(1, a_K=1.0) | {"feasible": "no"}], 0.03) is None


def test_designs_nearer_than_the_meshes_error_are_as_good_unless_they_share_the_mesh():
    rows = [
        row(1, a_K=1.00, p_Pa=5.0),
        row(2, a_K=1.02, p_Pa=5.0),
        row(3, a_K=1.02, p_Pa=5.0) | {"geometry": "1"},
        row(4, a_K=1.04, p_Pa=5.0),
        row(5, a_K=1.01, p_Pa=6.0),
        row(6, a_K=1.02, p_Pa=4.0) | {"feasible": "no"},
    ]

    def told(mesh_error, **directions):
        ranking = rank(study(False, **directions), rows, mesh_error)
        return [[ranking.rows[i]["design"] for i in found] for found in (ranking.front, ranking.alike)]

    assert told(0.03, a_K="minimize") == [[1], [2, 5]]
    assert told(0.0, a_K="minimize") == [[1], []]
    # A pressure does not follow from the mesh: 5 is worse for certain.
    assert told(0.03, a_K="minimize", p_Pa="minimize") == [[1], [2]]
    assert told(0.03, p_Pa="maximize") == [[5], []]


def axis(path, sampled=False):
    return Axis(path, (), 0.0, 1.0, None, sampled)


def test_whole_grid_is_decomposed_exactly():
    """y = 3a + b + ab on {-1, 1}²: variances 9, 1 and 1 of 11."""
    rows = [
        row(i, a=a, b=b, y=3 * a + b + a * b) for i, (a, b) in enumerate([(-1, -1), (-1, 1), (1, -1), (1, 1)])
    ]
    (found,) = sensitivities([axis("a"), axis("b")], rows, ["y"])
    assert found.first == pytest.approx((9 / 11, 1 / 11))
    assert found.total == pytest.approx((10 / 11, 2 / 11))
    assert found.slope == pytest.approx((6.0, 2.0))
    assert found.method == "whole grid"


def test_sample_gives_the_exact_shares_of_a_quadratic():
    """y = x + z² on [-1, 1]²: variances 1/3 and 4/45."""
    points = np.random.default_rng(3).uniform(-1.0, 1.0, (40, 2))
    points[0], points[1] = (-1.0, -1.0), (1.0, 1.0)
    rows = [
        row(i, x=x, z=z, y=x + z**2, junk=v)
        for i, ((x, z), v) in enumerate(zip(points, points[::-1, 0] ** 5, strict=True))
    ]
    (found,) = sensitivities(
        [axis("x"), axis("z")], rows, ["y", "junk"]
    )  # noise is not explained, and left out
    share = (1 / 3) / (1 / 3 + 4 / 45)
    assert found.first == pytest.approx((share, 1.0 - share), abs=0.02)
    assert found.prediction == pytest.approx(1.0, abs=1e-9)


def test_neighbours_by_scaled_distance():
    rows = [
        row(i, depth=0.001 * d, temperature=t)
        for i, (d, t) in enumerate([(5, 10), (6, 10), (5, 40), (9, 11)])
    ]
    near = neighbours([axis("depth"), axis("temperature")], rows, rows[0], 2)
    assert [item["design"] for item in near] == [1, 2]


def test_outputs_of_a_machine_and_their_units():
    spec = load_machine("small_two_start")
    paths = output_paths(spec)
    assert {"bearings.B1.ring_difference_K", "probes.B1_SEAT", "derived.cooler_heat_W"} <= set(paths)
    assert output_fault("bearings.B1.terms_W.cage", spec, "here") is None
    unknown = str(output_fault("bearings.B1.ring_diference_K", spec, "here"))
    assert 'Did you mean "bearings.B1.ring_difference_K"? Also near: ' in unknown
    assert len(unknown) < 300
    assert not any(path.startswith("coolant") for path in output_paths(load_machine("uncooled")))
    assert unit_of("coolant.film_coefficient_W_m2K.low").text == "W/(m²·K)"
    assert unit_of("bearings.B1.terms_W.cage").text == "W"


def test_limits_take_their_unit():
    assert limit_of("40 degC", "temperature.max_degC", "x") == 40.0
    assert limit_of("3 K", "bearings.F1.ring_difference_K", "x") == 3.0
    assert limit_of("12 L/min", "coolant.flow_m3_s", "x") == pytest.approx(2e-4)
    assert limit_of("15 deg", "bearings.F1.contact_angle_inner_deg", "x") == pytest.approx(15.0)
    assert limit_of("0.5 um", "bearings.F1.film_um", "x") == pytest.approx(0.5)
    with pytest.raises(UnitError, match="a unit is needed"):
        limit_of(5, "coolant.pressure_drop_Pa", "constraint[1].max")
    with pytest.raises(SpecError, match="is no output of this design"):
        value_of({"bearings": {"F1": {"terms_W": {}}}}, "bearings.F1.terms_W.cage")


def test_growth_and_preload_are_outputs_of_full_solves():
    paths = output_paths(load_machine("wu_tan_2016"))
    assert {"growth.nose_axial_um", "growth.nose_tilt_up_urad", "equilibrium.preload_ratio.F3"} <= set(paths)
    stiffness = "bearings.F3.axial_stiffness_N_um"
    assert stiffness in paths
    assert only_full(stiffness)
    assert limit_of("150 N/um", stiffness, "constraint[1].min") == pytest.approx(150.0)
    assert limit_of("50 um", "growth.nose_axial_um", "constraint[1].max") == pytest.approx(50.0)
    assert limit_of("0.1 mrad", "growth.nose_tilt_up_urad", "constraint[1].max") == pytest.approx(100.0)
    assert only_full("growth.nose_axial_um")
    assert not only_full("bearings.F3.preload_N")
    # without a flange nothing holds the nose
    assert "growth.nose_axial_um" not in output_paths(load_machine("small_two_start"))


def test_axial_loads_of_balls_are_outputs_of_full_solves():
    # springs of the rear press on a front set in tandem, which has no preload of its own
    paths = output_paths(load_machine("router_spindle"))
    loads = {path for path in paths if path.endswith(".axial_load_N")}
    assert loads == {f"bearings.{name}.axial_load_N" for name in ("F1", "F2", "R1", "R2")}
    assert all(map(only_full, loads))
    assert limit_of("1.2 kN", "bearings.F1.axial_load_N", "constraint[1].max") == pytest.approx(1200.0)
    # rollers take none, and a table of heat knows none
    rolling = output_paths(load_machine("belt_lathe"))
    assert "bearings.L1.axial_load_N" in rolling
    assert "bearings.F1.axial_load_N" not in rolling
    table = output_paths(load_machine("wu_tan_2016", ["heat.model=table"]))
    assert not any(path.endswith(".axial_load_N") for path in table)


def test_what_a_stream_does_is_an_output_of_machines_with_streams():
    spec = load_machine("grinding_spindle")
    paths = set(output_paths(spec))
    named = {path for path in paths if path.startswith("circuits.")}
    stems = {path.rsplit(".", 1)[0] for path in named}
    assert stems == {f"circuits.{circuit.name}" for circuit in spec.circuits}
    assert named
    assert all(map(only_full, named))
    stem = min(stems)
    assert unit_of(f"{stem}.pressure_drop_Pa").text == "Pa"
    assert unit_of(f"{stem}.outlet_degC").text == "°C"
    assert not any(path.startswith("circuits.") for path in output_paths(load_machine("uncooled")))


def test_the_terminal_says_which_designs_are_as_good():
    content = {
        "objectives": [{"output": "a_K", "direction": "minimize"}],
        "parameters": [],
        "outputs": [{"path": "a_K", "unit": "K"}],
        "optimum": {"best": {"design": 1, "parameters": {}, "outputs": {"a_K": 1.0}}},
    }
    # Folders of earlier versions do not say it.
    assert len(_best_designs(content)) == 2
    content["optimum"]["within_mesh_error"] = [2, 5]
    assert _best_designs(content)[-1].endswith("as good within the mesh's error: 2, 5")
