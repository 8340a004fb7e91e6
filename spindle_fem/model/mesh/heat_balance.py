"""Heat that leaves and enters a solved problem, consistent with its equations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from spindle_fem.errors import EnergyBalanceError
from spindle_fem.model.mesh.conduction_problem import ConductionProblem, heat_flux
from spindle_fem.model.mesh.linear_system import ThermalSystem
from spindle_fem.model.mesh.mesh_operators import spread

BALANCE_TOLERANCE = 1e-8
LINEAR_BALANCE_TOLERANCE = 1e-10
NEGLIGIBLE_DIFFERENCE_K = 1e-3


@dataclass(frozen=True, slots=True)
class HeatBalance:
    """Heat flows of a steady temperature field, [W].

    Attributes
    ----------
    heat_in : mapping of str to float
        Heat put into each surface, part and lumped node.
    films : mapping of str to float
        Heat that leaves through each film and each link to surroundings
        (negative where it enters).
    links : mapping of str to float
        Heat along each link between lumped nodes, from ``node`` to ``other``.
    connections : mapping of str to float
        ``"surface>node"``: heat from a surface into a lumped node.
    joints : mapping of str to float
        Heat from part a to part b of each joint.
    imbalance : float, [W]
        Heat in − heat out.
    imbalance_relative : float, [-]
        Relative to the turnover.
    turnover : float, [W]
        See :class:`BoundaryFlows`.
    """

    heat_in: Mapping[str, float]
    films: Mapping[str, float]
    links: Mapping[str, float]
    connections: Mapping[str, float]
    joints: Mapping[str, float]
    imbalance: float
    imbalance_relative: float
    turnover: float

    @property
    def total_in(self) -> float:
        """Sum of the heat put in, [W]."""
        return float(sum(self.heat_in.values()))


@dataclass(frozen=True, slots=True)
class BoundaryFlows:
    """Heat that enters and leaves, [W].

    Attributes
    ----------
    sources : mapping of str to float
        Heat put into each surface, part and lumped node.
    films : mapping of str to float
        Heat that leaves through each film and each link to surroundings.
    turnover : float
        Half the sum of absolute flows, facet by facet; at least what a
        millikelvin of difference would drive, so that a machine without heat
        balances too.
    """

    sources: Mapping[str, float]
    films: Mapping[str, float]
    turnover: float

    @property
    def heat_in(self) -> float:
        """Sum of the heat put in, [W]."""
        return float(sum(self.sources.values()))


def boundary_flows(
    problem: ConductionProblem,
    reference: float,
    rise: NDArray[np.float64],
    lumped_rise: NDArray[np.float64],
) -> BoundaryFlows:
    """Heat across the boundary of a linear problem.

    Parameters
    ----------
    reference : float, [K]
    rise, lumped_rise : (n,), (m,) ndarray, [K]
        Temperatures above the reference.
    """
    operators = problem.operators
    sources = {
        surface: float(heat_flux(operators, surface, heat) @ operators.facet_areas(surface))
        for surface, heat in problem.surface_heat.items()
    }
    for part, heat in problem.part_heat.items():
        sources[part] = sources.get(part, 0.0) + float(heat)
    for name, heat in problem.nodal_heat.items():
        sources[name] = sources.get(name, 0.0) + float(heat.sum())
    for node in problem.lumped_nodes:
        if node.heat:
            sources[node.name] = float(node.heat)
    films = {}
    gross = sum(map(abs, sources.values()))
    conductance = 0.0
    for film in problem.films:
        rows = operators.surface_rows[film.surface]
        ambient = np.asarray(film.ambient_temperature) - reference
        excess = operators.facet_integral(rise, rows) - ambient * operators.facet_area[rows]
        heat = np.asarray(film.coefficient) * excess
        films[film.label] = float(np.sum(heat))
        gross += float(np.sum(np.abs(heat)))
        conductance += float(np.sum(np.asarray(film.coefficient) * operators.facet_area[rows]))
    for link in problem.lumped_links:
        if link.other is None:
            excess = lumped_rise[problem.lumped_names.index(link.node)] - (link.temperature - reference)
            heat = float(link.conductance * excess)
            films[link.label] = films.get(link.label, 0.0) + heat
            gross += abs(heat)
            conductance += link.conductance
    return BoundaryFlows(sources, films, 0.5 * max(gross, NEGLIGIBLE_DIFFERENCE_K * conductance))


def compute_balance(
    problem: ConductionProblem,
    system: ThermalSystem,
    rise: NDArray[np.float64],
    lumped_rise: NDArray[np.float64],
) -> HeatBalance:
    """Flows through every film, connection, link and joint of a steady field.

    Parameters
    ----------
    system : ThermalSystem
        Of the same problem, before perfect joints are tied.
    rise, lumped_rise : (n,), (m,) ndarray, [K]
        Temperatures above the system's reference.
    """
    operators = problem.operators
    flows = boundary_flows(problem, system.reference_temperature, rise, lumped_rise)
    connections: dict[str, float] = {}
    for index, node in enumerate(problem.lumped_nodes):
        for surface, value in node.connections:
            rows = operators.surface_rows[surface]
            excess = operators.facet_integral(rise, rows) - lumped_rise[index] * operators.facet_area[rows]
            key = f"{surface}>{node.name}"
            connections[key] = connections.get(key, 0.0) + float(np.sum(np.asarray(value) * excess))
    links: dict[str, float] = {}
    for link in problem.lumped_links:
        if link.other is None:
            continue
        here, there = (lumped_rise[problem.lumped_names.index(name)] for name in (link.node, link.other))
        links[link.label] = links.get(link.label, 0.0) + float(link.conductance * (here - there))
    imbalance = flows.heat_in - sum(flows.films.values())
    turnover = flows.turnover
    return HeatBalance(
        flows.sources,
        flows.films,
        links,
        connections,
        _joint_heat(problem, system, rise, lumped_rise),
        float(imbalance),
        abs(float(imbalance)) / turnover if turnover else 0.0,
        float(turnover),
    )


def with_law_heat(balance: HeatBalance, law_heat: Mapping[str, float]) -> HeatBalance:
    """The balance with the heat of film laws as the laws give it, not their linearisation."""
    films = {**balance.films, **law_heat}
    imbalance = balance.imbalance + sum(balance.films[label] - heat for label, heat in law_heat.items())
    turnover = balance.turnover
    return replace(
        balance,
        films=films,
        imbalance=imbalance,
        imbalance_relative=abs(imbalance) / turnover if turnover else 0.0,
    )


def require_balance(balance: HeatBalance, tolerance: float) -> None:
    """Refuse a balance that does not close.

    Raises
    ------
    EnergyBalanceError
    """
    if not balance.imbalance_relative <= tolerance:
        raise EnergyBalanceError(
            "heat balance",
            f"in and out differ by {balance.imbalance:.3g} W ({balance.imbalance_relative:.2e} relative).",
            f"Allowed: {tolerance:.0e}. Tighten the linear solver's tolerance.",
        )


def _joint_heat(
    problem: ConductionProblem,
    system: ThermalSystem,
    rise: NDArray[np.float64],
    lumped_rise: NDArray[np.float64],
) -> dict[str, float]:
    operators = problem.operators
    perfect = [
        joint for joint, value in problem.joint_conductance.items() if np.ndim(value) == 0 and np.isinf(value)
    ]
    reaction, sharing = np.zeros(0), np.zeros(0)
    if perfect:
        # what a tied node's own equation lacks arrives through its joints, in equal shares
        reaction = system.matrix @ rise - system.exchange @ lumped_rise - system.load
        sharing = np.zeros(operators.n_unknowns)
        for joint in perfect:
            sharing[np.unique(operators.facet_nodes[operators.joint_rows[joint][1]])] += 1.0
    flows = {}
    for joint, value in problem.joint_conductance.items():
        side_a, side_b = operators.joint_rows[joint]
        if joint in perfect:
            nodes = np.unique(operators.facet_nodes[side_b])
            flows[joint] = float(np.sum(reaction[nodes] / sharing[nodes]))
        else:
            conductance = spread(value, side_a.stop - side_a.start, joint)
            jump = operators.facet_integral(rise, side_a) - operators.facet_integral(rise, side_b)
            flows[joint] = float(conductance @ jump)
    return flows
