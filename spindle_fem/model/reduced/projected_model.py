"""The projected model: small dense operators with every coefficient still free."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from spindle_fem.cache import cache_directory, load_record, save_record, source_digest
from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.model.reduced.affine_operators import AffineSystem
from spindle_fem.operation.channel_cells import ChannelCells
from spindle_fem.operation.coefficients import CoefficientTable, build_coefficient_table

Array = NDArray[np.float64]

FORMAT = "spindle-fem/reduced/2"
# Packages and modules whose change gives the same machine another reduced model.


@dataclass(frozen=True, slots=True)
class ReducedModel:
    """Galerkin projection of a machine's finite-element model on ``r`` basis vectors.

    The reduced unknowns ``u`` stand for the field ``V u``. Every operator is
    ``Vᵀ K_i V``: symmetric, positive semi-definite, and since the basis holds
    the uniform field, heat is conserved exactly.

    Attributes
    ----------
    coefficient_names : tuple of str
    operators : (n_c, r, r) ndarray
        Of unit coefficient.
    fluid_names : tuple of str
        Coefficients that are films.
    fluid_load : (n_f, r) ndarray
        What a fluid of 1 K puts in at unit coefficient.
    cell_film : (n_cells, r, r) ndarray, [m²]
    cell_load : (n_cells, r) ndarray, [m²]
    cell_area : (n_starts, n_along) ndarray, [m²]
    cell_angle, cell_position : (n_along,) ndarray, [rad], [m]
    cell_is_port : (n_along,) bool ndarray
    storage_names : tuple of str
    storage : (n_s, r, r) ndarray
    place_names : tuple of str
    places : (n_p, r) ndarray
        Mean over each place; also the load of 1 W spread over it.
    probe_names : tuple of str
    probes : (n_q, r) ndarray
    one : (r,) ndarray
        The uniform field of 1 K.
    contacts : tuple of str
    gap_radii : mapping of gap to (float, float), [m]
    ranges : mapping of coefficient to (float, float)
        Where the basis was made and checked.
    errors : mapping of str to float
        Largest error against the full model at samples that the basis was not
        made from, K, by what was compared.
    n_full : int
        Unknowns of the full model.
    digest : str
    probe_gradients : (n_q, 2, r) ndarray, [1/m]
        Change of each point probe's reading with a displacement of the probe
        along r and along z, as :func:`probe_places.probe_slopes` has it.
    """

    coefficient_names: tuple[str, ...]
    operators: Array
    fluid_names: tuple[str, ...]
    fluid_load: Array
    cell_film: Array
    cell_load: Array
    cell_area: Array
    cell_angle: Array
    cell_position: Array
    cell_is_port: NDArray[np.bool_]
    storage_names: tuple[str, ...]
    storage: Array
    place_names: tuple[str, ...]
    places: Array
    probe_names: tuple[str, ...]
    probes: Array
    one: Array
    contacts: tuple[str, ...]
    gap_radii: Mapping[str, tuple[float, float]]
    ranges: Mapping[str, tuple[float, float]]
    errors: Mapping[str, float] = field(default_factory=dict)
    n_full: int = 0
    digest: str = ""
    probe_gradients: Array = field(default_factory=lambda: np.zeros((0, 2, 0)))

    @property
    def size(self) -> int:
        """Basis vectors."""
        return len(self.one)

    def place(self, name: str) -> Array:
        """Mean over a place, and the load of 1 W spread over it, (r,)."""
        return self.places[self.place_names.index(name)]

    def table(self, spec: MachineSpec) -> CoefficientTable:
        """Coefficients of a machine with this model's geometry."""
        return build_coefficient_table(spec, self.contacts, self.gap_radii)

    def projected(self, basis: Array) -> ReducedModel:
        """Galerkin projection on a smaller basis, (r, s)."""

        def both(stack: Array) -> Array:
            return np.einsum("ra,nrs,sb->nab", basis, stack, basis, optimize=True)

        return replace(
            self,
            operators=both(self.operators),
            fluid_load=self.fluid_load @ basis,
            cell_film=both(self.cell_film),
            cell_load=self.cell_load @ basis,
            storage=both(self.storage),
            places=self.places @ basis,
            probes=self.probes @ basis,
            probe_gradients=self.probe_gradients @ basis,
            one=basis.T @ self.one,
        )

    def channel_cells(self) -> ChannelCells:
        """The coolant's cells, without the mesh's facets."""
        return ChannelCells(
            (), {}, {}, self.cell_area, self.cell_angle, self.cell_position, self.cell_is_port
        )

    def outside_range(self, coefficients: Mapping[str, float]) -> tuple[str, ...]:
        """Coefficients for which the basis was not made."""
        return tuple(
            name
            for name, value in coefficients.items()
            if name in self.ranges
            and not self.ranges[name][0] * (1.0 - 1e-9) <= value <= self.ranges[name][1] * (1.0 + 1e-9)
        )

    # ----------------------------------------------------------------- disk
    def save(self, path: Path) -> None:
        """Write to an .npz file; readers never see half of it."""
        save_record(self, path, FORMAT)

    @classmethod
    def load(cls, path: Path) -> ReducedModel | None:
        """What :meth:`save` wrote; None where there is none, or another version, or a damaged file."""
        found = load_record(path, FORMAT)
        if found is None:
            return None
        for name in ("gap_radii", "ranges"):
            found[name] = {key: tuple(pair) for key, pair in found[name].items()}
        return cls(**found)


