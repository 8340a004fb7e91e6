"""A fast model whose bearings follow expansion along some recordings."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.inference.predictor import Predictor
from spindle_fem.model.reduced.defined_effects import ActiveEffects
from spindle_fem.model.reduced.fast_model import FastModel
from spindle_fem.model.reduced.film_heat import FilmHeat
from spindle_fem.model.reduced.followed_preload import FollowedPreload, MountedRun, sample_preload
from spindle_fem.model.reduced.spindle_inputs import fast_spindle
from spindle_fem.recordings.align import Recording

Array = NDArray[np.float64]


def with_followed_preload(
    spec: MachineSpec,
    fast: FastModel,
    recordings: Sequence[Recording],
    effects: ActiveEffects,
    factors: Mapping[str, float] | None = None,
    *,
    progress: Callable[[str], None] = lambda stage: None,
) -> tuple[FastModel, float]:
    """The fast model with preload followed, and the largest relative error of friction between samples.

    Parameters
    ----------
    spec : MachineSpec
        That follows preload.
    fast : FastModel
        Of the same machine at the size of assembly.
    factors : mapping of str to float, optional
        Of the machine's parameters in the runs.

    Raises
    ------
    ConvergenceError
        The bearings have no equilibrium where a run goes.
    """
    (plain,) = (term for term in fast.inputs.extra_terms if isinstance(term, FilmHeat))

    def followed(preload: FollowedPreload | None) -> FastModel:
        if preload is None:
            return fast
        return fast_spindle(fast.model, fast.spec, (plain.with_preload(preload, fast.spec),))

    def march(preload: FollowedPreload | None) -> list[MountedRun]:
        predictor = Predictor(followed(preload), recordings, effects=effects, at_stamps=True)
        return [_run(predictor, number, factors or {}) for number in range(len(recordings))]

    preload, error = sample_preload(spec, fast.model, plain.friction_map, march, progress)
    return followed(preload), error


def preload_along(predictor: Predictor, number: int, factors: Mapping[str, float]) -> dict[str, Array]:
    """Preload of every bearing along one recording, (2 G,) N each; empty where bearings keep their size.

    At the starts of all steps, then at their ends.
    """
    terms = (term for term in predictor.fast.inputs.extra_terms if isinstance(term, FilmHeat))
    preload = next((term.preload for term in terms if term.preload is not None), None)
    if preload is None:
        return {}
    found = preload.preload(predictor.fast.model, _run(predictor, number, factors))
    return dict(zip(predictor.fast.bearings, found.T, strict=True))


def _run(predictor: Predictor, number: int, factors: Mapping[str, float]) -> MountedRun:
    """One recording's run; inputs that jump meet the state with both of their values."""
    states, drive = predictor.predict(number, factors).states, predictor.drives[number]
    unknowns = np.concatenate((states[:-1], states[1:]))
    speed, thrust = (
        np.concatenate((drive.start[:, column], drive.end[:, column]))
        for column in (drive.names.index("speed"), drive.names.index("thrust"))
    )
    return MountedRun(np.concatenate((drive.grid[:-1], drive.grid[1:])), unknowns, speed, thrust)
