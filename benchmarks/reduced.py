"""The fast model: its error over the step test, and its times as ratios within one run.

    python benchmarks/reduced.py [--preset coarse] [--order 1] [--parameters 30]

The full model's transient is the reference; times are medians of several
runs, in process time so that other load on the machine counts little.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable

import numpy as np

from spindle_fem.coupling import prepare_machine
from spindle_fem.effects.term import Term, TermParameter
from spindle_fem.network.history import InputHistory
from spindle_fem.reduced.adjoint import fast_gradient
from spindle_fem.reduced.build import build_reduced_model
from spindle_fem.reduced.coefficients import free_parameters
from spindle_fem.reduced.drive import STANDARD, make_drive
from spindle_fem.reduced.fast_model import FastModel
from spindle_fem.reduced.transient import simulate_fast
from spindle_fem.spec.load import load_machine
from spindle_fem.transients.run import TransientOptions, simulate_full

RPM = np.pi / 30.0
HELD = np.array([True, True, False, False, True])
REPEATS = 5


class ThermalPreload(Term):
    """Heat that follows the difference of the rings: the shape of a nonlinear term that matters."""

    name = "preload"
    parameters = (TermParameter("gain", 2.0, 0.5, "W/K"),)
    heat_places = ("F2.inner_raceway", "F2.outer_raceway")
    reads = ("F2.inner_raceway", "F2.outer_raceway")

    def heat(self, context):
        """Half on either raceway."""
        difference = context.temperatures[0] - context.temperatures[1]
        half = 0.5 * context.parameters["gain"] * difference * context.inputs["speed"] / (3000.0 * RPM)
        return np.array([half, half])


class GapClosure(Term):
    """A seat that conducts better as its ring expands into it."""

    name = "closure"
    parameters = (TermParameter("slope", 0.05, 0.5, "1/K"),)
    coefficients = ("joint.F2.outer_ring|housing",)
    reads = ("F2.outer_ring|housing@0", "F2.outer_ring|housing@1")

    def factor(self, context):
        """Rises with the temperature step across the seat."""
        step = context.temperatures[0] - context.temperatures[1]
        return (1.0 + context.parameters["slope"] * step)[None]


def median_time(run: Callable[[], object]) -> float:
    """Median process time of a call, s."""
    run()
    times = []
    for _ in range(REPEATS):
        begin = time.process_time()
        run()
        times.append(time.process_time() - begin)
    return statistics.median(times)


def inputs(times: np.ndarray, speed: np.ndarray | float, spec) -> np.ndarray:
    """Standard inputs with constant surroundings."""
    operation = spec.operation
    columns = [
        speed,
        operation.thrust,
        operation.ambient_temperature,
        spec.coolant.inlet_temperature,
        spec.coolant.flow,
    ]
    return np.column_stack([np.broadcast_to(np.asarray(c, dtype=float), times.shape) for c in columns])


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--machine", default="recorded_spindle")
    parser.add_argument("--preset", default="coarse")
    parser.add_argument("--order", type=int, default=1)
    parser.add_argument("--parameters", type=int, default=30)
    options = parser.parse_args()
    overrides = [f"mesh.preset={options.preset}", f"mesh.order={options.order}"]
    spec = load_machine(options.machine, overrides)
    machine = prepare_machine(spec)
    begin = time.process_time()
    model = build_reduced_model(machine)
    built = time.process_time() - begin
    fast = FastModel(model, spec)
    checked = model.errors["probes"]
    print(f"{model.n_full} unknowns -> {model.size}, built in {built:.1f} s, checked {checked:.2g} K")

    times = np.arange(0.0, 10 * 2400.0 + 1.0, 10.0)
    values = inputs(times, np.minimum(np.floor(times / 2400.0), 9) * 500.0 * RPM, spec)
    samples = times[::6]
    begin = time.process_time()
    full = simulate_full(
        machine,
        InputHistory(times, STANDARD, values, HELD),
        sample_times=samples,
        options=TransientOptions(error=0.01),
    )
    full_time = time.process_time() - begin
    start = spec.operation.ambient_temperature
    drive = make_drive(times, STANDARD, values, HELD)
    run = simulate_fast(fast, drive, start)
    for probe in full.probes:
        error = np.abs(run.temperature[::6, fast.channels.index(probe)] - full.reading(probe)).max()
        print(f"  step test 0-4500 rpm, {probe}: {error:.2g} K")
    fast_time = median_time(lambda: simulate_fast(fast, drive, start))
    print(f"  full model {full_time:.1f} s; fast model {fast_time:.3f} s")

    times = np.arange(0.0, 4 * 3600.0 + 1.0, 10.0)
    speeds = np.array([0.0, 3000.0, 1500.0, 4000.0])[np.minimum(times // 3600.0, 3).astype(int)]
    drive = make_drive(times, STANDARD, inputs(times, speeds * RPM, spec), HELD)
    shared = list(free_parameters(spec))
    single = [f"joint.{name}" for name in model.contacts] + [f"heat.{name}" for name in fast.bearings]
    names = tuple((shared + single)[: options.parameters])
    factors = dict.fromkeys(names, 1.01)
    terms = (ThermalPreload(), GapClosure())
    plain = median_time(lambda: simulate_fast(fast, drive, start, parameters=factors))
    derived = median_time(lambda: simulate_fast(fast, drive, start, parameters=factors, derivatives=names))
    nonlinear = median_time(lambda: simulate_fast(fast, drive, start, parameters=factors, terms=terms))
    both = median_time(
        lambda: simulate_fast(fast, drive, start, parameters=factors, terms=terms, derivatives=names)
    )
    print(f"4 h at 10 s, {len(names)} live parameters: {plain:.3f} s, {1e6 * plain / 1440:.0f} us a step")
    print(f"  with all derivatives {derived:.3f} s, {derived / plain:.1f} times")
    ones = np.ones((times.size, len(fast.channels)))
    adjoint = median_time(lambda: fast_gradient(fast, drive, start, ones, names, parameters=factors))
    print(f"  gradient of a misfit (adjoint) {adjoint:.3f} s, {adjoint / plain:.1f} times")
    print(f"  with two nonlinear terms {nonlinear:.3f} s")
    print(f"  and all derivatives {both:.3f} s, {both / nonlinear:.1f} times")


if __name__ == "__main__":
    main()
