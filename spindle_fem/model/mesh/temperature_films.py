"""Films that depend on temperature, linearised facet by facet (Newton)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from spindle_fem.errors import SpecError
from spindle_fem.model.mesh.conduction_problem import ConductionProblem, Film, FilmLaw
from spindle_fem.model.mesh.mesh_operators import ThermalOperators

DIFFERENCE_STEP_K = 0.01


def film_heat_flux(
    operators: ThermalOperators, law: FilmLaw, facet_temperature: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Heat flux ``h(T)(T − T_ambient)`` of a film law on each facet, (n,) [W/m²].

    Raises
    ------
    SpecError
        The law gives a coefficient of another shape, negative or not finite.
    """
    coefficient = np.asarray(law.coefficient(facet_temperature), dtype=float)
    if coefficient.shape != facet_temperature.shape:
        raise SpecError(
            f"film law {law.label}",
            f"coefficients of shape {coefficient.shape} for {facet_temperature.shape} facets.",
            "Return one for each facet.",
        )
    if not np.all(np.isfinite(coefficient)) or coefficient.min(initial=0.0) < 0.0:
        raise SpecError(f"film law {law.label}", "a negative or infinite coefficient.", "Allowed: 0 or more.")
    ambient = operators.per_facet(law.surface, law.ambient_temperature, law.label)
    return coefficient * (facet_temperature - ambient)


def linearise_films(problem: ConductionProblem, temperature: NDArray[np.float64]) -> ConductionProblem:
    """Replace film laws by films with the same flux and slope at a temperature field.

    On each facet ``q(T) ≈ q₀ + q₀' (T − T₀)`` is a film of coefficient ``q₀'``
    towards ``T₀ − q₀/q₀'``. Where the slope vanishes or falls, the secant
    (coefficient and ambient temperature of the law itself) is taken.

    Parameters
    ----------
    temperature : (n_unknowns,) ndarray, [K]
    """
    operators = problem.operators
    films = []
    for law in problem.film_laws:
        rows = operators.surface_rows[law.surface]
        here = operators.facet_integral(temperature, rows) / operators.facet_area[rows]
        flux = film_heat_flux(operators, law, here)
        above = film_heat_flux(operators, law, here + DIFFERENCE_STEP_K)
        below = film_heat_flux(operators, law, here - DIFFERENCE_STEP_K)
        slope = (above - below) / (2.0 * DIFFERENCE_STEP_K)
        secant = np.asarray(law.coefficient(here), dtype=float)
        ambient = operators.per_facet(law.surface, law.ambient_temperature, law.label)
        rising = slope > 1e-3 * secant
        coefficient = np.where(rising, slope, secant)
        safe = np.where(rising, slope, 1.0)
        films.append(Film(law.surface, coefficient, np.where(rising, here - flux / safe, ambient), law.label))
    return replace(problem, films=(*problem.films, *films), film_laws=())


def law_heat(problem: ConductionProblem, temperature: NDArray[np.float64]) -> dict[str, float]:
    """Heat that leaves through each film law at a temperature field, [W]."""
    operators = problem.operators
    heat = {}
    for law in problem.film_laws:
        rows = operators.surface_rows[law.surface]
        area = operators.facet_area[rows]
        here = operators.facet_integral(temperature, rows) / area
        heat[law.label] = float(film_heat_flux(operators, law, here) @ area)
    return heat
