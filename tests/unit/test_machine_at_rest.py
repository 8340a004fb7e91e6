"""A machine that stands where all is equally warm: what its balances leave is round-off."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from spindle_fem.commands import transient_command
from spindle_fem.errors import ConvergenceError
from spindle_fem.report.transient_report import equilibrium_text
from spindle_fem.solvers.coupled_steady import COOLANT_TOLERANCE, _beyond_the_fold, coolant_mismatch
from spindle_fem.studies.transient_summary import equilibrium_of

ERROR = ConvergenceError("machine", "still changes.", "Lower the speed.")


@pytest.mark.parametrize(("left", "settled"), [(3.0e-9, True), (1.0e-4, False)])
def test_round_off_in_films_counts_as_no_heat(left, settled) -> None:
    machine = SimpleNamespace(builder=SimpleNamespace(cells=SimpleNamespace(surfaces=("wall",))))
    solution = SimpleNamespace(balance=SimpleNamespace(films={"wall": left}))
    march = SimpleNamespace(enthalpy_rise=0.0, heat=np.array([2.0e-9]), pumping_heat=np.zeros(1))
    coolant = SimpleNamespace(march=SimpleNamespace(march=march))
    assert (coolant_mismatch(machine, solution, coolant) <= COOLANT_TOLERANCE) == settled


def test_no_fold_is_sought_below_standstill() -> None:
    assert _beyond_the_fold(None, SimpleNamespace(speed=0.0), ERROR, None) is ERROR


def test_a_steady_state_that_is_not_found_costs_no_transient() -> None:
    def steady():
        raise ERROR

    found = equilibrium_of(SimpleNamespace(phases=[SimpleNamespace(transient=None)]), steady)
    assert found == {"exists": None, "reason": str(ERROR)}
    assert equilibrium_text(found).startswith("The steady state of the last phase is not known: machine:")


def test_a_transient_is_written_before_its_steady_state_is_waited_for(tmp_path, monkeypatch) -> None:
    def write(name):
        return lambda result, path, *more: path.write_text(name)

    def wait(*arguments):
        assert {"transient.csv", "state.npz", "machine.toml"} <= {path.name for path in tmp_path.iterdir()}
        raise ERROR

    spec, result = SimpleNamespace(effects=()), SimpleNamespace(state=None, memory=None)
    stand_ins = {
        "load_study": lambda path: SimpleNamespace(machine="m", fields_every=None),
        "find_study": lambda study: study,
        "load_machine": lambda *arguments: spec,
        "prepare_machine": lambda *arguments, **more: SimpleNamespace(spec=spec),
        "last_point": lambda *arguments: None,
        "run_study": lambda *arguments, **more: result,
        "_Beside": lambda *arguments: SimpleNamespace(steady_probes=dict),
        "_write_table": write("csv"),
        "save_state": lambda path, *more: path.write_text("state"),
        "write_machine": lambda spec: "",
        "summarise": wait,
    }
    for name, stand_in in stand_ins.items():
        monkeypatch.setattr(transient_command, name, stand_in)
    with pytest.raises(ConvergenceError):
        transient_command.run_transient_study("s", tmp_path)
