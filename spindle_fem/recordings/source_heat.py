"""What the heat sources of a definition give at values of a recording's inputs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.interpolate import RegularGridInterpolator

from spindle_fem.definition.machine_spec import HeatSource, SourceTable


def source_heat(source: HeatSource, inputs: Mapping[str, Any]) -> Any:
    """Heat of a source, W, at one or many values of the inputs.

    Heat that was recorded for it comes first, then the input that it follows, then its own value.

    Parameters
    ----------
    inputs : mapping of str to float or (k,) ndarray
        ``speed`` [rad/s], ``thrust`` [N] and what was recorded, SI.
    """
    given = inputs.get(f"heat.{source.name}")
    if given is not None:
        return given
    if source.input is not None and source.input in inputs:
        gain = 1.0 if source.gain is None else source.gain.amount.value
        return gain * inputs[source.input]
    if isinstance(source.heat, SourceTable):
        return table_heat(source.heat, inputs["speed"], inputs["thrust"])
    return source.heat or 0.0


def table_heat(table: SourceTable, speed: Any, thrust: Any) -> Any:
    """Heat by a table, W, linear between its entries; speed without its sign."""
    if not table.thrust:
        return np.interp(np.abs(speed), table.speed, table.heat)
    rows = np.reshape(table.heat, (len(table.thrust), len(table.speed)))
    point = [
        np.clip(value, axis[0], axis[-1])
        for value, axis in ((thrust, table.thrust), (np.abs(speed), table.speed))
    ]
    return RegularGridInterpolator((table.thrust, table.speed), rows)(tuple(point))
