"""A projection that grows where its own residual asks, on a coarse linear mesh."""

from dataclasses import fields

import numpy as np
import pytest
from scipy import sparse

from spindle_fem.definition.load import load_machine
from spindle_fem.definition.uncertain_parameters import with_parameters
from spindle_fem.model.mesh.column_solver import solve_many
from spindle_fem.model.mesh.linear_solvers import build_preconditioner
from spindle_fem.model.reduced.build_reduced import (
    Reduction,
    ReductionOptions,
    _Sampler,
    build_reduced_model,
    physical_loads,
)
from spindle_fem.model.reduced.growing_projection import GrowingProjection
from spindle_fem.model.reduced.kept_operators import keep_operators, kept_operators, operators_path
from spindle_fem.model.reduced.mesh_model import build_mesh_model
from spindle_fem.model.reduced.reduced_cache import KeptBasis, family_of, reduced_digest, reduced_path
from spindle_fem.model.reduced.solving_order import in_solving_order
from spindle_fem.model.thermal_model import MATRIX_FIELDS

SHIFTS = (0.0, 1.0e-3)


@pytest.fixture(scope="module")
def models(small):
    full = build_mesh_model(small)
    return full, in_solving_order(full)


@pytest.fixture(scope="module")
def samples(small, models):
    sampler = _Sampler.of(small.spec, models[1], ReductionOptions())
    return sampler.sample({}, sampler.usual_speed), *sampler.random_samples(2, 5, 2.0)


def exact(full, sample, loads, shift):
    matrix = full.conduction(sample.coefficients, sample.channel_film) + shift * full.capacity(
        sample.capacities
    )
    matrix = matrix.tocsr()
    return matrix, solve_many(
        matrix, loads, build_preconditioner(full.system(matrix)), relative_tolerance=1e-8
    )


def test_another_numbering_reads_the_same(small, models, samples):
    readings = []
    for full in models:
        loads = physical_loads(full, samples[0], small.spec)
        _, fields = exact(full, samples[0], loads, 1.0e-3)
        readings.append((full.probes @ fields, full.places @ fields))
    for one, other in zip(*readings, strict=True):
        assert other == pytest.approx(one, abs=1e-5)


def test_it_holds_solutions_as_closely_as_was_asked(small, models, samples):
    full = models[1]
    grown = GrowingProjection(full, samples[0])
    size = np.max(
        grown.enrich(samples[0], physical_loads(full, samples[0], small.spec), SHIFTS, np.inf).errors
    )
    assert grown.size == 1
    wanted = 1.0e-3 * size
    for sample in samples:
        loads = physical_loads(full, sample, small.spec)
        solved = grown.enrich(sample, loads, SHIFTS, wanted)
        for shift, coordinates in zip(SHIFTS, solved.coordinates, strict=True):
            matrix, fields = exact(full, sample, loads, shift)
            error = fields - grown.fields(coordinates)
            energy = np.sqrt(np.einsum("nm,nm->m", error, matrix @ error))
            # The estimate knows the error but for what the preconditioner is off.
            assert energy.max() < 2.0 * wanted * np.sqrt(loads.shape[1])
    grown_to = grown.size
    again = grown.enrich(samples[1], physical_loads(full, samples[1], small.spec), SHIFTS, 2.0 * wanted)
    assert grown.size == grown_to
    assert np.max(again.errors) < 2.0 * wanted
    basis = grown.leading(40, 1e-6)
    assert basis.shape[1] == 40
    vectors = grown.fields(basis).astype(float)
    assert vectors[:, 0] == pytest.approx(1.0, abs=0.0)
    # the rest is orthonormal in the energy
    first = samples[0]
    energy = full.conduction(first.coefficients, first.channel_film) + 1e-4 * full.capacity(first.capacities)
    gram = vectors[:, 1:].T @ (energy @ vectors[:, 1:])
    assert gram == pytest.approx(np.eye(39), abs=1e-4)


