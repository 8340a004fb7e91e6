"""Amount of terminal output of a command: errors alone, results and progress, or every stage as a line."""

from __future__ import annotations

import logging
import sys

from spindle_fem.results.run_log import LINE, LOGGER, WARNINGS


class Verbosity:
    """Choice for this command."""

    quiet = False
    verbose = False


def choose_verbosity(*, quiet: bool, verbose: bool) -> None:
    """Set the verbosity of this process; warnings go to the log, and to the terminal when verbose."""
    Verbosity.quiet, Verbosity.verbose = quiet, verbose
    logging.captureWarnings(True)
    for logger in (LOGGER, WARNINGS):
        logger.handlers = [item for item in logger.handlers if not isinstance(item, _Terminal)]
        if verbose:
            handler = _Terminal(sys.stderr)
            handler.setFormatter(logging.Formatter(LINE))
            logger.addHandler(handler)
    if verbose:
        LOGGER.setLevel(logging.INFO)


class _Terminal(logging.StreamHandler):
    """The lines of ``--verbose``."""
