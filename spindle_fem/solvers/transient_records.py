"""Options and records of a machine's transient."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from spindle_fem.errors import EnergyBalanceError, SpecError
from spindle_fem.model.mesh.linear_solvers import Method
from spindle_fem.model.mesh.step_control import ErrorNorm, StepControl
from spindle_fem.model.mesh.thermal_state import ThermalState
from spindle_fem.solvers.input_history import TEMPERATURE_RESOLUTION

Array = NDArray[np.float64]
ENERGY_TOLERANCE = 1.0e-8
# The coolant is marched along walls that are known to the coupling tolerance. Tens of kelvin drive the heat
# there, so each kelvin of it changes what they give by less than this share.
ENERGY_PER_KELVIN = 0.1
# Factor on the coupling's tolerance if a run's balance requires less, and largest number of runs: where
# water cools, tenths of a kelvin drive the heat.
FINER_COUPLING, MOST_TRIES = 0.25, 3


@dataclass(frozen=True, slots=True)
class TransientOptions:
    """Accuracy settings of a transient.

    Attributes
    ----------
    error : float, [K]
        Estimated error of one time step.
    coupling_tolerance : float, [K]
        Change at which loads and temperatures of a stage agree.
    coefficient_tolerance : float, [-]
        Relative change of a film, joint or contact coefficient that renews the
        matrix, smaller ones act as heat; 0 renews it at every stage.
    first_step : float, [s]
        After the start and after every jump of the inputs.
    fixed_step : float or None, [s]
        Steps of one size without control, for convergence studies.
    input_resolution : float, [K]
        Temperatures of the inputs that leave a straight line by less pass inside a step.
    trust_contraction : bool
        Whether a stage's iteration may end one solve earlier, where what lately
        remained of a change leaves less than the tolerance.
    method : {"direct", "multigrid"} or None
        Of the linear solver; by size when None. A factor serves steps of one
        size, a multigrid hierarchy also those twice as long.
    imbalance : float or None, [-]
        Heat that may be missing in the run; what the coupling's tolerance leaves when None.
    error_norm : {"largest", "mean"}
        Of the error, as :class:`StepControl` takes it: at any node, or in the mean over the heat capacity.
    """

    error: float = 0.05
    coupling_tolerance: float = 3.0e-8
    coefficient_tolerance: float = 2.0e-2
    first_step: float = 0.1
    fixed_step: float | None = None
    input_resolution: float = TEMPERATURE_RESOLUTION
    trust_contraction: bool = False
    method: Method | None = None
    imbalance: float | None = None
    error_norm: ErrorNorm = "largest"

    def __post_init__(self) -> None:
        for name in ("error", "coupling_tolerance", "first_step", "input_resolution"):
            if not getattr(self, name) > 0.0:
                raise SpecError(
                    f"transient options: {name}", f"{getattr(self, name)!r}.", "Allowed: above 0."
                )
        if not self.coefficient_tolerance >= 0.0:
            raise SpecError(
                "transient options: coefficient_tolerance",
                f"{self.coefficient_tolerance!r}.",
                "Allowed: 0 or more.",
            )

    def control(self) -> StepControl:
        """Step control of the integrator."""
        return StepControl(
            tolerance=None if self.fixed_step else self.error,
            error_norm=self.error_norm,
            first_step=self.fixed_step or self.first_step,
            temperature_dependent=True,
            nonlinear_tolerance=self.coupling_tolerance,
            linear_tolerance=0.2 * self.coupling_tolerance,
            trust_contraction=self.trust_contraction,
            method=self.method,
        )

    @property
    def energy_tolerance(self) -> float:
        """Largest relative difference of heat stored, in and out, the coolant's enthalpy included."""
        return self.imbalance or max(ENERGY_TOLERANCE, ENERGY_PER_KELVIN * self.coupling_tolerance)


DEFAULT_OPTIONS = TransientOptions()
Found = TypeVar("Found")


