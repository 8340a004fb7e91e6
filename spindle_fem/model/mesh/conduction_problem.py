"""Conduction problem on a mesh: coefficients, heat, films, lumped nodes."""

from __future__ import annotations

import copy
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from spindle_fem.errors import MeshTagError, NoSteadyStateError, SpecError, did_you_mean
from spindle_fem.model.mesh.linear_system import ThermalSystem as ThermalSystem
from spindle_fem.model.mesh.mesh_operators import ThermalOperators, spread

PERFECT_CONTACT = np.inf


@dataclass(frozen=True, slots=True)
class Film:
    """Heat exchange of a surface with surroundings of given temperature.

    Attributes
    ----------
    coefficient : float or (n,) ndarray, [W/(m²·K)]
        One value, or one for each facet.
    ambient_temperature : float or (n,) ndarray, [K]
        Absolute; one value, or one for each facet.
    name : str
        Name in the heat balance; the surface's when empty. Must be unique.
    """

    surface: str
    coefficient: ArrayLike
    ambient_temperature: ArrayLike
    name: str = ""

    @property
    def label(self) -> str:
        """Name in the heat balance."""
        return self.name or self.surface


@dataclass(frozen=True, slots=True)
class FilmLaw:
    """A film whose coefficient follows the surface temperature.

    Attributes
    ----------
    coefficient : callable
        ``(n,)`` mean temperature of each facet [K] to ``(n,)`` coefficients
        [W/(m²·K)], positive; for natural convection and radiation.
    ambient_temperature : float or (n,) ndarray, [K]
    name : str
        Name in the heat balance; the surface's when empty.
    """

    surface: str
    coefficient: Callable[[NDArray[np.float64]], NDArray[np.float64]]
    ambient_temperature: ArrayLike
    name: str = ""

    @property
    def label(self) -> str:
        """Name in the heat balance."""
        return self.name or self.surface


@dataclass(frozen=True, slots=True)
class LumpedNode:
    """A body or volume of one temperature, joined to surfaces by films.

    Used for ball rows (between two raceways) and for the air of a gap (z-bands
    between a rotating and a stationary surface; the band's one temperature is
    the mean that a rotating part sees in one turn).

    Attributes
    ----------
    connections : tuple of (surface, coefficient)
        Coefficient in W/(m²·K), one value or one for each facet (zero outside
        a band).
    capacity : float, [J/K]
    heat : float, [W]
    """

    name: str
    connections: tuple[tuple[str, ArrayLike], ...]
    capacity: float = 0.0
    heat: float = 0.0


@dataclass(frozen=True, slots=True)
class LumpedLink:
    """Conductance between two lumped nodes, or from one to a given temperature.

    Attributes
    ----------
    conductance : float, [W/K]
    other : str or None
        The other lumped node; None when ``temperature`` is given.
    temperature : float or None, [K]
    name : str
        Name in the heat balance, where links of one name add up; made of both ends when empty.
    """

    node: str
    conductance: float
    other: str | None = None
    temperature: float | None = None
    name: str = ""

    @property
    def label(self) -> str:
        """Name in the heat balance."""
        return self.name or f"{self.node}|{self.other if self.other is not None else 'surroundings'}"


