"""Prior knowledge of a machine's uncertain parameters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spindle_fem.definition.uncertain_parameters import uncertain_parameters
from spindle_fem.model.reduced.fast_model import FastModel
from spindle_fem.operation.coefficient_table import INNER_SHARE

# A share of heat stays below one.
LARGEST_SHARE = 0.999


@dataclass(frozen=True, slots=True)
class Prior:
    """One uncertain parameter.

    Attributes
    ----------
    value : float
        Most likely value before the data, in ``unit``.
    sigma_log : float
        One standard deviation of the natural logarithm.
    highest : float
        Factor on the value that cannot be passed; 1/0.5 for a share of one half.
    """

    name: str
    value: float
    sigma_log: float
    unit: str
    highest: float = np.inf


def priors_of(fast: FastModel) -> tuple[Prior, ...]:
    """Uncertain parameters of a network, or of a machine with geometry."""
    if fast.network is not None:
        known = fast.network.parameters
        return tuple(Prior(p.name, p.value, p.sigma_log, p.unit) for p in known if p.sigma_log > 0.0)
    return tuple(
        Prior(
            item.name,
            item.value,
            item.sigma_log,
            item.unit,
            LARGEST_SHARE / item.value if item.name == INNER_SHARE else np.inf,
        )
        for item in uncertain_parameters(fast.spec)
    )
