"""A search for hidden states in one recording of the flawed network."""

from spindle_fem.effects.registry import catalogue, interval_effects
from spindle_fem.inference.hypothesis_fit import Problem
from spindle_fem.inference.hypothesis_search import Search
from spindle_fem.inference.opened_machine import open_machine
from spindle_fem.inference.predictor import Predictor
from spindle_fem.inference.prepared_problem import calibrate
from spindle_fem.inference.state_search import add_states
from spindle_fem.recordings.align import read_recording
from tests.support.flawed_network import MACHINE, record


def searched(folder, times, extra):
    """The machine, and a search that holds nothing missing and what switches beside it.

    ``extra`` heats the body, as :func:`tests.support.flawed_network.temperatures` takes it.
    """
    (folder / "drive.toml").write_text(MACHINE)
    run = record(folder / "run", 3, times=times, extra=extra)
    machine = open_machine(folder / "drive.toml", (), [read_recording(run)], [])
    predictor = Predictor(machine.fast, machine.recordings)
    calibrated = calibrate(None, predictor)
    problem = Problem(predictor, calibrated.known, calibrated.slow, predictor.observations)
    effects = catalogue()
    weights = {name: effect.prior_weight for name, effect in effects.items()}
    nothing = problem.fit()
    search = Search(problem, machine.view, effects, (), interval_effects(), weights, found={})
    search.keep(search.hypothesis(nothing))
    add_states(search, nothing)
    return machine, search
