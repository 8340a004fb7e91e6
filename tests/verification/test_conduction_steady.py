"""Steady conduction against exact solutions: slab, fin, tube, tubes in contact, jump in conductivity.

Carslaw & Jaeger (1959), Conduction of Heat in Solids, 2nd ed., chapters 3, 4 and 7.
"""

from __future__ import annotations

import numpy as np
import pytest

from spindle_fem.machine.meshing.simple_bodies import (
    Block,
    build_box,
    build_joined_tubes,
    build_structured_mesh,
    build_tube,
)
from spindle_fem.model.mesh.conduction_problem import PERFECT_CONTACT, ConductionProblem, Film
from spindle_fem.model.mesh.evaluate import probe_matrix, surface_mean
from spindle_fem.model.mesh.mesh_operators import build_operators
from spindle_fem.model.mesh.steady_conduction import solve_steady

AMBIENT = 293.15


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("method", ["direct", "multigrid"])
def test_slab_between_two_films_is_exact(order, method):
    """A linear profile lies in the space: only round-off and the solver's tolerance remain."""
    length, conductivity, hot, cold = 0.1, 42.0, (500.0, 353.15), (200.0, 293.15)
    operators = build_operators(build_box((length, 0.03, 0.02), (4, 2, 2)), order)
    problem = ConductionProblem(
        operators,
        {"box": conductivity},
        films=(Film("box.x0", *hot), Film("box.x1", *cold)),
        adiabatic="rest",
    )
    solution = solve_steady(problem, method=method)
    flux = (hot[1] - cold[1]) / (1 / hot[0] + length / conductivity + 1 / cold[0])
    exact = hot[1] - flux / hot[0] - flux / conductivity * operators.mesh.points[: operators.n_unknowns, 0]
    np.testing.assert_allclose(solution.temperature, exact, rtol=0, atol=1e-8)
    assert solution.balance.films["box.x1"] == pytest.approx(flux * 0.03 * 0.02, rel=1e-9)
    assert solution.balance.imbalance_relative < 1e-10


def test_slab_with_heat_inside_is_exact_for_order_2():
    length, conductivity, heat, film = 0.1, 42.0, 30.0, 150.0
    operators = build_operators(build_box((length, 0.03, 0.02), (3, 2, 2)), 2)
    problem = ConductionProblem(
        operators,
        {"box": conductivity},
        films=(Film("box.x1", film, AMBIENT),),
        part_heat={"box": heat},
        adiabatic="rest",
    )
    solution = solve_steady(problem)
    density = heat / (length * 0.03 * 0.02)
    x = operators.mesh.points[:, 0]
    exact = AMBIENT + density * length / film + density * (length**2 - x**2) / (2.0 * conductivity)
    np.testing.assert_allclose(solution.temperature, exact, rtol=0, atol=1e-9)


@pytest.mark.parametrize("order", [1, 2])
def test_jump_in_conductivity_with_contact_is_exact(order):
    """Two slabs, k = 1 and 400, with contact conductance: exact on any mesh."""
    blocks = [
        Block("low", (2, 2, 2), lambda u: np.stack((0.01 * u[0], 0.02 * u[1], 0.02 * u[2])), _names()),
        Block(
            "high", (3, 2, 2), lambda u: np.stack((0.01 + 0.05 * u[0], 0.02 * u[1], 0.02 * u[2])), _names()
        ),
    ]
    operators = build_operators(build_structured_mesh(blocks, [("low", "u1", "high", "u0")]), order)
    conductance, heat = 2500.0, 4.0
    problem = ConductionProblem(
        operators,
        {"low": 1.0, "high": 400.0},
        films=(Film("high.u1", 80.0, AMBIENT),),
        joint_conductance={"low|high": conductance},
        surface_heat={"low.u0": heat},
        adiabatic="rest",
    )
    solution = solve_steady(problem)
    flux = heat / 4e-4
    side_a, side_b = (
        operators.facet_integral(solution.temperature, rows).sum() / operators.facet_area[rows].sum()
        for rows in operators.joint_sides("low|high", "joint temperatures")
    )
    assert side_b == pytest.approx(AMBIENT + flux * (1 / 80.0 + 0.05 / 400.0), abs=1e-8)
    assert side_a - side_b == pytest.approx(flux / conductance, abs=1e-8)
    assert surface_mean(operators, solution.temperature, "low.u0") == pytest.approx(
        side_a + flux * 0.01 / 1.0, abs=1e-8
    )
    assert solution.balance.joints["low|high"] == pytest.approx(heat, rel=1e-10)


def _names():
    return {face: face for face in ("u0", "u1", "v0", "v1", "w0", "w1")}


def test_rectangular_fin():
    """Base held, sides cooled: one-dimensional theory holds to the transverse Biot number, 2.5e-5."""
    length, half, conductivity, film = 0.05, 1e-3, 400.0, 10.0
    operators = build_operators(build_box((length, 2 * half, 0.02), (16, 2, 2)), 2)
    problem = ConductionProblem(
        operators,
        {"box": conductivity},
        films=(
            Film("box.x0", 1e7, AMBIENT + 80.0),
            Film("box.y0", film, AMBIENT),
            Film("box.y1", film, AMBIENT),
        ),
        adiabatic="rest",
    )
    solution = solve_steady(problem)
    excess = surface_mean(operators, solution.temperature, "box.x0") - AMBIENT
    m = np.sqrt(film / (conductivity * half))
    tip = AMBIENT + excess / np.cosh(m * length)
    assert surface_mean(operators, solution.temperature, "box.x1") == pytest.approx(tip, abs=2.5e-5 * excess)
    heat = excess * np.sqrt(film * conductivity * half) * 2 * 0.02 * np.tanh(m * length)
    assert -solution.balance.films["box.x0"] == pytest.approx(heat, rel=5e-5)


