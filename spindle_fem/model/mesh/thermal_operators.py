"""The unit integrals of a mesh and how a problem's coefficients sum them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse

from spindle_fem.errors import MeshQualityError, SpecError, UnknownSurfaceError, did_you_mean
from spindle_fem.machine.meshing.tagged_mesh import TaggedMesh
from spindle_fem.model.mesh.element_integrals import upper_pairs
from spindle_fem.model.mesh.sparsity_pattern import SymmetricPattern

AREA_TOLERANCE = 1e-3


@dataclass(frozen=True, slots=True)
class ThermalOperators:
    """Unit integrals of a mesh for one order of the temperature.

    Unknowns are the temperatures at the mesh's corner nodes (order 1) or at
    all its nodes (order 2), in the mesh's numbering. Make it with
    :func:`build_operators`.

    Attributes
    ----------
    order : int
        1 or 2.
    part_of_slot : (n_upper,) int16 ndarray
        Part of each upper entry; -1 where only a joint couples.
    part_of_unknown : (n_unknowns,) int32 ndarray
    conduction, storage : (n_upper,) ndarray, [m], [m³]
        Unit conductivity and unit volumetric capacity.
    part_load : (n_unknowns,) ndarray, [m³]
        ``∫ N dV`` over the part that owns the unknown.
    part_volume : mapping of str to float, [m³]
    facet_nodes : (n_facets, n) int64 ndarray
        Unknowns of each facet: surfaces first, then both sides of each joint.
    facet_film : (n_facets, n_upper) ndarray, [m²]
    facet_load : (n_facets, n) ndarray, [m²]
    facet_area : (n_facets,) ndarray, [m²]
    facet_slots, facet_inverse : ndarray
        Distinct upper entries that facets touch, and the place of each facet
        entry among them.
    surface_rows : mapping of str to slice
        Rows of each surface in the facet arrays.
    joint_rows : mapping of str to (slice, slice)
        Rows of side a and side b of each joint.
    joint_cross_slots : mapping of str to (n_facets, n, n) int32 ndarray
        Upper entry that couples node i of side a with node j of side b.
    prolongation : (n_unknowns, n_corners) csr_array or None
        Linear temperatures as quadratic ones; None for order 1.
    """

    mesh: TaggedMesh
    order: int
    n_unknowns: int
    pattern: SymmetricPattern
    part_of_slot: NDArray[np.int16]
    part_of_unknown: NDArray[np.int32]
    conduction: NDArray[np.float64]
    storage: NDArray[np.float64]
    part_load: NDArray[np.float64]
    part_volume: Mapping[str, float]
    facet_nodes: NDArray[np.int64]
    facet_film: NDArray[np.float64]
    facet_load: NDArray[np.float64]
    facet_area: NDArray[np.float64]
    facet_slots: NDArray[np.int32]
    facet_inverse: NDArray[np.int32]
    surface_rows: Mapping[str, slice]
    joint_rows: Mapping[str, tuple[slice, slice]]
    joint_cross_slots: Mapping[str, NDArray[np.int32]]
    prolongation: sparse.csr_array | None

    # ------------------------------------------------------------- measures
    def surface_area(self, surface: str) -> float:
        """Area of a surface on the curved mesh, [m²]."""
        return float(self.facet_area[self.rows_of(surface, "surface_area")].sum())

    def facet_areas(self, surface: str) -> NDArray[np.float64]:
        """Area of each facet of a surface, (n,) [m²]."""
        return self.facet_area[self.rows_of(surface, "facet_areas")]

    def joint_facet_areas(self, joint: str) -> NDArray[np.float64]:
        """Area of each facet pair of a joint, (n,) [m²]."""
        return self.facet_area[self.joint_sides(joint, "joint_facet_areas")[0]]

    def area_error(self) -> dict[str, float]:
        """Relative error of every surface's and joint's area against CAD."""
        measured = {name: self.facet_area[rows].sum() for name, rows in self.surface_rows.items()}
        measured |= {name: self.facet_area[rows[0]].sum() for name, rows in self.joint_rows.items()}
        return {name: float(area / self.mesh.cad_area[name] - 1.0) for name, area in measured.items()}

    def volume_error(self) -> dict[str, float]:
        """Relative error of every part's volume against CAD."""
        return {part: volume / self.mesh.cad_volume[part] - 1.0 for part, volume in self.part_volume.items()}

    def require_measures(self, tolerance: float = AREA_TOLERANCE) -> None:
        """Refuse a mesh whose areas or volumes are away from CAD.

        Raises
        ------
        MeshQualityError
            Names the worst surface or part.
        """
        errors = {f'area of "{name}"': error for name, error in self.area_error().items()}
        errors |= {f'volume of "{name}"': error for name, error in self.volume_error().items()}
        worst = max(errors, key=lambda name: abs(errors[name]))
        if abs(errors[worst]) > tolerance:
            raise MeshQualityError(
                "mesh",
                f"{worst} is {100.0 * errors[worst]:+.3f} % away from the solid model.",
                f"Allowed: {100.0 * tolerance:g} %. Mesh finer there, or make the mesh second order.",
            )

    # ------------------------------------------------------------- look-ups
    def rows_of(self, surface: str, where: str) -> slice:
        """Rows of a surface in the facet arrays; raises UnknownSurfaceError."""
        if surface not in self.surface_rows:
            raise UnknownSurfaceError(
                where, f'names "{surface}", not in this mesh.', did_you_mean(surface, self.surface_rows)
            )
        return self.surface_rows[surface]

    def joint_sides(self, joint: str, where: str) -> tuple[slice, slice]:
        """Rows of both sides of a joint; raises UnknownSurfaceError."""
        if joint not in self.joint_rows:
            raise UnknownSurfaceError(
                where, f'names joint "{joint}", not in this mesh.', did_you_mean(joint, self.joint_rows)
            )
        return self.joint_rows[joint]

    def part_index(self, part: str, where: str) -> int:
        """Index of a part; raises UnknownSurfaceError."""
        if part not in self.mesh.part_names:
            raise UnknownSurfaceError(
                where, f'names part "{part}", not in this mesh.', did_you_mean(part, self.mesh.part_names)
            )
        return self.mesh.part_names.index(part)

    def per_facet(self, surface: str, value: ArrayLike, where: str) -> NDArray[np.float64]:
        """Scalar or per-facet value of a surface as an array (n_facets of the surface,).

        Raises
        ------
        SpecError
            Wrong length, or not finite.
        """
        rows = self.rows_of(surface, where)
        return spread(value, rows.stop - rows.start, where)

    # ------------------------------------------------------------ operators
    def sum_conduction(self, conductivity: NDArray[np.float64]) -> NDArray[np.float64]:
        """Upper entries of ``Σ k_p K_p``; (n_parts,) [W/(m·K)] in."""
        return self._scaled(self.conduction, conductivity)

    def sum_storage(self, volumetric_capacity: NDArray[np.float64]) -> NDArray[np.float64]:
        """Upper entries of the capacity matrix; (n_parts,) [J/(m³·K)] in."""
        return self._scaled(self.storage, volumetric_capacity)

    def _scaled(self, unit: NDArray[np.float64], factors: NDArray[np.float64]) -> NDArray[np.float64]:
        """Each upper entry times the factor of its part; 0 where only a joint couples (part -1, the last)."""
        return unit * np.append(factors, 0.0)[self.part_of_slot]

    def add_films(self, upper: NDArray[np.float64], coefficient: NDArray[np.float64]) -> None:
        """Add ``Σ h_f R_f`` in place; ``coefficient`` (n_facets,) [W/(m²·K)] over all facets."""
        active = np.flatnonzero(coefficient)
        weights = (coefficient[active, None] * self.facet_film[active]).ravel()
        summed = np.bincount(
            self.facet_inverse[active].ravel(), weights=weights, minlength=len(self.facet_slots)
        )
        upper[self.facet_slots] += summed

    def add_joint(self, upper: NDArray[np.float64], joint: str, conductance: NDArray[np.float64]) -> None:
        """Subtract the coupling ``M_ab`` in place; the diagonal blocks are films of both sides.

        Parameters
        ----------
        upper : (n_upper,) ndarray
        conductance : (n,) ndarray, [W/(m²·K)]
            Of each facet pair.
        """
        side_a = self.joint_sides(joint, "add_joint")[0]
        n = self.facet_nodes.shape[1]
        square = np.empty((n, n), dtype=np.int64)
        rows, columns = upper_pairs(n)
        square[rows, columns] = square[columns, rows] = np.arange(len(rows))
        values = conductance[:, None, None] * self.facet_film[side_a][:, square]
        np.subtract.at(upper, self.joint_cross_slots[joint].ravel(), values.ravel())

    def facet_vector(self, flux: NDArray[np.float64], rows: slice) -> NDArray[np.float64]:
        """``Σ q_f ∫ N dA`` over a range of facets, (n_unknowns,).

        Parameters
        ----------
        flux : (n,) ndarray
            For example heat flux [W/m²] of each facet.
        rows : slice
            Facets.
        """
        return np.bincount(
            self.facet_nodes[rows].ravel(),
            weights=(flux[:, None] * self.facet_load[rows]).ravel(),
            minlength=self.n_unknowns,
        )

    def facet_integral(self, temperature: NDArray[np.float64], rows: slice) -> NDArray[np.float64]:
        """``∫ T dA`` over each facet, (n,) [K·m²]."""
        return np.einsum("fn,fn->f", self.facet_load[rows], temperature[self.facet_nodes[rows]])

    def matrix(self, upper: NDArray[np.float64]) -> sparse.csr_array:
        """Full matrix of upper entries."""
        return self.pattern.expand(upper)

    def film_matrix(self, surface: str, coefficient: ArrayLike = 1.0) -> sparse.csr_array:
        """``Σ h_f R_f`` of one surface as a matrix of its own, for reduced models.

        Parameters
        ----------
        coefficient : float or (n,) array_like, [W/(m²·K)]
        """
        rows = self.rows_of(surface, "film_matrix")
        values = self.per_facet(surface, coefficient, "film_matrix")
        return self._facet_matrix(rows, values, self.facet_nodes[rows])

    def joint_matrix(self, joint: str, conductance: ArrayLike = 1.0) -> sparse.csr_array:
        """``+M_aa −M_ab −M_ba +M_bb`` of one joint as a matrix of its own.

        Parameters
        ----------
        conductance : float or (n,) array_like, [W/(m²·K)]
        """
        side_a, side_b = self.joint_sides(joint, "joint_matrix")
        values = spread(conductance, side_a.stop - side_a.start, f"joint {joint}")
        blocks = self._facet_matrix(side_a, values, self.facet_nodes[side_a])
        shift = sparse.csr_array(
            (
                np.ones(2 * self.facet_nodes[side_a].size),
                (
                    np.tile(self.facet_nodes[side_a].ravel(), 2),
                    np.concatenate((self.facet_nodes[side_a].ravel(), self.facet_nodes[side_b].ravel())),
                ),
            ),
            shape=(self.n_unknowns, self.n_unknowns),
        )
        jump = shift.tocsr()
        jump.data[:] = np.where(
            jump.indices == np.repeat(np.arange(self.n_unknowns), np.diff(jump.indptr)), 1, -1
        )
        return (jump.T @ blocks @ jump).tocsr()

    def parts_conduction(self, parts: Sequence[str]) -> sparse.csr_array:
        """Conduction matrix of some parts with unit conductivity, [m]."""
        return self._of_parts(parts, self.conduction)

    def parts_storage(self, parts: Sequence[str]) -> sparse.csr_array:
        """Storage matrix of some parts with unit volumetric capacity, [m³]."""
        return self._of_parts(parts, self.storage)

    def _of_parts(self, parts: Sequence[str], unit: NDArray[np.float64]) -> sparse.csr_array:
        factors = np.zeros(len(self.mesh.part_names))
        factors[[self.part_index(part, "part") for part in parts]] = 1.0
        # a copy, whose zeros go
        matrix = self.matrix(self._scaled(unit, factors)).copy()
        matrix.eliminate_zeros()
        return matrix

    def _facet_matrix(
        self, rows: slice, values: NDArray[np.float64], nodes: NDArray[np.int64]
    ) -> sparse.csr_array:
        i, j = upper_pairs(nodes.shape[1])
        # One cell of a channel is a small part of its wall.
        active = np.flatnonzero(values)
        nodes = nodes[active]
        entries = values[active, None] * self.facet_film[rows][active]
        off = i != j
        return sparse.coo_array(
            (
                np.concatenate((entries.ravel(), entries[:, off].ravel())),
                (
                    np.concatenate((nodes[:, i].ravel(), nodes[:, j[off]].ravel())),
                    np.concatenate((nodes[:, j].ravel(), nodes[:, i[off]].ravel())),
                ),
            ),
            shape=(self.n_unknowns, self.n_unknowns),
        ).tocsr()


def spread(value: ArrayLike, count: int, where: str) -> NDArray[np.float64]:
    """A scalar, or an array of ``count`` finite values, as an array.

    Raises
    ------
    SpecError
        Wrong length or not finite.

    >>> spread(2.0, 3, "film").tolist()
    [2.0, 2.0, 2.0]
    """
    array = np.asarray(value, dtype=float)
    if array.ndim > 1 or (array.ndim == 1 and array.size != count):
        raise SpecError(where, f"an array of shape {array.shape}.", f"Allowed: a number or {count} values.")
    if not np.isfinite(array).all():
        raise SpecError(where, "a value that is not finite.", "Allowed: finite numbers.")
    return array if array.ndim else np.full(count, array)
