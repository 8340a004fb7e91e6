"""Energy balance, refinement and reduction of the study's machine: ``python -m validation.check_model``."""

import argparse
import time

import numpy as np
from scipy import sparse

from . import machine as m
from .finite_volume import FiniteVolumes, assemble
from .oil import channel_film
from .reduction import (
    channel_series,
    conductance,
    factorise,
    full_operator,
    load_reduced,
    nominal_coefficients,
)
from .stepping import bearing_heat, shaft_end_film

COLUMNS = (*m.PROBES, "COOLANT_OUT")


def coefficients_at(speed: float, groups: dict[str, object]) -> dict[str, float]:
    """Nominal coefficients of every group at a speed."""
    air = {
        "gap": 8.0 + 12.0 * (speed / 3000.0) ** 0.75,
        "nose_end": shaft_end_film(speed, 0.18),
        "drive_end": shaft_end_film(speed, 0.11),
    }
    return nominal_coefficients(groups) | air


def steady_full(
    fv: FiniteVolumes, speed: float = 3000.0, inlet: float = 15.0, ambient: float = 17.6, rate: float = 0.0
) -> tuple[np.ndarray, float]:
    """Readings of the unreduced model, and heat out over heat in; the response at a ``rate`` > 0, 1/s."""
    coefficients = coefficients_at(speed, fv.pair_groups | fv.film_groups)
    film, capacity, _ = (float(x) for x in channel_film(inlet))
    operator, used = full_operator(fv, coefficients, film)
    factors = factorise((operator + rate * sparse.diags(fv.capacity)).tocsc())
    heat = bearing_heat(speed, 1750.0)
    force = np.zeros(fv.size)
    for bearing, watts in zip(m.BEARINGS, heat, strict=True):
        force += 0.5 * watts * (fv.sources[f"{bearing}.inner"] + fv.sources[f"{bearing}.outer"])
    for name, weights in fv.film_groups.items():
        force += used[name] * weights * ambient
    u = conductance(film, channel_series(fv))
    area = np.asarray(fv.wall.sum(axis=0)).ravel()
    oil = np.full(area.size, inlet)
    for _ in range(25):
        temperature = factors.solve(force + u * (fv.wall @ oil))
        taken = u * (fv.wall.T @ temperature - area * oil)
        oil = inlet + (np.cumsum(taken) - 0.5 * taken) / capacity
    out = sum(used[n] * float(w @ temperature - w.sum() * ambient) for n, w in fv.film_groups.items())
    readings = [float(fv.readings[p] @ temperature) for p in m.PROBES]
    return np.array([*readings, inlet + taken.sum() / capacity]), (out + taken.sum()) / heat.sum()


def steady_reduced(model, speed: float = 3000.0, inlet: float = 15.0, ambient: float = 17.6) -> np.ndarray:
    """Readings of the reduced model."""
    film, capacity, _ = (float(x) for x in channel_film(inlet))
    nominal = coefficients_at(speed, dict.fromkeys(model.groups))
    used = conductance(np.array([nominal[name] for name in model.groups]), model.series)
    matrix, load, row, factor = model.coolant_terms(film, capacity)
    force = (used * ambient) @ model.loads + load * inlet
    for bearing, watts in zip(m.BEARINGS, bearing_heat(speed, 1750.0), strict=True):
        for ring in ("inner", "outer"):
            force += 0.5 * watts * model.sources[model.source_names.index(f"{bearing}.{ring}")]
    state = np.linalg.solve(model.conduction + np.tensordot(used, model.matrices, axes=1) + matrix, force)
    readings = [float(model.readings[model.reading_names.index(p)] @ state) for p in m.PROBES]
    return np.array([*readings, inlet + row @ state + factor * inlet])


def main(arguments: list[str] | None = None) -> None:
    """Command line."""
    parser = argparse.ArgumentParser(prog="python -m validation.check_model", description=__doc__)
    parser.add_argument(
        "--fine", action="store_true", help="every cell in two along r and z as well; needs 4 GB"
    )
    given = parser.parse_args(arguments)
    grids = [(16, 1), (32, 1), *([(48, 1), (16, 2)] if given.fine else [])]
    print(
        f"{'sectors x refine':18s}{'cells':>9s}"
        + "".join(f"{c:>13s}" for c in COLUMNS)
        + f"{'out/in':>12s}{'s':>7s}"
    )
    for sectors, refine in grids:
        began = time.perf_counter()
        fv = assemble(m.build_grid(sectors, refine))
        values, balance = steady_full(fv)
        print(
            f"{f'{sectors} x {refine}':18s}{fv.size:9d}"
            + "".join(f"{v:13.3f}" for v in values)
            + f"{balance:12.8f}{time.perf_counter() - began:7.1f}",
            flush=True,
        )
    values = steady_reduced(load_reduced())
    print(f"{'32 x 1 reduced':18s}{load_reduced().size:9d}" + "".join(f"{v:13.3f}" for v in values))


if __name__ == "__main__":
    main()
