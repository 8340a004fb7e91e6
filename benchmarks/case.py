"""The same discrete problem for every program: the reference spindle in linear tetrahedra.

A quadratic mesh of the machine is divided, each element into eight, so that
its nodes become the corners: as many unknowns as the machine's own quadratic
temperatures, the same tags. Film coefficients, surrounding temperatures and
heat are means over each surface of the machine's solved field; joints conduct
perfectly, because most programs know no other; balls and air between parts
keep the temperatures that they had.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from spindle_fem.machine.meshing.tagged_mesh import Joint, TaggedMesh
from spindle_fem.solvers.coupled_steady import CoupledState, solve_coupled
from spindle_fem.solvers.prepared_machine import PreparedMachine

STEPS = 100
STEP_S = 60.0
# Share of the heat in each quarter of the steps.
HEAT_LEVELS = (1.0, 0.3, 0.8, 0.5)
SCHEMA = "spindle-fem/benchmark-case/1"

_OCTAHEDRON = {(4, 9): (5, 6, 7, 8), (5, 7): (4, 6, 9, 8), (6, 8): (4, 5, 9, 7)}
_CORNERS = np.array([[0, 4, 6, 7], [4, 1, 5, 8], [6, 5, 2, 9], [7, 8, 9, 3]])
_TRIANGLES = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]])


def divided(mesh: TaggedMesh) -> TaggedMesh:
    """Straight linear elements, (n, 4), on all nodes of a quadratic mesh.

    The octahedron inside each element is cut along its shortest diagonal.
    Areas and volumes of the solid model are replaced by those of the straight
    facets: the benchmark's problem is the discrete one.
    """
    points, quadratic = mesh.points, mesh.tetrahedra
    diagonals = list(_OCTAHEDRON)
    length = np.stack(
        [np.linalg.norm(points[quadratic[:, a]] - points[quadratic[:, b]], axis=1) for a, b in diagonals]
    )
    shortest = length.argmin(axis=0)
    inner = np.empty((len(quadratic), 4, 4), dtype=np.int64)
    for index, (a, b) in enumerate(diagonals):
        ring = _OCTAHEDRON[a, b]
        table = np.array([[a, b, ring[k], ring[(k + 1) % 4]] for k in range(4)])
        chosen = shortest == index
        inner[chosen] = quadratic[chosen][:, table]
    tetrahedra = np.concatenate((quadratic[:, _CORNERS], inner), axis=1).reshape(-1, 4)
    volume = signed_volume(points, tetrahedra)
    turned = volume < 0.0
    tetrahedra[turned] = tetrahedra[turned][:, [0, 1, 3, 2]]
    part_of_element = np.repeat(mesh.part_of_element, 8)
    surfaces = {name: _divided_facets(facets) for name, facets in mesh.surfaces.items()}
    joints = {
        name: Joint(name, _divided_facets(joint.facets_a), _divided_facets(joint.facets_b))
        for name, joint in mesh.joints.items()
    }
    area = {name: float(facet_area(points, facets).sum()) for name, facets in surfaces.items()}
    area |= {name: float(facet_area(points, joint.facets_a).sum()) for name, joint in joints.items()}
    volumes = np.bincount(part_of_element, weights=np.abs(volume), minlength=len(mesh.part_names))
    return replace(
        mesh,
        n_corners=len(points),
        tetrahedra=tetrahedra,
        part_of_element=part_of_element,
        surfaces=surfaces,
        joints=joints,
        cad_area=area,
        cad_volume=dict(zip(mesh.part_names, volumes.tolist(), strict=True)),
        digest=f"{mesh.digest}/divided",
    )


def _divided_facets(facets: NDArray[np.int64]) -> NDArray[np.int64]:
    return facets[:, _TRIANGLES].reshape(-1, 3)


def signed_volume(points: NDArray[np.float64], tetrahedra: NDArray[np.int64]) -> NDArray[np.float64]:
    """Volume of straight tetrahedra, (n,) [m³]; negative where turned inside out."""
    first, second, third = (points[tetrahedra[:, k]] - points[tetrahedra[:, 0]] for k in (1, 2, 3))
    return np.einsum("ni,ni->n", np.cross(first, second), third) / 6.0


def facet_area(points: NDArray[np.float64], facets: NDArray[np.int64]) -> NDArray[np.float64]:
    """Area of straight triangles, (n,) [m²]."""
    first, second = (points[facets[:, k]] - points[facets[:, 0]] for k in (1, 2))
    return 0.5 * np.linalg.norm(np.cross(first, second), axis=1)


@dataclass(frozen=True, slots=True)
class SurfaceLoad:
    """Film and heat of one surface.

    Attributes
    ----------
    coefficient : float, [W/(m²·K)]
    ambient_temperature : float, [K]
    heat : float, [W]
    """

    coefficient: float
    ambient_temperature: float
    heat: float


def surface_loads(machine: PreparedMachine, coupled: CoupledState) -> dict[str, SurfaceLoad]:
    """Means over each surface of the loads of a solved machine."""
    problem = coupled.solution.problem
    operators = problem.operators
    conductance = dict.fromkeys(machine.mesh.surfaces, 0.0)
    moment = dict.fromkeys(machine.mesh.surfaces, 0.0)
    films = [(film.surface, film.coefficient, film.ambient_temperature) for film in problem.films]
    for node in problem.lumped_nodes:
        level = coupled.solution.lumped(node.name)
        films += [(surface, coefficient, level) for surface, coefficient in node.connections]
    for surface, coefficient, ambient in films:
        area = operators.facet_areas(surface)
        each = np.broadcast_to(coefficient, area.shape) * area
        conductance[surface] += float(each.sum())
        moment[surface] += float(each @ np.broadcast_to(ambient, area.shape))
    loads = {}
    for surface, total in conductance.items():
        heat = float(np.sum(problem.surface_heat.get(surface, 0.0)))
        if total == 0.0 and heat == 0.0:
            continue
        ambient = moment[surface] / total if total else machine.spec.operation.ambient_temperature
        loads[surface] = SurfaceLoad(total / operators.surface_area(surface), ambient, heat)
    return loads


def loads_of(machine: PreparedMachine) -> dict[str, SurfaceLoad]:
    """Loads of a machine at its own operating point, from its coupled solution."""
    from spindle_fem.operation.operating_point import OperatingPoint

    return surface_loads(machine, solve_coupled(machine, OperatingPoint.of(machine.spec)))


def merged_nodes(mesh: TaggedMesh) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Nodes with the two sides of every joint as one: (new of old, first old of new)."""
    from scipy import sparse
    from scipy.sparse.csgraph import connected_components

    n = len(mesh.points)
    pairs = [(joint.facets_a.ravel(), joint.facets_b.ravel()) for joint in mesh.joints.values()]
    rows = np.concatenate([a for a, _ in pairs]) if pairs else np.empty(0, dtype=np.int64)
    columns = np.concatenate([b for _, b in pairs]) if pairs else np.empty(0, dtype=np.int64)
    graph = sparse.coo_array((np.ones(len(rows)), (rows, columns)), shape=(n, n))
    label = connected_components(graph, directed=False)[1]
    _, first, new = np.unique(label, return_index=True, return_inverse=True)
    return new, first


