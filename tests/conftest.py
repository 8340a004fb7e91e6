"""What tests of several folders share."""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import settings

from tests.support.written_texts import manifest_text

if TYPE_CHECKING:
    # the controller of the workers imports this file before they start
    import pandas as pd

# Modules and collected tests are millions of objects that stay: searching them for garbage again and again
# took a tenth of the processor time.
gc.set_threshold(50_000, 20, 20)
# Without compiled modules on disk every worker compiles the package and rewrites the assertions of all tests,
# and every command that a test starts compiles the package once more.
sys.dont_write_bytecode = False
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
# Seconds are asserted nowhere: a busy machine would fail what is right.
settings.register_profile("any machine", deadline=None)
settings.load_profile("any machine")


def pytest_collection_finish():
    """Keep modules and collected tests out of every later search for garbage."""
    gc.collect()
    gc.freeze()


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
    text = manifest_text("made", temperatures, inputs, data="made.csv", time="time")
    (folder / "recording.toml").write_text(text, encoding="utf-8")
    return folder


@pytest.fixture(scope="session")
def recorded_in() -> Callable[..., Path]:
    """Writer of a recording; see :func:`write_recording`."""
    return write_recording


@pytest.fixture
def unpictured(monkeypatch):
    """Sweeps without pictures and report, which take longer than a few small designs."""
    from spindle_fem.commands import sweep_command

    monkeypatch.setattr(sweep_command, "_pictured", lambda *told, **settings: {})
    monkeypatch.setattr(sweep_command, "write_sweep_report", lambda *told: None)
