"""What a calibration needs of a machine: predictions of a recording, and their derivatives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.uncertain_parameters import uncertain_parameters
from spindle_fem.model.lumped.thermal_network import Parameter, ThermalNetwork
from spindle_fem.model.reduced.defined_effects import NO_EFFECTS, ActiveEffects
from spindle_fem.model.reduced.drive import Drive, drive_of_recording, inputs_at
from spindle_fem.model.reduced.fast_model import FastModel
from spindle_fem.model.reduced.network_fast_model import NetworkFastModel
from spindle_fem.model.reduced.reduced_transient import FastTransient, simulate_fast
from spindle_fem.operation.coefficient_table import INNER_SHARE
from spindle_fem.recordings.align import Recording
from spindle_fem.solvers.simulate_network import initial_parameters, simulate_on_recording

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Prior:
    """One free parameter.

    Attributes
    ----------
    name : str
    value : float
        Most likely value before the data, in ``unit``.
    sigma_log : float
        One standard deviation of the natural logarithm.
    unit : str
    highest : float
        Factor on the value that cannot be passed; 1/0.5 for a share of one half.
    """

    name: str
    value: float
    sigma_log: float
    unit: str
    highest: float = np.inf


class Predictor(Protocol):
    """A machine with free parameters on its recordings."""

    priors: tuple[Prior, ...]
    recordings: tuple[Recording, ...]

    def predict(self, log_factors: Array, *, derivatives: bool = True) -> list[tuple[Array, Array]]:
        """Prediction (N, c) [K] and derivatives (N, c, p) [K] for every recording."""
        ...


class MachinePredictor:
    """A machine with geometry by its reduced model.

    Parameters
    ----------
    fast : FastModel
    recordings : sequence of Recording
    fixed : mapping of str to float
        Factors of parameters that stay as they are.
    effects : ActiveEffects
        Physics beyond the machine's own, as its definition has it.
    """

    def __init__(
        self,
        fast: FastModel,
        recordings: Sequence[Recording],
        fixed: Mapping[str, float] | None = None,
        effects: ActiveEffects = NO_EFFECTS,
    ) -> None:
        self.fast, self.effects = fast, effects
        self.recordings = tuple(recordings)
        self.fixed = dict(fixed or {})
        self.priors = tuple(
            Prior(
                item.name,
                item.value,
                item.sigma_log,
                item.unit,
                0.999 / item.value if item.name == INNER_SHARE else np.inf,
            )
            for item in uncertain_parameters(fast.spec)
            if item.name not in self.fixed
        )
        self.drives: tuple[Drive, ...] = tuple(drive_of_recording(fast.spec, r) for r in self.recordings)
        self.columns = [fast.require_channels(r.probes, r.source) for r in self.recordings]

    def initial_temperature(self, number: int) -> float:
        """Uniform temperature at the start of a recording, K."""
        recording = self.recordings[number]
        if self.fast.spec.initial == "ambient":
            return self.drives[number].first("ambient")
        return float(np.mean(list(recording.first_readings().values())))

    def predict(self, log_factors: Array, *, derivatives: bool = True) -> list[tuple[Array, Array]]:
        """Prediction and derivatives for every recording."""
        names = tuple(prior.name for prior in self.priors)
        factors = self.fixed | {
            name: float(value) for name, value in zip(names, np.exp(log_factors), strict=True)
        }
        found = []
        for number, drive in enumerate(self.drives):
            run = simulate_fast(
                self.fast,
                drive,
                self.initial_temperature(number),
                parameters=self.effects.times_parameters(factors),
                derivatives=names if derivatives else (),
                terms=self.effects.terms,
            )
            found.append(_readings(run, drive, self.recordings[number], self.columns[number], self.effects))
        return found


def _readings(
    run: FastTransient, drive: Drive, recording: Recording, columns: NDArray[np.int64], effects: ActiveEffects
) -> tuple[Array, Array]:
    """What the channels of a recording tell, and derivatives."""
    temperature, sensitivity = run.temperature[:, columns], run.sensitivity[:, columns]
    if not effects.readings:
        return temperature, sensitivity
    inputs = inputs_at(drive, recording.times)
    return effects.read(recording.temperature_names, recording.times, temperature, sensitivity, inputs)


class NetworkPredictor:
    """A network that the user wrote.

    The temperatures at the start of each recording are free, with the noise of
    their readings as prior; nodes that nothing reads are known to a few kelvin.

    Parameters
    ----------
    network : ThermalNetwork
    recordings : sequence of Recording
    initial : str
        As the machine's ``initial``.
    effects : ActiveEffects
        Physics beyond the network's own, as its definition has it.
    """

    def __init__(
        self,
        network: ThermalNetwork,
        recordings: Sequence[Recording],
        initial: str = "first_reading",
        effects: ActiveEffects = NO_EFFECTS,
    ) -> None:
        self.network, self.effects = network, effects
        self.recordings = tuple(recordings)
        self.initial = initial
        self.free = tuple(p for p in network.parameters if p.sigma_log > 0.0)
        starts = [
            initial_parameters(network, r) if initial == "first_reading" else () for r in self.recordings
        ]
        self.starts: tuple[tuple[Parameter, ...], ...] = tuple(starts)
        priors = [Prior(p.name, p.value, p.sigma_log, p.unit) for p in self.free]
        for number, items in enumerate(starts):
            label = f"[{number + 1}]" if len(starts) > 1 else ""
            priors += [Prior(f"{p.name}{label}", p.value, p.sigma_log, p.unit) for p in items]
        self.priors = tuple(priors)

    def predict(self, log_factors: Array, *, derivatives: bool = True) -> list[tuple[Array, Array]]:
        """Prediction and derivatives for every recording."""
        if self.effects.candidates:
            return self._predict_with_effects(log_factors, derivatives=derivatives)
        factors = np.exp(log_factors)
        own = {p.name: p.value * f for p, f in zip(self.free, factors, strict=False)}
        network = self.network.with_values(own)
        position = len(self.free)
        found = []
        for recording, items in zip(self.recordings, self.starts, strict=True):
            moved = tuple(replace(p, value=own[p.name]) for p in self.free)
            begun = tuple(
                replace(p, value=p.value * f) for p, f in zip(items, factors[position:], strict=False)
            )
            run = simulate_on_recording(network, recording, parameters=moved + begun, initial=self.initial)
            sensitivity = np.zeros((*run.predicted.shape, len(self.priors)))
            sensitivity[:, :, : len(moved)] = run.sensitivity[:, :, : len(moved)]
            sensitivity[:, :, position : position + len(begun)] = run.sensitivity[:, :, len(moved) :]
            position += len(begun)
            found.append((run.predicted, sensitivity))
        return found

    def _predict_with_effects(self, log_factors: Array, *, derivatives: bool) -> list[tuple[Array, Array]]:
        """By the fast model, which takes terms."""
        fast = NetworkFastModel(self.network)
        own = tuple(p.name for p in self.free)
        factors = np.exp(log_factors)
        position = len(own)
        found = []
        for recording, items in zip(self.recordings, self.starts, strict=True):
            begun = tuple(p.name for p in items)
            places = [*range(len(own)), *range(position, position + len(begun))]
            names = (*own, *begun)
            position += len(begun)
            values = dict(zip(names, factors[places].tolist(), strict=True))
            values = self.effects.times_parameters(values)
            asked = names if derivatives else ()
            drive = fast.drive(recording)
            start = fast.start(recording, drive, values, asked, kind=self.initial, initial=items)
            run = simulate_fast(
                fast, drive, start, parameters=values, derivatives=asked, terms=self.effects.terms
            )
            columns = fast.require_channels(recording.probes, recording.source)
            predicted, part = _readings(run, drive, recording, columns, self.effects)
            sensitivity = np.zeros((*predicted.shape, len(self.priors)))
            if derivatives:
                sensitivity[:, :, places] = part
            found.append((predicted, sensitivity))
        return found
