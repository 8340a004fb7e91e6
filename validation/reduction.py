"""Galerkin reduction of the finite volumes: small matrices, one for each coefficient.

The basis spans the responses of the full model to every input (heat at each place, every
surrounding, the first shapes of oil temperature along the helix) at several rates of change and
with every joint and film far from its nominal value, compressed by proper orthogonal
decomposition in the norm of the heat capacity.
"""

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from . import machine as m
from .finite_volume import FiniteVolumes, assemble

MARCH_TERMS = 7
DEFAULT_CACHE = Path("~/.cache/spindle_fem_validation")
_RATES = (0.0, 1.5e-4, 1.0e-3, 8.0e-3, 6.0e-2)


def nominal_coefficients(fv_groups: dict[str, object]) -> dict[str, float]:
    """Nominal coefficient of every joint, gap and film at 3000 rpm; W/(m² K), balls in W/K."""
    values = {}
    for name in fv_groups:
        kind, _, rest = name.partition(":")
        if kind == "seat":
            value = m.INNER_SEAT if rest.startswith("shaft|") else m.OUTER_SEAT
        elif kind == "balls":
            value = m.BALL_CONDUCTANCE[rest[0]]
        else:
            value = {
                "axial": m.AXIAL_CONTACT, "gap": 20.0, "labyrinth": m.LABYRINTH_FILM,
                "outside": m.OUTSIDE_FILM, "flange_back": m.FLANGE_BACK_FILM,
                "nose_end": 60.0, "drive_end": 50.0,
            }[kind]  # fmt: skip
        values[name] = value
    return values


def conductance(coefficient: NDArray[np.float64] | float, series: NDArray[np.float64] | float):
    """Coefficient in series with the half cells beside the face, W/(m² K)."""
    return coefficient / (1.0 + coefficient * series)


def channel_series(fv: FiniteVolumes) -> float:
    """Resistance of the half cells behind the channel's walls, m² K/W."""
    return (
        0.0015 / m.material_of("housing")[0] if fv.grid.r.size < 50 else 0.00075 / m.material_of("housing")[0]
    )


def full_operator(
    fv: FiniteVolumes, coefficients: dict[str, float], film: float
) -> tuple[sparse.csc_matrix, dict[str, float]]:
    """Conduction with every joint and film at given coefficients; channel film towards given oil."""
    operator = fv.conduction.copy()
    diagonal = np.zeros(fv.size)
    used = {name: conductance(value, fv.series[name]) for name, value in coefficients.items()}
    for name, matrix in fv.pair_groups.items():
        operator = operator + used[name] * matrix
    for name, weights in fv.film_groups.items():
        diagonal += used[name] * weights
    diagonal += conductance(film, channel_series(fv)) * np.asarray(fv.wall.sum(axis=1)).ravel()
    return (operator + sparse.diags(diagonal)).tocsc(), used


def factorise(operator: sparse.csc_matrix):
    """Sparse factors of a symmetric positive definite operator."""
    return splu(operator, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})


def _inputs(fv: FiniteVolumes) -> NDArray[np.float64]:
    stations = np.linspace(-1.0, 1.0, fv.wall.shape[1])
    shapes = np.polynomial.legendre.legvander(stations, 3)
    columns = [100.0 * s for s in fv.sources.values()]
    columns += [10.0 * conductance(m.OUTSIDE_FILM * (20.0 if n == "flange_back" else 2.0), 0.0) * w
                for n, w in fv.film_groups.items()]  # fmt: skip
    columns += [243.0 * 3.0 * (fv.wall @ shape) for shape in shapes.T]
    columns += [100.0 * fv.readings[f"{name}.balls"] for name in m.BEARINGS]
    return np.stack(columns, axis=1)


def build_basis(fv: FiniteVolumes, size: int, draws: int, seed: int) -> NDArray[np.float64]:
    """Basis (n, size), orthonormal in the heat capacity, holding the uniform temperature."""
    rng = np.random.default_rng(seed)
    nominal = nominal_coefficients(fv.pair_groups | fv.film_groups)
    inputs = _inputs(fv)
    snapshots = []
    root = np.sqrt(fv.capacity)
    for draw in range(draws):
        spread = 0.0 if draw == 0 else 0.9
        drawn = {name: value * np.exp(spread * rng.standard_normal()) for name, value in nominal.items()}
        film = 243.0 * np.exp(0.6 * (spread > 0) * rng.standard_normal())
        operator, _ = full_operator(fv, drawn, film)
        for rate in _RATES:
            factors = factorise((operator + rate * sparse.diags(fv.capacity)).tocsc())
            answer = factors.solve(inputs) * root[:, None]
            # A slow answer is an offset more than a shape: weighed by what a probe would see of it.
            snapshots.append(answer.astype(np.float64))
    block = np.concatenate(snapshots, axis=1)
    scale = np.linalg.norm(block, axis=0)
    block /= np.sqrt(scale * np.median(scale))
    uniform = root / np.linalg.norm(root)
    block -= np.outer(uniform, uniform @ block)
    gram = block.T @ block
    values, vectors = np.linalg.eigh(gram)
    keep = np.argsort(values)[::-1][: size - 1]
    modes = block @ (vectors[:, keep] / np.sqrt(values[keep]))
    basis, _ = np.linalg.qr(np.column_stack([uniform, modes]))
    return basis / root[:, None]


