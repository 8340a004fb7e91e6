"""Both fits of a diagnosis through the finite-element model, on a recording that the full model made."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from spindle_fem.definition.uncertain_parameters import with_parameters
from spindle_fem.effects.registry import candidates_for, effect_of
from spindle_fem.inference import full_model_check as full_model
from spindle_fem.inference.full_model_check import full_model_errors, options_for, spec_on
from spindle_fem.inference.full_model_runs import inputs_of_drive
from spindle_fem.inference.predictor import Predictor
from spindle_fem.machine.view.build_view import view_of
from spindle_fem.recordings.align import read_recording
from spindle_fem.recordings.displaced_readings import with_displacements
from spindle_fem.report.diagnosis_full_model import full_model_sections
from spindle_fem.solvers.machine_transient import simulate_full
from spindle_fem.solvers.mesh_terms import Physics
from spindle_fem.solvers.prepared_machine import prepare_machine
from tests.support.nose_spindle import nose_machine

PROBES = ("SP01", "SP05", "COOLANT_OUT")
MANIFEST = """
schema = "spindle-fem/recording/1"
name = "steps"
data = "steps.csv"
time = {column = "t", unit = "s"}
channel = [
{column = "S1", role = "displacement", probe = "S1", unit = "um", sigma = 0.2},
{column = "speed", role = "input", hold = "previous", drives = "speed", unit = "rpm"},
{column = "ambient", role = "input", drives = "ambient", unit = "degC"},
%s]
"""
CHANNEL = '{column = "%s", role = "temperature", probe = "%s", unit = "degC", sigma = 0.1},\n'
TIMES = np.arange(0.0, 1801.0, 60.0)
MACHINE = {"heat.front": 1.1, "film.outside": 1.2}
HEAT, OFFSET = 150.0, 2.0


def recorded_as(folder, temperatures, displacement):
    columns = {
        "t": TIMES,
        "speed": np.where(TIMES < 1200.0, 3000.0, 0.0),
        "ambient": np.full(TIMES.size, 20.0),
    }
    columns |= {name: temperatures[:, column] for column, name in enumerate(PROBES)} | {"S1": displacement}
    pd.DataFrame(columns).to_csv(folder / "steps.csv", index=False)
    manifest = MANIFEST % "".join(CHANNEL % (name, name) for name in PROBES)
    (folder / "steps.toml").write_text(manifest, encoding="utf-8")
    return with_displacements(read_recording(folder / "steps.toml"))


@pytest.mark.slow
def test_the_full_model_confirms_what_was_found(tmp_path, monkeypatch):
    fast = nose_machine()
    spec = fast.spec
    blank = recorded_as(tmp_path, np.full((TIMES.size, len(PROBES)), 20.0), np.zeros(TIMES.size))
    view = view_of(fast.names, blank)
    lying = next(c for c in candidates_for(view) if (c.effect, c.component) == ("sensor_offset", "SP05"))
    source = effect_of("unrecorded_heat_source").over(view, "housing", [(300.0, 1500.0)])
    effects = {source.amplitude: HEAT, lying.amplitude: OFFSET}

    # The truth: parameters in the definition itself, the term beside it, the offset added by hand.
    coarse = prepare_machine(spec_on(spec, "coarse"))
    true = prepare_machine(with_parameters(coarse.spec, MACHINE))
    predictor = Predictor(fast, [blank], [np.ones(TIMES.size, dtype=bool)])
    drive = predictor.drives[0]
    physics = Physics(source.terms, {source.amplitude: HEAT}, {})
    run = simulate_full(
        true, inputs_of_drive(drive), sample_times=TIMES, options=options_for(predictor), physics=physics
    )
    readings = np.column_stack([run.reading(name) for name in PROBES]) - 273.15
    readings[:, 1] += OFFSET
    moved = 1e6 * run.motion_of("S1") + 57.0
    # Sensors see growth although preload does not follow it.
    assert true.growth is None
    assert np.ptp(moved) > 1.0
    held = (TIMES > 600.0) & (TIMES < 900.0)
    predictor = Predictor(fast, [recorded_as(tmp_path, readings, moved)], [~held])

    monkeypatch.setattr(full_model, "prepare_machine", lambda own: coarse)
    monkeypatch.setattr(full_model, "thread_count", lambda: 1)
    null = SimpleNamespace(candidates=(), values=MACHINE)
    found = SimpleNamespace(
        candidates=(source, lying), values={**MACHINE, **effects}, without_candidates=null
    )
    diagnosis = SimpleNamespace(predictor=predictor, unchanged=predictor, null=null, stated_fit=found)
    machine = SimpleNamespace(is_network=False, spec=spec)
    kept = {}
    found = full_model_errors(diagnosis, machine, keep=kept.__setitem__)
    assert found["reason"] is None
    assert found["mesh"] == "coarse"
    assert (found["preset"], found["order"]) == ("coarse", 1)
    assert found["unknowns"] == coarse.operators.n_unknowns
    # Stamps are points of the reduced model's grid: nothing is lost by straight lines between.
    for kind in ("train_rmse_K", "heldout_rmse_K"):
        assert found["before"][kind] > 1.0
        assert found["after"][kind] < 0.005
    for kind in ("before", "after"):
        assert [row["channel"] for row in found[kind]["channels"]] == list(PROBES)
        assert kept[kind][0].shape == (TIMES.size, len(PROBES) + 1)
    assert [row["channel"] for row in found["differences"]] == list(PROBES)
    before, after = (found[kind]["displacements"][0]["rmse_um"] for kind in ("before", "after"))
    # what 0.005 K of the nose's rise moves it by
    assert after < 0.005 * np.ptp(moved) / np.ptp(readings[:, 0])
    assert before > 10.0 * after
    # The lumped spindle is another machine: its differences are large, and finite.
    assert all(0.0 < row[key] < 100.0 for row in found["differences"] for key in ("before_K", "after_K"))
    # Two processes answer as one does, but for the random start of the multigrid's eigenvalues.
    monkeypatch.setattr(full_model, "thread_count", lambda: 2)
    beside = full_model_errors(diagnosis, machine)
    for kind in ("before", "after"):
        errors = ([row["rmse_K"] for row in item[kind]["channels"]] for item in (beside, found))
        assert next(errors) == pytest.approx(next(errors), abs=1e-4)
    fast = {"train_rmse_K": 2.0, "heldout_rmse_K": 3.0}
    channels = [{"channel": name, "rmse_K": 2.5, "noise_K": 0.1} for name in PROBES]
    moved = [{"channel": "S1", "rmse_um": 1.0, "noise_um": 0.2}]
    content = {
        "mismatch": {"channels": channels, "displacements": moved},
        "fit": {
            "before": fast,
            "after": {**fast, "heldout_rmse_K": 1.0},
            "noise_K": 0.1,
            "channels_after": channels,
            "displacements_after": moved,
            "full_model": found,
        },
    }
    (section,) = full_model_sections(content)
    assert [block.kind for block in section.blocks] == ["text", "table", "table", "table", "table", "table"]
    total, by_channel = section.blocks[1:3]
    names = [row["cells"][0] for row in total.rows]
    assert names == [f"{a}, {b} model" for a in ("before", "after") for b in ("fast", "full")] + ["noise"]
    assert [row["cells"][0] for row in by_channel.rows] == list(PROBES)
    assert by_channel.rows[0]["cells"][-1] == "0.100"
