"""The Python of ``docs/python.md`` runs from top to bottom, and its table names what there is."""

import contextlib
import re
from pathlib import Path

import matplotlib.figure
import pytest

import spindle_fem
from spindle_fem.library.design_sweep import DesignSweep
from spindle_fem.library.machine_diagnosis import MachineDiagnosis
from spindle_fem.library.network_check import NetworkCheck
from spindle_fem.library.simulated_recording import ReadRecording, SimulatedRecording
from spindle_fem.library.solved_bearing import SolvedBearing
from spindle_fem.library.solved_machine import SolvedMachine
from spindle_fem.library.transient_run import TransientRun

PAGE = (Path(__file__).parents[2] / "docs" / "python.md").read_text(encoding="utf-8")
ANSWERS = {
    "solve": SolvedMachine,
    "transient": TransientRun,
    "read_recording": ReadRecording,
    "simulate": SimulatedRecording,
    "diagnose": MachineDiagnosis,
    "sweep": DesignSweep,
    "crosscheck": NetworkCheck,
    "bearing": SolvedBearing,
}


@pytest.mark.slow
def test_the_lines_run(tmp_path):
    namespace = {}
    with contextlib.chdir(tmp_path):
        for block in re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL):
            exec(compile(block, "<page>", "exec"), namespace)
    assert {item.name for item in tmp_path.iterdir()} == {"temperature.png", "half.vtu"}
    assert isinstance(namespace["result"].plot_coolant(), matplotlib.figure.Figure)


def test_the_table_names_every_way_out_of_a_result():
    for name, answer in ANSWERS.items():
        row = re.search(rf"^\| `{name}\(.*$", PAGE, re.MULTILINE).group()
        shown = set(re.findall(r"\b(?:plot|to)_\w+", row))
        assert shown == {item for item in dir(answer) if re.match(r"(?:plot|to)_", item)}, name
        assert callable(getattr(spindle_fem, name))
