"""A fast model whose bearings follow expansion along some recordings."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.inference.predictor import Predictor
from spindle_fem.model.reduced.defined_effects import ActiveEffects
from spindle_fem.model.reduced.fast_model import FastModel
from spindle_fem.model.reduced.film_heat import film_heat_of
from spindle_fem.model.reduced.followed_preload import FollowedPreload, MountedRun, sample_preload
from spindle_fem.model.reduced.spindle_inputs import fast_spindle
from spindle_fem.operation.friction_map import film_temperature
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
    plain = film_heat_of(fast)

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
    term = film_heat_of(predictor.fast)
    preload = None if term is None else term.preload
    if preload is None:
        return {}
    found = preload.preload(predictor.fast.model, _run(predictor, number, factors))
    return dict(zip(predictor.fast.bearings, found.T, strict=True))


def require_solved_friction(
    fast: FastModel,
    recordings: Sequence[Recording],
    effects: ActiveEffects,
    factors: Mapping[str, float] | None = None,
) -> None:
    """Refuse recordings along which bearings of assembly size come to a state without equilibrium.

    Raises
    ------
    NoEquilibriumError, OutOfValidityError
        As the friction map has it.
    """
    term = film_heat_of(fast)
    # Bearings that follow expansion are solved in the states that they have.
    if term is None or term.preload is not None or not term.friction_map.refused:
        return
    predictor = Predictor(fast, recordings, effects=effects, at_stamps=True)
    sides = np.array([term.read_row(fast.model, name) for name in term.reads])
    for number in range(len(recordings)):
        run = _run(predictor, number, factors or {})
        temperatures = (sides @ run.unknowns.T).reshape(-1, 3, len(run.times)).swapaxes(0, 1)
        term.friction_map.require_solved(run.speed, run.thrust, film_temperature(*temperatures))


def _run(predictor: Predictor, number: int, factors: Mapping[str, float]) -> MountedRun:
    """One recording's run; inputs that jump meet the state with both of their values."""
    states, drive = predictor.predict(number, factors).states, predictor.drives[number]
    unknowns = np.concatenate((states[:-1], states[1:]))
    speed, thrust = (
        np.concatenate((drive.start[:, column], drive.end[:, column]))
        for column in (drive.names.index("speed"), drive.names.index("thrust"))
    )
    return MountedRun(np.concatenate((drive.grid[:-1], drive.grid[1:])), unknowns, speed, thrust)