@dataclass(frozen=True, slots=True)
class ConductionProblem:
    """Coefficients and loads on a mesh's operators.

    Attributes
    ----------
    conductivity : mapping of str to float, [W/(m·K)]
        Of each part.
    films : tuple of Film
        Several may act on one surface.
    joint_conductance : mapping of str to float or (n,) ndarray, [W/(m²·K)]
        Of each joint, one value or one for each facet pair. 0 separates,
        ``inf`` ties the nodes of both sides exactly.
    surface_heat : mapping of str to float or (n,) ndarray, [W]
        Total, spread evenly over the surface's area; or one for each facet.
    part_heat : mapping of str to float, [W]
        Total, spread evenly over the part's volume.
    nodal_heat : mapping of str to (n_unknowns,) ndarray, [W]
        What each unknown receives, by a name of its own; its sum is the heat.
    capacity_scale : (n_unknowns,) ndarray or None, [-]
        Above 0: entry (i, j) of the capacity matrix is scaled by the root of
        both unknowns' values. For mass that the parts do not have.
    volumetric_capacity : mapping of str to float, [J/(m³·K)]
        Needed for transients only.
    film_laws : tuple of FilmLaw
        Films that depend on temperature.
    adiabatic : collection of str, or "rest"
        Surfaces that exchange nothing: each surface must be named in a film,
        a heat, a connection or here.
    """

    operators: ThermalOperators
    conductivity: Mapping[str, float]
    films: tuple[Film, ...] = ()
    joint_conductance: Mapping[str, ArrayLike] = field(default_factory=dict)
    surface_heat: Mapping[str, ArrayLike] = field(default_factory=dict)
    part_heat: Mapping[str, float] = field(default_factory=dict)
    nodal_heat: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    capacity_scale: NDArray[np.float64] | None = None
    lumped_nodes: tuple[LumpedNode, ...] = ()
    lumped_links: tuple[LumpedLink, ...] = ()
    volumetric_capacity: Mapping[str, float] = field(default_factory=dict)
    film_laws: tuple[FilmLaw, ...] = ()
    adiabatic: Collection[str] | Literal["rest"] = ()

    def __post_init__(self) -> None:
        require_sound(self)

    def altered(self, **values: Any) -> ConductionProblem:
        """The problem with other values of some attributes, of the same parts, surfaces and nodes.

        Names are not checked again, which takes longer than making the problem.

        Raises
        ------
        SpecError
            Impossible values.
        """
        found = copy.copy(self)
        for name, value in values.items():
            object.__setattr__(found, name, value)
        if not _has_possible_values(found):
            require_sound(found)
        return found

    @property
    def lumped_names(self) -> tuple[str, ...]:
        """Names of the lumped nodes, in the order of their unknowns."""
        return tuple(node.name for node in self.lumped_nodes)


def conductivity_of_parts(problem: ConductionProblem) -> NDArray[np.float64]:
    """Conductivity of each part in the mesh's order, (n_parts,) [W/(m·K)]."""
    return np.array([problem.conductivity[part] for part in problem.operators.mesh.part_names], dtype=float)


def heat_flux(operators: ThermalOperators, surface: str, heat: ArrayLike) -> NDArray[np.float64]:
    """Heat flux into a surface, (n_facets,) [W/m²], of a total or per-facet heat in W."""
    areas = operators.facet_areas(surface)
    if np.ndim(heat) == 0:
        return np.full(len(areas), float(heat) / areas.sum())
    return operators.per_facet(surface, heat, f"heat on {surface}") / areas


def reference_temperature(problem: ConductionProblem) -> float:
    """Mean temperature of the surroundings that the problem names, [K]."""
    given = [float(np.mean(film.ambient_temperature)) for film in (*problem.films, *problem.film_laws)]
    given += [link.temperature for link in problem.lumped_links if link.temperature is not None]
    return float(np.mean(given)) if given else 0.0


# ------------------------------------------------------------------ validation
def require_sound(problem: ConductionProblem) -> None:
    """Refuse unknown names, missing parts, impossible values.

    Raises
    ------
    UnknownSurfaceError, SpecError, MeshTagError
    """
    operators = problem.operators
    for part in (*problem.conductivity, *problem.part_heat, *problem.volumetric_capacity):
        operators.part_index(part, "problem")
    for part in operators.mesh.part_names:
        if part not in problem.conductivity:
            raise SpecError("conductivity", f'no value for part "{part}".', "Name every part.")
        _require(
            problem.conductivity[part] > 0.0,
            f'conductivity of "{part}"',
            problem.conductivity[part],
            "above 0",
        )
    for part, capacity in problem.volumetric_capacity.items():
        _require(capacity > 0.0, f'volumetric capacity of "{part}"', capacity, "above 0")
    _require_films(problem)
    _require_joints(problem)
    _require_lumped(problem)
    _require_every_surface_named(problem)


