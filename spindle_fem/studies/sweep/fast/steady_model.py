"""The steady projected model of all designs that share a mesh: small dense operators, free coefficients."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from spindle_fem.cache import cache_directory, load_record, save_record
from spindle_fem.model.mesh.evaluate import temperature_at_nodes
from spindle_fem.model.reduced.affine_operators import AffineSystem
from spindle_fem.operation.channel_cells import ChannelCells
from spindle_fem.operation.coefficients import gap_radii_of
from spindle_fem.solvers.coupled_steady import PreparedMachine

Array = NDArray[np.float64]

FORMAT = "spindle-fem/steady-model/1"
# Packages and modules whose change gives the same designs another model.


@dataclass(frozen=True, slots=True)
class SteadyModel:
    """Galerkin projection of the steady problem on ``r`` basis vectors, by falling weight.

    The film of a cell is split into what the cell's mean temperature drives,
    which the coolant's march takes up whole, and the small rest of uneven
    walls: ``∫ h T dA`` = mean part + ``cell_rest``.

    Attributes
    ----------
    coefficient_names : tuple of str
    operators : (n_c, r, r) ndarray
        Of unit coefficient.
    fluid_names : tuple of str
        Coefficients that are films to a fluid.
    fluid_load : (n_f, r) ndarray
        What a fluid of 1 K puts in at unit coefficient.
    cell_rest : (n_cells, r, r) ndarray, [m²]
    cell_mean : (n_cells, r) ndarray
        Mean wall temperature of each cell.
    cell_area : (n_starts, n_along) ndarray, [m²]
    cell_angle, cell_position : (n_along,) ndarray, [rad], [m]
    cell_is_port : (n_along,) bool ndarray
    place_names : tuple of str
    places : (n_p, r) ndarray
        Mean over each place; also the load of 1 W spread over it.
    probe_names : tuple of str
    probes : (n_q, r) ndarray
        Of point probes.
    nodes : (r, n_nodes) float32 ndarray
        The basis at every node of the mesh.
    one : (r,) ndarray
        The uniform field of 1 K.
    surface_area : mapping of surface to float, [m²]
    mesh_numbers : mapping of str to float
        ``nodes``, ``elements``, ``min_quality``.
    mesh_digest : str
    contacts : tuple of str
    gap_radii : mapping of gap to (float, float), [m]
    ranges : (n_c + 1, 2) ndarray
        Lowest and highest of every coefficient, then of the mean channel
        film, among the designs that the basis was made for.
    worst_estimate : float, [K]
        Largest estimated error over the designs that the basis was made for.
    checked_error : float, [K]
        Largest true error over designs that were solved in full; nan before.
    calibration : float, [-]
        How many times the true error exceeded its estimate there, at least 1.
    checked : tuple of str
        Keys of these designs.
    """

    coefficient_names: tuple[str, ...]
    operators: Array
    fluid_names: tuple[str, ...]
    fluid_load: Array
    cell_rest: Array
    cell_mean: Array
    cell_area: Array
    cell_angle: Array
    cell_position: Array
    cell_is_port: NDArray[np.bool_]
    place_names: tuple[str, ...]
    places: Array
    probe_names: tuple[str, ...]
    probes: Array
    nodes: NDArray[np.float32]
    one: Array
    ranges: Array
    contacts: tuple[str, ...] = ()
    gap_radii: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    surface_area: Mapping[str, float] = field(default_factory=dict)
    mesh_numbers: Mapping[str, float] = field(default_factory=dict)
    mesh_digest: str = ""
    worst_estimate: float = float("nan")
    checked_error: float = float("nan")
    calibration: float = 1.0
    checked: tuple[str, ...] = ()

    @property
    def size(self) -> int:
        """Basis vectors."""
        return len(self.one)

    def place(self, name: str) -> Array:
        """Mean over a place, (r,)."""
        return self.places[self.place_names.index(name)]

    def channel_cells(self) -> ChannelCells:
        """The coolant's cells, without the mesh's facets."""
        return ChannelCells(
            (), {}, {}, self.cell_area, self.cell_angle, self.cell_position, self.cell_is_port
        )

    def functionals(self) -> Array:
        """Everything that an output may read: places, probes, cells of the channel, (n, r)."""
        return np.vstack((self.places, self.probes, self.cell_mean))

    # ----------------------------------------------------------------- disk
    def save(self, path: Path) -> None:
        """Write to an .npz file; readers never see half of it."""
        save_record(self, path, FORMAT)

    @classmethod
    def load(cls, path: Path) -> SteadyModel | None:
        """What :meth:`save` wrote; None where there is none, or another version, or a damaged file."""
        found = load_record(path, FORMAT)
        return None if found is None else cls(**found)


def model_path(digest: str) -> Path:
    """File of a model in the cache."""
    return cache_directory() / f"steady-{digest}.npz"


def project(machine: PreparedMachine, affine: AffineSystem, basis: Array, one: Array) -> SteadyModel:
    """Galerkin projection of a machine on a basis.

    Parameters
    ----------
    machine : PreparedMachine
    affine : AffineSystem
        Of the machine.
    basis : (n, r) ndarray
    one : (r,) ndarray
        Coordinates of the uniform field.
    """
    size = basis.shape[1]

    def small(matrix: object) -> Array:
        found = basis.T @ (matrix @ basis)
        return 0.5 * (found + found.T)

    area = affine.cell_area.ravel()
    load = np.asarray(affine.cell_load @ basis)
    rest = np.zeros((area.size, size, size))
    for cell, matrix in enumerate(affine.cell_film):
        rest[cell] = small(matrix) - np.outer(load[cell], load[cell]) / area[cell]
    cells, mesh = machine.builder.cells, machine.mesh
    n_along = affine.cell_area.shape[1]
    at_nodes = temperature_at_nodes(machine.operators, basis[: affine.n_unknowns])
    return SteadyModel(
        coefficient_names=affine.coefficient_names,
        operators=np.array([small(matrix) for matrix in affine.operators]),
        fluid_names=tuple(affine.fluid_load),
        fluid_load=np.array([basis.T @ item for item in affine.fluid_load.values()]).reshape(-1, size),
        cell_rest=rest,
        cell_mean=load / area[:, None],
        cell_area=affine.cell_area,
        cell_angle=np.zeros(n_along) if cells is None else cells.angle,
        cell_position=np.zeros(n_along) if cells is None else cells.position,
        cell_is_port=np.zeros(n_along, dtype=bool) if cells is None else cells.is_port,
        place_names=affine.place_names,
        places=np.asarray(affine.places @ basis),
        probe_names=affine.probe_names,
        probes=np.asarray(affine.probes @ basis),
        nodes=np.ascontiguousarray(at_nodes.T, dtype=np.float32),
        one=one,
        ranges=np.empty((0, 2)),
        contacts=tuple(mesh.joints),
        gap_radii=gap_radii_of(machine.spec, machine.operators),
        surface_area={name: float(machine.builder.facet_area[name].sum()) for name in mesh.surfaces},
        mesh_numbers={
            "nodes": machine.operators.n_unknowns,
            "elements": mesh.n_elements,
            "min_quality": mesh.min_quality,
        },
        mesh_digest=mesh.digest,
    )
