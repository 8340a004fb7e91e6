"""Observed order on a curved domain with a manufactured solution; loads and norms are scikit-fem's."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve
from skfem import Functional, LinearForm
from skfem.helpers import dot, grad

from spindle_fem.machine.meshing.simple_bodies import build_tube
from spindle_fem.model.mesh.conduction_problem import ConductionProblem, Film
from spindle_fem.model.mesh.equations import assemble_system
from spindle_fem.model.mesh.mesh_operators import build_operators
from spindle_fem.model.mesh.skfem_mesh import load_into_skfem

CONDUCTIVITY, FILM = 3.0, 2.0


def exact(x):
    return np.sin(1.1 * x[0]) * np.cos(0.9 * x[1]) + np.exp(0.5 * x[2]) * x[1]


def exact_gradient(x):
    return np.stack(
        (
            1.1 * np.cos(1.1 * x[0]) * np.cos(0.9 * x[1]),
            -0.9 * np.sin(1.1 * x[0]) * np.sin(0.9 * x[1]) + np.exp(0.5 * x[2]),
            0.5 * np.exp(0.5 * x[2]) * x[1],
        )
    )


def exact_laplacian(x):
    return -(1.1**2 + 0.9**2) * np.sin(1.1 * x[0]) * np.cos(0.9 * x[1]) + 0.25 * np.exp(0.5 * x[2]) * x[1]


@LinearForm
def heat_source(v, w):
    return -CONDUCTIVITY * exact_laplacian(w.x) * v


@LinearForm
def film_load(v, w):
    return (CONDUCTIVITY * dot(exact_gradient(w.x), w.n) + FILM * exact(w.x)) * v


@Functional
def squared_error(w):
    return (w["field"] - exact(w.x)) ** 2


@Functional
def squared_gradient_error(w):
    difference = grad(w["field"]) - exact_gradient(w.x)
    return dot(difference, difference)


def _errors(order, n):
    mesh = build_tube((0.5, 1.0), 0.6, (n, 3 * n, n), angle=np.pi / 2)
    operators = build_operators(mesh, order, area_tolerance=0.05)
    films = tuple(Film(name, FILM, 0.0) for name in mesh.surfaces)
    system = assemble_system(ConductionProblem(operators, {"tube": CONDUCTIVITY}, films=films))
    loaded = load_into_skfem(mesh, order)
    load = heat_source.assemble(loaded.basis)
    for facets in mesh.surfaces.values():
        load = load + film_load.assemble(loaded.facet_basis(facets))
    right = np.empty_like(load)
    right[loaded.unknown_of_dof] = load
    field = loaded.basis.interpolate(spsolve(system.matrix.tocsc(), right)[loaded.unknown_of_dof])
    return (
        np.sqrt(squared_error.assemble(loaded.basis, field=field)),
        np.sqrt(squared_gradient_error.assemble(loaded.basis, field=field)),
    )


@pytest.mark.parametrize(
    ("order", "meshes", "rate_l2", "rate_h1"), [(1, (4, 6, 9, 12), 2.0, 1.0), (2, (4, 6, 8), 3.0, 2.0)]
)
def test_observed_order_on_a_curved_domain(order, meshes, rate_l2, rate_h1):
    errors = np.array([_errors(order, n) for n in meshes])
    l2, h1 = -np.polyfit(np.log(meshes), np.log(errors), 1)[0]
    assert l2 == pytest.approx(rate_l2, abs=0.1)
    assert h1 == pytest.approx(rate_h1, abs=0.1)
