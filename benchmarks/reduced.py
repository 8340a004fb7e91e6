"""The fast model: its error against the full model, and its times.

    python benchmarks/reduced.py [--machine recorded_spindle] [--preset coarse] [--order 2] [--whole]

The full model is the reference: the step test 0-4500 rpm by 500, 40 min each or, with ``--whole``,
each until the probes have settled, then switched off for 4 h. Times are medians of
several runs, in process time so that other load on the machine counts little.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from spindle_fem.definition.load import load_machine, read_toml
from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.effects.framework.term import Term, TermParameter
from spindle_fem.model.reduced.drive import STANDARD, make_drive
from spindle_fem.model.reduced.fast_model import FastModel
from spindle_fem.model.reduced.recorded_model import fast_model_for
from spindle_fem.model.reduced.reduced_transient import TransientRun, simulate_fast
from spindle_fem.model.reduced.run_start import Start
from spindle_fem.operation.coefficient_table import free_parameters
from spindle_fem.solvers.prepared_machine import PreparedMachine, prepare_machine
from spindle_fem.studies.transient_study import StudyResult, run_study, study_of

RPM = np.pi / 30.0
HELD = np.array([True, True, False, False, True])
REPEATS = 5
STEP_TEST = Path(__file__).parents[1] / "studies" / "step_test.toml"
SWITCHED_OFF = {"name": "switched off", "speed": "0 rpm", "thrust": "0 N", "duration": "4 h"}


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


def step_test(machine: PreparedMachine, *, whole: bool) -> StudyResult:
    """The step test by the full model, and the cool-down after it."""
    content = read_toml(STEP_TEST)
    content["error"] = "0.01 K"
    if not whole:
        for phase in content["phase"]:
            phase["duration"] = "40 min"
    content["phase"].append(SWITCHED_OFF)
    return run_study(machine, study_of(content))


def fast_step_test(fast: FastModel, result: StudyResult) -> tuple[np.ndarray, np.ndarray]:
    """Step test by the fast model in steps of 10 s, (n, c) K, and which samples belong to the cool-down."""
    samples = result.joined("times")
    times = np.union1d(np.arange(0.0, samples[-1], 10.0), samples)
    owner = np.searchsorted([phase.start for phase in result.phases], times, side="right") - 1
    points = [result.phases[i].point for i in owner]
    values = np.array(
        [
            (p.speed, p.thrust, p.ambient_temperature, p.coolant_inlet_temperature, p.coolant_flow)
            for p in points
        ]
    )
    drive = make_drive(times, STANDARD, values, np.ones(len(STANDARD), dtype=bool))
    run = simulate_fast(fast, drive, points[0].ambient_temperature)
    at = np.searchsorted(times, samples)
    return run.temperature[at], samples > result.phases[-1].start


def report_step_test(fast: FastModel, machine: PreparedMachine, *, whole: bool) -> None:
    """Errors of the fast model at every probe."""
    begin = time.process_time()
    result = step_test(machine, whole=whole)
    spent = time.process_time() - begin
    for phase in result.phases:
        length, steps = (phase.end - phase.start) / 3600.0, len(phase.transient.steps.sizes)
        told = "" if phase.settled is None else ", settled" if phase.settled else ", NOT settled"
        print(f"  {phase.name:>12}: {length:.2f} h, {steps} steps{told}")
    found, off = fast_step_test(fast, result)
    full = result.joined("readings")
    for column, probe in enumerate(result.phases[0].transient.probes):
        error = np.abs(found[:, fast.channels.index(probe)] - full[:, column])
        rise = np.ptp(full[:, column])
        off_error, on_error = error[off].max(), error[~off].max()
        print(f"  {probe:>12}: steps {on_error:.2g} K, cool-down {off_error:.2g} K, of {rise:.1f} K")
    imbalance = max(phase.transient.energy.imbalance_relative for phase in result.phases)
    print(f"  full model {spent:.0f} s for {full.shape[0] / 60:.1f} h, heat closed to {imbalance:.1g}")


def report_times(fast: FastModel, spec: MachineSpec, number: int) -> None:
    """4 h at 10 s: steps, derivatives, nonlinear terms."""
    start = spec.operation.ambient_temperature
    times = np.arange(0.0, 4 * 3600.0 + 1.0, 10.0)
    speeds = np.array([0.0, 3000.0, 1500.0, 4000.0])[np.minimum(times // 3600.0, 3).astype(int)]
    drive = make_drive(times, STANDARD, inputs(times, speeds * RPM, spec), HELD)
    shared = list(free_parameters(spec))
    single = [f"joint.{name}" for name in fast.model.contacts] + [f"heat.{name}" for name in fast.bearings]
    names = tuple((shared + single)[:number])
    factors = dict.fromkeys(names, 1.01)
    own = fast.own_terms(drive)

    def run(**options: object) -> Callable[[], object]:
        return lambda: simulate_fast(fast, drive, start, parameters=factors, **options)

    plain, derived = median_time(run()), median_time(run(derivatives=names))
    ready, state = TransientRun(fast, drive, factors, (), own), Start.of(start, fast.model.one)
    march = median_time(lambda: ready.march(state))
    terms = (ThermalPreload(), GapClosure())
    nonlinear, both = median_time(run(terms=terms)), median_time(run(terms=terms, derivatives=names))
    steps = len(drive.steps)
    print(f"4 h at 10 s, {len(names)} live parameters: {plain:.3f} s; a step {1e6 * march / steps:.1f} us, "
          f"operators and all {1e6 * plain / steps:.1f} us")  # fmt: skip
    print(f"  with all derivatives {derived:.3f} s, {derived / plain:.1f} times")
    print(f"  with two nonlinear terms {nonlinear:.3f} s")
    print(f"  and all derivatives, so the gradient of the misfit: {both:.3f} s, {both / nonlinear:.1f} times")


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--machine", default="recorded_spindle")
    parser.add_argument("--preset", default="coarse")
    parser.add_argument("--order", type=int, default=2)
    parser.add_argument("--parameters", type=int, default=30)
    parser.add_argument("--whole", action="store_true", help="Each step of the test until settled.")
    parser.add_argument("--times-only", action="store_true", help="No full transient.")
    parser.add_argument("--set", action="append", default=[], metavar="PATH=VALUE")
    options = parser.parse_args()
    overrides = [f"mesh.preset={options.preset}", f"mesh.order={options.order}", *options.set]
    spec = load_machine(options.machine, overrides)
    # A model for all speeds and thrusts of the step test and the cool-down.
    highest = 4500.0 * RPM
    inputs = np.array([[highest, 0.0], [highest, spec.operation.thrust]])
    asked = [SimpleNamespace(source="step test", probes=(), input_names=("speed", "thrust"), inputs=inputs)]
    begin = time.process_time()
    fast = fast_model_for(spec, asked)
    built = time.process_time() - begin
    model, checked = fast.model, fast.model.errors["probes"]
    print(f"{model.n_full} unknowns -> {model.size}, made or read in {built:.1f} s, checked {checked:.2g} K")
    report_times(fast, spec, options.parameters)
    if not options.times_only:
        report_step_test(fast, prepare_machine(spec), whole=options.whole)


if __name__ == "__main__":
    main()
