"""The riddle's errors by speed, and what the scoring makes of stated probabilities."""

import gzip
import json

import numpy as np
import pytest

from validation import riddle
from validation.asked import held_against_asked, wilson
from validation.machine import CHANNELS
from validation.recorder import draw_noise
from validation.score import by_strength, effect_confusion, ranked_sets, same_extent
from validation.stepping import draw_as_built


def stairs(step=60.0):
    levels = np.repeat([*riddle.SPEEDS_RPM, 0.0], 60)
    return np.arange(levels.size) * step, levels


def test_error_by_speed_is_that_of_the_end_of_each_step_up():
    time, speed = stairs()
    error = np.where(speed == 2500, 3.0, 0.5)[:, None] * np.ones((1, 6))
    start = np.flatnonzero(speed == 2500)[0]
    error[start : start + 20] = 99.0
    error[speed == 2500, 1] = np.nan
    rows = riddle.by_speed(time, speed, error)
    assert [row["speed_rpm"] for row in rows] == list(map(float, riddle.SPEEDS_RPM))
    worst = max(rows, key=lambda row: row["rms_K"])
    assert (worst["speed_rpm"], worst["rms_K"]) == (2500.0, 3.0)
    assert worst["channels_K"][1] is None


def test_cool_down_is_no_part_of_standstill():
    time, speed = stairs()
    error = np.zeros((time.size, 6))
    error[-60:] = 50.0
    assert riddle.by_speed(time, speed, error)[0]["rms_K"] == 0.0


def test_errors_of_files_meet_by_stamp_whatever_the_order_of_rows(tmp_path):
    time, speed = stairs()
    read = np.full((time.size, 6), 30.0)
    rows = [
        ",".join([f"{t + 500:g}", *(f"{v:.3f}" for v in values), "20", "15", f"{s:g}", "1750"])
        for t, values, s in zip(time, read, speed, strict=True)
    ]
    rows[10], rows[11] = rows[11], rows[10]
    rows.insert(20, rows[20])
    rows[30] = rows[30].replace("30.000", "", 1)
    rows[40] = rows[40].replace("30.000", "77.000", 1)
    header = ",".join(["time_s", *CHANNELS, "ambient", "coolant_in", "speed", "thrust"])
    (tmp_path / "recording.csv.gz").write_bytes(gzip.compress("\n".join([header, *rows]).encode()))
    simulated = ["time_s," + ",".join(CHANNELS)]
    simulated += [f"{t:g}," + ",".join(["28.5"] * 6) for t in time]
    (tmp_path / "after.csv").write_text("\n".join(simulated), encoding="utf-8")
    found = riddle.errors_by_speed(tmp_path, tmp_path / "after.csv")
    assert [row["rms_K"] for row in found] == pytest.approx([1.5] * 10)


def test_step_test_visits_every_speed_and_cools():
    drive = riddle.step_test(np.random.default_rng(0), hold=600.0)
    assert list(np.unique(drive.speed)) == list(riddle.SPEEDS_RPM)
    assert drive.speed[-1] == 0.0
    assert (np.diff(drive.speed[: drive.speed.argmax() + 1]) >= 0).all()
    assert ((drive.thrust > 0) == (drive.speed > 0)).all()


def test_riddle_answers_stand_apart_from_inputs(tmp_path, monkeypatch):
    from validation.reduction import load_reduced

    model = load_reduced(tmp_path / "cache", sectors=8, size=60, draws=1)
    monkeypatch.setattr(riddle, "_HOLD_S", 600.0)
    monkeypatch.setattr(riddle, "what_is_known", lambda study, effects: None)
    monkeypatch.setattr(riddle, "Study", lambda *arguments: None)
    answer = riddle.write(tmp_path, 3, model=model, calibrated=True)
    assert [effect["effect"] for effect in answer["effects"]] == ["thermal_preload", "starvation"]
    assert answer["verdict"] == "missing_physics"
    inputs = sorted(path.name for path in (tmp_path / "inputs" / riddle.NAME).iterdir())
    assert inputs == ["calibration.csv.gz", "calibration.toml", "recording.csv.gz", "recording.toml"]
    for path in (tmp_path / "inputs" / riddle.NAME).glob("*.toml"):
        text = path.read_text(encoding="utf-8")
        assert not any(word in text for word in ("preload", "starvation", "as_built"))
    rng = np.random.default_rng([3, 2016])
    assert answer["as_built"]["heat_F"] == pytest.approx(draw_as_built(rng)["heat_F"], abs=1e-4)
    assert json.loads((tmp_path / "answers" / "riddle.json").read_text())["noise"]["white_K"] == (
        draw_noise(rng).white_K
    )


