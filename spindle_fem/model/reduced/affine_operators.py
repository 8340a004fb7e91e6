"""The finite-element model of a machine as a sum of named operators.

``K = Σ c_i K_i`` with one symmetric, positive semi-definite ``K_i`` for every
conductivity, contact, film, gap and ball row, so that each coefficient stays
free after the projection. Unknowns are the mesh's temperatures followed by the
lumped nodes (ball rows, bands of mixed air).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.errors import SpecError
from spindle_fem.model.mesh.equations import ThermalSystem
from spindle_fem.model.mesh.evaluate import probe_matrix
from spindle_fem.operation.machine_loads import FieldState
from spindle_fem.operation.named_places import named_places
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.operation.probe_places import probe_positions, probe_slopes
from spindle_fem.solvers.coupled_steady import PreparedMachine

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class AffineSystem:
    """Unit operators of a machine on its mesh.

    Attributes
    ----------
    coefficient_names : tuple of str
        ``conductivity.<material>``, ``joint.<contact>``, ``film.<surface>``,
        ``gap.<gap>``, ``balls.<bearing>.inner``, ``balls.<bearing>.outer``.
    operators : tuple of (n, n) csr_array
        Of unit coefficient, in the order of the names.
    fluid_load : mapping of coefficient name to (n,) ndarray
        ``K_i · 1``: what a fluid of 1 K puts in, for films.
    cell_film : tuple of (n, n) csr_array, [m²]
        Unit film of each coolant cell.
    cell_load : (n_cells, n) csr_array, [m²]
        ``∫ N dA`` over each cell's wall.
    cell_area : (n_starts, n_along) ndarray, [m²]
    storage_names : tuple of str
        ``capacity.<material>`` [J/(m³·K)] and ``capacity.<bearing>.balls`` [J/K].
    storage : tuple of (n, n) csr_array
    place_names : tuple of str
        Volumes (``<part>.<segment>``, ``<bearing>.inner_ring``), surfaces,
        ``<bearing>.balls``, seats (``<contact>@0``, ``@1``) and the
        neighbourhoods of point probes (``near.<probe>``, ``around.<probe>``).
    places : (n_places, n) csr_array
        Mean over each place; its transpose is the load of 1 W spread over it.
    probe_names : tuple of str
    probes : (n_probes, n) csr_array
        Point probes only.
    probe_slopes : (2 n_probes, n) csr_array, [1/m]
        Change of each with a displacement along r and along z.
    n_unknowns, n_lumped : int
    prolongation : (n_unknowns, n_corners) csr_array or None
    """

    coefficient_names: tuple[str, ...]
    operators: tuple[sparse.csr_array, ...]
    fluid_load: dict[str, Array]
    cell_film: tuple[sparse.csr_array, ...]
    cell_load: sparse.csr_array
    cell_area: Array
    storage_names: tuple[str, ...]
    storage: tuple[sparse.csr_array, ...]
    place_names: tuple[str, ...]
    places: sparse.csr_array
    probe_names: tuple[str, ...]
    probes: sparse.csr_array
    probe_slopes: sparse.csr_array
    n_unknowns: int
    n_lumped: int
    prolongation: sparse.csr_array | None

    @property
    def size(self) -> int:
        """Unknowns, lumped nodes included."""
        return self.n_unknowns + self.n_lumped

    def place(self, name: str) -> Array:
        """Dense functional of one place, (n,)."""
        return self.places[[self.place_names.index(name)]].toarray()[0]

    def conduction(self, coefficients: dict[str, float], channel_film: Array) -> sparse.csr_array:
        """``Σ c_i K_i`` with the channel's film by cell; the coolant counts as given."""
        total = _weighted(self.operators, [coefficients[name] for name in self.coefficient_names], self.size)
        return total + _weighted(self.cell_film, np.ravel(channel_film), self.size)

    def capacity(self, volumetric: dict[str, float]) -> sparse.csr_array:
        """``Σ m_i M_i``."""
        return _weighted(self.storage, [volumetric[name] for name in self.storage_names], self.size)

    def system(self, matrix: sparse.csr_array) -> ThermalSystem:
        """A matrix over all unknowns in the blocks that the linear solvers take."""
        n = self.n_unknowns
        matrix = matrix.tocsr()
        return ThermalSystem(
            matrix[:n, :n],
            np.zeros(n),
            (-matrix[:n, n:]).tocsc(),
            matrix[n:, n:].toarray(),
            np.zeros(self.n_lumped),
            0.0,
            None,
            self.prolongation,
        )


