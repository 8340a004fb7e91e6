"""On a machine's mesh: the matrix that is solved is what scikit-fem assembles of the forms."""

import numpy as np
import pytest
from skfem import asm

from spindle_fem.definition.load import load_machine
from spindle_fem.machine.geometry.assembly import build_assembly
from spindle_fem.machine.meshing.build_mesh import build_mesh
from spindle_fem.model.mesh import element_integrals, forms
from spindle_fem.model.mesh.conduction_problem import ConductionProblem, Film
from spindle_fem.model.mesh.equations import assemble_capacity, assemble_system
from spindle_fem.model.mesh.mesh_operators import build_operators
from spindle_fem.model.mesh.skfem_mesh import load_into_skfem

ROUND_OFF = 1e-13


@pytest.fixture(scope="module")
def mesh():
    spec = load_machine("small_two_start", ("mesh.preset=coarse",))
    return build_mesh(build_assembly(spec), preset="coarse", sizes=spec.mesh.size)


def difference(one, other):
    return abs(one - other).max() / abs(other).max()


@pytest.mark.parametrize("order", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_the_matrices_of_a_machine_are_the_forms(mesh, order):
    assert mesh.n_elements >= element_integrals.MANY_ELEMENTS
    operators = build_operators(mesh, order)
    rng = np.random.default_rng(1)
    parts, surfaces = mesh.part_names, list(mesh.surfaces)[::3]
    conductivity = dict(zip(parts, rng.uniform(10.0, 60.0, len(parts)), strict=True))
    capacity = dict(zip(parts, rng.uniform(3e6, 4e6, len(parts)), strict=True))
    films = {name: rng.uniform(5.0, 300.0, len(mesh.surfaces[name])) for name in surfaces}
    joints = {name: rng.uniform(1e3, 1e4, len(joint.facets_a)) for name, joint in mesh.joints.items()}
    problem = ConductionProblem(
        operators,
        conductivity,
        films=tuple(Film(name, value, 300.0) for name, value in films.items()),
        joint_conductance=joints,
        volumetric_capacity=capacity,
        adiabatic="rest",
    )

    loaded = load_into_skfem(mesh, order)
    of_elements = [
        np.array([by[part] for part in parts])[mesh.part_of_element] for by in (conductivity, capacity)
    ]
    matrix, stored = (
        asm(weighted(form), loaded.basis, h=value[:, None])
        for form, value in zip((forms.conduction, forms.capacity), of_elements, strict=True)
    )
    wetted = loaded.facet_basis(np.vstack([mesh.surfaces[name] for name in films]))
    matrix = matrix + asm(weighted(forms.film), wetted, h=np.concatenate(list(films.values()))[:, None])
    facets = zip(*((mesh.joints[name].facets_a, mesh.joints[name].facets_b) for name in joints), strict=True)
    sides = [loaded.facet_basis(np.vstack(side)) for side in facets]
    matrix = matrix + asm(
        weighted(forms.joint), sides, sides, h=np.concatenate(list(joints.values()))[:, None]
    )
    assert difference(assemble_system(problem).matrix, loaded.in_our_order(matrix)) < ROUND_OFF
    assert difference(assemble_capacity(problem)[0], loaded.in_our_order(stored)) < ROUND_OFF


def weighted(form):
    """A form with a coefficient that is constant on each element or facet."""
    return type(form)(lambda u, v, w: w.h * form.form(u, v, w))
