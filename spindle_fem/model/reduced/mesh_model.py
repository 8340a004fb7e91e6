"""The finite-element model of a machine as a thermal model of named sparse operators.

Unknowns are the mesh's temperatures followed by the lumped nodes (ball rows,
bands of mixed air). Every conductivity, contact, film, gap and ball row keeps
its own unit operator, so that each coefficient stays free after a projection.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.errors import SpecError
from spindle_fem.model.mesh.equations import ThermalSystem
from spindle_fem.model.mesh.evaluate import probe_matrix
from spindle_fem.model.reduced.growth_rows import GrowthWorker, widened
from spindle_fem.model.thermal_model import ThermalModel
from spindle_fem.operation.coefficient_table import gap_radii_of
from spindle_fem.operation.machine_loads import FieldState
from spindle_fem.operation.named_places import named_places
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.operation.probe_places import probe_positions, probe_slopes
from spindle_fem.parallel import BackgroundProcess
from spindle_fem.solvers.prepared_machine import PreparedMachine

Array = NDArray[np.float64]
# Wetted surfaces of one lumped node, each with its exchange coefficient by facet.
Pieces = list[tuple[str, Array]]


@dataclass(frozen=True, slots=True, kw_only=True)
class MeshModel(ThermalModel):
    """Thermal model of a machine on its mesh, every operator sparse.

    Attributes
    ----------
    n_unknowns : int
        Temperatures of the mesh; the lumped nodes follow them.
    prolongation : (n_unknowns, n_corners) csr_array or None
        From linear to quadratic temperatures, for the linear solvers.
    """

    n_unknowns: int
    prolongation: sparse.csr_array | None

    def system(self, matrix: sparse.csr_array) -> ThermalSystem:
        """A matrix over all unknowns in the blocks that the linear solvers take."""
        n = self.n_unknowns
        matrix = matrix.tocsr()
        return ThermalSystem(
            matrix[:n, :n],
            np.zeros(n),
            (-matrix[:n, n:]).tocsc(),
            matrix[n:, n:].toarray(),
            np.zeros(self.size - n),
            0.0,
            None,
            self.prolongation,
        )


def build_mesh_model(machine: PreparedMachine, growth_of: MeshModel | None = None) -> MeshModel:
    """Split a prepared machine into its unit operators.

    Parameters
    ----------
    growth_of : MeshModel, optional
        Without displacement sensors, on as many nodes: its rows of growing bodies, which take longer than
        all others, are taken.

    Raises
    ------
    SpecError
        A contact tied perfectly: its two sides share one temperature and have
        no coefficient to vary.
    """
    spec, operators = machine.spec, machine.operators
    tied = [name for name, value in machine.joint_conductance.items() if np.isinf(value)]
    if tied:
        raise SpecError(
            "joint.conductance",
            f'{", ".join(tied)} is "perfect", which the reduced model cannot vary.',
            'Give a large conductance instead, such as "1e6 W/m**2/K".',
        )
    lumped = _lumped_nodes(machine)
    size = operators.n_unknowns + len(lumped)
    names = tuple(name for name, _ in lumped)
    beside = growth_of is None and machine.growth is None
    with BackgroundProcess(partial(GrowthWorker, machine), beside=beside) as growth:
        grown = growth.ask("rows", size) if growth_of is None else lambda: None
        coefficients = _conduction(machine, lumped, size)
        films = tuple(f"film.{surface}" for film in spec.film for surface in film.surface)
        storage = _storage(machine, names, size)
        places = dict(named_places(machine, names, size))
        points = [probe for probe in spec.probe if probe.kind == "point"]
        rows = widened(probe_matrix(operators, probe_positions(points), [p.part for p in points]), size)
        gradients = widened(probe_slopes(operators, points), size)
        channel = {} if machine.builder.cells is None else _channel(machine, size)
        found = grown()
    sensors = [sensor.name for sensor in spec.displacement_sensor]
    growing: dict[str, object] = {}
    if found is not None:
        if sensors:
            rows = sparse.vstack([rows, found.sensors], format="csr")
            gradients = sparse.vstack([gradients, sparse.csr_array((2 * len(sensors), size))], format="csr")
            growing["probe_spins"] = np.append(np.zeros(len(points)), found.spins)
        places |= found.places
        if found.shifts.shape[0]:
            growing["ring_shifts"] = found.shifts
    if growth_of is not None:
        own = zip(growth_of.place_names, growth_of.places.toarray(), strict=True)
        places |= {name: row for name, row in own if name not in places}
        growing["ring_shifts"] = growth_of.ring_shifts
    return MeshModel(
        coefficient_names=tuple(coefficients),
        operators=tuple(coefficients.values()),
        fluid_names=films,
        fluid_load=np.array([coefficients[name] @ np.ones(size) for name in films]).reshape(-1, size),
        storage_names=tuple(storage),
        storage=tuple(storage.values()),
        place_names=tuple(places),
        places=sparse.vstack([sparse.csr_array(row[None, :]) for row in places.values()], format="csr"),
        probe_names=(*(p.name for p in points), *sensors),
        probes=rows,
        one=np.ones(size),
        probe_gradients=gradients,
        contacts=tuple(machine.mesh.joints),
        gap_radii=gap_radii_of(spec, operators),
        n_unknowns=operators.n_unknowns,
        prolongation=operators.prolongation,
        mesh_digest=machine.mesh.digest,
        **growing,
        **channel,
    )


def _conduction(
    machine: PreparedMachine, lumped: Sequence[tuple[str, dict[str, Pieces]]], size: int
) -> dict[str, sparse.csr_array]:
    """Unit operator of every coefficient but the channel's film."""
    spec, operators = machine.spec, machine.operators
    found: dict[str, sparse.csr_array] = {}
    materials = _materials(spec, operators.mesh.part_names)
    for material in dict.fromkeys(materials.values()):
        own = [part for part, kind in materials.items() if kind == material]
        found[f"conductivity.{material}"] = _padded(operators.parts_conduction(own), size)
    for contact in operators.mesh.joints:
        found[f"joint.{contact}"] = _padded(operators.joint_matrix(contact), size)
    for film in spec.film:
        for surface in film.surface:
            if surface not in spec.wetted_rows:
                found[f"film.{surface}"] = _padded(operators.film_matrix(surface), size)
    names = [name for name, _ in lumped]
    for row in spec.wetted_rows:
        nodes = machine.builder.ball_nodes(row.removesuffix(".balls"))
        own = [operators.n_unknowns + names.index(node) for node in nodes]
        area = machine.builder.facet_area[row]
        found[f"film.{row}"] = sparse.coo_array((area, (own, own)), shape=(size, size)).tocsr()
    for index, (_, connections) in enumerate(lumped):
        for key, pieces in connections.items():
            matrix = _exchange_matrix(machine, operators.n_unknowns + index, pieces, size)
            found[key] = found[key] + matrix if key in found else matrix
    return found


