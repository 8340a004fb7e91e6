"""``diagnose --plan`` as a user runs it."""

import json


def test_plan_of_a_network_says_what_its_sensors_tell(command, tmp_path):
    out = tmp_path / "out"
    process = command("diagnose", "--plan", "bench_motor", "-o", out, "--json")
    assert process.returncode == 0, process.stderr
    content = json.loads(process.stdout)
    assert content == json.loads((out / "plan.json").read_text(encoding="utf-8"))
    assert (out / "report.html").stat().st_size > 20_000
    assert [sensor["name"] for sensor in content["sensors"]] == ["winding", "stator_body"]


def test_unknown_sensor_ends_with_two_and_names_those_there_are(command, tmp_path):
    process = command("diagnose", "bench_motor", "--plan", "--sensors", "windig", "-o", tmp_path / "out")
    assert process.returncode == 2
    assert "winding" in process.stderr
    assert not (tmp_path / "out").exists()
