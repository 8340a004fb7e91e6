"""Smaller bases on which hypotheses are searched and refitted: what the diagnosed recordings can excite."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from spindle_fem.effects.framework.effect import Candidate
from spindle_fem.effects.framework.machine_view import MachineView
from spindle_fem.inference import tuned
from spindle_fem.inference.predictor import Predictor
from spindle_fem.model.reduced.reduced_transient import TransientRun
from spindle_fem.parallel import in_copies, thread_count

Array = NDArray[np.float64]

# Draws of the machine's parameters whose states join the basis, the nominal one among them.
DRAWS = 4
# Standard deviations of the prior to either side of which they are drawn.
DRAWN_SIGMAS = 2.0
# Sensitivities join the basis at every fourth step: neighbours are similar.
EVERY_TANGENT = 4
# Rates of change of the heat at a place, 1/s: steady, and over about an hour and five minutes.
PLACE_RATES = (0.0, 3e-4, 3e-3)
# Heat at a place, W: what makes its temperatures weigh as much as the states.
PLACE_HEAT = 50.0


def smaller_predictors(
    predictor: Predictor, view: MachineView, candidates: Sequence[Candidate], read: Sequence[str] = ()
) -> tuple[Predictor, Predictor, frozenset[str]]:
    """The recordings on the bases of a search and of final fits, and the places where something may act.

    A network is small enough as it is.

    Parameters
    ----------
    candidates : sequence of Candidate
        Candidates of the search, beside heat at every spot of the view.
    read : sequence of str
        Further places that will be read.
    """
    known = acted_on(predictor, view, candidates) | ({*read} & {*predictor.fast.model.place_names})
    if predictor.is_network:
        return predictor, predictor, known
    contacts = sorted({name for own in view.joint_coefficients.values() for name in own})
    names = [prior.name for prior in predictor.uncertain()]
    return *on_smaller_bases(predictor, names, sorted(known), contacts), known


def acted_on(predictor: Predictor, view: MachineView, candidates: Sequence[Candidate]) -> frozenset[str]:
    """Places where candidates, and heat at every spot of a view, may act."""
    places = {p for named in (view.spots, view.sides) for own in named.values() for p in own}
    places |= {p for c in candidates for t in c.terms for p in (*t.reads, *t.heat_places)}
    return frozenset(places & {*predictor.fast.model.place_names})


def on_smaller_bases(
    predictor: Predictor, names: Sequence[str], places: Sequence[str], contacts: Sequence[str] = ()
) -> tuple[Predictor, Predictor]:
    """The recordings on the smaller bases that a search and final fits need.

    States and their sensitivities of every recording, with the machine's
    parameters at their prior values and two standard deviations to either
    side in a few combinations, what heat at every place leaves, and states
    with each contact all but opened.

    Parameters
    ----------
    names : sequence of str
        Parameters of the machine.
    places : sequence of str
        Where candidates put heat.
    contacts : sequence of str
        Coefficients that candidates scale one by one; parameters scale them together.
    """
    model = predictor.fast.model
    generator = np.random.default_rng(0)
    priors = predictor.fast.sigmas(names)
    usual, drawn = [], []
    for number in range(len(predictor.recordings)):
        usual.append(
            partial(_usual_snapshots, predictor, number, tuple(names), places if number == 0 else ())
        )
        for _ in range(1, DRAWS):
            signs = generator.choice((-DRAWN_SIGMAS, DRAWN_SIGMAS), len(names))
            factors = {n: float(np.exp(s * priors[n])) for n, s in zip(names, signs, strict=True)}
            drawn.append(partial(_rise, predictor, number, factors))
    opened = [partial(_rise, predictor, 0, {contact: tuned.OPENED_CONTACT}) for contact in contacts]
    found = in_copies([*usual, *drawn, *opened], thread_count())
    snapshots = [item for own in found[: len(usual)] for item in own]
    snapshots += found[len(usual) : len(usual) + len(drawn)]
    # States less those of the machine as it is: a share of them would drown the rest.
    snapshots += [item - snapshots[0] for item in found[len(usual) + len(drawn) :]]
    # The uniform field stays exactly: a share of it would be a share of 293 K.
    uniform = model.one / np.linalg.norm(model.one)
    rest = np.hstack([_scaled(item) for item in snapshots])
    rest -= np.outer(uniform, uniform @ rest)
    squares, vectors = np.linalg.eigh(rest @ rest.T)
    values, vectors = np.sqrt(np.maximum(squares[::-1], 0.0)), vectors[:, ::-1]

    def within(tolerance: float, same: float) -> Predictor:
        kept = int(np.sum(values > tolerance * values[0]))
        basis = np.column_stack((uniform, vectors[:, :kept]))
        spread = np.concatenate((values[:1], values[:kept]))
        return predictor.with_model(predictor.fast.projected(basis, spread), same)

    return within(tuned.SEARCH_BASIS, tuned.SAME_OPERATORS_WITHIN), within(tuned.FINAL_BASIS, 0.0)


def _rise(predictor: Predictor, number: int, factors: Mapping[str, float]) -> Array:
    """States of a recording above where it begins, (r, n)."""
    initial = predictor.start(number)
    states, _ = predictor.transient(number, factors).march(initial)
    return (states - initial * predictor.fast.model.one).T


def _usual_snapshots(
    predictor: Predictor, number: int, names: tuple[str, ...], places: Sequence[str]
) -> list[Array]:
    """States of a recording at the prior values of parameters, and what these and heat at places change."""
    initial, model = predictor.start(number), predictor.fast.model
    run = predictor.transient(number, {}, (), names)
    states, tracks = run.march(initial)
    tangent = run.tangents(run.forcing_of(states, tracks), tracks)
    found = [
        (states - initial * model.one).T,
        tangent[::EVERY_TANGENT].transpose(1, 0, 2).reshape(model.size, -1),
    ]
    return [*found, _place_snapshots(predictor, run, places)] if places else found


def _place_snapshots(predictor: Predictor, run: TransientRun, places: Sequence[str]) -> Array:
    """Temperatures that heat at each place leaves, steady and while it changes, (r, n)."""
    loads = np.array([predictor.fast.model.place(name) for name in places]).T
    found = []
    for key in run.groups:
        conduction = run.operators[key[0]].conduction
        for rate in PLACE_RATES:
            found.append(np.linalg.solve(conduction + rate * run.built.storage, PLACE_HEAT * loads))
    return np.hstack(found)


def _scaled(columns: Array) -> Array:
    """Columns divided by the root of their number: snapshots of each kind weigh the same together."""
    return columns / np.sqrt(max(columns.shape[1], 1))
