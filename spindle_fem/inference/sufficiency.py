"""Whether a recording has enough information to be diagnosed at all."""

from __future__ import annotations

import numpy as np
from scipy.linalg import eigh

from spindle_fem.inference.opened_machine import DiagnosedMachine
from spindle_fem.inference.predictor import Predictor

# Readings, or what the model predicts, must move by this many times the noise.
EXCITED_SIGMAS = 6.0
# Readings that the best channel must have.
FEWEST_READINGS = 30
# One-sided 95 % of a normal distribution.
ONE_SIDED_SIGMAS = 1.645
# Share of the final answer to a step after one time constant, 1 - 1/e.
REACHED = 0.632


def says_too_little(machine: DiagnosedMachine) -> str:
    """Why the recordings cannot be diagnosed; empty where they can.

    A recording must hold readings, last longer than the machine needs to
    answer, and move either the readings or the model by more than the noise.
    """
    reasons = []
    for recording in machine.recordings:
        if not recording.temperature_count:
            return f'"{recording.name}" has no channel of role "temperature": there is nothing to explain.'
        usable = int(recording.usable.sum(axis=0).max(initial=0))
        if usable < FEWEST_READINGS:
            reasons.append(
                f'"{recording.name}" has {usable} usable readings in its best channel; '
                f"at least {FEWEST_READINGS} are needed."
            )
            continue
        predictor = Predictor(machine.fast, [recording], effects=machine.effects)
        duration = float(recording.times[-1] - recording.times[0])
        # A network whose values are guesses may be that much quicker than its nominal values say.
        needed = response_time(predictor) / prior_factor(predictor)
        if duration < needed:
            reasons.append(
                f'"{recording.name}" lasts {duration / 60.0:.3g} min, but the machine needs '
                f"{needed / 60.0:.3g} min to answer a change at the probes by 63 %: "
                "causes that act at different speeds cannot be told apart."
            )
            continue
        predicted = predictor.predict(0, {}).temperature
        moved = float((np.ptp(predicted, axis=0) / recording.sigma).max())
        spread = [
            np.ptp(np.quantile(recording.temperature[recording.usable[:, k], k], [0.02, 0.98]))
            / recording.sigma[k]
            for k in range(len(recording.temperature_names))
            if recording.usable[:, k].any()
        ]
        if moved < EXCITED_SIGMAS and max(spread, default=0.0) < EXCITED_SIGMAS:
            reasons.append(
                f'"{recording.name}" holds no excitation: no reading moves by more than '
                f"{EXCITED_SIGMAS:g} times its noise, nor should it by the model."
            )
    return " ".join(reasons) if len(reasons) == len(machine.recordings) else ""


def prior_factor(predictor: Predictor) -> float:
    """Factor (95 % bound) by which the priors allow a machine to be quicker than nominal, at least 1."""
    sigmas: dict[str, list[float]] = {"capacity": [], "conductance": []}
    if predictor.is_network:
        for prior in predictor.uncertain():
            kind = prior.name.partition(".")[0]
            if kind in sigmas:
                sigmas[kind].append(prior.sigma_log)
    # A time constant is a capacity over a conductance.
    variance = sum(float(np.median(values)) ** 2 for values in sigmas.values() if values)
    return float(np.exp(ONE_SIDED_SIGMAS * np.sqrt(variance)))


def response_time(predictor: Predictor) -> float:
    """Time in which the probes reach 63 % of the response to a step of all heat, median over the probes [s].

    From the modes of the machine at its mean operating point.
    """
    run = predictor.transient(0, {})
    counts = np.bincount(predictor.drives[0].step_class, weights=predictor.drives[0].steps)
    operators = run.operators[int(np.argmax(counts))]
    rates, modes = eigh(operators.conduction, run.built.storage)
    heat = operators.loads[:, : len(predictor.fast.heat_places)].sum(axis=1)
    gains = (operators.outputs[predictor.columns[0]] @ modes) * (modes.T @ heat)
    found = []
    for gain in gains:
        final = float(np.sum(gain / rates))
        if abs(final) < 1e-12:
            continue
        low, high = 0.0, 20.0 / float(rates[0])
        for _ in range(60):
            middle = 0.5 * (low + high)
            answer = float(np.sum(gain / rates * -np.expm1(-rates * middle))) / final
            low, high = (low, middle) if answer > REACHED else (middle, high)
        found.append(high)
    return float(np.median(found)) if found else 0.0
