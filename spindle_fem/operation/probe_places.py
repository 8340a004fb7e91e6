"""Places around each point probe, and sides of stationary parts, in the reduced model.

A patch of the probe's own part around it, where an unmodelled source may sit,
the ring about the axis through it, and how the reading changes when the probe
sits a little elsewhere.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from spindle_fem.definition.machine_spec import Probe
from spindle_fem.errors import GeometryError
from spindle_fem.machine.view.place_names import AROUND, NEAR, STANDARD_DISTANCE
from spindle_fem.model.mesh.evaluate import locate_points, probe_matrix
from spindle_fem.model.mesh.mesh_operators import ThermalOperators

Array = NDArray[np.float64]

DISPLACEMENT = 0.5e-3
# A curved wall and its quadratic mesh differ by less.
WALL_TOLERANCE = 2e-5


def probe_positions(probes: Sequence[Probe]) -> Array:
    """Cartesian places of point probes, (n, 3) [m]."""
    return np.array([(-p.r * np.sin(p.angle), p.r * np.cos(p.angle), p.z) for p in probes]).reshape(-1, 3)


def near_places(operators: ThermalOperators, probes: Sequence[Probe]) -> Iterator[tuple[str, Array]]:
    """Means over a patch around each point probe, by name ``near.<probe>``.

    Weighted by a Gaussian of the distance from the probe, 20 mm in root mean
    square, within the probe's own part: what lies beyond a joint or across the
    axis counts nothing.

    Yields
    ------
    str, (n_unknowns,) ndarray
        The weights sum to 1.
    """
    corners, storage = _corners(operators), operators.matrix(operators.storage)
    for probe, position in zip(probes, probe_positions(probes), strict=True):
        squared = np.sum((corners - position) ** 2, axis=1)
        yield NEAR + probe.name, _patch(operators, storage, probe.part, squared)


def around_places(operators: ThermalOperators, probes: Sequence[Probe]) -> Iterator[tuple[str, Array]]:
    """Patch by distance in the meridian plane, by name ``around.<probe>``: a ring about the axis."""
    x, y, z = _corners(operators).T
    radius, storage = np.hypot(x, y), operators.matrix(operators.storage)
    for probe in probes:
        squared = (radius - probe.r) ** 2 + (z - probe.z) ** 2
        yield AROUND + probe.name, _patch(operators, storage, probe.part, squared)


def _corners(operators: ThermalOperators) -> Array:
    corners = operators.mesh.points[: operators.n_unknowns]
    return corners if operators.prolongation is None else corners[: operators.prolongation.shape[1]]


def _patch(operators: ThermalOperators, storage: sparse.csr_array, part: str, squared: Array) -> Array:
    """Weights that fall with the squared distance [m²] of corner nodes."""
    # Linear between corners: a quadratic interpolation could undershoot zero.
    weight = np.exp(-1.5 * squared / STANDARD_DISTANCE**2)
    if operators.prolongation is not None:
        weight = operators.prolongation @ weight
    # Storage couples no two parts.
    weight[operators.part_of_unknown != operators.part_index(part, "probe")] = 0.0
    vector = storage @ weight
    return vector / vector.sum()


def harmonics(operators: ThermalOperators, mean: Array) -> tuple[Array, Array]:
    """First harmonics of a place around the axis.

    Parameters
    ----------
    mean : (n_unknowns,) ndarray
        Weights of the place's mean; their sum is 1.

    Returns
    -------
    (n_unknowns,) ndarray, (n_unknowns,) ndarray
        The same weights times the cosine and the sine of the angle from y, less
        their means: of a field ``T`` the covariances with both. As a load, 1 W
        of it moves heat from one side to the other and adds nothing.
    """
    x, y = operators.mesh.points[: operators.n_unknowns, :2].T
    radius = np.maximum(np.hypot(x, y), np.finfo(float).tiny)
    up, across = y / radius, -x / radius
    return mean * (up - mean @ up), mean * (across - mean @ across)


def probe_slopes(operators: ThermalOperators, probes: Sequence[Probe]) -> sparse.csr_array:
    """Change of point probes' readings with a displacement along r and along z.

    A central difference over ± 0.5 mm of the finite-element field; where one
    of the two places lies outside the part, the one-sided difference.

    Returns
    -------
    (2 n_probes, n_unknowns) csr_array, [1/m]
        Along r then along z of the first probe, then the next.

    Raises
    ------
    GeometryError
        The part is thinner than 0.5 mm on both sides of a probe.
    """
    rows = [sparse.csr_array((0, operators.n_unknowns))]
    for probe, position in zip(probes, probe_positions(probes), strict=True):
        outward = np.array([-np.sin(probe.angle), np.cos(probe.angle), 0.0])
        for direction, word in ((outward, "r"), (np.array([0.0, 0.0, 1.0]), "z")):
            ends = [
                sign
                for sign in (-1.0, 1.0)
                if _is_inside(operators, position + sign * DISPLACEMENT * direction, probe.part)
            ]
            if not ends:
                raise GeometryError(
                    f"probe {probe.name}",
                    f'"{probe.part}" ends within {1e3 * DISPLACEMENT:g} mm on both sides along {word}.',
                    "Put the probe where its part is thicker.",
                )
            low, high = (ends[0], ends[-1]) if len(ends) == 2 else sorted((0.0, ends[0]))
            places = [position + end * DISPLACEMENT * direction for end in (low, high)]
            pair = probe_matrix(operators, places, [probe.part] * 2)
            rows.append((pair[[1]] - pair[[0]]) / ((high - low) * DISPLACEMENT))
    return sparse.csr_array(sparse.vstack(rows, format="csr"))


def _is_inside(operators: ThermalOperators, position: Array, part: str) -> bool:
    try:
        return bool(locate_points(operators.mesh, position[None], [part]).distance[0] <= WALL_TOLERANCE)
    except GeometryError:
        return False
