"""Reduced model of a machine with geometry whose range holds what some recordings did."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.definition.uncertain_parameters import with_parameters
from spindle_fem.model.reduced.build_reduced import ReductionOptions, reduced_model_of
from spindle_fem.model.reduced.fast_model import FastModel
from spindle_fem.model.reduced.film_heat import FilmHeat, film_heat_of, operators_machine, tabulated_machine
from spindle_fem.model.reduced.spindle_inputs import fast_spindle
from spindle_fem.operation.friction_map import needs_map, tabulate_friction, thrusts_between
from spindle_fem.operation.kept_friction import kept_friction
from spindle_fem.recordings.align import Recording
from spindle_fem.recordings.input_limits import require_possible_inputs

Progress = Callable[[str], None]


def fast_model_for(
    spec: MachineSpec,
    recordings: Sequence[Recording],
    *,
    as_given: bool = False,
    progress: Progress = lambda stage: None,
) -> FastModel:
    """Reduced model whose range holds the speeds of some recordings.

    ``as_given`` says that the machine's coefficients will not be moved.

    Friction and ball contacts that follow their films are solved once over the
    speeds and thrusts of the recordings; the model's ``spec`` then has a heat
    table and constant ball rows, and a term among its own brings both to the
    film temperature of the moment.

    Raises
    ------
    SpecError
        Heat that follows expansion.
    RecordingError or FaultsError
        Inputs that the machine cannot take.
    """
    for recording in recordings:
        require_possible_inputs(spec, recording)
    options = options_for(spec, recordings)
    if not needs_map(spec):
        model = reduced_model_of(spec, options=options, as_given=as_given, progress=progress)
        return fast_spindle(model, spec)
    progress("friction over speed, thrust and film temperature")
    thrusts = thrusts_between(spec, *_recorded_range(recordings, "thrust", spec.operation.thrust))
    friction = tabulate_friction(spec, options.highest_speed_of(spec), thrusts, kept_friction)
    table = tabulated_machine(spec, friction)
    term = FilmHeat(friction, spec, table)
    made_of = operators_machine(table, term)
    model = reduced_model_of(made_of, options=options, as_given=as_given, progress=progress)
    return fast_spindle(model, table, (term,))


def options_for(spec: MachineSpec, recordings: Sequence[Recording]) -> ReductionOptions:
    """A range that ends at the highest recorded speed where that is beyond the definition's."""
    _, highest = _recorded_range(recordings, "speed", 0.0)
    options = ReductionOptions()
    if highest > options.highest_speed_of(spec) * (1.0 + 1e-6):
        options = ReductionOptions(highest_speed=highest)
    return options


def _recorded_range(recordings: Sequence[Recording], name: str, otherwise: float) -> tuple[float, float]:
    """Lowest and highest value of an input in all recordings that have it; speeds have no sign."""
    columns = [
        item.inputs[:, item.input_names.index(name)] for item in recordings if name in item.input_names
    ]
    if not columns:
        return otherwise, otherwise
    values = np.concatenate(columns)
    if name == "speed":
        values = np.abs(values)
    return float(np.nanmin(values)), float(np.nanmax(values))


def recentred_model(
    fast: FastModel, factors: Mapping[str, float], options: ReductionOptions, progress: Progress
) -> FastModel:
    """The machine with a reduced model made at the given factors."""
    terms = fast.inputs.extra_terms
    film_heat = film_heat_of(fast)
    made_of = fast.spec if film_heat is None else operators_machine(fast.spec, film_heat)
    model = reduced_model_of(with_parameters(made_of, factors), options=options, progress=progress)
    return fast_spindle(model, fast.spec, terms)