def _has_possible_values(problem: ConductionProblem) -> bool:
    """Whether coefficients and temperatures of surroundings, all in one pass, are 0 or more."""
    connected = [value for node in problem.lumped_nodes for _, value in node.connections]
    exchanged = [value for film in problem.films for value in (film.coefficient, film.ambient_temperature)]
    links = [link.conductance for link in problem.lumped_links]
    finite = np.concatenate([np.ravel(value) for value in (*connected, *exchanged, links)])
    joints = np.concatenate([[0.0], *(np.ravel(value) for value in problem.joint_conductance.values())])
    possible = bool(np.isfinite(finite).all() and finite.min(initial=0.0) >= 0.0 and (joints >= 0.0).all())
    heats = [np.sum(heat) for heat in (*problem.surface_heat.values(), *problem.nodal_heat.values())]
    return (
        possible
        and bool(np.isfinite(heats).all())
        and all(value > 0.0 for value in problem.conductivity.values())
    )


def _require(holds: bool, where: str, value: object, allowed: str) -> None:
    if not holds:
        raise SpecError(where, f"{value!r}.", f"Allowed: {allowed}.")


def _require_not_negative(values: NDArray[np.float64], where: str, allowed: str = "0 or more") -> None:
    """Refuse values below zero, with one pass over them: each stage of a step checks a hundred surfaces."""
    least = values.min(initial=0.0)
    if least < 0.0:
        raise SpecError(where, f"{least!r}.", f"Allowed: {allowed}.")


def _require_films(problem: ConductionProblem) -> None:
    operators = problem.operators
    labels = set()
    for film in problem.films:
        values = operators.per_facet(film.surface, film.coefficient, f"film {film.label}")
        ambient = operators.per_facet(film.surface, film.ambient_temperature, f"film {film.label}")
        _require_not_negative(values, f"film {film.label}: coefficient")
        _require_not_negative(ambient, f"film {film.label}: ambient temperature", "kelvin, 0 or more")
        _require(film.label not in labels, "films", film.label, "each name once; give the second film a name")
        labels.add(film.label)
    for law in problem.film_laws:
        operators.per_facet(law.surface, law.ambient_temperature, f"film law {law.label}")
        _require(
            law.label not in labels, "film laws", law.label, "each name once; give the second film a name"
        )
        labels.add(law.label)
    for surface, heat in problem.surface_heat.items():
        operators.per_facet(surface, heat, f"heat on {surface}")
    for part, heat in problem.part_heat.items():
        _require(bool(np.isfinite(heat)), f"heat of {part}", heat, "finite")
    for name, heat in problem.nodal_heat.items():
        sound = np.shape(heat) == (operators.n_unknowns,) and bool(np.all(np.isfinite(heat)))
        _require(sound, f"heat of {name}", heat, f"{operators.n_unknowns} finite values")
    scale = problem.capacity_scale
    if scale is not None:
        sound = np.shape(scale) == (operators.n_unknowns,) and bool(np.all(scale > 0.0))
        _require(sound, "capacity_scale", scale, f"{operators.n_unknowns} values above 0")


def _require_joints(problem: ConductionProblem) -> None:
    operators = problem.operators
    for joint, value in problem.joint_conductance.items():
        side_a, _ = operators.joint_sides(joint, "joint_conductance")
        if np.ndim(value) == 0 and value == PERFECT_CONTACT:
            continue
        values = spread(value, side_a.stop - side_a.start, f"joint {joint}")
        _require_not_negative(values, f"conductance of joint {joint}")
    missing = [joint for joint in operators.joint_rows if joint not in problem.joint_conductance]
    if missing:
        raise SpecError(
            "joint_conductance", f"no value for {', '.join(missing)}.", "Name every joint; 0 separates."
        )


