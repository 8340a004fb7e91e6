import ast
from pathlib import Path

import numpy as np
import pytest

from validation import machine as m
from validation.check_model import steady_full, steady_reduced
from validation.cycles import CYCLES, draw_drive
from validation.finite_volume import assemble
from validation.oil import channel_film
from validation.reduction import build_basis, load_reduced, project
from validation.stepping import Drive, bearing_heat, draw_as_built, nominal_machine, run

FOLDER = Path(__file__).parents[2] / "validation"
# What diagnoses cases, holds results against answers or draws them; nothing that makes cases is among them.
CALL_THE_PROGRAM = (
    "run_study", "riddle", "reliability", "calibration_coverage", "plan_check", "kept_back", "watch_delay",
    "causes", "proof_pictures", "solid_growth", "calculix",
)  # fmt: skip


@pytest.fixture(scope="module")
def volumes():
    return assemble(m.build_grid(sectors=8))


@pytest.fixture(scope="module")
def reduced(volumes):
    return project(volumes, build_basis(volumes, size=150, draws=2, seed=3))


def test_shares_nothing_with_the_program_it_tries_to_fool():
    for path in FOLDER.rglob("*.py"):
        imported = {
            name.name if isinstance(node, ast.Import) else node.module or ""
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
            if isinstance(node, (ast.Import, ast.ImportFrom))
            for name in node.names
        }
        ours = {name for name in imported if name.startswith("spindle_fem")}
        # Hardening makes no cases to be fooled by: it spoils inputs of the program itself.
        calls = path.stem in CALL_THE_PROGRAM or "hardening" in path.relative_to(FOLDER).parts
        assert calls or not ours, path.name


def test_film_of_the_reference_page():
    film, _, reynolds = channel_film(15.0)
    assert film == pytest.approx(243.0, abs=0.5)
    assert reynolds == pytest.approx(292.0, abs=0.5)


def test_channel_area_is_exact_wall_by_wall(volumes):
    assert volumes.wall.sum() == pytest.approx(0.1562, rel=1e-12)
    stations = np.asarray(volumes.wall.sum(axis=0)).ravel()
    assert np.ptp(stations) < 1e-12 * stations.max()


@pytest.mark.parametrize(
    ("group", "area"),
    [
        ("seat:shaft|F1.inner", 2 * np.pi * 0.070 * 0.024),
        ("seat:R2.outer|housing", 2 * np.pi * 0.0825 * 0.022),
        ("axial:cover|housing", np.pi * (0.150**2 - 0.095**2)),
        ("axial:F3.outer|housing", np.pi * (0.095**2 - 0.089**2)),
        ("gap", 2 * np.pi * 0.065 * 0.253),
    ],
)
def test_joints_have_the_areas_of_the_drawing(volumes, group, area):
    assert volumes.pair_groups[group].diagonal().sum() / 2 == pytest.approx(area, rel=1e-9)


@pytest.mark.parametrize(
    ("group", "area"),
    [
        ("flange_back", np.pi * (0.190**2 - 0.150**2)),
        ("nose_end", np.pi * (0.090**2 - 0.030**2) + 2 * np.pi * 0.090 * 0.025),
        ("outside:rear", 2 * np.pi * 0.130 * 0.080 + np.pi * (0.130**2 - 0.0825**2)),
    ],
)
def test_films_have_the_areas_of_the_drawing(volumes, group, area):
    assert volumes.film_groups[group].sum() == pytest.approx(area, rel=1e-9)


def test_heat_capacity_is_that_of_the_drawing(volumes):
    solids = {**m._ROTATING, **m._STANDING}
    total = 3 * 170.0 + 2 * 119.0
    for part, rectangles in solids.items():
        for z0, z1, r0, r1 in rectangles:
            total += m.material_of(part)[1] * np.pi * (r1**2 - r0**2) * (z1 - z0) * 1e-9
    channel = 0.010 * 0.012 * 2 * np.pi * 0.113 * 5 * 7200 * 500
    # The staircase holds the channel's volume to the share of one cell in its width.
    assert volumes.capacity.sum() == pytest.approx(total - channel, rel=6e-4)


def test_full_model_keeps_its_heat(volumes):
    _, balance = steady_full(volumes)
    assert balance == pytest.approx(1.0, abs=1e-9)


def test_reduced_model_reads_like_the_full_one(volumes, reduced):
    full, _ = steady_full(volumes)
    assert np.abs(steady_reduced(reduced) - full).max() < 0.02


def test_machine_at_rest_in_its_own_room_stays_there(reduced):
    n = 60
    level = np.full(n, 18.0)
    drive = Drive(np.arange(n) * 60.0, np.zeros(n), np.zeros(n), level, level)
    path = run(reduced, drive, draw_as_built(np.random.default_rng(4)))
    assert np.abs(path.readings - 18.0).max() < 1e-7


def test_long_run_ends_at_the_steady_state(reduced, volumes):
    n = 700
    drive = Drive(
        np.arange(n) * 120.0, np.full(n, 3000.0), np.full(n, 1750.0), np.full(n, 17.6), np.full(n, 15.0)
    )
    path = run(reduced, drive, nominal_machine())
    steady = steady_reduced(reduced)
    # Factors are kept for steps of 0.3 % in the oil's film and flow.
    assert np.abs(path.readings[-1] - path.readings[-60]).max() < 1e-3
    assert np.abs(path.readings[-1] - steady).max() < 0.02


def test_step_is_of_second_order(reduced):
    def last(step):
        time = np.arange(0.0, 3600.0 + step, step)
        full = np.full(time.size, 1.0)
        drive = Drive(time, 3000 * full, 1750 * full, 17.0 * full, 15.0 * full)
        return run(reduced, drive, nominal_machine()).readings[-1]

    exact = last(7.5)
    errors = [np.abs(last(step) - exact)[:5].max() for step in (240.0, 120.0)]
    assert errors[0] / errors[1] > 3.0


def test_heat_table_between_and_at_its_entries():
    assert bearing_heat(4500.0, 1750.0).tolist() == [274, 274, 247, 150, 150]
    assert bearing_heat(750.0, 3500.0) == pytest.approx([25 * 1.1, 25 * 1.1, 22.5 * 0.96, 13.5, 13.5])


def test_as_built_is_cut_at_two_sigma():
    draws = [draw_as_built(np.random.default_rng(k)) for k in range(400)]
    films = np.log([d["film"] for d in draws])
    assert np.abs(films).max() == pytest.approx(0.3)
    assert np.std(films) == pytest.approx(0.15, rel=0.1)


@pytest.mark.parametrize("cycle", CYCLES)
def test_cycles_last_hours_and_stay_within_the_table(cycle):
    for seed in range(6):
        drive = draw_drive(np.random.default_rng(seed), cycle=cycle).drive
        assert 4 * 3600 < drive.time[-1] < 6.1 * 3600
        assert drive.speed.max() <= 4500
        assert drive.speed.min() == 0
        assert (drive.thrust[drive.speed == 0] <= 1750).all()


def test_cache_gives_the_same_model(tmp_path):
    first = load_reduced(tmp_path, sectors=8, size=40, draws=1)
    again = load_reduced(tmp_path, sectors=8, size=40, draws=1)
    assert first.groups == again.groups
    assert np.array_equal(first.matrices, again.matrices)
    assert len(list(tmp_path.iterdir())) == 1