def project(
    affine: AffineSystem,
    basis: Array,
    one: Array,
    *,
    cells: ChannelCells | None,
    contacts: tuple[str, ...],
    gap_radii: Mapping[str, tuple[float, float]],
    ranges: Mapping[str, tuple[float, float]],
    digest: str,
) -> ReducedModel:
    """Galerkin projection of every operator.

    Parameters
    ----------
    affine : AffineSystem
    basis : (n, r) ndarray
    one : (r,) ndarray
        Coordinates of the uniform field.
    """

    def small(matrices: tuple) -> Array:
        found = [_projected(matrix, basis) for matrix in matrices]
        stacked = np.array(found) if found else np.zeros((0, basis.shape[1], basis.shape[1]))
        return 0.5 * (stacked + stacked.transpose(0, 2, 1))

    n_along = affine.cell_area.shape[1]
    return ReducedModel(
        coefficient_names=affine.coefficient_names,
        operators=small(affine.operators),
        fluid_names=tuple(affine.fluid_load),
        fluid_load=np.array([basis.T @ load for load in affine.fluid_load.values()]).reshape(
            -1, basis.shape[1]
        ),
        cell_film=small(affine.cell_film),
        cell_load=np.asarray(affine.cell_load @ basis),
        cell_area=affine.cell_area,
        cell_angle=np.zeros(n_along) if cells is None else cells.angle,
        cell_position=np.zeros(n_along) if cells is None else cells.position,
        cell_is_port=np.zeros(n_along, dtype=bool) if cells is None else cells.is_port,
        storage_names=affine.storage_names,
        storage=small(affine.storage),
        place_names=affine.place_names,
        places=np.asarray(affine.places @ basis),
        probe_names=affine.probe_names,
        probes=np.asarray(affine.probes @ basis),
        one=one,
        contacts=contacts,
        gap_radii=gap_radii,
        ranges=ranges,
        n_full=affine.size,
        digest=digest,
        probe_gradients=np.asarray(affine.probe_slopes @ basis).reshape(-1, 2, basis.shape[1]),
    )


def _projected(matrix: sparse.csr_array, basis: Array) -> Array:
    """``Vᵀ K V``; most operators live on a surface, and only its rows are touched."""
    own = np.flatnonzero(np.diff(matrix.indptr))
    if 2 * len(own) > matrix.shape[0]:
        return basis.T @ (matrix @ basis)
    rows = basis[own]
    return rows.T @ (matrix[own][:, own] @ rows)


def reduced_digest(spec: MachineSpec, options: Mapping[str, float]) -> str:
    """Hash of everything that a reduced model depends on: its family's, and that of its range."""
    content = _content(spec)
    own = _hash([content, dict(options)])
    return f"{_hash(_without_coefficients(content))[:24]}-{own}"


def reduced_path(digest: str) -> Path:
    """File of a reduced model in the cache."""
    return cache_directory() / f"reduced-{digest}.npz"


def family_of(digest: str) -> list[Path]:
    """Models in the cache of machines that differ in values of coefficients only, the newest first."""
    family = digest.partition("-")[0]
    found = cache_directory().glob(f"reduced-{family}-*.npz")
    return sorted(found, key=lambda path: -path.stat().st_mtime)


def _content(spec: MachineSpec) -> dict[str, Any]:
    content = spec.model_dump(mode="json")
    # The operating point and the words change nothing in the operators.
    for key in ("operation", "name", "title", "description", "initial", "effects"):
        content.pop(key, None)
    return content


def _without_coefficients(content: Mapping[str, Any]) -> dict[str, Any]:
    """A definition without what the reduced model has as live coefficients, and without heat."""
    rest = {key: value for key, value in content.items() if key not in ("factor", "heat", "grease")}
    rest["heat_capacity_factor"] = rest["coolant"] = None
    rest["joint"] = [
        item | {"conductance": "perfect" if item.get("conductance") == "perfect" else None}
        for item in content["joint"]
    ]
    rest["film"] = [item | {"coefficient": None, "factor": None} for item in content["film"]]
    rest["gap"] = [item | {"factor": None} for item in content["gap"]]
    rest["bearing_set"] = [
        item | {"heat_factor": None, "ball_row": item["ball_row"] | {"conductance": None}}
        for item in content["bearing_set"]
    ]
    return rest


def _hash(content: Any) -> str:
    text = json.dumps(
        [FORMAT, source_digest("spindle_fem.model.reduced.build_reduced"), content],
        sort_keys=True,
        default=str,
    )
    return hashlib.sha256(text.encode()).hexdigest()
