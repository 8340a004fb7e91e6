"""Displacements of a recording beside its temperatures, as one table of readings that a fit explains."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from spindle_fem.recordings.align import Recording
from spindle_fem.recordings.channel_checks import Flag
from spindle_fem.units import MICROMETRES


def with_displacements(recording: Recording) -> Recording:
    """The recording with its displacements as the last of its readings, in micrometres.

    Every reader that works through the readings, their flags and noise then sees them too; columns named in
    ``displacement_names`` count from a constant of their own.
    """
    names = tuple(name for name in recording.displacement_names if name not in recording.temperature_names)
    if not names:
        return recording
    read = MICROMETRES * recording.displacements
    flags = np.where(np.isnan(read), int(Flag.MISSING), 0).astype(np.uint8)
    noise = tuple(
        replace(
            item,
            white=MICROMETRES * item.white,
            slow=MICROMETRES * item.slow,
            resolution=MICROMETRES * item.resolution,
            coarse_step=MICROMETRES * item.coarse_step,
        )
        for item in recording.displacement_noise
    )
    return replace(
        recording,
        temperature_names=(*recording.temperature_names, *names),
        probes=(*recording.probes, *recording.displacement_sensors),
        temperature=np.hstack([recording.temperature, read]),
        flags=np.hstack([recording.flags, flags]),
        sigma=np.append(recording.sigma, MICROMETRES * recording.displacement_sigma),
        noise=(*recording.noise, *noise),
    )