def _materials(spec: MachineSpec, parts: tuple[str, ...]) -> dict[str, str]:
    keys = {id(material): key for key, material in spec.materials.items()}
    return {part: keys[id(spec.part_material(part))] for part in parts}


def _padded(matrix: sparse.csr_array, size: int) -> sparse.csr_array:
    entries = matrix.tocoo()
    padded = sparse.coo_array((entries.data, (entries.row, entries.col)), shape=(size, size)).tocsr()
    padded.eliminate_zeros()
    return padded


def _lumped_nodes(machine: PreparedMachine) -> list[tuple[str, dict[str, Pieces]]]:
    """Every lumped node with unit exchange coefficients, by the coefficient that scales them."""
    spec, builder = machine.spec, machine.builder
    uniform = FieldState(
        {
            name: np.full(rows.stop - rows.start, 293.15)
            for name, rows in machine.operators.surface_rows.items()
        },
        {},
        {},
    )
    point = OperatingPoint.of(spec)
    loads, _ = builder.at(point, uniform)
    found: list[tuple[str, dict[str, Pieces]]] = []
    for node in loads.lumped:
        owner = node.name.split("[")[0]
        pieces: dict[str, Pieces] = {}
        if owner.endswith(".balls"):
            bearing = owner.removesuffix(".balls")
            share = 1.0 / len(builder.ball_nodes(bearing))
            for surface, value in node.connections.items():
                # Conductances in W/K: spread over the sector's own area.
                total = float(value @ builder.facet_area[surface])
                side = "inner" if surface.endswith("inner_raceway") else "outer"
                pieces[f"balls.{bearing}.{side}"] = [(surface, value * (share / total))]
        else:
            bands = builder.gaps[owner]
            cell = int(node.name.split("[")[1].rstrip("]"))
            rotating = next(gap.rotating for gap in spec.gap if gap.name == owner)
            # Half the resistance on either side of the mixed air, as the loads have it.
            conductance = 2.0 * bands.conductance_share[cell]
            pieces[f"gap.{owner}"] = [
                (surface, np.where(value > 0.0, conductance / area[cell], 0.0))
                for surface, value in node.connections.items()
                for area in [bands.rotating_area if surface == rotating else bands.standing_area]
            ]
        found.append((node.name, pieces))
    return found


