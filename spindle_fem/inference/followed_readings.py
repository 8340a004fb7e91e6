"""Readings that fits predict, with states and moments that all readings tell, to judge between sets."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from spindle_fem.inference import tuned
from spindle_fem.inference.belief import GivenUp
from spindle_fem.inference.followed_states import InferredState
from spindle_fem.inference.hypothesis import Hypothesis
from spindle_fem.inference.hypothesis_fit import Fit, Problem
from spindle_fem.inference.input_sampling import error_over_noise, left_over_noise
from spindle_fem.inference.like_sets import only_size_free
from spindle_fem.inference.observations import Observation
from spindle_fem.inference.reading_noise import ChannelBins
from spindle_fem.inference.set_problems import SetProblems
from spindle_fem.inference.unseen_moments import unread_changes, unseen_moments
from spindle_fem.inference.worker_processes import Workers, of_candidates

Array = NDArray[np.float64]

# Steps of a fit about states that all readings tell: it begins near its end.
FOLLOWED_STEPS = 8


@dataclass(frozen=True, slots=True)
class Followed:
    """A fit with states and moments that all readings tell.

    Attributes
    ----------
    states : mapping of str to InferredState
        Hidden states, by the name of their amplitude.
    """

    fit: Fit
    states: Mapping[str, InferredState] = field(default_factory=dict)


class FollowedReadings:
    """Predicted readings of fits, and residuals of single readings.

    Parameters
    ----------
    problems : SetProblems
        With effects, each set its own, and with nothing missing.
    follow : callable
        Hidden states of a fit from all readings, as :func:`inferred_states` gives them.
    """

    def __init__(
        self,
        problems: SetProblems,
        follow: Callable[[Fit], Mapping[str, InferredState]] = lambda fit: {},
    ) -> None:
        self._problems, self._plant = problems, problems.first.predictor
        self._slow, self._belief = problems.first.slow, problems.first.belief
        self._follow = follow
        self._known: dict[int, tuple[Fit, list[Array]]] = {}
        self._followed: dict[int, tuple[Fit, Followed]] = {}
        self._given: dict[int, tuple[Fit, GivenUp]] = {}
        self._heldout: dict[int, tuple[Fit, float | None]] = {}

    def work_out(self, fits: Sequence[Fit], workers: Workers) -> None:
        """Know what all fits say of all readings, worked out side by side."""
        found = workers.beside([partial(self._worked_out, fit) for fit in fits])
        for fit, (own, predicted, heldout) in zip(fits, found, strict=True):
            followed = Followed(fit)
            if own is not None:
                members = zip(fit.candidates, own.fit.candidates, strict=True)
                same = [c if own.states.get(c.amplitude) is None else new for c, new in members]
                followed = replace(own, fit=of_candidates(own.fit, same))
            self._followed[id(fit)] = fit, followed
            self._known[id(followed.fit)] = followed.fit, predicted
            self._heldout[id(fit)] = fit, heldout

    def _worked_out(self, fit: Fit) -> tuple[Followed | None, list[Array], float | None]:
        followed = self.followed(fit)
        moved = None if followed.fit is fit else followed
        return moved, self._predicted(followed.fit), self.heldout_misfit(fit)

    def apart(self, one: Fit, other: Fit) -> float:
        """Root mean square of the difference over the noise, in the channel where it is largest."""
        largest = 0.0
        for item, first, second in zip(self._plant.observations, self._of(one), self._of(other), strict=True):
            slow = self._slow.of(item.bins.key).sigma if item.bins.is_relative else self._slow.sigma
            noise = np.hypot(self._plant.recordings[item.recording].sigma[item.channel], slow)
            apart = first - second
            if item.bins.is_relative:
                apart = apart - apart.mean()
            largest = max(largest, float(np.sqrt(np.mean(apart**2))) / float(noise))
        return largest

    def left(self, fit: Fit) -> float:
        """Root mean square residual of single readings over their noise, all channels weighted equally.

        What a fit gives up of the calibration's readings is left of those.
        """
        return self._left_of(self._plant.observations, fit)

    def residuals(self, fit: Fit) -> list[tuple[ChannelBins, Array]]:
        """Predicted less read, K, averaged over the bins of every observation that was fitted."""
        seen = self._plant.observations
        predicted = self._predicted_by_all(fit, seen)
        return [(item.bins, values - item.values) for item, values in zip(seen, predicted, strict=True)]

    def beyond(self, fit: Fit) -> float:
        """Residual of held-out readings likewise; switching states follow all readings."""
        if not self._plant.heldout:
            return 0.0
        return self._left_of(self._plant.heldout, fit)

    def _left_of(self, seen: Sequence[Observation], fit: Fit) -> float:
        left = left_over_noise(self._plant, seen, self._predicted_by_all(fit, seen), fit.values)
        return float(np.sqrt(left**2 + self._given_up(fit).left))

    def left_with(self, followed: Followed) -> float:
        """What these states leave of all readings, held-out ones included, over their noise."""
        seen = (*self._plant.observations, *self._plant.heldout)
        predicted = self._predicted(followed.fit)
        values = [item.at(predicted[item.recording][:, item.channel]) for item in seen]
        return left_over_noise(self._plant, seen, values, followed.fit.values)

    def heldout_misfit(self, fit: Fit) -> float | None:
        """Minus twice the logarithm of their likelihood after the fitted ones, with the best set's error.

        With that of the calibration's readings: a fit that gives them up to tell others predicts less.
        """
        if id(fit) not in self._heldout:
            self._heldout[id(fit)] = fit, self._heldout_misfit(fit)
        return self._heldout[id(fit)][1]

    def _heldout_misfit(self, fit: Fit) -> float | None:
        predictor = self._problems.of(fit).predictor
        if not predictor.heldout:
            return None
        held = Problem(predictor, self._belief, self._slow, predictor.heldout)
        return self._given_up(fit).misfit + held.averaged_misfit(self.followed(fit).fit)

    def _predicted_by_all(self, fit: Fit, seen: Sequence[Observation]) -> list[Array]:
        """Predicted readings with states and moments that follow all readings."""
        followed = self.followed(fit)
        predicted = self._predicted(followed.fit)
        return [item.at(predicted[item.recording][:, item.channel]) for item in seen]

    def followed(self, fit: Fit) -> Followed:
        """The fit with states and moments that all readings tell, held-out ones included.

        Where a state is not known within a held-out block, the readings after it miss its heat, and a fit
        without it makes up for that: sizes and laws are fitted again, to the same readings as before.
        """
        if id(fit) not in self._followed:
            states = self._follow(fit)
            found = self.with_states(fit, states)
            hidden = {c.amplitude for c in fit.candidates if only_size_free(c)}
            if not states.keys() <= hidden:
                # Intervals with edges of their own stay as they were fitted where that leaves less.
                fitted = {name: state for name, state in states.items() if name in hidden}
                found = min(self.with_states(fit, fitted), found, key=self.left_with)
            self._followed[id(fit)] = fit, found
        return self._followed[id(fit)][1]

    def with_states(self, fit: Fit, states: Mapping[str, InferredState]) -> Followed:
        """The fit with these hidden states, and with moments that all readings tell."""
        again = fit
        if states:
            own = [states.get(c.amplitude) for c in fit.candidates]
            chosen = tuple(
                c if state is None else state.fitted or state.candidate
                for c, state in zip(fit.candidates, own, strict=True)
            )
            again = self._problems.of(fit).fit(chosen, fit.values, iterations=FOLLOWED_STEPS)
        predictor = self._problems.of(fit).predictor
        moments = unseen_moments(predictor, again) | unread_changes(predictor, again)
        if moments:
            moved = [
                c.of(moments[c.name]) if c.name in moments else u
                for c, u in zip(again.coordinates, again.position, strict=True)
            ]
            again = replace(again, position=np.array(moved))
        return Followed(again, states)

    def kept(self, hypotheses: Sequence[Hypothesis]) -> list[Hypothesis]:
        """Sets without those that predict held-out readings worse than some of their effects alone.

        By the mean square, in which a false event shows however short, unless most readings are told better:
        where the machine starts anew within a held-out stretch, what is left for a while hides all else.
        """
        error = {id(h): self._heldout_error(h.fit) for h in hypotheses}

        def worse(one: Hypothesis, other: Hypothesis) -> bool:
            mostly = self.beyond(one.fit) > (1.0 - tuned.LEAST_IMPROVEMENT) * self.beyond(other.fit)
            return error[id(one)] > tuned.WORSE_HELDOUT * error[id(other)] and mostly

        return [h for h in hypotheses if not any(o.keys < h.keys and worse(h, o) for o in hypotheses)]

    def _heldout_error(self, fit: Fit) -> float:
        """Root mean square error of held-out readings over their noise, with what is given up of others."""
        held = self._plant.heldout
        if not held:
            return 0.0
        error = error_over_noise(held, self._predicted_by_all(fit, held))
        return float(np.sqrt(error + self._given_up(fit).error))

    def _given_up(self, fit: Fit) -> GivenUp:
        """What a fit gives up of the calibration's readings."""
        known = self._belief
        if known.earlier is None:
            return GivenUp()
        if id(fit) not in self._given:
            own = fit.position[: len(known.coordinates)]
            self._given[id(fit)] = fit, known.earlier.given_up(known.coordinates, own)
        return self._given[id(fit)][1]

    def _of(self, fit: Fit) -> list[Array]:
        predicted = self._predicted(fit)
        return [item.at(predicted[item.recording][:, item.channel]) for item in self._plant.observations]

    def _predicted(self, fit: Fit) -> list[Array]:
        if id(fit) not in self._known:
            predictor = self._problems.of(fit).predictor
            predicted = [
                predictor.predict(number, fit.values, fit.candidates).temperature
                for number in range(len(self._plant.recordings))
            ]
            # The fit is kept so that no other takes its identity.
            self._known[id(fit)] = fit, predicted
        return self._known[id(fit)][1]
