"""Hardening: a sample of its cases, what it calls a fault, and that no input is unpickled."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from validation.hardening.child import Ended
from validation.hardening.judged import ACCEPTED, FAULT, REFUSED, Record, judge
from validation.hardening.page import page, summarise

ROOT = Path(__file__).parents[2]


@pytest.mark.slow
def test_a_sample_of_spoilt_inputs_is_accepted_or_refused(tmp_path):
    command = [sys.executable, "-m", "validation.hardening", "-o", str(tmp_path), "--short", "--jobs", "1"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    families = json.loads((tmp_path / "result.json").read_text())["families"]
    assert sum(item["done"] for item in families.values()) == 29
    assert families["definitions"]["accepted"] > 0
    assert families["definitions"]["refused"] > 0


@pytest.mark.parametrize(
    ("status", "err", "seconds", "outcome"),
    [
        (0, "", 1.0, ACCEPTED),
        (2, "SpecError: machine.toml: name: is missing.", 1.0, REFUSED),
        (2, "", 1.0, FAULT),
        (1, "NoSteadyStateError: machine: heat runs away.", 1.0, FAULT),
        (1, "Traceback (most recent call last):\nKeyError: 'name'", 1.0, FAULT),
        (-11, "", 1.0, FAULT),
        (0, "", 31.0, FAULT),
    ],
)
def test_what_counts_as_a_fault(status, err, seconds, outcome):
    assert judge(Ended(status, seconds, seconds, 100.0, "", err), (2,))[0] == outcome


def test_whole_commands_beside_spoilt_inputs_have_their_time_but_no_more_memory():
    assert judge(Ended(0, 31.0, 31.0, 100.0, "", "", patient=True), (2,))[0] == ACCEPTED
    assert judge(Ended(0, 31.0, 31.0, 3000.0, "", "", patient=True), (2,))[0] == FAULT


def test_the_page_has_every_family_and_every_fault():
    record = Record("definitions", 1, ["wu_tan_2016"])
    record.fault("traceback: KeyError")
    text = page(summarise([record.as_dict()], {"definitions": 5, "kills": 2}, 7))
    assert "| 5 | 1 | 0 | 0 | 1 |" in text
    assert "definitions 1 (wu_tan_2016): traceback: KeyError" in text


def test_nothing_unpickles_or_runs_what_a_file_says():
    risky = re.compile(
        r"\bpickle\b|\bmarshal\b|\bshelve\b|\beval\(|\bexec\(|os\.system|shell=True|yaml\.load"
    )
    found = {
        f"{path.relative_to(ROOT)}: {line.strip()}"
        for path in sorted((ROOT / "spindle_fem").rglob("*.py"))
        # between this program's own processes objects are sent pickled, through pipes and a folder of its own
        if path.parent.name != "parallel"
        for line in path.read_text(encoding="utf-8").splitlines()
        if risky.search(line.replace("allow_pickle=False", ""))
    }
    assert not found
    loads = [
        line
        for path in (ROOT / "spindle_fem").rglob("*.py")
        for line in path.read_text(encoding="utf-8").splitlines()
        if "np.load(" in line
    ]
    assert loads
    assert all("allow_pickle=False" in line for line in loads)
