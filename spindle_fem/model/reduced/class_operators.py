"""Operators of a fast model at one operating class, with their derivatives to parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

NO_CHANGES: Mapping[str, float] = MappingProxyType({})


@dataclass(frozen=True, slots=True)
class ClassOperators:
    """Operators of one operating class and their derivatives.

    ``K u = W w`` with ``w`` the load inputs of :attr:`FastModel.load_names`.

    Attributes
    ----------
    conduction : (r, r) ndarray
    loads : (r, n_w) ndarray
    outputs : (n_out, r) ndarray
        Temperature channels from the unknowns.
    output_inputs : (n_out, n_w) ndarray
        And from the load inputs, for the coolant's outlet.
    conduction_by : mapping of parameter to (r, r) ndarray
        Derivatives to logarithms; absent where zero. Likewise the others.
    loads_by, outputs_by, output_inputs_by : mapping of parameter to ndarray
    """

    conduction: Array
    loads: Array
    outputs: Array
    output_inputs: Array
    conduction_by: dict[str, Array] = field(default_factory=dict)
    loads_by: dict[str, Array] = field(default_factory=dict)
    outputs_by: dict[str, Array] = field(default_factory=dict)
    output_inputs_by: dict[str, Array] = field(default_factory=dict)