def _weighted(matrices: tuple[sparse.csr_array, ...], weights: object, size: int) -> sparse.csr_array:
    """Weighted sum by one concatenation: much cheaper than adding one after the other."""
    rows, columns, values = [], [], []
    for matrix, weight in zip(matrices, weights, strict=True):
        if weight != 0.0:
            entries = matrix.tocoo()
            rows.append(entries.row.astype(np.int32, copy=False))
            columns.append(entries.col.astype(np.int32, copy=False))
            values.append(weight * entries.data)
    if not rows:
        return sparse.csr_array((size, size))
    joined = (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))
    return sparse.coo_array(joined, shape=(size, size)).tocsr()


def build_affine_system(machine: PreparedMachine) -> AffineSystem:
    """Split a prepared machine into its unit operators.

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
    names = tuple(name for name, _ in lumped)
    size = operators.n_unknowns + len(names)
    coefficients: dict[str, sparse.csr_array] = {}
    for material in dict.fromkeys(_materials(spec, operators.mesh.part_names).values()):
        own = [p for p, m in _materials(spec, operators.mesh.part_names).items() if m == material]
        coefficients[f"conductivity.{material}"] = _padded(
            sum((operators.part_conduction(part) for part in own[1:]), operators.part_conduction(own[0])),
            size,
        )
    for contact in operators.mesh.joints:
        coefficients[f"joint.{contact}"] = _padded(operators.joint_matrix(contact), size)
    fluid_load: dict[str, Array] = {}
    for film in spec.film:
        for surface in film.surface:
            name = f"film.{surface}"
            coefficients[name] = _padded(operators.film_matrix(surface), size)
            fluid_load[name] = coefficients[name] @ np.ones(size)
    for index, (_, connections) in enumerate(lumped):
        for key, pieces in connections.items():
            matrix = _exchange_matrix(machine, operators.n_unknowns + index, pieces, size)
            coefficients[key] = coefficients[key] + matrix if key in coefficients else matrix
    cell_film, cell_load, cell_area = _channel(machine, size)
    storage = _storage(machine, names, size)
    places = dict(named_places(machine, names, size))
    points = [probe for probe in spec.probe if probe.kind == "point"]
    rows = probe_matrix(operators, probe_positions(points), [p.part for p in points])
    return AffineSystem(
        tuple(coefficients),
        tuple(coefficients.values()),
        fluid_load,
        cell_film,
        cell_load,
        cell_area,
        tuple(storage),
        tuple(storage.values()),
        tuple(places),
        sparse.vstack([sparse.csr_array(vector[None, :]) for vector in places.values()], format="csr"),
        tuple(p.name for p in points),
        _widened(rows, size),
        _widened(probe_slopes(operators, points), size),
        operators.n_unknowns,
        len(names),
        operators.prolongation,
    )


def _materials(spec: MachineSpec, parts: tuple[str, ...]) -> dict[str, str]:
    keys = {id(material): key for key, material in spec.materials.items()}
    return {part: keys[id(spec.part_material(part))] for part in parts}


def _padded(matrix: sparse.csr_array, size: int) -> sparse.csr_array:
    entries = matrix.tocoo()
    padded = sparse.coo_array((entries.data, (entries.row, entries.col)), shape=(size, size)).tocsr()
    padded.eliminate_zeros()
    return padded


def _widened(rows: sparse.csr_array, size: int) -> sparse.csr_array:
    """Rows over the mesh's unknowns extended over the lumped nodes."""
    return sparse.csr_array((rows.data, rows.indices, rows.indptr), shape=(rows.shape[0], size))


Pieces = list[tuple[str, Array]]


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


def _channel(
    machine: PreparedMachine, size: int
) -> tuple[tuple[sparse.csr_array, ...], sparse.csr_array, Array]:
    cells = machine.builder.cells
    if cells is None:
        return (), sparse.csr_array((0, size)), np.zeros((1, 0))
    operators = machine.operators
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
    return tuple(films), sparse.vstack(loads, format="csr"), cells.cell_area


def _storage(machine: PreparedMachine, lumped: tuple[str, ...], size: int) -> dict[str, sparse.csr_array]:
    spec, operators = machine.spec, machine.operators
    found: dict[str, sparse.csr_array] = {}
    for part, material in _materials(spec, operators.mesh.part_names).items():
        matrix = _padded(operators.part_storage(part), size)
        key = f"capacity.{material}"
        found[key] = found[key] + matrix if key in found else matrix
    for _, bearing in spec.bearings:
        nodes = [
            operators.n_unknowns + lumped.index(node) for node in machine.builder.ball_nodes(bearing.name)
        ]
        share = np.full(len(nodes), 1.0 / len(nodes))
        found[f"capacity.{bearing.name}.balls"] = sparse.coo_array(
            (share, (nodes, nodes)), shape=(size, size)
        ).tocsr()
    return found