SECTOR = np.pi / 6
REFINEMENTS = [(1, (2, 4, 8), 1.9), (2, (2, 4, 6), 2.9)]


@pytest.mark.parametrize(("order", "refinements", "rate"), REFINEMENTS)
def test_tube_with_heat_and_film(order, refinements, rate):
    """Uniform heat inside, film outside, adiabatic bore; the L2 error falls with the order."""
    inner, outer, length, k, heat, h = 0.03, 0.09, 0.04, 42.0, 800.0, 120.0
    density = heat / (np.pi * (outer**2 - inner**2) * length)

    def exact(r):
        surface = AMBIENT + density * (outer**2 - inner**2) / (2 * outer * h)
        return (
            surface + density / (4 * k) * (outer**2 - r**2) - density * inner**2 / (2 * k) * np.log(outer / r)
        )

    errors = []
    for n in refinements:
        operators = build_operators(build_tube((inner, outer), length, (n, n, n), angle=SECTOR), order)
        problem = ConductionProblem(
            operators,
            {"tube": k},
            films=(Film("tube.outer", h, AMBIENT),),
            part_heat={"tube": heat * SECTOR / (2 * np.pi)},
            adiabatic="rest",
        )
        radius = np.hypot(*operators.mesh.points[: operators.n_unknowns, :2].T)
        errors.append(_l2(operators, solve_steady(problem).temperature - exact(radius)))
    assert _rate(refinements, errors) > rate
    assert errors[-1] < 0.05


@pytest.mark.parametrize("conductance", [800.0, PERFECT_CONTACT])
@pytest.mark.parametrize(("order", "refinements", "rate"), REFINEMENTS)
def test_two_tubes_with_a_joint(order, refinements, rate, conductance):
    """Heat in at the bore, through a joint, out by a film; perfect contact ties the nodes."""
    a, b, c, length, k1, k2, heat, h = 0.03, 0.05, 0.08, 0.03, 46.0, 20.0, 400.0, 300.0
    flow = heat / length / (2 * np.pi)
    jump = 0.0 if np.isinf(conductance) else flow / (b * conductance)

    def outside(r):
        return AMBIENT + flow / (c * h) + flow / k2 * np.log(c / r)

    errors = []
    for n in refinements:
        mesh = build_joined_tubes((a, b, c), length, ((n, n), n, n), angle=SECTOR)
        operators = build_operators(mesh, order)
        share = heat * SECTOR / (2 * np.pi)
        problem = ConductionProblem(
            operators,
            {"inner": k1, "outer": k2},
            films=(Film("outer.outer", h, AMBIENT),),
            joint_conductance={"inner|outer": conductance},
            surface_heat={"inner.inner": share},
            adiabatic="rest",
        )
        solution = solve_steady(problem)
        assert solution.balance.joints["inner|outer"] == pytest.approx(share, rel=1e-8)
        radius = np.hypot(*operators.mesh.points[: operators.n_unknowns, :2].T)
        inside = outside(b) + jump + flow / k1 * np.log(b / radius)
        exact = np.where(operators.part_of_unknown == 0, inside, outside(radius))
        errors.append(_l2(operators, solution.temperature - exact))
    assert _rate(refinements, errors) > rate
    assert errors[-1] < 0.05


def _l2(operators, error):
    """Root of the volume mean of a nodal error's square, [K]."""
    return np.sqrt(
        error @ (operators.matrix(operators.storage) @ error) / sum(operators.part_volume.values())
    )


def _rate(refinements, errors):
    return -np.polyfit(np.log(refinements), np.log(errors), 1)[0]


def test_large_conductance_approaches_the_tie():
    mesh = build_joined_tubes((0.03, 0.05, 0.08), 0.03, ((2, 2), 12, 2), angle=np.pi / 2)
    operators = build_operators(mesh, 2)

    def bore(conductance):
        problem = ConductionProblem(
            operators,
            {"inner": 46.0, "outer": 20.0},
            films=(Film("outer.outer", 300.0, AMBIENT),),
            joint_conductance={"inner|outer": conductance},
            surface_heat={"inner.inner": 100.0},
            adiabatic="rest",
        )
        return surface_mean(operators, solve_steady(problem).temperature, "inner.inner")

    tied = bore(PERFECT_CONTACT)
    gaps = [bore(conductance) - tied for conductance in (1e5, 1e6, 1e7)]
    flux = 100.0 / mesh.cad_area["inner|outer"]
    np.testing.assert_allclose(gaps, [flux / 1e5, flux / 1e6, flux / 1e7], rtol=2e-2)


def test_nafems_t4_plate_with_convection():
    """NAFEMS (1990), The Standard NAFEMS Benchmarks, T4: 18.3 °C at E (0.6 m, 0.2 m)."""
    operators = build_operators(build_box((0.6, 1.0, 0.1), (18, 30, 1)), 2)
    problem = ConductionProblem(
        operators,
        {"box": 52.0},
        films=(
            Film("box.y0", 1e9, 373.15),
            Film("box.x1", 750.0, 273.15),
            Film("box.y1", 750.0, 273.15),
        ),
        adiabatic="rest",
    )
    solution = solve_steady(problem)
    at_e = (probe_matrix(operators, [[0.6, 0.2, 0.05]], ["box"]) @ solution.temperature)[0]
    assert at_e - 273.15 == pytest.approx(18.3, abs=0.1)
