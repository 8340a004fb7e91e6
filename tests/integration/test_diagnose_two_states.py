"""Two causes at once in a written network, one of which switches: heat at a node, cooling of another."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from spindle_fem.commands.diagnose_command import diagnose_without_report
from tests.support import flawed_network
from tests.support.flawed_network import MACHINE, as_built, inputs_at, record

STOP, HEAT, MORE = 28800.0, 25.0, 2.2
POWERS = ((0.0, 0.0, 0.0), (900.0, 60.0, 1500.0), (6000.0, 90.0, 1500.0))
POWERS = (*POWERS, (12000.0, 60.0, 2500.0), (18000.0, 90.0, 2000.0), (24000.0, 60.0, 0.0))


def course(generator, shortest, longest, begin):
    """Intervals on whole minutes."""
    found, time = [], begin
    while time < STOP - 600.0:
        end = time + generator.uniform(shortest, longest)
        found.append((60.0 * round(time / 60.0), 60.0 * round(end / 60.0)))
        time = end + 1.2 * generator.uniform(shortest, longest)
    return found


def switching(heated, cooled, share_of_speed=1.0):
    """Temperatures of the nodes with heat at the bearing, and the body cooled more, in intervals.

    Parameters
    ----------
    share_of_speed : float
        Of what the bearing heats at a speed, all through.
    """

    def temperatures(built, times):
        def slope(time, state):
            power, speed, room = inputs_at(min(time, stop - 1e-6))
            winding, bearing, body = state
            middle = 0.5 * (start + stop)
            more = HEAT * any(a <= middle < b for a, b in heated)
            share = MORE if any(a <= middle < b for a, b in cooled) else 1.0
            one = built["winding|body"] * (winding - body)
            two = built["bearing|body"] * (bearing - body)
            heat = share_of_speed * built["speed"] * (speed / 1000.0) ** 1.5 + more
            out = share * built["body|ambient"] * (body - room)
            return [
                (built["power"] * power - one) / built["winding"],
                (heat - two) / built["bearing"],
                (one + two - out) / built["body"],
            ]

        state, found = np.full(3, inputs_at(0.0)[2]), np.empty((times.size, 3))
        edges = [edge for pair in (*heated, *cooled) for edge in pair]
        for start, stop in pairwise(np.unique([row[0] for row in POWERS] + edges + [times[-1]])):
            own = (times >= start) & (times < stop)
            solved = solve_ivp(
                slope,
                (start, stop),
                state,
                t_eval=np.append(times[own], stop),
                rtol=1e-8,
                atol=1e-8,
                max_step=60.0,
            )
            found[own], state = solved.y[:, :-1].T, solved.y[:, -1]
        found[times == times[-1]] = state
        return found

    return temperatures


@pytest.mark.slow
def test_heat_and_cooling_that_switch_at_once_are_both_named(monkeypatch, tmp_path):
    generator = np.random.default_rng(5)
    heated, cooled = course(generator, 500.0, 1500.0, 1500.0), course(generator, 700.0, 2000.0, 2200.0)
    monkeypatch.setattr(flawed_network, "PROGRAMME", POWERS)
    monkeypatch.setattr(flawed_network, "temperatures", switching(heated, cooled))
    run = record(tmp_path / "run", 3, times=np.arange(0.0, STOP + 1.0, 60.0))
    machine = tmp_path / "machine.toml"
    machine.write_text(MACHINE)
    content = diagnose_without_report(machine, [run], tmp_path / "out")
    found = {item["effect"]: item for item in content["findings"]}
    assert found["unrecorded_heat_source"]["component"] == "bearing"
    assert found["unrecorded_heat_source"]["parameters"]["heat"]["value"] == pytest.approx(HEAT, rel=0.1)
    assert found["unrecorded_cooling"]["component"] == "body|ambient"
    more = (MORE - 1.0) * as_built(3)["body|ambient"]
    assert found["unrecorded_cooling"]["parameters"]["conductance"]["value"] == pytest.approx(more, rel=0.15)
    assert content["fit"]["after"]["train_rmse_K"] < 0.5 * content["fit"]["before"]["train_rmse_K"]


@pytest.mark.slow
def test_heat_that_switches_is_told_beside_a_share_that_is_off_at_the_same_node(monkeypatch, tmp_path):
    """Found alone, what switches takes up the share: its course is sought anew beside the best laws."""
    heated = course(np.random.default_rng(5), 500.0, 1500.0, 1500.0)
    monkeypatch.setattr(flawed_network, "PROGRAMME", POWERS)
    times = np.arange(0.0, STOP + 1.0, 60.0)
    monkeypatch.setattr(flawed_network, "temperatures", switching((), ()))
    calibration = record(tmp_path / "calibration", 3, times=times)
    monkeypatch.setattr(flawed_network, "temperatures", switching(heated, (), 1.7))
    run = record(tmp_path / "run", 3, times=times)
    machine = tmp_path / "machine.toml"
    machine.write_text(MACHINE)
    content = diagnose_without_report(machine, [run], tmp_path / "out", calibrate=[calibration])
    found = {item["effect"]: item for item in content["findings"]}
    assert {(name, item["component"]) for name, item in found.items()} == {
        ("unrecorded_heat_source", "bearing"),
        ("heat_scale", "bearing"),
    }
    assert found["unrecorded_heat_source"]["parameters"]["heat"]["value"] == pytest.approx(HEAT, rel=0.1)


@pytest.mark.slow
def test_cooling_that_changes_its_level_is_told_beside_heat_that_switches(monkeypatch, tmp_path):
    heated = course(np.random.default_rng(5), 500.0, 1500.0, 1500.0)
    monkeypatch.setattr(flawed_network, "PROGRAMME", POWERS)
    monkeypatch.setattr(flawed_network, "temperatures", switching(heated, ((9000.0, 19800.0),)))
    run = record(tmp_path / "run", 3, times=np.arange(0.0, STOP + 1.0, 60.0))
    machine = tmp_path / "machine.toml"
    machine.write_text(MACHINE)
    content = diagnose_without_report(machine, [run], tmp_path / "out")
    found = {item["effect"]: item for item in content["findings"]}
    assert {(name, item["component"]) for name, item in found.items()} == {
        ("unrecorded_heat_source", "bearing"),
        ("unrecorded_cooling", "body|ambient"),
    }
    assert found["unrecorded_heat_source"]["parameters"]["heat"]["value"] == pytest.approx(HEAT, rel=0.1)
    (interval,) = found["unrecorded_cooling"]["intervals"]
    assert interval["start"] == pytest.approx(9000.0, abs=120.0)
    assert interval["end"] == pytest.approx(19800.0, abs=120.0)
    more = (MORE - 1.0) * as_built(3)["body|ambient"]
    assert interval["value"] == pytest.approx(more, rel=0.1)
