"""What tests of several folders share."""

from collections.abc import Callable, Mapping
from pathlib import Path

import pandas as pd
import pytest

HEAD = """
schema = "spindle-fem/recording/1"
name = "made"
data = "made.csv"
time = {column = "time", unit = "s"}
"""
READ = """
[[channel]]
column = "%s"
role = "temperature"
probe = "%s"
unit = "degC"
sigma = 0.1
"""
DRIVEN = """
[[channel]]
column = "%s"
role = "input"
drives = "%s"
unit = "%s"
hold = "%s"
"""
# Unit of an input and how it goes on between two stamps.
INPUTS = {
    "speed": ("rpm", "previous"),
    "thrust": ("N", "previous"),
    "power": ("W", "previous"),
    "ambient": ("degC", "linear"),
    "coolant_inlet": ("degC", "linear"),
}


def write_recording(
    folder: Path, frame: pd.DataFrame, temperatures: Mapping[str, str], inputs: Mapping[str, str]
) -> Path:
    """A recording in a folder: column ``time`` in s, noise of 0.1 K.

    Parameters
    ----------
    folder : Path
        Made when it is missing.
    frame : DataFrame
    temperatures : mapping of column to probe
        In °C.
    inputs : mapping of column to input
        In the units of ``INPUTS``.
    """
    folder.mkdir(exist_ok=True)
    frame.to_csv(folder / "made.csv", index=False)
    channels = [READ % item for item in temperatures.items()]
    channels += [DRIVEN % (column, name, *INPUTS[name]) for column, name in inputs.items()]
    (folder / "recording.toml").write_text("".join([HEAD, *channels]), encoding="utf-8")
    return folder


@pytest.fixture(scope="session")
def recorded_in() -> Callable[..., Path]:
    """Writer of a recording; see :func:`write_recording`."""
    return write_recording
