"""The function behind ``spindle-fem watch``."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from spindle_fem.studies.watch import Watching, alarms_a_month, duration, watch_recording


def watch(
    machine: str | Path,
    recording: str | Path,
    calibrate: Iterable[str | Path] = (),
    overrides: Iterable[str] = (),
    *,
    warm_up: str | None = None,
    false_alarms: str = "1/month",
    heartbeat: str | None = None,
    until_end: bool = False,
) -> Iterator[dict[str, Any]]:
    """Say when and where the readings of a recording that grows leave the machine's model.

    Parameters
    ----------
    machine : str or Path
        A definition or the name of one that ships; with geometry or a ``[network]``.
    recording : str or Path
        Manifest of the data that are written, or its folder.
    calibrate : iterable of str or Path
        Recordings of the same machine with nothing missing.
    overrides : iterable of str
        ``path=value`` texts.
    warm_up : str, optional
        Beginning of the recording that is taken as sound in place of calibration recordings: ``8 h``.
    false_alarms : str
        Rate at which a sound machine may be said to have left: ``1/month``.
    heartbeat : str, optional
        A line at least so often, by the recording's clock; at changes of the state only by default.
    until_end : bool
        Stop at the end of what is there, instead of waiting for more.

    Yields
    ------
    dict
        ``time``, ``state`` (``as modelled``, ``leaving``, ``left``), ``channel``, ``condition``,
        ``false_alarms_per_month``, ``departure_K`` (of a displacement ``departure_um``), ``evidence``.

    Raises
    ------
    SpindleFemError
    """
    how = Watching(
        tuple(calibrate),
        tuple(overrides),
        warm_up=0.0 if warm_up is None else duration(warm_up, "--warm-up"),
        alarms=alarms_a_month(false_alarms),
        heartbeat=float("inf") if heartbeat is None else duration(heartbeat, "--heartbeat"),
        until_end=until_end,
    )
    return watch_recording(machine, recording, how, progress=_say)


def _say(text: str) -> None:
    """Stages and defects, beside the lines of the watch."""
    print(text, file=sys.stderr, flush=True)