def _exchange_matrix(machine: PreparedMachine, index: int, pieces: Pieces, size: int) -> sparse.csr_array:
    operators = machine.operators
    matrix = sparse.csr_array((size, size))
    for surface, value in pieces:
        rows = operators.surface_rows[surface]
        film = _padded(operators.film_matrix(surface, value), size)
        vector = np.zeros(size)
        vector[: operators.n_unknowns] = operators.facet_vector(value, rows)
        column = np.flatnonzero(vector)
        at = np.full(len(column), index)
        total = vector.sum()
        coupling = sparse.coo_array(
            (
                np.concatenate((-vector[column], -vector[column], [total])),
                (np.concatenate((column, at, [index])), np.concatenate((at, column, [index]))),
            ),
            shape=(size, size),
        )
        matrix = matrix + film + coupling.tocsr()
    return matrix


def _channel(machine: PreparedMachine, size: int) -> dict[str, object]:
    """Fields of the model that describe the coolant's cells."""
    operators, cells = machine.operators, machine.builder.cells
    films: list[sparse.csr_array] = []
    loads: list[sparse.csr_array] = []
    for cell in range(cells.cell_area.size):
        matrix = sparse.csr_array((size, size))
        load = np.zeros((1, size))
        for surface, owner in cells.facet_cell.items():
            inside = (owner == cell).astype(float)
            if not inside.any():
                continue
            matrix = matrix + _padded(operators.film_matrix(surface, inside), size)
            load[0, : operators.n_unknowns] += operators.facet_vector(inside, operators.surface_rows[surface])
        films.append(matrix)
        loads.append(sparse.csr_array(load))
    return {
        "cell_film": tuple(films),
        "cell_load": sparse.vstack(loads, format="csr"),
        "cell_area": cells.cell_area,
        "cell_angle": cells.angle,
        "cell_position": cells.position,
        "cell_is_port": cells.is_port,
    }


def _storage(machine: PreparedMachine, lumped: tuple[str, ...], size: int) -> dict[str, sparse.csr_array]:
    """Unit capacity of every material and ball row."""
    spec, operators = machine.spec, machine.operators
    found: dict[str, sparse.csr_array] = {}
    materials = _materials(spec, operators.mesh.part_names)
    for material in dict.fromkeys(materials.values()):
        own = [part for part, kind in materials.items() if kind == material]
        found[f"capacity.{material}"] = _padded(operators.parts_storage(own), size)
    for _, bearing in spec.bearings:
        nodes = [operators.n_unknowns + lumped.index(n) for n in machine.builder.ball_nodes(bearing.name)]
        share = np.full(len(nodes), 1.0 / len(nodes))
        found[f"capacity.{bearing.name}.balls"] = sparse.coo_array(
            (share, (nodes, nodes)), shape=(size, size)
        ).tocsr()
    return found
