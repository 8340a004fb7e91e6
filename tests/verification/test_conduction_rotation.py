"""Rotating parts: uniform around the axis through lumped exchange, or nearly so by conductivity.

The circumferential factor is a cheap alternative with a price: functions that
are uniform around the axis are not in the finite-element space, so a large
factor also stiffens the radial direction ("locking"). The last test pins what
a factor costs, so that whoever raises it sees the price.
"""

from __future__ import annotations

import numpy as np
import pytest

from spindle_fem.machine.meshing.simple_bodies import Block, build_structured_mesh, build_tube, tube_mapping
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


@pytest.mark.parametrize("order", [1, 2])
def test_factor_conducts_around_the_axis_as_it_says(order):
    """T = A cos θ at the wall of a thin ring: the ring's fin equation with k·factor."""
    inner, outer, k, factor, film = 0.099, 0.101, 40.0, 4.0, 60.0
    operators = build_operators(
        build_tube((inner, outer), 0.01, (1, 48, 1)), order, circumferential_parts=("tube",)
    )
    mesh = operators.mesh
    centre = mesh.points[mesh.surfaces["tube.outer"][:, :3]].mean(axis=1)
    angle = np.arctan2(centre[:, 1], centre[:, 0])
    problem = ConductionProblem(
        operators,
        {"tube": k},
        films=(Film("tube.outer", film, 300.0 + 10.0 * np.cos(angle)),),
        circumferential_factor={"tube": factor},
        adiabatic="rest",
    )
    temperature = solve_steady(problem).temperature
    around = np.arctan2(mesh.points[: operators.n_unknowns, 1], mesh.points[: operators.n_unknowns, 0])
    amplitude = 2.0 * np.mean((temperature - 300.0) * np.cos(around))
    mean_radius = 0.5 * (inner + outer)
    exact = 10.0 / (1.0 + factor * k * (outer - inner) / (film * outer * mean_radius))
    assert amplitude == pytest.approx(exact, rel=5e-3)


@pytest.mark.parametrize(
    ("order", "factor", "drop_error", "spread"),
    [
        (1, 1.0, 0.014, None),
        (1, 10.0, 0.016, 0.35),
        (1, 100.0, 0.03, 0.10),
        (2, 10.0, 0.004, 0.35),
        (2, 100.0, 0.015, 0.12),
    ],
)
def test_price_of_a_circumferential_factor(order, factor, drop_error, spread):
    """Error of the radial drop with heat in the bore, and what is left of a one-sided load's spread."""
    inner, outer, k, heat, film = 0.03, 0.065, 42.0, 155.0, 30.0
    operators = build_operators(
        build_tube((inner, outer), LENGTH, (2, 16, 4)), order, circumferential_parts=("tube",)
    )
    mesh = operators.mesh

    def solve(films, heats, value):
        return solve_steady(
            ConductionProblem(
                operators,
                {"tube": k},
                films=films,
                surface_heat=heats,
                circumferential_factor={"tube": value},
                adiabatic="rest",
            )
        ).temperature

    field = solve((Film("tube.outer", film, 293.15),), {"tube.inner": heat}, factor)
    drop = surface_mean(operators, field, "tube.inner") - surface_mean(operators, field, "tube.outer")
    exact = heat / (2 * np.pi * k * LENGTH) * np.log(outer / inner)
    assert abs(drop / exact - 1.0) < drop_error
    if spread is not None:
        centre = mesh.points[mesh.surfaces["tube.outer"][:, :3]].mean(axis=1)
        one_sided = (Film("tube.outer", 10 * film, 293.15 + 40.0 * (centre[:, 1] > 0.0)),)
        ratio = np.ptp(solve(one_sided, {}, factor)) / np.ptp(solve(one_sided, {}, 1.0))
        assert ratio < spread
