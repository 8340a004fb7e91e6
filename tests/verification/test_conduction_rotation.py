"""Rotating parts are uniform around the axis: they exchange heat with lumped nodes."""

from __future__ import annotations

import numpy as np
import pytest

from spindle_fem.machine.meshing.simple_bodies import Block, build_structured_mesh, tube_mapping
from spindle_fem.model.mesh.conduction_problem import ConductionProblem, Film, LumpedNode
from spindle_fem.model.mesh.evaluate import surface_mean
from spindle_fem.model.mesh.mesh_operators import build_operators
from spindle_fem.model.mesh.steady_conduction import solve_steady

LENGTH = 0.1


def _names(*pairs):
    return dict(zip(("u0", "u1", "w0", "w1"), pairs, strict=True))


def _shaft_in_housing(counts):
    shaft = Block(
        "shaft",
        counts,
        tube_mapping(0.03, 0.065, 0.0, LENGTH),
        _names("bore", "outer", "z0", "z1"),
        periodic=True,
        rotating=True,
    )
    housing = Block(
        "housing",
        counts,
        tube_mapping(0.09, 0.13, 0.0, LENGTH),
        _names("bore", "outer", "z0", "z1"),
        periodic=True,
    )
    return build_structured_mesh([shaft, housing])


def test_shaft_behind_lumped_air_is_uniform_around_the_axis():
    """A housing heated on one side only: the shaft sees its mean, exactly by symmetry of the mesh."""
    operators = build_operators(_shaft_in_housing((1, 12, 2)), 2)
    mesh = operators.mesh
    centre = mesh.points[mesh.surfaces["housing.outer"][:, :3]].mean(axis=1)
    ambient = 290.0 + 40.0 * (centre[:, 0] > 0.0)
    film, inside, heat = 25.0, 30.0, 60.0
    problem = ConductionProblem(
        operators,
        {"shaft": 42.0, "housing": 50.0},
        films=(Film("housing.outer", film, ambient),),
        surface_heat={"shaft.bore": heat},
        lumped_nodes=(LumpedNode("air", (("shaft.outer", inside), ("housing.bore", inside))),),
        adiabatic="rest",
    )
    solution = solve_steady(problem)
    # the mesh repeats every twelfth of a turn, so temperatures must repeat to the solver's tolerance
    shaft = operators.part_of_unknown == 0
    x, y, z = mesh.points.T
    sector = np.mod(np.arctan2(-x, y) / (2 * np.pi / 12) + 1e-6, 1.0)
    place = np.round(np.stack((np.hypot(x, y) / 1e-6, sector / 1e-3, z / 1e-6), axis=1)).astype(int)
    _, group = np.unique(place[shaft], axis=0, return_inverse=True)
    group = group.ravel()
    assert np.all(np.bincount(group) == 12)
    order = np.argsort(group, kind="stable")
    rings = solution.temperature[shaft][order].reshape(-1, 12)
    assert np.ptp(rings, axis=1).max() < 1e-7
    assert np.ptp(solution.temperature[~shaft]) > 5.0
    area_outer = operators.surface_area("housing.outer")
    weighted = operators.facet_areas("housing.outer") @ ambient / area_outer
    mean_outer = surface_mean(operators, solution.temperature, "housing.outer")
    assert mean_outer == pytest.approx(weighted + heat / (film * area_outer), abs=1e-7)
    jump = surface_mean(operators, solution.temperature, "shaft.outer") - solution.lumped("air")
    assert jump == pytest.approx(heat / (inside * operators.surface_area("shaft.outer")), abs=1e-7)
