"""Synthetic recordings: a day around the operating point of a machine's definition.

Where an effect can act follows from the machine, its usual size from a
recording. Without a recording, these are used instead.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.recordings.align import Recording
from spindle_fem.recordings.channel_checks import ChannelNoise
from spindle_fem.recordings.defects import DefectReport
from spindle_fem.recordings.standard_inputs import standard_inputs

DAY = 86400.0
# Flow and speed vary by this share of the defined values, since laws of the Reynolds number need a range.
RANGE = 0.5
# Shares of the highest speed that a run holds one after the other, each for so long, s.
SPEEDS = (0.25, 0.5, 0.75, 1.0, 1.0, 0.0, 1.0, 0.5, 0.0)
HOLD = 3600.0


def at_the_defined_point(spec: MachineSpec) -> Recording:
    """A day about the operating point of a definition, all of it at the ambient temperature."""
    inputs = standard_inputs(spec)
    spread = {name: RANGE if name in ("speed", "coolant_flow") else 0.0 for name in inputs}
    ends = {
        name: ((1.0 - spread[name]) * value, (1.0 + spread[name]) * value) for name, value in inputs.items()
    }
    probes = tuple(probe.name for probe in spec.probe)
    return defined_recording(spec.name, probes, inputs["ambient"], ends, {})


def through_its_speeds(spec: MachineSpec, highest: float) -> Recording:
    """A run from cold through shares of a highest speed [rad/s] and standstill, the rest as defined."""
    usual = at_the_defined_point(spec)
    times = HOLD * np.arange(len(SPEEDS) + 1)
    inputs = np.tile(usual.inputs.mean(axis=0), (len(times), 1))
    inputs[:, usual.input_names.index("speed")] = highest * np.array([*SPEEDS, SPEEDS[-1]])
    shape = len(times), len(usual.probes)
    return replace(
        usual,
        times=times,
        inputs=inputs,
        temperature=np.resize(usual.temperature, shape),
        flags=np.zeros(shape, dtype=np.uint8),
        covariates=np.empty((len(times), 0)),
        segments=np.array([[0, len(times)]]),
    )


def defined_recording(
    source: str,
    probes: tuple[str, ...],
    temperature: float,
    inputs: Mapping[str, tuple[float, float]],
    units: Mapping[str, str],
) -> Recording:
    """A day that ends of inputs enclose, every probe at one temperature [K].

    Parameters
    ----------
    temperature : float, [K]
    inputs : mapping of str to (float, float)
        Value at the start and at the end, SI.
    units : mapping of str to str
        Units of the inputs that need one.
    """
    times = np.array([0.0, DAY])
    noise = ChannelNoise(0.0, 0.0, 0.0, 0.0)
    return Recording(
        name="as defined",
        source=source,
        start=None,
        times=times,
        temperature_names=probes,
        probes=probes,
        temperature=np.full((2, len(probes)), temperature),
        flags=np.zeros((2, len(probes)), dtype=np.uint8),
        sigma=np.ones(len(probes)),
        noise=(noise,) * len(probes),
        input_names=tuple(inputs),
        input_columns=tuple(inputs),
        inputs=np.array(list(inputs.values())).reshape(-1, 2).T,
        held=np.ones(len(inputs), dtype=bool),
        input_units=tuple(units.get(name, "") for name in inputs),
        covariate_names=(),
        covariates=np.empty((2, 0)),
        covariate_units=(),
        segments=np.array([[0, 2]]),
        defects=DefectReport(
            name=source,
            rows=2,
            stamps=2,
            duration_s=DAY,
            rows_without_time=0,
            blank_rows=0,
            short_rows=0,
            truncated_last_row=False,
            unordered_rows=0,
            repeated_rows=0,
            conflicting_stamps=0,
            median_step_s=DAY,
            non_uniform_steps=0,
            gaps=(),
            long_gap_s=DAY,
            segments=1,
            unused_columns=(),
            channels=(),
        ),
    )
