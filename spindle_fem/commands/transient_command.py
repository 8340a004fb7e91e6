"""A transient study from its file to its folder."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from spindle_fem.definition.load import load_machine
from spindle_fem.model.reduced.defined_effects import physics_of
from spindle_fem.report.transient_report import write_transient
from spindle_fem.results.output_folder import output_folder
from spindle_fem.solvers.coupled_steady import prepare_machine
from spindle_fem.solvers.saved_state import load_state
from spindle_fem.studies.transient_study import load_study, run_study


def run_transient_study(
    study: str | Path,
    folder: str | Path,
    *,
    machine: str | Path | None = None,
    overrides: Iterable[str] = (),
    restart: str | Path | None = None,
    progress: Callable[[str], None] = lambda stage: None,
) -> dict[str, Any]:
    """Run a transient study by the full model and write what came of it.

    Parameters
    ----------
    study : str or Path
        File with ``schema = "spindle-fem/transient/1"``.
    folder : str or Path
        Gets ``transient.csv``, ``transient.json``, ``state.npz``,
        ``machine.toml``, ``figures/*.png`` and ``report.html``.
    machine : str or Path, optional
        In place of the study's own.
    overrides : iterable of str
        ``path=value`` texts for the machine.
    restart : str or Path, optional
        ``state.npz`` of an earlier run on the same mesh, to go on from.
    progress : callable, optional
        Told each stage by name as it begins.

    Returns
    -------
    dict
        The content of ``transient.json``.
    """
    asked = load_study(study)
    start, memory = (None, None) if restart is None else load_state(restart)
    spec = load_machine(asked.machine if machine is None else machine, overrides)
    with output_folder(folder) as place:
        prepared = prepare_machine(spec, progress=progress)
        physics = physics_of(prepared)
        result = run_study(prepared, asked, start=start, memory=memory, physics=physics, progress=progress)
        return write_transient(prepared, result, place)
