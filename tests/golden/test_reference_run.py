"""The reference spindle on its coarse mesh, pinned to ourselves.

A change of these numbers needs a reason in its commit message; the file is
written again by ``python tests/golden/test_reference_run.py``.
"""

import json
from pathlib import Path

import pytest

from spindle_fem.definition.load import load_machine
from spindle_fem.results.run_summary import build_summary
from spindle_fem.studies.solve_machine import solve

CASES = {
    "wu_tan_2016": {"machine": "wu_tan_2016", "overrides": ["mesh.preset=coarse"]},
    "recorded_spindle": {"machine": "recorded_spindle", "overrides": ["mesh.preset=coarse"]},
    "wu_tan_2016_paper_optimum": {
        "machine": "wu_tan_2016",
        "overrides": ["mesh.preset=coarse", "channel.depth=19mm", "coolant.inlet_temperature=31degC"],
    },
}
FOLDER = Path(__file__).parent


def outputs(case):
    """What a case is pinned by."""
    result = solve(load_machine(case["machine"], case["overrides"]))
    summary = build_summary(result, 0.0, 0.0)
    return {
        "probes": summary["probes"],
        "hottest": summary["temperature"]["max_degC"],
        "heat_W": {name: bearing["heat_W"] for name, bearing in summary["bearings"].items()},
        "ring_difference_K": {
            name: bearing["ring_difference_K"] for name, bearing in summary["bearings"].items()
        },
        "coolant_W": summary["coolant"]["heat_W"],
        "film_W_m2K": summary["coolant"]["film_coefficient_W_m2K"]["value"],
        "nose_axial_um": summary["growth"]["nose_axial_um"],
        "housing_seats_um": {name: seat["housing_um"] for name, seat in summary["growth"]["seats"].items()},
    }


@pytest.mark.parametrize(
    "name", [*list(CASES)[:2], pytest.param("wu_tan_2016_paper_optimum", marks=pytest.mark.slow)]
)
def test_run_gives_what_it_gave(name):
    golden = json.loads((FOLDER / f"{name}.json").read_text(encoding="utf-8"))
    assert golden["inputs"] == CASES[name]
    found = outputs(CASES[name])
    # Another mesher build may move nodes: temperatures by some hundredths of a kelvin.
    assert found["probes"] == pytest.approx(golden["outputs"]["probes"], abs=0.05)
    assert found["hottest"] == pytest.approx(golden["outputs"]["hottest"], abs=0.05)
    assert found["heat_W"] == pytest.approx(golden["outputs"]["heat_W"], rel=2e-3)
    assert found["ring_difference_K"] == pytest.approx(golden["outputs"]["ring_difference_K"], abs=0.05)
    assert found["coolant_W"] == pytest.approx(golden["outputs"]["coolant_W"], rel=2e-3)
    assert found["film_W_m2K"] == pytest.approx(golden["outputs"]["film_W_m2K"], rel=2e-3)
    # a kelvin of the housing is 1 µm of its seats
    assert found["nose_axial_um"] == pytest.approx(golden["outputs"]["nose_axial_um"], abs=0.1)
    assert found["housing_seats_um"] == pytest.approx(golden["outputs"]["housing_seats_um"], abs=0.05)


if __name__ == "__main__":
    for name, case in CASES.items():
        content = {"inputs": case, "outputs": outputs(case)}
        (FOLDER / f"{name}.json").write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
