"""Sums of a model's operators: sparse ones of a mesh stay sparse, with a channel or without."""

import numpy as np
from scipy import sparse

from spindle_fem.model.thermal_model import ThermalModel

SIZE = 3


def mesh_model(**channel):
    film, joint = np.diag([1.0, 0.0, 0.0]), np.diag([0.0, 2.0, 2.0])
    return ThermalModel(
        coefficient_names=("film.outside", "joint.a|b"),
        operators=tuple(map(sparse.csr_array, (film, joint))),
        fluid_names=("film.outside",),
        fluid_load=np.array([[1.0, 0.0, 0.0]]),
        storage_names=(),
        storage=(),
        place_names=(),
        places=sparse.csr_array((0, SIZE)),
        probe_names=(),
        probes=sparse.csr_array((0, SIZE)),
        one=np.ones(SIZE),
        **channel,
    )


VALUES = {"film.outside": 10.0, "joint.a|b": 5.0}


def test_conduction_without_a_channel_stays_sparse():
    total = mesh_model().conduction(VALUES, np.zeros((1, 0)))
    assert sparse.issparse(total)
    np.testing.assert_allclose(total.toarray(), np.diag([10.0, 10.0, 10.0]))


def test_conduction_adds_the_film_of_every_cell():
    cells = tuple(sparse.csr_array(np.diag(area)) for area in ([0.0, 0.1, 0.0], [0.0, 0.0, 0.2]))
    total = mesh_model(cell_film=cells).conduction(VALUES, np.array([[100.0, 200.0]]))
    np.testing.assert_allclose(total.toarray(), np.diag([10.0, 20.0, 50.0]))
