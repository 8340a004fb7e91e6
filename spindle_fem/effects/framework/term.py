"""Physics that the linear model lacks, as terms that can be added to it one by one.

A term may do any of five things, each with parameters of its own:

- put heat into named places, or shift the temperature of a fluid, as a
  function of inputs, temperatures, a state of its own, time and parameters
  (:meth:`Term.heat`);
- multiply named coefficients by such a function (:meth:`Term.factor`);
- multiply the friction heat of bearings by one (:meth:`Term.friction`);
- multiply coefficients by a function of the operating point alone
  (:meth:`Term.operating_factor`), the coolant's flow included;
- add heat capacity to a place, or a conductance from a place to the ambient
  (:meth:`Term.place_capacity`, :meth:`Term.place_conductance`).

Functions of temperatures are called with complex arguments, several columns at
once, and differentiated by complex steps: write them with numpy's analytic
functions and choose branches by ``np.real``. The columns may also be instants
of time; write everything so that it broadcasts over the last axis.

Source of the complex step: Squire & Trapp (1998), SIAM Review 40, 110-112.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FLOW = "coolant.flow"
FLUID_PREFIX = "fluid."
COOLANT_INLET = "fluid.coolant_inlet"
# Coefficient of the film in the cooling channel.
CHANNEL_FILM = "channel.film"
# Inputs used only by terms that follow them: ``covariate.<column>``.
COVARIATE = "covariate."


class Operating(Protocol):
    """Quantities of the operating point that a term may use, in SI."""

    speed: float
    thrust: float
    ambient_temperature: float
    coolant_inlet_temperature: float
    coolant_flow: float


class ReadModel(Protocol):
    """A model whose places can be read."""

    def place(self, name: str) -> Array:
        """Mean over a place, (n,)."""


@dataclass(frozen=True, slots=True)
class TermParameter:
    """One parameter of a term.

    Attributes
    ----------
    name : str
        Within the term; ``<term>.<name>`` outside.
    value : float
        SI, before any data.
    sigma : float
        One standard deviation: of the logarithm when ``logarithmic``, else in
        the value's unit; 0 means fixed.
    logarithmic : bool
        Whether derivatives are taken to the logarithm.
    low, high : float
        Values that it cannot pass, in its own unit.
    """

    name: str
    value: float
    sigma: float = 0.0
    unit: str = ""
    logarithmic: bool = True
    low: float = -np.inf
    high: float = np.inf


@dataclass(frozen=True, slots=True)
class TermContext:
    """Inputs and state of a term; the last axis counts complex perturbations, or instants.

    Attributes
    ----------
    time : float or (k,) ndarray, [s]
    inputs : mapping of str to float or (k,) ndarray
        As :class:`spindle_fem.model.reduced.drive.Drive` names them.
    temperatures : (n_reads, k) ndarray, [K]
        Of the term's ``reads``.
    state : (n_states, k) ndarray
    parameters : mapping of str to (k,) ndarray
    """

    time: float | Array
    inputs: Mapping[str, float | Array]
    temperatures: NDArray[np.complex128]
    state: NDArray[np.complex128]
    parameters: Mapping[str, NDArray[np.complex128]]


class Term:
    """A term that does nothing; give what differs.

    Attributes
    ----------
    heat_places : tuple of str
        Places of :class:`spindle_fem.model.thermal_model.ThermalModel`, in W; or
        ``fluid.<surface>`` (the film's fluid) and ``fluid.coolant_inlet``, in
        K above what the inputs say.
    coefficients : tuple of str
        Coefficients that :meth:`factor` multiplies.
    bearings : tuple of str
        Bearings (sources of a network) whose friction heat :meth:`friction` multiplies.
    reads : tuple of str
        Places whose mean temperatures it needs.
    combined : tuple of str
        Those of ``reads`` that are no places: sums over the unknowns, as :meth:`read_row` gives them.
    n_states : int
        Numbers that it remembers from step to step.
    follows : tuple of str
        Inputs, beyond those that every machine has, that it needs.
    """

    name: str = ""
    parameters: tuple[TermParameter, ...] = ()
    heat_places: tuple[str, ...] = ()
    coefficients: tuple[str, ...] = ()
    bearings: tuple[str, ...] = ()
    reads: tuple[str, ...] = ()
    combined: tuple[str, ...] = ()
    n_states: int = 0
    follows: tuple[str, ...] = ()

    def heat(self, context: TermContext) -> NDArray[np.complex128]:
        """Heat of every heat place, (n_heat_places, k) W; K for fluids."""
        return np.zeros((len(self.heat_places), context.temperatures.shape[-1]), dtype=complex)

    def factor(self, context: TermContext) -> NDArray[np.complex128]:
        """Factor on every coefficient, (n_coefficients, k)."""
        return np.ones((len(self.coefficients), context.temperatures.shape[-1]), dtype=complex)

    def friction(self, context: TermContext) -> NDArray[np.complex128]:
        """Factor on the friction heat of every one of ``bearings``, (n_bearings, k)."""
        return np.ones((len(self.bearings), context.temperatures.shape[-1]), dtype=complex)

    def initial_state(self, parameters: Mapping[str, float]) -> Array:
        """State at time zero, (n_states,); must not depend on parameters that are fitted."""
        return np.zeros(self.n_states)

    def advance(self, context: TermContext, step: float | Array) -> NDArray[np.complex128]:
        """State after a step [s], or (k,) steps, (n_states, k), from what holds at its start."""
        return context.state

    def operating_factor(self, point: Operating, parameters: Mapping[str, float]) -> dict[str, float]:
        """Factors by coefficient at an operating point; ``coolant.flow`` is the flow itself."""
        return {}

    def place_capacity(self, parameters: Mapping[str, float]) -> dict[str, float]:
        """Heat capacity added to places, J/K."""
        return {}

    def place_conductance(self, parameters: Mapping[str, float]) -> dict[str, float]:
        """Conductance from places to the ambient, W/K."""
        return {}

    # -------------------------------------------------------------- helpers
    def read_row(self, model: ReadModel, name: str) -> Array:
        """What one of ``reads`` is of a model's unknowns, (n,)."""
        return model.place(name)

    def names(self) -> dict[str, TermParameter]:
        """Parameters by the names that they have outside."""
        return {f"{self.name}.{item.name}": item for item in self.parameters}

    def values(self, given: Mapping[str, float]) -> dict[str, float]:
        """Values by inner name, the nominal one where none is given."""
        return {item.name: given.get(f"{self.name}.{item.name}", item.value) for item in self.parameters}

    @property
    def is_dynamic(self) -> bool:
        """Whether anything depends on temperatures, time or state."""
        return bool(self.heat_places or self.coefficients or self.bearings)

    @property
    def is_steady(self) -> bool:
        """Whether it changes the machine by the operating point alone: its coefficients or its places."""
        own = type(self)
        return any(
            getattr(own, name) is not getattr(Term, name)
            for name in ("operating_factor", "place_capacity", "place_conductance")
        )


class RecordedHeat(Term):
    """Heat that a recording gives for a place: an input ``heat.<place>`` in W.

    Parameters
    ----------
    source : str
        Name of the input.
    """

    def __init__(self, source: str) -> None:
        self.name = source
        self.heat_places = (source.removeprefix("heat."),)

    def heat(self, context: TermContext) -> NDArray[np.complex128]:
        """The input itself, (1, k) W."""
        return np.full((1, context.temperatures.shape[-1]), context.inputs[self.name], dtype=complex)
