"""The function behind ``spindle-fem crosscheck``."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from spindle_fem.definition.load import load_machine, write_machine
from spindle_fem.report.crosscheck_charts import write_crosscheck_figures
from spindle_fem.report.crosscheck_report import write_crosscheck_report
from spindle_fem.results.output_folder import output_folder, replace_text
from spindle_fem.results.run_log import LOGGER
from spindle_fem.studies.crosscheck.crosscheck_study import Crosscheck, crosscheck
from spindle_fem.studies.crosscheck.network_files import export_network


def crosscheck_machine(
    machine: str | Path,
    folder: str | Path,
    overrides: Iterable[str] = (),
    progress: Callable[[str], None] | None = None,
    keep: Callable[[Crosscheck], None] = lambda found: None,
) -> dict[str, Any]:
    """Build the paper's network of a machine, solve it and the FEM, and explain their differences.

    Writes ``crosscheck.json``, ``figures/*.png``, ``report.html``,
    ``reduced_network.toml``, ``state_space.npz``, ``state_space.json`` and
    ``machine.toml``.

    Parameters
    ----------
    machine : str or Path
        A definition with geometry, or the name of one that ships.
    folder : str or Path
        Made when missing; complete, or marked incomplete.
    overrides : iterable of str
        ``path=value`` texts.
    progress : callable, optional
        Called with the name of each stage as it begins.
    keep : callable, optional
        Given what was found.

    Returns
    -------
    dict
        The content of ``crosscheck.json``.

    Raises
    ------
    SpindleFemError
        Bad input, or a model that has no solution.
    """
    tell = progress or LOGGER.info
    spec = load_machine(machine, overrides)
    with output_folder(folder) as place:
        found = crosscheck(spec, tell)
        keep(found)
        content = found.content
        content["matched"]["files"] = export_network(found.matched, place, found.points, found.heat_model)
        tell("pictures and report")
        replace_text(place / "machine.toml", write_machine(spec))
        replace_text(place / "crosscheck.json", json.dumps(content, indent=2, ensure_ascii=False))
        write_crosscheck_figures(place, found)
        write_crosscheck_report(place)
    return content
