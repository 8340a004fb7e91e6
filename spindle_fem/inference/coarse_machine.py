"""A written network that cannot explain its own calibration recordings, and what would.

Options are one more node behind a node, a link that the file lacks, a film that grows with the temperature
difference, and a log of the inputs that ran on a clock of its own. Each is fitted to most of the
calibration's time and judged on the rest.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from spindle_fem.definition.effect_entries import EffectEntry
from spindle_fem.definition.network_tables import LinkSpec, NodeSpec
from spindle_fem.effects.framework.effect import Candidate
from spindle_fem.effects.framework.outside_film_law import OutsideFilmEffect
from spindle_fem.effects.registry import candidates_for, catalogue, definition_entry
from spindle_fem.errors import SpindleFemError
from spindle_fem.inference import tuned
from spindle_fem.inference.findings import candidate_values
from spindle_fem.inference.heldout import heldout_stamps
from spindle_fem.inference.hypothesis_fit import Fit, Problem
from spindle_fem.inference.input_clocks import other_clocks
from spindle_fem.inference.input_sampling import left_over_noise
from spindle_fem.inference.misdescription_columns import misdescriptions_of, with_misdescriptions
from spindle_fem.inference.opened_machine import DiagnosedMachine, with_network
from spindle_fem.inference.predictor import Predictor
from spindle_fem.inference.prepared_problem import expected_slow_error, known_before, slow_error_of
from spindle_fem.units import Uncertain

# Additions at most, and steps of the fit of each option.
MOST_ADDITIONS, STEPS = 2, 6
# Nothing is added that does not take this share off what is left on held-out time.
LEAST_GAIN = 0.1
# Capacity of a further node as a share of its neighbour's, conductances as a share of the usual one there,
# and the standard deviations of their logarithms: nothing is known of them.
SHARE, SPREAD = 0.3, 1.2


@dataclass(frozen=True, slots=True)
class Addition:
    """Structure or another clock, with what held-out time leaves over the noise before and with it."""

    statement: str
    left_before: float
    left_after: float


@dataclass(frozen=True, slots=True)
class TooCoarse:
    """A machine that cannot explain its own calibration.

    Attributes
    ----------
    left : float
        What its calibration leaves of the readings over their noise.
    additions : tuple of Addition
        What helps, in order; empty where nothing of what was tried does.
    left_with_them : float
        What the calibration leaves with all additions.
    """

    left: float
    additions: tuple[Addition, ...]
    left_with_them: float

    @property
    def statement(self) -> str:
        """Describe it in words."""
        text = (
            "The machine as it is written is too coarse: fitted to its own calibration recordings it leaves "
            f"{self.left:.1f} times their noise."
        )
        if not self.additions:
            return f"{text} No further node, link, film that grows with the difference or clock helps."
        words = "; ".join(item.statement for item in self.additions)
        first, last = self.additions[0].left_before, self.additions[-1].left_after
        return f"{text} With {words} it leaves {last:.1f} instead of {first:.1f} on held-out time."


@dataclass(frozen=True, slots=True)
class _Option:
    statement: str
    machine: DiagnosedMachine
    candidates: tuple[Candidate, ...] = ()
    # A wrong clock has misled the fit before: this one begins anew.
    anew: bool = False


def refined(machine: DiagnosedMachine) -> DiagnosedMachine:
    """The machine with structure added that helps to explain its calibration; unchanged if not applicable."""
    if not machine.is_network or not machine.calibration:
        return machine
    own, left, before = _fitted(machine)
    remaining = left
    if left <= tuned.COARSE_LEFT:
        return machine
    additions: list[Addition] = []
    while len(additions) < MOST_ADDITIONS:
        best: tuple[float, float, DiagnosedMachine, _Option, Fit] | None = None
        for option in _options(machine):
            try:
                fit, seen, after = _fitted(option.machine, option.candidates, None if option.anew else own)
            except SpindleFemError:
                # It cannot be simulated: no help.
                continue
            if best is None or after < best[0]:
                best = after, seen, _with_effects(option.machine, fit), option, fit
        if best is None or best[0] > (1.0 - LEAST_GAIN) * before:
            break
        additions.append(Addition(best[3].statement, before, best[0]))
        before, remaining, machine, _, own = best
    return replace(machine, too_coarse=TooCoarse(left, tuple(additions), remaining))


def _fitted(
    machine: DiagnosedMachine, candidates: tuple[Candidate, ...] = (), known: Fit | None = None
) -> tuple[Fit, float, float]:
    """Fit to most of the calibration's time; what that leaves over the noise there, and on the rest.

    ``known`` is the fit of the machine that this one extends: its slow error holds, and the fit
    begins from its values. In two rounds when None.
    """
    use = [~heldout_stamps(item)[0] for item in machine.calibration]
    unseen = machine.unseen[len(machine.recordings) :]
    predictor = Predictor(machine.fast, machine.calibration, use, machine.effects).with_unseen(unseen)
    predictor = with_misdescriptions(predictor, misdescriptions_of(predictor))
    slow = expected_slow_error(predictor) if known is None else known.slow
    problem = Problem(predictor, known_before(predictor), slow, predictor.observations)
    fit = problem.fit(candidates, None if known is None else known.values, iterations=STEPS)
    if known is None:
        predictor = with_misdescriptions(predictor, predictor.misdescribed, fit.values, candidates)
        slow = slow_error_of(problem, fit)
        problem = Problem(predictor, problem.belief, slow, predictor.observations)
        fit = problem.fit(candidates, fit.values, iterations=STEPS)
    predicted = [
        predictor.predict(number, fit.values, candidates).temperature
        for number in range(len(machine.calibration))
    ]
    own, rest = (
        left_over_noise(
            predictor,
            seen,
            [item.at(predicted[item.recording][:, item.channel]) for item in seen],
            fit.values,
        )
        for seen in (predictor.observations, predictor.heldout)
    )
    return fit, own, rest


def _with_effects(machine: DiagnosedMachine, fit: Fit) -> DiagnosedMachine:
    """The machine with the laws of a fit in its definition."""
    entries = tuple(
        EffectEntry.model_validate(definition_entry(item, candidate_values(item, fit.values)))
        for item in fit.candidates
    )
    if not entries:
        return machine
    return with_network(
        machine, machine.spec.model_copy(update={"effects": (*machine.spec.effects, *entries)})
    )


def _options(machine: DiagnosedMachine) -> Iterator[_Option]:
    """Other clocks, further nodes, links and laws, one at a time."""
    for statement, timed in other_clocks(machine):
        yield _Option(statement, timed, anew=True)
    spec, network = machine.spec, machine.spec.network

    def grown(node: NodeSpec | None, link: LinkSpec) -> DiagnosedMachine:
        nodes = network.node if node is None else (*network.node, node)
        own = network.model_copy(update={"node": nodes, "link": (*network.link, link)})
        return with_network(machine, spec.model_copy(update={"network": own}))

    names = [node.name for node in network.node]
    joined = {frozenset(link.between) for link in network.link}
    at: dict[str, float] = {}
    for link in network.link:
        for end in link.between:
            at[end] = at.get(end, 0.0) + link.conductance.value
    for node in network.node:
        number = sum(name.startswith(f"{node.name}_behind") for name in names) + 1
        new = f"{node.name}_behind_{number}"
        usual = at.get(node.name, 0.0)
        if usual > 0.0:
            yield _Option(
                f"one more node behind {node.name}",
                grown(
                    NodeSpec(name=new, capacity=Uncertain(SHARE * node.capacity.value, SPREAD)),
                    LinkSpec(between=(node.name, new), conductance=Uncertain(usual, SPREAD)),
                ),
            )
    others = [boundary.name for boundary in network.boundary]
    for pair in (*itertools.combinations(names, 2), *itertools.product(names, others)):
        if frozenset(pair) not in joined:
            usual = SHARE * min(at.get(end, np.inf) for end in pair)
            if np.isfinite(usual) and usual > 0.0:
                link = LinkSpec(between=pair, conductance=Uncertain(usual, SPREAD))
                yield _Option(f"a link from {pair[0]} to {pair[1]}", grown(None, link))
    present = {(entry.effect, entry.component) for entry in spec.effects}
    for candidate in candidates_for(machine.view):
        grows = isinstance(catalogue()[candidate.effect], OutsideFilmEffect)
        if grows and (candidate.effect, candidate.component) not in present:
            law = candidate.effect.replace("_", " ")
            yield _Option(f"{law} on {candidate.component}", machine, (candidate,))