def _require_lumped(problem: ConductionProblem) -> None:
    names = problem.lumped_names
    _require(len(set(names)) == len(names), "lumped nodes", names, "each name once")
    for node in problem.lumped_nodes:
        for surface, value in node.connections:
            values = problem.operators.per_facet(surface, value, f"lumped node {node.name}")
            _require_not_negative(values, f"lumped node {node.name}: coefficient")
        _require(node.capacity >= 0.0, f"lumped node {node.name}: capacity", node.capacity, "0 or more")
    for link in problem.lumped_links:
        for name in (link.node, *([link.other] if link.other is not None else [])):
            if name not in names:
                raise SpecError("lumped_links", f'names "{name}", no lumped node.', did_you_mean(name, names))
        _require(link.conductance >= 0.0, f"link {link.label}: conductance", link.conductance, "0 or more")
        _require(
            (link.other is None) != (link.temperature is None),
            f"link of {link.node}",
            (link.other, link.temperature),
            "another node or a temperature, one of both",
        )


def _require_every_surface_named(problem: ConductionProblem) -> None:
    surfaces = problem.operators.surface_rows
    filmed = {film.surface for film in (*problem.films, *problem.film_laws)}
    used = filmed | set(problem.surface_heat)
    used |= {surface for node in problem.lumped_nodes for surface, _ in node.connections}
    if problem.adiabatic == "rest":
        return
    for surface in problem.adiabatic:
        problem.operators.rows_of(surface, "adiabatic")
    both = sorted(filmed & set(problem.adiabatic))
    if both:
        raise MeshTagError("adiabatic", f"{', '.join(both)} also has a film.", "Name it in one of both.")
    left = sorted(set(surfaces) - used - set(problem.adiabatic))
    if left:
        raise MeshTagError(
            "problem",
            f"nothing is said about {', '.join(left)}.",
            "Give a film or heat, or name it in adiabatic.",
        )


def require_surroundings(problem: ConductionProblem) -> None:
    """Refuse a steady problem with a part that heat cannot leave.

    Raises
    ------
    NoSteadyStateError
        Names the parts and lumped nodes without a path to the surroundings.
    """
    operators = problem.operators
    parts = operators.mesh.part_names
    names = (*parts, *problem.lumped_names, "surroundings")
    ends: list[tuple[int, int]] = []
    part_of = operators.mesh.part_of_surface
    for film in problem.films:
        if np.any(np.asarray(film.coefficient) > 0.0):
            ends.append((parts.index(part_of[film.surface]), len(names) - 1))
    ends += [(parts.index(part_of[law.surface]), len(names) - 1) for law in problem.film_laws]
    for joint, value in problem.joint_conductance.items():
        if np.any(np.asarray(value) > 0.0):
            side_a, side_b = operators.joint_rows[joint]
            ends.append(
                tuple(
                    int(operators.part_of_unknown[operators.facet_nodes[side][0, 0]])
                    for side in (side_a, side_b)
                )
            )
    for index, node in enumerate(problem.lumped_nodes):
        ends += [
            (parts.index(part_of[surface]), len(parts) + index)
            for surface, value in node.connections
            if np.any(np.asarray(value) > 0.0)
        ]
    for link in problem.lumped_links:
        if link.conductance > 0.0:
            other = (
                len(names) - 1 if link.other is None else len(parts) + problem.lumped_names.index(link.other)
            )
            ends.append((len(parts) + problem.lumped_names.index(link.node), other))
    rows, columns = np.array(ends, dtype=int).reshape(-1, 2).T
    graph = sparse.coo_array((np.ones(len(rows)), (rows, columns)), shape=(len(names), len(names)))
    _, label = connected_components(graph, directed=False)
    floating = [name for name, group in zip(names, label, strict=True) if group != label[-1]]
    if floating:
        raise NoSteadyStateError(
            "problem",
            f"heat cannot leave {', '.join(floating)}.",
            "Give it a film, or a joint to a part with one.",
        )
