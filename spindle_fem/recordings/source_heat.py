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
        ``speed`` [rad/s], ``thrust`` [N] and what was recorded, SI; ``torque`` [N m] where it is not that of
        the operation.
    """
    given = inputs.get(f"heat.{source.name}")
    if given is not None:
        return given
    if source.input is not None and source.input in inputs:
        gain = 1.0 if source.gain is None else source.gain.amount.value
        return gain * inputs[source.input]
    torque = np.abs(inputs.get("torque", source.usual_torque))
    windings = 0.0
    if source.copper_loss is not None:
        windings = source.copper_loss * (torque / source.rated_torque) ** 2
    if isinstance(source.heat, SourceTable):
        loads = {"torque": torque, None: 0.0}
        axis = source.heat.load_input
        load = loads[axis] if axis in loads else inputs[axis]
        return windings + _table_heat(source.heat, np.abs(inputs["speed"]), load)
    return windings + (source.heat or 0.0)


def _table_heat(table: SourceTable, speed: Any, load: Any) -> Any:
    """Heat by a table, W, linear between its entries."""
    if not table.load:
        return np.interp(speed, table.speed, table.heat)
    rows, axes = np.reshape(table.heat, (len(table.load), len(table.speed))), (table.load, table.speed)
    values = zip(np.broadcast_arrays(load, speed), axes, strict=True)
    return RegularGridInterpolator(axes, rows)(tuple(np.clip(own, axis[0], axis[-1]) for own, axis in values))
