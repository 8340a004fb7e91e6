"""What the terminal and Python say of where, at what and without what a result is."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from spindle_fem.commands.console import print_heat
from spindle_fem.errors import SpecError
from spindle_fem.library import solved_machine
from spindle_fem.library.solved_machine import SolvedMachine
from spindle_fem.report.heat_report import heat_conditions


def test_heat_is_shown_with_the_temperature_and_size_it_is_for(capsys) -> None:
    content = {"model": "full", "bearings": {}, "models": [], "warnings": [], "temperature_degC": 40.0}
    print_heat(content, None)
    assert "At 40.0 °C of films, rings and balls, and the size of assembly" in capsys.readouterr().out
    assert "each speed" in heat_conditions({"temperature_degC": None})


def test_coolant_along_no_channel_is_refused_with_the_streams_there_are(monkeypatch) -> None:
    monkeypatch.setattr(solved_machine, "draw_charts", lambda result: {"coolant": lambda: None})
    machine = SimpleNamespace(circuits={"jacket": None}, spec=SimpleNamespace(name="mill"))
    with pytest.raises(SpecError, match=r"mill: has no \[channel\].* circuits has jacket"):
        SolvedMachine.plot_coolant(machine)