def test_a_pair_is_as_probable_as_its_set():
    findings = [{"effect": "a", "component": "x", "probability": 0.4}] * 2
    assert ranked_sets({"findings": findings, "set_probability": 0.8})[0][1] == 0.8
    assert ranked_sets({"findings": findings})[0][1] == 0.4


@pytest.mark.parametrize(("share", "number"), [(0.9, 40), (0.5, 7), (0.02, 200)])
def test_wilson_interval_ends_where_the_score_test_rejects(share, number):
    for end in wilson(share, number):
        assert (share - end) ** 2 == pytest.approx(1.645**2 * end * (1.0 - end) / number)


def test_wilson_interval_at_its_limits():
    assert wilson(0.0, 10)[0] == 0.0
    assert wilson(1.0, 10)[1] == 1.0
    assert wilson(0.5, 0) == (0.0, 1.0)


def test_what_is_asked_for():
    summary = {
        "false_alarms": {"share": 0.05, "of": 40},
        "interval_coverage": {"share": 0.97, "of": 60},
        "heldout_after_over_noise": {"of": 9, "median": 1.04, "worst": 1.6},
        "clear_pair_exact": {"share": None, "of": 0},
    }
    rows = {row["key"]: row for row in held_against_asked(summary)}
    assert rows["false_alarms"]["met"] is False
    assert rows["interval_coverage"]["met"] is False
    assert rows["heldout_after_over_noise.median"]["met"] is True
    assert rows["heldout_after_over_noise.worst"]["met"] is False
    assert rows["clear_pair_exact"]["met"] is None
    assert rows["wall_s.worst"]["value"] is None


def row(truth, found, ratio, *, exact=False, rank=None, verdict="missing_physics"):
    return {"truth": truth, "found": found, "ratio": ratio, "exact": exact, "rank": rank, "verdict": verdict}


def test_outcome_by_strength_counts_each_case_once():
    rows = [
        row(["a@x"], ["a@x"], 3.0, exact=True, rank=1),
        row(["a@x"], ["b@x"], 3.0, rank=2),
        row(["a@x"], [], 0.2, verdict="consistent"),
        row(["a@x"], ["b@x"], 9.0),
        row([], [], None, verdict="consistent"),
    ]
    bins = by_strength(rows)
    assert [(item["from"], item["cases"]) for item in bins] == [(0.0, 1), (2.0, 2), (8.0, 1)]
    for item in bins:
        parts = item["named"] + item["among_the_sets"] + item["consistent"] + item["other"]
        assert parts == item["cases"]
    assert bins[1]["named"] == bins[1]["among_the_sets"] == 1


def test_confusion_of_effects_leaves_pairs_out():
    rows = [
        row(["a@x"], ["b@y"], 3.0),
        row([], [], None, verdict="consistent"),
        row(["a@x", "b@y"], ["a@x"], 3.0),
        row(["c@z"], [], 0.2, verdict="unexplained"),
    ]
    assert effect_confusion(rows) == {"a": {"b": 1}, "nothing": {"nothing": 1}, "c": {"unexplained": 1}}


def test_parameter_of_a_bearing_is_not_that_of_its_set():
    assert not same_extent("front_bearings", "F2")
    assert not same_extent("R1", "rear_bearings")
    assert same_extent("front_bearings", "front_bearings")
    assert same_extent("flange", "flange")
    assert same_extent("housing", "SP05")
