"""``simulation.nc``: inputs, readings and predictions of a simulation, as one xarray Dataset with units."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from spindle_fem.studies.simulate import Simulation
from spindle_fem.units import ZERO_CELSIUS_K

if TYPE_CHECKING:
    import xarray as xr

SIMULATION_SCHEMA = "spindle-fem/simulation-data/1"


def _displaced(simulation: Simulation) -> dict[str, tuple]:
    """Displacement channels, from the first reading of each."""
    if not simulation.displacements.size:
        return {}
    along, metres = ("stamp", "displacement_name"), {"units": "m"}
    return {
        "displacement": (along, simulation.recording.displacements, metres),
        "displacement_predicted": (along, simulation.displacements, metres),
    }


def simulation_dataset(simulation: Simulation) -> xr.Dataset:
    """Inputs and results of a simulation; temperatures in °C, inputs in SI, named as in ``diagnosis.nc``."""
    import xarray as xr

    recording = simulation.recording
    along, displaced = ("stamp", "channel"), _displaced(simulation)
    return xr.Dataset(
        {
            "time": ("stamp", recording.times, {"units": "s", "long_name": "time from the first stamp"}),
            "measured": (along, recording.temperature - ZERO_CELSIUS_K, {"units": "degC"}),
            "usable": (along, recording.usable.astype(np.int8)),
            "predicted": (along, simulation.predicted - ZERO_CELSIUS_K, {"units": "degC"}),
            "input": (("stamp", "input_name"), recording.input_history().values, {"long_name": "inputs, SI"}),
            "input_unit": ("input_name", list(recording.input_units)),
            "input_held": ("input_name", recording.held.astype(np.int8)),
            "channel_probe": ("channel", list(recording.probes)),
            **displaced,
        },
        {
            "channel": list(recording.temperature_names),
            "input_name": list(recording.input_names),
            **({"displacement_name": list(recording.displacement_names)} if displaced else {}),
        },
        {"schema": SIMULATION_SCHEMA, "machine": simulation.machine, "recording": recording.name},
    )
