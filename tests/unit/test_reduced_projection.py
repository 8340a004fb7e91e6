"""The basis of the reduced model, and the coefficients that it leaves free."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy import sparse

from spindle_fem.definition.load import load_machine
from spindle_fem.errors import SpecError
from spindle_fem.machine.geometry.assembly import build_assembly
from spindle_fem.model.reduced.mesh_model import build_mesh_model
from spindle_fem.model.reduced.reduced_cache import reduced_digest
from spindle_fem.model.reduced.snapshots import SnapshotSpace, orthonormalise
from spindle_fem.model.reduced.unit_loads import helix_profiles
from spindle_fem.operation.coefficient_table import build_coefficient_table
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.physics.surroundings.rotating_surfaces import rotating_film

RADII = {"air_gap": (0.065, 0.09), "labyrinth": (0.09, 0.091)}


@pytest.fixture(scope="module")
def energy():
    rng = np.random.default_rng(0)
    root = sparse.random_array((80, 80), density=0.1, rng=rng) + sparse.eye_array(80)
    return (root.T @ root).tocsr()


def test_the_basis_is_orthonormal_in_energy_and_holds_what_it_must(energy):
    rng = np.random.default_rng(1)
    keep = np.ones((80, 1))
    snapshots = rng.normal(size=(80, 6)) @ rng.normal(size=(6, 30))
    space = SnapshotSpace(energy, keep, 1e-6)
    for first in range(0, 30, 10):
        space.add(snapshots[:, first : first + 10])
    basis = space.basis(40)
    assert basis.shape[1] == 7
    assert basis.T @ (energy @ basis) == pytest.approx(np.eye(7), abs=1e-12)
    for vectors in (keep, snapshots):
        rest = vectors - basis @ (basis.T @ (energy @ vectors))
        assert np.abs(rest).max() < 1e-9


@pytest.mark.parametrize("portions", [1, 4])
def test_what_is_dropped_is_as_small_as_was_asked(energy, portions):
    rng = np.random.default_rng(2)
    directions = orthonormalise(rng.normal(size=(80, 20)), energy)
    sizes = 10.0 ** -np.arange(20)
    space = SnapshotSpace(energy, np.ones((80, 1)), 1e-5)
    for block in np.array_split(directions * sizes, portions, axis=1):
        space.add(block)
    basis = space.basis(60)
    rest = directions * sizes
    rest = rest - basis @ (basis.T @ (energy @ rest))
    left = np.sqrt(np.sum(rest * (energy @ rest), axis=0))
    assert left.max() <= 1.01e-5
    assert basis.shape[1] <= 8
    assert space.basis(5).shape[1] == 5


def test_the_best_directions_are_those_of_all_solutions_together(energy):
    rng = np.random.default_rng(3)
    snapshots = rng.normal(size=(80, 12)) * np.logspace(0.0, -4.0, 12)
    keep = np.ones((80, 1))
    space = SnapshotSpace(energy, keep, 1e-9)
    for column in range(0, 12, 3):
        space.add(snapshots[:, column : column + 3])
    basis = space.basis(6)
    # Independent: singular values of the whole in the Cholesky factor's coordinates.
    factor = np.linalg.cholesky(energy.toarray()).T
    fixed = factor @ keep
    rest = factor @ snapshots
    rest -= fixed @ np.linalg.lstsq(fixed, rest, rcond=None)[0]
    values = np.linalg.svd(rest, compute_uv=False)
    left = factor @ (snapshots - basis @ (basis.T @ (energy @ snapshots)))
    assert np.linalg.norm(left) == pytest.approx(np.sqrt(np.sum(values[5:] ** 2)), rel=1e-6)


def test_an_empty_space_has_what_must_be_held(energy):
    space = SnapshotSpace(energy, np.ones((80, 1)), 1e-6)
    assert space.basis(10).shape == (80, 1)
    space.add(np.full((80, 2), 3.0))
    assert space.basis(10).shape == (80, 1)


def test_shapes_along_the_channel_are_polynomials_of_each_start_alone():
    profiles = helix_profiles(2, 10, 2)
    assert profiles.shape == (20, 6)
    assert profiles[:10, 0].tolist() == [1.0] * 10
    assert not profiles[10:, :3].any()
    assert not profiles[:10, 3:].any()
    assert profiles[:10, 1].sum() == pytest.approx(0.0, abs=1e-12)


@pytest.fixture(scope="module")
def table():
    spec = load_machine("recorded_spindle")
    return build_coefficient_table(spec, build_assembly(spec).joint_names, RADII)


def test_coefficients_are_those_of_the_definition(table):
    point = OperatingPoint(314.16, 1750.0, 293.15, 288.15, 3.3e-4)
    base = table.base(point)
    assert base["joint.F1.inner_ring|shaft"] == 10_000.0
    assert base["joint.F1.outer_ring|shaft:face"] == 0.0
    assert base["film.housing.flange_back"] == 200.0
    assert base["balls.R1.inner"] == 3.0
    # The reference page: 8 + 12 (n/3000)^0.75 and 0.133 Re^(2/3) 0.71^(1/3) 0.026/D.
    assert base["gap.air_gap"] == pytest.approx(20.0, rel=1e-4)
    assert base["film.shaft.nose_end"] == pytest.approx(
        rotating_film("becker", 314.16, 0.18, minimum=10.0).value
    )
    reynolds = 314.16 * 0.18**2 / (2.0 * 1.55e-5)
    assert base["film.shaft.nose_end"] == pytest.approx(
        0.133 * reynolds ** (2 / 3) * 0.71 ** (1 / 3) * 0.026 / 0.18, rel=1e-3
    )
    assert table.capacities()["capacity.F1.balls"] == 170.0


def test_a_parameter_scales_its_group_and_only_that(table):
    factors = table.factors(
        {"shaft_end_films": 1.5, "joint.inner_ring_seats": 2.0, "joint.F1.inner_ring|shaft": 3.0}
    )
    assert table.scale("film.shaft.nose_end", factors) == 1.5
    assert table.scale("film.shaft.drive_end", factors) == 1.5
    assert table.scale("film.housing.outside", factors) == 1.0
    assert table.scale("joint.F2.inner_ring|shaft", factors) == 2.0
    assert table.scale("joint.F1.inner_ring|shaft", factors) == 6.0


def test_what_has_no_constant_coefficient_is_refused():
    spec = load_machine("wu_tan_2016")
    with pytest.raises(SpecError, match=r"bearing_set.front.ball_row.*no constant conductance"):
        build_coefficient_table(spec, build_assembly(spec).joint_names, RADII).base(OperatingPoint.of(spec))
    machine = SimpleNamespace(spec=None, operators=None, joint_conductance={"A|B": np.inf, "B|C": 1.0})
    with pytest.raises(SpecError, match=r"A\|B is .perfect.*Give a large conductance"):
        build_mesh_model(machine)


def test_the_identity_of_a_model_follows_coefficients_but_not_words_or_operation():
    plain = load_machine("recorded_spindle")
    same = load_machine("recorded_spindle", ["operation.thrust=900 N"]).model_copy(update={"title": "other"})
    other = load_machine("recorded_spindle", ["channel.depth=11 mm"])
    assert reduced_digest(plain, {}) == reduced_digest(same, {})
    assert reduced_digest(plain, {}) != reduced_digest(other, {})
    assert reduced_digest(plain, {}) != reduced_digest(plain, {"tolerance": 1.0})
    warmer = load_machine("recorded_spindle", ["coolant.film_factor=1.2"])
    digests = [reduced_digest(item, {}) for item in (plain, warmer, other)]
    family = [digest.partition("-")[0] for digest in digests]
    assert family[0] == family[1] != family[2]
    assert digests[0] != digests[1]