def test_what_a_basis_misses_is_what_the_full_model_adds(small, models, samples):
    full, sample = models[1], samples[1]
    grown = GrowingProjection(full, samples[0])
    loads = physical_loads(full, sample, small.spec)
    size = grown.size_of(sample, loads)
    grown.enrich(samples[0], loads, SHIFTS, 1e-2 * size)
    basis = grown.leading(20, 1e-6)
    missing = grown.missing(sample, loads, SHIFTS, basis, 1e-3)
    for shift, found in zip(SHIFTS, missing, strict=True):
        matrix, fields = exact(full, sample, loads, shift)
        vectors = grown.fields(basis).astype(float)
        reduced = vectors @ np.linalg.solve(vectors.T @ (matrix @ vectors), vectors.T @ loads)
        expected = full.probes @ (fields - reduced)
        assert np.abs(expected).max() > 0.01
        assert full.probes @ found == pytest.approx(expected, abs=0.05 * np.abs(expected).max())


def test_a_machine_with_other_coefficients_begins_from_a_kept_basis(small, small_fast, models):
    kept = KeptBasis.beside(reduced_path(small_fast.model.digest))
    assert kept.mesh == small.mesh.digest
    near = Reduction(small_fast.model, kept.fields)
    calibrated = with_parameters(small.spec, {"film.outside": 1.3, "joint.rear_outer_ring_seats": 0.7})
    same = build_reduced_model(calibrated, models[1], near=near)
    assert same.fields is kept.fields
    assert same.model.operators is near.model.operators
    assert same.model.ranges["film.housing.outside"][1] > 1.25 * near.model.ranges["film.housing.outside"][1]
    assert 0.0 < same.model.errors["probes"] <= ReductionOptions().error
    assert same.model.digest != near.model.digest


@pytest.mark.slow
def test_a_kept_basis_grows_where_the_check_asks(small, small_fast, models):
    kept = KeptBasis.beside(reduced_path(small_fast.model.digest))
    near = Reduction(small_fast.model, kept.fields)
    iron = small.spec.materials["cast_iron"]
    other_iron = iron.model_copy(update={"thermal_conductivity": 1.3 * iron.thermal_conductivity})
    other = small.spec.model_copy(update={"materials": small.spec.materials | {"cast_iron": other_iron}})
    grown = build_reduced_model(other, models[1], near=near)
    assert near.model.size < grown.model.size < 2 * near.model.size
    assert grown.fields[:, : near.model.size] == pytest.approx(kept.fields, abs=0.0)
    assert grown.model.errors["probes"] <= ReductionOptions().error


def test_what_is_set_belongs_to_the_family_unless_it_is_geometry(small):
    def family(spec):
        return reduced_digest(spec, ReductionOptions().key(spec)).partition("-")[0]

    own = family(small.spec)
    for changed in ("coolant.film_factor=1.4", "materials.cast_iron.density=7100 kg/m**3"):
        spec = load_machine("recorded_spindle", ["mesh.preset=coarse", "mesh.order=1", changed])
        assert family(spec) == own
        assert reduced_digest(spec, {}) != reduced_digest(small.spec, {})
    moved = load_machine("recorded_spindle", ["mesh.preset=coarse", "mesh.order=1", "channel.depth=9 mm"])
    assert family(moved) != own
    assert family_of(reduced_digest(moved, {})) == []


def test_operators_come_back_from_the_cache_as_they_were(models, monkeypatch, tmp_path):
    monkeypatch.setenv("SPINDLE_FEM_CACHE", str(tmp_path))
    full = models[1]
    assert kept_operators("family-own") is None
    keep_operators(full, "family-own")
    again = kept_operators("family-other")
    for item in fields(full):
        given, found = getattr(full, item.name), getattr(again, item.name)
        if item.name in MATRIX_FIELDS:
            assert len(given) == len(found)
            assert all(abs(one - two).max() == 0.0 for one, two in zip(given, found, strict=True))
        elif sparse.issparse(given):
            assert given.shape == found.shape
            assert abs(given - found).max() == 0.0
        else:
            assert np.array_equal(given, found), item.name
    operators_path("family").write_bytes(operators_path("family").read_bytes()[:-2000])
    assert kept_operators("family-own") is None
