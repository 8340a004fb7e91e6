import tomllib

import numpy as np
import pytest
from scipy.sparse.linalg import splu

import spindle_fem
from validation.generate_meridian import Fits, choose, make_case
from validation.meridian.conceal import EFFECTS, Mounted, Scene, deviating, draw
from validation.meridian.definition import recorded, text_of, value
from validation.meridian.elements import assemble, rectangles
from validation.meridian.run import Plant, draw_as_built, run
from validation.stepping import Drive


@pytest.fixture(scope="module")
def plant():
    tables = recorded("uncooled")
    return Plant(assemble(tables, longest=0.02), tables)


def steady(plant, speed=2000.0, ambient=20.0):
    """Steady temperatures and the heat put in, W."""
    matrix, force = plant.model.conduction.copy(), np.zeros(plant.model.size)
    for group, h in plant.nominal(speed).items():
        operator, load = plant.model.exchange[group]
        matrix, force = matrix + h * operator, force + h * ambient * load
    heat = plant.bearing_heat(speed, 800.0)
    for b, watts in heat.items():
        force += 0.5 * watts * (plant.model.place[f"{b}.inner"] + plant.model.place[f"{b}.outer"])
    return splu(matrix.tocsc()).solve(force), sum(heat.values())


def test_heat_that_enters_leaves(plant):
    state, heat = steady(plant)
    films = {g: h for g, h in plant.nominal(2000.0).items() if g.startswith("film:")}
    out = sum(h * plant.model.exchange[g][1] @ (state - 20.0) for g, h in films.items())
    assert out == pytest.approx(heat, rel=1e-9)


def test_capacity_is_that_of_the_parts(plant):
    materials = plant.tables["materials"]
    exact = 0.0
    for material, boxes in rectangles(plant.tables).values():
        rho_c = value(materials[material]["density"]) * value(materials[material]["specific_heat_capacity"])
        exact += rho_c * sum(np.pi * (r1**2 - r0**2) * (z1 - z0) for r0, r1, z0, z1 in boxes)
    balls = sum(value(s["ball_row"]["capacity"]) * len(s["bearing"]) for s in plant.tables["bearing_set"])
    assert plant.model.capacity.sum() == pytest.approx(exact + balls, rel=1e-6)


def test_run_settles_where_the_steady_state_is(plant):
    n = 400
    drive = Drive(400.0 * np.arange(n), np.full(n, 2000.0), np.full(n, 800.0), np.full(n, 20.0), np.zeros(n))
    built = dict.fromkeys(plant.priors(), 1.0) | {"split": 0.0}
    exact = np.array(list(plant.model.probes.values())) @ steady(plant)[0]
    # Coefficients are taken in steps of half a per cent.
    assert run(plant, drive, built)[-1] == pytest.approx(exact, abs=0.1)


def test_definition_is_written_as_it_is_read():
    tables = recorded("uncooled", 1.6)
    assert tomllib.loads(text_of(tables)) == tables


def test_larger_housing_is_larger_outside_alone():
    tables = recorded("uncooled")
    drawn, grown = (assemble(t, 0.02).exchange for t in (tables, deviating(tables, 0.03)))
    assert grown["film:outside"][1].sum() > 1.02 * drawn["film:outside"][1].sum()
    assert grown["film:nose_end"][1].sum() == pytest.approx(drawn["film:nose_end"][1].sum())


@pytest.mark.parametrize("effect", EFFECTS)
def test_every_effect_changes_what_is_read(plant, effect):
    n = 60
    speed = np.where(np.arange(n) < 40, 2500.0, 1000.0)
    drive = Drive(300.0 * np.arange(n), speed, np.full(n, 800.0), np.linspace(20.0, 22.0, n), np.zeros(n))
    built = dict.fromkeys(plant.priors(), 1.0) | {"split": 0.0}
    made = draw(effect, Scene(np.random.default_rng(1), plant, drive, (0, 1, 2, 3), 1.0))
    plain = run(plant, drive, built)
    changed = run(plant, drive, built, [made.machine] if made.machine else [])
    changed = made.sensor.apply(drive.time, changed) if made.sensor else changed
    assert np.abs(changed - plain).max() > 0.1


def test_a_refit_takes_up_what_a_parameter_can(plant):
    n = 60
    drive = Drive(300.0 * np.arange(n), np.full(n, 2500.0), np.full(n, 800.0), np.full(n, 20.0), np.zeros(n))
    built = draw_as_built(np.random.default_rng(3), plant)
    fits = Fits(plant, [drive], built, [Mounted()])
    fits.prepare((0, 1, 2, 3), 0.1, 0.1)
    warmer = [0.3 * fits.columns[0][0]]
    assert fits.left(warmer)[0].max() < 0.3 * np.abs(warmer[0]).max()


def test_families_come_in_turn():
    drawn = [choose(n, np.random.default_rng(n)) for n in range(1, 61)]
    assert sum(family == "consistent" for family, _ in drawn) == 10
    assert {e for family, names in drawn if family == "single" for e in names} == set(EFFECTS)


@pytest.mark.slow
def test_package_reads_the_same_machine_alike(tmp_path):
    tables = recorded("uncooled")
    path = tmp_path / "machine.toml"
    path.write_text(text_of(tables), encoding="utf-8")
    solved = spindle_fem.solve(spindle_fem.load_machine(path, ["mesh.preset=coarse"]))
    plant = Plant(assemble(tables), tables)
    state, _ = steady(plant, value(tables["operation"]["speed"]))
    for name, weights in plant.model.probes.items():
        assert weights @ state == pytest.approx(solved.probes[name] - 273.15, abs=0.15)


@pytest.mark.slow
def test_case_has_its_own_machine(tmp_path):
    answer = make_case(tmp_path, 4, 1)
    assert answer["verdict"] == "consistent"
    spindle_fem.load_machine(tmp_path / "inputs" / answer["case"] / "machine.toml")