@dataclass(slots=True)
class ReducedSpindle:
    """Operators in the reduced unknowns; the heat capacity's is the unit matrix.

    ``pairs`` (groups, m, m), ``films`` (groups, m, m) with ``film_loads`` (groups, m) towards one
    kelvin of surrounding. ``march`` and its companions are the powers of the marching operator
    along the helix (see `coolant_terms`). ``sources`` and ``readings`` are (count, m).
    """

    conduction: NDArray[np.float64]
    groups: tuple[str, ...]
    matrices: NDArray[np.float64]
    loads: NDArray[np.float64]
    series: NDArray[np.float64]
    nominal: NDArray[np.float64]
    film_matrix: NDArray[np.float64]
    film_load: NDArray[np.float64]
    march: NDArray[np.float64]
    march_load: NDArray[np.float64]
    outlet: NDArray[np.float64]
    outlet_load: NDArray[np.float64]
    channel_series: float
    source_names: tuple[str, ...]
    sources: NDArray[np.float64]
    reading_names: tuple[str, ...]
    readings: NDArray[np.float64]
    uniform: NDArray[np.float64]

    @property
    def size(self) -> int:
        """Number of reduced unknowns."""
        return self.uniform.size

    def coolant_terms(
        self, film: float, capacity_flow: float
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], float]:
        """Exchange with the oil that warms along the helix by what it takes up.

        Returns the matrix (m, m) and load (m,) per kelvin of inlet temperature, and the row and
        factor that give the outlet's rise from the unknowns and the inlet temperature. The march
        is the Neumann series of a Volterra operator; its terms fall like those of exp.
        """
        u = conductance(film, self.channel_series)
        ratio = u / capacity_flow
        powers = ratio * (-ratio) ** np.arange(MARCH_TERMS)
        matrix = u * (self.film_matrix - np.tensordot(powers, self.march, axes=1))
        load = u * (self.film_load - powers @ self.march_load)
        return matrix, load, powers @ self.outlet, -float(powers @ self.outlet_load)


def project(fv: FiniteVolumes, basis: NDArray[np.float64]) -> ReducedSpindle:
    """Project every operator onto the basis."""
    groups = (*fv.pair_groups, *fv.film_groups)
    matrices = [basis.T @ (k @ basis) for k in fv.pair_groups.values()]
    matrices += [basis.T @ (w[:, None] * basis) for w in fv.film_groups.values()]
    loads = np.zeros((len(groups), basis.shape[1]))
    loads[len(fv.pair_groups) :] = [w @ basis for w in fv.film_groups.values()]
    wall = basis.T @ fv.wall.toarray()
    area = np.asarray(fv.wall.sum(axis=0)).ravel()
    stations = area.size
    lower = np.tril(np.ones((stations, stations)), -1) + 0.5 * np.eye(stations)
    march, march_load, outlet, outlet_load = [], [], [], []
    left = np.eye(stations)
    for _ in range(MARCH_TERMS):
        half = lower @ left
        march.append(wall @ half @ wall.T)
        march_load.append(wall @ half @ area)
        outlet.append(left.sum(axis=0) @ wall.T)
        outlet_load.append(left.sum(axis=0) @ area)
        left = (area[:, None] * lower) @ left
    nominal = nominal_coefficients(dict.fromkeys(groups))
    return ReducedSpindle(
        conduction=basis.T @ (fv.conduction @ basis),
        groups=groups,
        matrices=np.array(matrices),
        loads=loads,
        series=np.array([fv.series[name] for name in groups]),
        nominal=np.array([nominal[name] for name in groups]),
        film_matrix=basis.T @ (np.asarray(fv.wall.sum(axis=1)) * basis),
        film_load=wall.sum(axis=1),
        march=np.array(march),
        march_load=np.array(march_load),
        outlet=np.array(outlet),
        outlet_load=np.array(outlet_load),
        channel_series=channel_series(fv),
        source_names=tuple(fv.sources),
        sources=np.array([s @ basis for s in fv.sources.values()]),
        reading_names=tuple(fv.readings),
        readings=np.array([r @ basis for r in fv.readings.values()]),
        uniform=basis.T @ fv.capacity,
    )


def load_reduced(
    cache: Path | None = None,
    *,
    sectors: int = 32,
    refine: int = 1,
    size: int = 170,
    draws: int = 7,
    deviation: m.Deviation = m.AS_DRAWN,
) -> ReducedSpindle:
    """Read the reduced spindle from the cache, or build it (a minute or two) and keep it."""
    folder = (cache or DEFAULT_CACHE).expanduser()
    here = Path(__file__).parent
    text = b"".join(
        (here / name).read_bytes()
        for name in ("machine.py", "finite_volume.py", "nose_growth.py", "reduction.py")
    )
    key = hashlib.sha256(text + repr((sectors, refine, size, draws, deviation)).encode()).hexdigest()[:16]
    path = folder / f"spindle_{key}.npz"
    names = ReducedSpindle.__slots__
    if path.exists():
        with np.load(path) as data:
            values = {n: data[n] for n in names}
        for name in ("groups", "source_names", "reading_names"):
            values[name] = tuple(str(x) for x in values[name])
        values["channel_series"] = float(values["channel_series"])
        return ReducedSpindle(**values)
    fv = assemble(m.build_grid(sectors, refine, deviation))
    reduced = project(fv, build_basis(fv, size, draws, seed=11))
    folder.mkdir(parents=True, exist_ok=True)
    scratch = path.with_suffix(".tmp.npz")
    np.savez(scratch, **{n: np.asarray(getattr(reduced, n)) for n in names})
    scratch.rename(path)
    return reduced
