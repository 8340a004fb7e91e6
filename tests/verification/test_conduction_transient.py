"""Transient conduction against exact series, a benchmark and a manufactured solution.

Carslaw & Jaeger (1959), Conduction of Heat in Solids, 2nd ed., sections 3.11 and 13.4.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import j0, j1, y0, y1

from spindle_fem.machine.meshing.simple_bodies import build_box, build_tube
from spindle_fem.model.mesh.conduction_problem import ConductionProblem, Film, LumpedNode
from spindle_fem.model.mesh.evaluate import probe_matrix
from spindle_fem.model.mesh.mesh_operators import build_operators
from spindle_fem.model.mesh.steady_conduction import solve_steady
from spindle_fem.model.mesh.step_control import StepControl
from spindle_fem.model.mesh.thermal_state import uniform_state
from spindle_fem.model.mesh.time_stepper import integrate

AMBIENT, START = 300.0, 400.0
K, CAPACITY = 40.0, 3.6e6


def slab(order=2, counts=(24, 1, 1), length=0.05, film=800.0):
    operators = build_operators(build_box((length, 0.01, 0.01), counts), order)
    return ConductionProblem(
        operators,
        {"box": K},
        films=(Film("box.x1", film, AMBIENT),),
        volumetric_capacity={"box": CAPACITY},
        adiabatic="rest",
    )


def slab_series(x, time, length=0.05, film=800.0):
    biot = film * length / K
    roots = [
        brentq(lambda q: q * np.tan(q) - biot, n * np.pi + 1e-9, n * np.pi + np.pi / 2 - 1e-9)
        for n in range(60)
    ]
    total = sum(
        4
        * np.sin(q)
        / (2 * q + np.sin(2 * q))
        * np.cos(q * x / length)
        * np.exp(-(q**2) * K / CAPACITY * time / length**2)
        for q in roots
    )
    return AMBIENT + (START - AMBIENT) * total


@pytest.mark.parametrize("method", ["direct", "multigrid"])
def test_slab_that_cools_follows_the_series(method):
    problem = slab()
    probes = probe_matrix(problem.operators, [[0.0, 0.005, 0.005], [0.05, 0.005, 0.005]], ["box", "box"])
    times = np.array([1.0, 5.0, 20.0, 60.0, 100.0])
    result = integrate(
        problem,
        uniform_state(problem, START),
        100.0,
        control=StepControl(tolerance=0.002, first_step=0.01, method=method),
        outputs=probes,
        sample_times=times,
    )
    exact = [[slab_series(0.0, t), slab_series(0.05, t)] for t in times]
    np.testing.assert_allclose(result.samples, exact, rtol=0, atol=0.01)
    assert result.energy.imbalance_relative < 1e-10


def test_annulus_that_cools_follows_the_bessel_series():
    inner, outer, film = 0.02, 0.06, 600.0
    ratio = film / K

    def shape(q, r):
        return j0(q * r) * y1(q * inner) - j1(q * inner) * y0(q * r)

    def slope(q, r):
        return -q * (j1(q * r) * y1(q * inner) - j1(q * inner) * y1(q * r))

    def condition(q):
        return slope(q, outer) + ratio * shape(q, outer)

    grid = np.linspace(0.5, 3000.0, 60_000)
    values = condition(grid)
    roots = [brentq(condition, grid[i], grid[i + 1]) for i in np.flatnonzero(values[:-1] * values[1:] < 0.0)]
    nodes, weights = np.polynomial.legendre.leggauss(400)
    r = 0.5 * (outer - inner) * nodes + 0.5 * (outer + inner)

    def series(radius, time):
        total = 0.0
        for q in roots:
            numerator = weights @ (r * shape(q, r))
            total += (
                numerator
                / (weights @ (r * shape(q, r) ** 2))
                * shape(q, radius)
                * np.exp(-(q**2) * K / CAPACITY * time)
            )
        return AMBIENT + (START - AMBIENT) * total

    operators = build_operators(build_tube((inner, outer), 0.02, (6, 12, 1), angle=np.pi / 2), 2)
    problem = ConductionProblem(
        operators,
        {"tube": K},
        films=(Film("tube.outer", film, AMBIENT),),
        volumetric_capacity={"tube": CAPACITY},
        adiabatic="rest",
    )
    angle = np.pi / 4
    points = [[-radius * np.sin(angle), radius * np.cos(angle), 0.01] for radius in (inner, 0.04, outer)]
    times = np.array([20.0, 60.0, 120.0])
    result = integrate(
        problem,
        uniform_state(problem, START),
        120.0,
        control=StepControl(tolerance=0.002, first_step=0.01),
        outputs=probe_matrix(operators, points, ["tube"] * 3),
        sample_times=times,
    )
    exact = [[series(radius, t) for radius in (inner, 0.04, outer)] for t in times]
    np.testing.assert_allclose(result.samples, exact, rtol=0, atol=0.01)


def test_nafems_t3_oscillating_wall():
    """NAFEMS (1990), The Standard NAFEMS Benchmarks, T3: 36.60 °C at 0.08 m and 32 s."""
    operators = build_operators(build_box((0.1, 0.01, 0.01), (20, 1, 1)), 2)

    def inputs(time, state):
        wall = 273.15 + 100.0 * np.sin(np.pi * time / 40.0)
        return ConductionProblem(
            operators,
            {"box": 35.0},
            films=(Film("box.x0", 1e8, 273.15), Film("box.x1", 1e8, wall)),
            volumetric_capacity={"box": 7200.0 * 440.5},
            adiabatic="rest",
        )

    start = uniform_state(inputs(0.0, None), 273.15)
    result = integrate(
        inputs,
        start,
        32.0,
        control=StepControl(tolerance=0.01),
        outputs=probe_matrix(operators, [[0.08, 0.005, 0.005]], ["box"]),
        sample_times=[32.0],
    )
    assert result.samples[0, 0] - 273.15 == pytest.approx(36.60, abs=0.03)


def test_manufactured_solution_is_second_order_in_time():
    """T = a(t) + b x² lies in the quadratic space: what is left is the error in time."""
    base, length, film, b, omega = slab(), 0.05, 800.0, 4000.0, 2 * np.pi / 50.0
    volume = length * 0.01 * 0.01

    def swing(time):
        return 320.0 + 20.0 * np.sin(omega * time)

    def inputs(time, state):
        rate = 20.0 * omega * np.cos(omega * time)
        ambient = swing(time) + b * length**2 + 2.0 * K * b * length / film
        heat = (CAPACITY * rate - 2.0 * K * b) * volume
        return replace(base, films=(Film("box.x1", film, ambient),), part_heat={"box": heat})

    x = base.operators.mesh.points[:, 0]
    start = replace(uniform_state(base, 0.0), temperature=swing(0.0) + b * x**2)
    errors, counts = [], (16, 32, 64, 128)
    for count in counts:
        control = StepControl(tolerance=None, first_step=50.0 / count, linear_tolerance=1e-11)
        result = integrate(inputs, start, 40.0, control=control)
        errors.append(np.abs(result.state.temperature - swing(40.0) - b * x**2).max())
        assert result.energy.imbalance_relative < 1e-8
    assert -np.polyfit(np.log(counts), np.log(errors), 1)[0] == pytest.approx(2.0, abs=0.1)


def test_steady_state_is_where_the_transient_ends():
    problem = replace(slab(), surface_heat={"box.x0": 5.0})
    result = integrate(
        problem,
        uniform_state(problem, AMBIENT),
        20_000.0,
        control=StepControl(tolerance=0.05, first_step=0.1),
    )
    np.testing.assert_allclose(result.state.temperature, solve_steady(problem).temperature, rtol=0, atol=1e-4)


def test_lumped_node_cools_exponentially():
    """A lumped body on a part that conducts perfectly well: two time constants, known exactly."""
    operators = build_operators(build_box((0.01, 0.01, 0.01), (1, 1, 1)), 1)
    mass, node_capacity, film, coupling = 3.6e6 * 1e-6, 20.0, 100.0, 4000.0
    problem = ConductionProblem(
        operators,
        {"box": 1e7},
        films=(Film("box.x1", film, AMBIENT),),
        lumped_nodes=(LumpedNode("balls", (("box.x0", coupling),), capacity=node_capacity),),
        volumetric_capacity={"box": 3.6e6},
        adiabatic="rest",
    )
    rates = np.array(
        [
            [-(coupling + film) * 1e-4 / mass, coupling * 1e-4 / mass],
            [coupling * 1e-4 / node_capacity, -coupling * 1e-4 / node_capacity],
        ]
    )
    values, vectors = np.linalg.eig(rates)
    exact = AMBIENT + vectors @ (np.exp(values * 300.0) * np.linalg.solve(vectors, [100.0, 100.0]))
    result = integrate(
        problem, uniform_state(problem, START), 300.0, control=StepControl(tolerance=1e-3, first_step=0.01)
    )
    assert result.state.temperature.mean() == pytest.approx(exact[0], abs=0.02)
    assert result.state.lumped_temperature[0] == pytest.approx(exact[1], abs=0.02)
