"""Sums of sparse matrices on one pattern equal sums of the matrices."""

import numpy as np
import pytest
from scipy import sparse

from spindle_fem.model.matrices_on_pattern import MatricesOnPattern, sum_of


@pytest.fixture
def matrices():
    draw = np.random.default_rng(4)
    shares = (0.2, 0.01, 0.1)
    return [sparse.random_array((30, 30), density=share, rng=draw, format="csr") for share in shares]


@pytest.fixture
def together(matrices):
    pattern = sum(abs(matrix) for matrix in matrices).tocsr()
    pattern.sort_indices()
    for matrix in matrices:
        matrix.sort_indices()
    return MatricesOnPattern.of(pattern, iter(matrices))


def test_each_of_them_comes_back(matrices, together):
    assert len(together) == len(list(together)) == 3
    for given, found in zip(matrices, together, strict=True):
        assert np.array_equal(given.toarray(), found.toarray())
        assert given.nnz == found.nnz


def test_weighted_sums_of_all_and_of_a_part(matrices, together):
    total = together.weighted([2.0, 0.0, -1.0])
    assert total.toarray() == pytest.approx(2.0 * matrices[0].toarray() - matrices[2].toarray(), abs=1e-15)
    part = together.part(1, 3)
    assert part.weighted([1.0, 3.0]).toarray() == pytest.approx(
        matrices[1].toarray() + 3.0 * matrices[2].toarray(), abs=1e-15
    )


def test_sums_on_one_pattern_and_on_two(matrices, together):
    one, two = together.weighted([1.0, 0.0, 0.0]), together.weighted([0.0, 1.0, 1.0])
    expected = one.toarray() + 0.5 * two.toarray()
    same, other = sum_of(one, two, 0.5), sum_of(one, two.copy(), 0.5)
    assert same.indices.ctypes.data == one.indices.ctypes.data
    assert other.indices.ctypes.data != one.indices.ctypes.data
    assert same.toarray() == pytest.approx(expected, abs=1e-15)
    assert other.toarray() == pytest.approx(expected, abs=1e-15)
