import ast
import gzip
import json
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from spindle_fem.definition.network_load import load_network_machine
from validation import generate_networks
from validation.generate_networks import choose, draw_machine, judge, make_case
from validation.networks.conceal import CONCEALED, Lie, Scene
from validation.networks.truth import Change, Network, Work, march

FOLDER = Path(generate_networks.__file__).parent


def test_modal_steps_agree_with_an_ordinary_solver():
    network = Network({"a": 1e3, "b": 5e3}, {"a|b": 5.0, "b|room": 3.0, "a|room": 0.5}, ("room",), ())
    time = 20.0 * np.arange(201)
    around = 20.0 + np.sin(time / 900.0)
    change = Change(
        heat={"a": np.full(time.size, 200.0)},
        factor={"b|room": 2.0},
        law={"a|room": (0.3, 20.0)},
        rise={"a|b": 1e-3},
        mass=(("b", 800.0, 4.0),),
    )
    found = march(network, Work(20.0, {}, {"room": around}), change)

    def rate(t, y):
        a, b, mass = y
        room = np.interp(t, time, around)
        between = 5.0 * (1.0 + 1e-3 * (0.5 * (a + b) - 30.0)) * (a - b)
        lost = 0.5 * np.clip(abs(a - room) / 20.0, 0.02, 3.0) ** 0.3 * (a - room)
        hung = 4.0 * (b - mass)
        return [(200.0 - between - lost) / 1e3, (between - hung - 6.0 * (b - room)) / 5e3, hung / 800.0]

    exact = solve_ivp(rate, (0.0, time[-1]), np.full(3, around[0]), t_eval=time, rtol=1e-8, max_step=20.0)
    assert np.abs(found - exact.y[:2].T).max() < 0.01


def test_a_lagging_sensor_follows_a_ramp_as_a_first_order_one():
    time = np.arange(0.0, 6000.0, 30.0)
    ramp = 20.0 + 1e-3 * time
    read = Lie("sensor_lag", "body", 600.0).applied(time, ramp, ramp)
    assert read == pytest.approx(20.0 + 1e-3 * (time - 600.0 * (1.0 - np.exp(-time / 600.0))), abs=1e-12)


def test_every_fifth_case_conceals_nothing_and_every_family_has_its_turn():
    drawn = [choose(n, np.random.default_rng(n)) for n in range(1, 121)]
    assert sum(not d for d in drawn) == 24
    assert {d[0] for d in drawn if d} == set(CONCEALED)


@pytest.mark.parametrize("name", CONCEALED)
def test_stronger_is_the_same_effect(name):
    case = draw_machine(np.random.default_rng(2), "cabinet", calibrated=True)
    make = CONCEALED[name][0]
    weak, strong = (make(Scene(case.owner, np.random.default_rng(8), k)) for k in (0.5, 1.0))
    assert (weak.component, weak.intervals, weak.follows) == (
        strong.component,
        strong.intervals,
        strong.follows,
    )
    assert weak.form != strong.form


def test_case_is_what_the_package_reads(tmp_path):
    answer = make_case(tmp_path, 11, 13)
    inputs = tmp_path / "inputs" / answer["case"]
    machine = load_network_machine(inputs / "machine.toml")
    assert {node.name for node in machine.network.node} == set(answer["initial_degC"])
    table = gzip.decompress((inputs / "recording.csv.gz").read_bytes()).decode().splitlines()
    assert len(table) - 1 == answer["rows"]["recording"]["rows"]
    assert json.loads((tmp_path / "answers" / f"{answer['case']}.json").read_text())["effects"]
    assert answer["identifiability"]["own_simple_form"]["ratio"] < 0.5 * answer["identifiability"]["ratio"]


def test_what_reads_like_the_truth_counts_as_right():
    case = draw_machine(np.random.default_rng(2), "cabinet", calibrated=True)
    effect = CONCEALED["changed_heat"][0](Scene(case.owner, np.random.default_rng(8), 1.0))
    twin = {"effect": "sensor_gain", "components": ["air"], "accepted": True}
    known = {"ratio": 5.0, "each": [5.0], "best_mimics": [twin]}
    alone, both = judge([effect], {**known, "best_mimics": []}, True), judge([effect], known, True)
    assert alone["clear"]
    assert not both["clear"]
    assert [{"effect": "sensor_gain", "components": ["air"]}] in both["acceptable_sets"]
    assert set(both["acceptable_verdicts"]) == {"ambiguous", "parameter", "sensor"}


def test_generators_share_nothing_with_the_package():
    alone = """concealed_effect cycles draw draw_sensor_errors finite_volume generate generate_meridian
        generate_networks generate_rough identify laws machine oil recorder reduction rough sensor_errors
        stepping"""
    folders = [*(FOLDER / "networks").glob("*.py"), *(FOLDER / "meridian").glob("*.py")]
    for path in [*folders, *(FOLDER / f"{name}.py" for name in alone.split())]:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            assert not any(name.startswith("spindle_fem") for name in names), path
