"""``log.txt`` of an output folder: what was run, its stages with their times, warnings, and how it ended."""

from __future__ import annotations

import logging
import platform
import shlex
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from spindle_fem import __version__
from spindle_fem.errors import SpindleFemError

LOG_FILE = "log.txt"
LOGGER = logging.getLogger("spindle_fem")
# Where Python sends warnings once ``logging.captureWarnings`` is on.
WARNINGS = logging.getLogger("py.warnings")
LINE = "%(asctime)s %(levelname)-7s %(message)s"


class _LogFile(logging.FileHandler):
    """A log that a full disk ends in silence: what fails besides has its own message."""

    def handleError(self, record: logging.LogRecord) -> None:  # noqa: N802 - the name that logging calls
        """Say nothing."""


@contextmanager
def logged_in(folder: Path) -> Iterator[None]:
    """Log to a folder while the block runs; what an earlier run wrote there stays above it."""
    handler = _LogFile(folder / LOG_FILE, encoding="utf-8")
    handler.setFormatter(logging.Formatter(LINE))
    for logger in (LOGGER, WARNINGS):
        logger.addHandler(handler)
    if LOGGER.level == logging.NOTSET:
        LOGGER.setLevel(logging.INFO)
    started = time.perf_counter()
    system = f"Python {platform.python_version()}, {platform.platform()}"
    LOGGER.info("spindle-fem %s (%s): %s", __version__, system, shlex.join(sys.argv))
    try:
        yield
    except BaseException as error:
        expected = isinstance(error, (SpindleFemError, KeyboardInterrupt))
        LOGGER.error("not finished: %s: %s", type(error).__name__, error, exc_info=not expected)
        raise
    else:
        LOGGER.info("done after %.1f s", time.perf_counter() - started)
    finally:
        for logger in (LOGGER, WARNINGS):
            logger.removeHandler(handler)
        with suppress(OSError):
            handler.close()
