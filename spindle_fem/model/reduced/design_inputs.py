"""Quantities that vary between designs of one mesh, as arrays with a row for each design."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.model.reduced.heat_tables import mechanical_keys
from spindle_fem.operation.coefficients import fluid_temperature, linear_coefficients
from spindle_fem.operation.heat_shares import BODIES, heat_shares
from spindle_fem.operation.operating_point import OperatingPoint

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class DesignInputs:
    """Designs of one structure as arrays, a row each.

    Attributes
    ----------
    coefficients : (n, n_c) ndarray, SI
        In the order of the model; those of the balls nan where they follow the contacts.
    fluid : (n, n_f) ndarray, [K]
        Temperature of the fluid of each film.
    ambient, inlet : (n,) ndarray, [K]
    flow : (n,) ndarray, [m³/s]
    film_factor : (n,) ndarray
    shares : (n, 3) ndarray
        Of a bearing's heat: inner raceway, outer raceway, balls.
    mechanics : tuple of str
        Key of the mechanical state of each design: the same key, the same heat
        at the same temperatures.
    """

    specs: tuple[MachineSpec, ...]
    points: tuple[OperatingPoint, ...]
    coefficients: Array
    fluid: Array
    ambient: Array
    inlet: Array
    flow: Array
    film_factor: Array
    shares: Array
    mechanics: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.specs)

    def take(self, rows: Sequence[int] | NDArray[np.int64]) -> DesignInputs:
        """Some of the designs."""
        index = np.asarray(rows, dtype=np.int64)
        return DesignInputs(
            tuple(self.specs[i] for i in index),
            tuple(self.points[i] for i in index),
            *(
                getattr(self, name)[index]
                for name in ("coefficients", "fluid", "ambient", "inlet", "flow", "film_factor", "shares")
            ),
            mechanics=tuple(self.mechanics[i] for i in index),
        )


def design_inputs(
    specs: Sequence[MachineSpec],
    names: Sequence[str],
    fluid_names: Sequence[str],
    contacts: Sequence[str],
    gap_radii: Mapping[str, tuple[float, float]],
    mechanics: Sequence[str] | None = None,
) -> DesignInputs:
    """Arrays of designs of one structure.

    Parameters
    ----------
    names, fluid_names : sequence of str
        Coefficients and films of the model.
    contacts : sequence of str
        Joints of the mesh.
    gap_radii : mapping of gap to (float, float), [m]
    mechanics : sequence of str, optional
        Keys where they are known.
    """
    points = tuple(OperatingPoint.of(spec) for spec in specs)
    rows, fluids = [], []
    for spec, point in zip(specs, points, strict=True):
        values = linear_coefficients(spec, point, contacts, gap_radii)
        rows.append([values[name] for name in names])
        fluid = {
            f"film.{surface}": fluid_temperature(film, point.ambient_temperature)
            for film in spec.film
            for surface in film.surface
        }
        fluids.append([fluid[name] for name in fluid_names])
    shares = [[heat_shares(spec.heat)[body] for body in BODIES] for spec in specs]
    has_channel = specs[0].coolant is not None
    return DesignInputs(
        tuple(specs),
        points,
        np.array(rows, dtype=float),
        np.array(fluids, dtype=float).reshape(len(specs), -1),
        np.array([point.ambient_temperature for point in points]),
        np.array([point.coolant_inlet_temperature for point in points]),
        np.array([point.coolant_flow for point in points]),
        np.array([spec.coolant.film_factor.value if has_channel else 1.0 for spec in specs]),
        np.array(shares),
        tuple(mechanics) if mechanics is not None else mechanical_keys(specs, points),
    )