def write_case(folder: Path, machine: PreparedMachine, loads: dict[str, SurfaceLoad]) -> Path:
    """Write the case: ``mesh.npz`` with parts apart, ``problem.npz`` conforming, ``case.json``.

    ``problem.npz`` is what other programs read: ``points``, ``tetrahedra``,
    ``conductivity`` and ``capacity`` of each element, boundary ``facets`` with
    ``film_coefficient``, ``ambient_temperature`` and ``heat_flux``,
    ``start_temperature``, ``step_s``, ``heat_factor`` of each step.
    """
    folder.mkdir(parents=True, exist_ok=True)
    mesh = divided(machine.mesh)
    if signed_volume(mesh.points, mesh.tetrahedra).min() <= 0.0:
        raise ValueError(f"{folder}: a divided element is inverted; use another size factor")
    arrays = {f"surface:{name}": facets for name, facets in mesh.surfaces.items()}
    for name, joint in mesh.joints.items():
        arrays |= {f"joint_a:{name}": joint.facets_a, f"joint_b:{name}": joint.facets_b}
    np.savez(
        folder / "mesh.npz",
        points=mesh.points,
        tetrahedra=mesh.tetrahedra.astype(np.int32),
        part_of_element=mesh.part_of_element,
        **{name: value.astype(np.int32) for name, value in arrays.items()},
    )
    new, first = merged_nodes(mesh)
    facets = [mesh.surfaces[name] for name in loads]
    counts = [len(item) for item in facets]
    spread = {
        "film_coefficient": [load.coefficient for load in loads.values()],
        "ambient_temperature": [load.ambient_temperature for load in loads.values()],
        "heat_flux": [load.heat / mesh.cad_area[name] for name, load in loads.items()],
    }
    parts = mesh.part_names
    np.savez(
        folder / "problem.npz",
        points=mesh.points[first],
        tetrahedra=new[mesh.tetrahedra].astype(np.int32),
        part_of_element=mesh.part_of_element,
        part_conductivity=np.array([machine.conductivity[part] for part in parts]),
        part_capacity=np.array([machine.volumetric_capacity[part] for part in parts]),
        facets=new[np.concatenate(facets)].astype(np.int32),
        start_temperature=machine.spec.operation.ambient_temperature,
        step_s=STEP_S,
        heat_factor=np.repeat(HEAT_LEVELS, STEPS // len(HEAT_LEVELS)),
        **{name: np.repeat(values, counts) for name, values in spread.items()},
    )
    case = {
        "schema": SCHEMA,
        "nodes": len(first),
        "nodes_with_doubled": len(mesh.points),
        "elements": mesh.n_elements,
        "part_names": list(parts),
        "conductivity": {part: float(machine.conductivity[part]) for part in parts},
        "volumetric_capacity": {part: float(machine.volumetric_capacity[part]) for part in parts},
        "part_of_surface": dict(mesh.part_of_surface),
        "cad_area": dict(mesh.cad_area),
        "cad_volume": dict(mesh.cad_volume),
        "rotating": dict(mesh.rotating),
        "start_temperature": float(machine.spec.operation.ambient_temperature),
        "loads": {
            name: [load.coefficient, load.ambient_temperature, load.heat] for name, load in loads.items()
        },
    }
    (folder / "case.json").write_text(json.dumps(case, indent=1), encoding="utf-8")
    return folder


def read_case(folder: Path) -> tuple[TaggedMesh, dict]:
    """The mesh with separate parts, and the content of ``case.json``."""
    case = json.loads((folder / "case.json").read_text(encoding="utf-8"))
    with np.load(folder / "mesh.npz") as data:
        surfaces = {name[8:]: data[name] for name in data.files if name.startswith("surface:")}
        joints = {
            name[8:]: Joint(name[8:], data[name], data[f"joint_b:{name[8:]}"])
            for name in data.files
            if name.startswith("joint_a:")
        }
        points = data["points"]
        mesh = TaggedMesh(
            points=points,
            n_corners=len(points),
            tetrahedra=data["tetrahedra"],
            part_names=tuple(case["part_names"]),
            part_of_element=data["part_of_element"],
            surfaces=surfaces,
            joints=joints,
            part_of_surface=case["part_of_surface"],
            cad_area=case["cad_area"],
            cad_volume=case["cad_volume"],
            rotating=case["rotating"],
            min_quality=np.nan,
        )
    return mesh, case