def balanced(run: Callable[[TransientOptions], Found], options: TransientOptions) -> Found:
    """Result of a run, repeated with tighter coupling until its heat balance holds.

    The coupling accuracy needed for the balance depends on what heats and cools; the
    balance is held to the options' limit throughout.

    Raises
    ------
    EnergyBalanceError
        The balance of the most exact run is still open.
    """
    for _ in range(MOST_TRIES - 1):
        try:
            return run(options)
        except EnergyBalanceError:
            finer = FINER_COUPLING * options.coupling_tolerance
            options = replace(options, coupling_tolerance=finer, imbalance=options.energy_tolerance)
    return run(options)


@dataclass(frozen=True, slots=True)
class MachineEnergy:
    """Heat over a transient, [J].

    Attributes
    ----------
    heat_in : float
        Friction and other sources in the machine, friction in the coolant included.
    heat_out : mapping of str to float
        Through each film to the air and ``coolant``: what the coolant carried
        away, by its own enthalpy.
    stored : float
        Change of the heat content of parts and balls.
    """

    heat_in: float
    heat_out: Mapping[str, float]
    stored: float

    @property
    def imbalance_relative(self) -> float:
        """Heat in − heat out − stored, relative to the heat that was moved."""
        moved = 0.5 * (abs(self.heat_in) + abs(self.stored) + sum(map(abs, self.heat_out.values())))
        imbalance = self.heat_in - sum(self.heat_out.values()) - self.stored
        return abs(imbalance) / moved if moved else 0.0

    def __add__(self, other: MachineEnergy) -> MachineEnergy:
        names = dict.fromkeys((*self.heat_out, *other.heat_out))
        out = {name: self.heat_out.get(name, 0.0) + other.heat_out.get(name, 0.0) for name in names}
        return MachineEnergy(self.heat_in + other.heat_in, out, self.stored + other.stored)


@dataclass(frozen=True, slots=True)
class StepRecord:
    """State of the machine at the end of every accepted step.

    Attributes
    ----------
    times, sizes, errors : (n_steps,) ndarray, [s], [s], [K]
    hottest, coldest : (n_steps,) ndarray, [K]
    speed : (n_steps,) ndarray, [rad/s]
        At the end of the step, before a jump there.
    bearing_heat : (n_steps, n_bearings) ndarray, [W]
    preload : (n_steps, n_bearings) ndarray, [N]
        NaN where the heat model has none.
    coolant_heat : (n_steps,) ndarray, [W]
        Mean over the step.
    """

    times: Array
    sizes: Array
    errors: Array
    hottest: Array
    coldest: Array
    speed: Array
    bearing_heat: Array
    preload: Array
    coolant_heat: Array


@dataclass(frozen=True, slots=True)
class MachineTransient:
    """A machine from start to end.

    Attributes
    ----------
    times : (n,) ndarray, [s]
        Sample times.
    readings : (n, n_probes) ndarray, [K]
    inner, outer, balls : (n, n_bearings) ndarray, [K]
        Raceway means and ball rows.
    state : ThermalState
        At the end, to go on from.
    counts : mapping of str to int
        ``rejected``, ``linear_iterations``, ``matrix_builds``,
        ``preconditioner_builds``, ``evaluations``.
    stopped : bool
        Whether the stop condition ended it, not the end time.
    memory : ndarray or None
        What terms remember at the end.
    motions : tuple of str
        Of the nose (``nose_axial``, ...), then displacement sensors; none without elastic bodies.
    motion : (n, n_motions) ndarray, [m], tilts in [rad]
        Since assembly.
    """

    times: Array
    probes: tuple[str, ...]
    readings: Array
    bearings: tuple[str, ...]
    inner: Array
    outer: Array
    balls: Array
    steps: StepRecord
    energy: MachineEnergy
    state: ThermalState
    counts: Mapping[str, int]
    cpu_seconds: float
    stopped: bool = False
    memory: Array | None = None
    motions: tuple[str, ...] = ()
    motion: Array = field(default_factory=lambda: np.zeros((0, 0)))

    def reading(self, probe: str) -> Array:
        """Readings of one probe, (n,) [K]."""
        return self.readings[:, self.probes.index(probe)]

    def motion_of(self, name: str) -> Array:
        """One motion of the nose, or what a displacement sensor reads, since assembly, (n,) [m] or [rad]."""
        return self.motion[:, self.motions.index(name)]
