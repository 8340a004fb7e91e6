"""Circuits on a dense model: what the warming of their coolant adds to films at inlet temperature.

At given coefficients the coolant of a circuit is linear in its walls, so that it is eliminated: a matrix of
low rank that is not symmetric, for a wall feels those upstream.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.machine_spec import MachineSpec, StreamFilm
from spindle_fem.model.reduced.class_operators import ClassOperators
from spindle_fem.model.reduced.coolant_maps import COMPLEX_STEP
from spindle_fem.model.thermal_model import ThermalModel
from spindle_fem.operation.circuits import CircuitMarch, wall_cells

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class CircuitMaps:
    """Contribution of one circuit's warming, and its outlet, in the unknowns of a model.

    Attributes
    ----------
    conduction : (n, n) ndarray, [W/K]
    inlet_load : (n,) ndarray, [W/K]
        For each kelvin of the inlet.
    outlet : (n,) ndarray, [-]
        Outlet temperature from the unknowns.
    outlet_inlet : float, [-]
        Share of the inlet temperature in it.
    """

    conduction: Array
    inlet_load: Array
    outlet: Array
    outlet_inlet: float


class CircuitWalls:
    """The walls of one circuit on a model.

    Parameters
    ----------
    model : ThermalModel
        Dense, with a film for each wall.
    """

    def __init__(self, model: ThermalModel, film: StreamFilm) -> None:
        names = [f"film.{surface}" for surface in film.surface]
        self.rows = np.array([model.coefficient_names.index(name) for name in names])
        self.load = model.fluid_load[[model.fluid_names.index(name) for name in names]]
        self.area = self.load @ model.one
        self.mean = self.load / self.area[:, None]
        self.cell = wall_cells(film)

    def maps(self, film: StreamFilm, values: Array) -> CircuitMaps:
        """Maps at coefficients of the walls, (k,) W/(m²·K); they may be complex, for derivatives."""
        march = CircuitMarch.of(film, values * self.area, self.cell)
        weighted, warming, outlet = values[:, None] * self.load, march.warming, march.outlet
        return CircuitMaps(
            -weighted.T @ (warming @ self.mean),
            -weighted.T @ warming.sum(axis=1),
            outlet @ self.mean,
            1.0 - outlet.sum(),
        )

    def heat(self, film: StreamFilm, values: Array, unknowns: Array) -> Array:
        """Heat that each wall gives to the coolant at states (..., n), (..., k) W."""
        rise = unknowns @ self.mean.T - film.inlet_temperature
        warming = CircuitMarch.of(film, values * self.area, self.cell).warming
        return values * self.area * (rise - rise @ warming.T)


class CircuitOperators:
    """All circuits of a machine on a model.

    Parameters
    ----------
    spec : MachineSpec
    columns : mapping of str to int
        Load input that is the fluid of each film.
    """

    def __init__(self, model: ThermalModel, spec: MachineSpec, columns: Mapping[str, int]) -> None:
        self._circuits = [
            (film, CircuitWalls(model, film), columns[f"film.{film.surface[0]}"]) for film in spec.circuits
        ]
        # Outputs that read the outlet of each circuit.
        self._readers = {
            film.name: [row for row, probe in enumerate(spec.probe) if probe.circuit == film.name]
            for film in spec.circuits
        }

    def add(self, operators: ClassOperators, values: Array, touched: Mapping[str, Sequence[int]]) -> None:
        """Add the circuits to the operators of a class.

        Parameters
        ----------
        values : (n_c,) ndarray
            Every coefficient of the model.
        touched : mapping of parameter to sequence of int
            Positions of the coefficients that each requested parameter scales.
        """
        for film, walls, column in self._circuits:
            own = values[walls.rows]
            maps = walls.maps(film, own)
            operators.conduction[...] += maps.conduction
            operators.loads[:, column] += maps.inlet_load
            rows_read = self._readers[film.name]
            operators.outputs[rows_read] = maps.outlet
            operators.output_inputs[rows_read, column] = maps.outlet_inlet
            for parameter, rows in touched.items():
                scaled = np.isin(walls.rows, list(rows))
                if scaled.any():
                    by = walls.maps(film, own * (1.0 + 1j * COMPLEX_STEP * scaled))
                    before = operators.conduction_by[parameter]
                    operators.conduction_by[parameter] = before + by.conduction.imag / COMPLEX_STEP
                    operators.loads_by[parameter][:, column] += by.inlet_load.imag / COMPLEX_STEP
                    if rows_read:
                        outputs, inputs = (
                            derivatives.setdefault(parameter, np.zeros_like(whole))
                            for derivatives, whole in (
                                (operators.outputs_by, operators.outputs),
                                (operators.output_inputs_by, operators.output_inputs),
                            )
                        )
                        outputs[rows_read] = by.outlet.imag / COMPLEX_STEP
                        inputs[rows_read, column] = np.imag(by.outlet_inlet) / COMPLEX_STEP

    def add_difference(self, operators: ClassOperators, upper: Array, lower: Array) -> None:
        """Add what the circuits do at the first of two sets of coefficients less the second, in place."""
        for film, walls, column in self._circuits:
            pair = [coefficients[walls.rows] for coefficients in (upper, lower)]
            if np.any(pair[0] != pair[1]):
                one, other = (walls.maps(film, own) for own in pair)
                operators.conduction[...] += one.conduction - other.conduction
                operators.loads[:, column] += one.inlet_load - other.inlet_load
                rows_read = self._readers[film.name]
                operators.outputs[rows_read] = one.outlet - other.outlet
                operators.output_inputs[rows_read, column] = one.outlet_inlet - other.outlet_inlet
