"""A fast model as named matrices and tables: what every exported file holds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from spindle_fem.studies.export.portable_model import SCHEMA, PortableModel
from spindle_fem.units import registry

Array = NDArray[np.float64]

# Room and start where a program that steps the model says nothing, °C.
USUAL_TEMPERATURE = 20.0
EXACT, TR_BDF2 = "exact", "TR-BDF2"
CELSIUS = "degC"
# A load that is 1.
CONSTANT = "constant"
# How units of inputs are written where they have these dimensions.
USUAL_UNITS = ("", "W", "rad/s", "N", "N*m", "A", "V", "m/s", "m**3/s", "Pa")


@dataclass(frozen=True, slots=True)
class StateSpace:
    """A machine's fast model for other programs.

    Attributes
    ----------
    header : mapping
        ``machine``, ``scheme``, ``inputs``, ``outputs``, ``loads`` with names and units, ranges, and
        which arrays are tables over which inputs; plain data.
    arrays : mapping of str to ndarray
        As :mod:`spindle_fem.studies.export.portable_model` uses them.
    """

    header: Mapping[str, Any]
    arrays: Mapping[str, Array]

    def model(self) -> PortableModel:
        """The model at its start, to be stepped."""
        return PortableModel(dict(self.header), dict(self.arrays))


@dataclass(frozen=True, slots=True)
class ModelInput:
    """One input of an exported model.

    Attributes
    ----------
    low, high : float or None
        Range of the model; None where there is no end to it.
    magnitude : bool
        Whether its sign says nothing: a rotational speed.
    """

    name: str
    unit: str
    default: float
    low: float | None = None
    high: float | None = None
    magnitude: bool = False

    def as_plain(self) -> dict[str, Any]:
        """Plain values for the header of the file."""
        return {name: getattr(self, name) for name in self.__slots__}


@dataclass(frozen=True, slots=True)
class PowerLoad:
    """A heat [W] or a fluid's temperature [°C] that is ``gain (input + offset)^exponent``.

    Attributes
    ----------
    input : int
        Position of the input; -1 for none, where the load is its gain.
    """

    name: str
    unit: str
    input: int
    gain: float = 1.0
    exponent: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True, slots=True)
class FeedbackTable:
    """Heats that follow one temperature of the machine, and inputs.

    Attributes
    ----------
    sense : (r,) ndarray
        The temperature, °C, from the unknowns.
    sense_load : mapping of load to float
        And from the loads.
    inputs : tuple of str
        Axes behind that temperature.
    axes : tuple of ndarray
    values : (n, ..., m) ndarray
    column : (d,) int ndarray
        Which of the m values each heat is proportional to.
    out, into : (d, r) ndarray
        What each heat warms, and the temperature that it is proportional to.
    load : list of d mappings of load to float
        And the loads that it is proportional to.
    read : (d, p) ndarray or None
        What each adds to the outputs where these are read; nothing where None.
    less, response : (d,) int ndarray or None
        A heat is proportional to ``values[column] exp(q) - values[less]``, with ``q`` the logarithm of that
        number among the responses of the bearings. Neither where -1 or None.
    """

    sense: Array
    sense_load: dict[str, float]
    inputs: tuple[str, ...]
    axes: tuple[Array, ...]
    values: Array
    column: NDArray[np.int64]
    out: Array
    into: Array
    load: list[dict[str, float]]
    read: Array | None = None
    less: NDArray[np.int64] | None = None
    response: NDArray[np.int64] | None = None


def modal_basis(storage: Array, conduction: Array) -> Array:
    """Modes of a model as columns, each scaled to store one unit, (n, n).

    Parameters
    ----------
    storage, conduction : (n, n) ndarray
        Symmetric; the storage positive definite.
    """
    return eigh(conduction, storage)[1]


def power_load_arrays(loads: Sequence[PowerLoad]) -> dict[str, Array]:
    """Arrays of the loads that are powers of inputs."""
    columns = ("input", "gain", "exponent", "offset")
    return {f"load_{name}": np.array([float(getattr(load, name)) for load in loads]) for name in columns}


def header_of(
    machine: str,
    scheme: str,
    longest_step: float,
    inputs: Sequence[ModelInput],
    outputs: Mapping[str, str],
    loads: Mapping[str, str],
) -> dict[str, Any]:
    """Header of a model without tables.

    Parameters
    ----------
    longest_step : float, [s]
    outputs, loads : mapping of name to unit
    """

    def named(units: Mapping[str, str]) -> list[dict[str, str]]:
        return [{"name": name, "unit": unit} for name, unit in units.items()]

    return {
        "schema": SCHEMA,
        "machine": machine,
        "scheme": scheme,
        "longest_step_s": longest_step,
        "initial_degC": USUAL_TEMPERATURE,
        "inputs": [item.as_plain() for item in inputs],
        "outputs": named(outputs),
        "loads": named(loads),
        "load_tables": [],
        "operator_tables": [],
        "feedback_tables": [],
        "held_tables": [],
        "responses": [],
        "table_inputs": {},
        "notes": [],
    }


def unit_of_input(gain_unit: str, exponent: float) -> str:
    """SI unit of an input whose power times a gain is a heat; empty for a pure number.

    >>> unit_of_input("W/(rad/s)**1.5", 1.5)
    'rad/s'
    """
    units = registry()
    known = units.Quantity(1.0, gain_unit or "dimensionless")
    wanted = ((units.Quantity(1.0, "W") / known) ** (1.0 / exponent)).to_base_units()
    for unit in USUAL_UNITS:
        # Dimensions with rounded exponents.
        own = units.Quantity(1.0, unit or "dimensionless").to_base_units()
        ratio = (wanted / own).dimensionality
        if all(abs(power) < 1e-9 for power in dict(ratio).values()):
            return unit
    return f"{wanted.units:~C}"
