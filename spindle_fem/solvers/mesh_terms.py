"""Terms of the effect catalogue in the finite-element model.

What a term reads are means of the field over the fast model's places, and what
it gives goes back into the same places: heat into volumes, surfaces and lumped
nodes, factors onto films, joints, gaps, contacts of balls, conductivities and
friction, shifts onto the temperatures of fluids. Everything is iterated with
the field, at every stage of a time step.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from spindle_fem.definition.uncertain_parameters import with_parameters
from spindle_fem.effects.framework.term import COOLANT_INLET, FLOW, FLUID_PREFIX, Term
from spindle_fem.errors import SpecError, did_you_mean
from spindle_fem.machine.view.place_names import GROWTH
from spindle_fem.model.elastic.machine_growth import GrowthModel
from spindle_fem.operation.coefficient_table import CoefficientTable, build_coefficient_table, gap_radii_of
from spindle_fem.operation.effect_terms import (
    Derivatives,
    EffectTerms,
    Instants,
    Quantities,
    multiplied,
    operating_factors,
    require_known,
)
from spindle_fem.operation.loads import LoadChange
from spindle_fem.operation.named_places import growth_places, named_places
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.solvers.prepared_machine import PreparedMachine, machine_on_mesh

Array = NDArray[np.float64]

# A memory that has had so much time has reached where it goes, s.
LONG = 1.0e9
# A step this much shorter than a lag changes it as evenly as the step itself is.
SHORT_STEPS = 1.0e-4


@dataclass(frozen=True, slots=True)
class Physics:
    """Effects of a machine beyond its definition's tables.

    Attributes
    ----------
    values : mapping of str to float
        Parameters of the terms by outer name; nominal where absent.
    factors : mapping of str to float
        On the machine's own parameters, by the names that its fast model knows.
    """

    terms: tuple[Term, ...] = ()
    values: Mapping[str, float] = field(default_factory=dict)
    factors: Mapping[str, float] = field(default_factory=dict)

    @property
    def is_there(self) -> bool:
        """Whether there is anything."""
        return bool(self.terms or self.factors)

    def breakpoints(self) -> list[float]:
        """Instants at which something is switched, s: a time step has to end there."""
        return [
            self.values.get(f"{term.name}.{item.name}", item.value)
            for term in self.terms
            for item in term.parameters
            if item.unit == "s" and item.name.startswith(("start_", "end_"))
        ]


NO_PHYSICS = Physics()
# Factors that no load or coefficient carries.
OF_THE_DEFINITION = ("heat.inner_share", "heat_capacity_factor")


def with_factors(machine: PreparedMachine, physics: Physics) -> tuple[PreparedMachine, Physics]:
    """A machine with those factors that only its definition can hold, and the rest of the physics."""
    own = {name: value for name, value in physics.factors.items() if name in OF_THE_DEFINITION}
    if not own:
        return machine, physics
    rest = {name: value for name, value in physics.factors.items() if name not in own}
    changed = machine_on_mesh(with_parameters(machine.spec, own), machine.mesh, machine.operators)
    return replace(changed, timings=machine.timings), replace(physics, factors=rest)


@dataclass(frozen=True, slots=True)
class _Begin:
    """State at the start of a time step."""

    time: float
    sensed: Array
    memory: Array
    inputs: Mapping[str, float]


class FieldTerms:
    """Terms and factors on a machine with a mesh.

    Parameters
    ----------
    lumped_names : sequence of str
        Lumped nodes in the order of their unknowns.

    Raises
    ------
    SpecError
        A place, coefficient or bearing that the machine does not have.
    """

    def __init__(self, machine: PreparedMachine, lumped_names: Sequence[str], physics: Physics) -> None:
        self.machine, self.lumped_names = machine, tuple(lumped_names)
        self.terms = EffectTerms(physics.terms, physics.values)
        self.table: CoefficientTable = build_coefficient_table(
            machine.spec, tuple(machine.mesh.joints), gap_radii_of(machine.spec, machine.operators)
        )
        self._n = machine.operators.n_unknowns
        self._capacities, self._losses = (
            [getattr(term, kind)(own) for term, own in self._each()]
            for kind in ("place_capacity", "place_conductance")
        )
        self._places = self._known_places()
        self._factors = self._of_parameters(self.table.factors(physics.factors))
        self._lossy = tuple(dict.fromkeys(name for losses in self._losses for name in losses))
        rows = [self._places[name] for name in (*self.terms.reads, *self._lossy)]
        self._sense = np.array(rows).reshape(-1, self._n + len(self.lumped_names))
        self._initial = self.terms.initial_states()
        self._scale, self._lumped_capacity = self._added_capacity()
        self._begin: _Begin | None = None

    def _each(self) -> Iterator[tuple[Term, Mapping[str, float]]]:
        """Every term with the values of its parameters."""
        return zip(self.terms.terms, self.terms.values, strict=True)

    # ---------------------------------------------------------------- set-up
    def _known_places(self) -> dict[str, Array]:
        """Places of the machine, after a look whether it has all that the terms name."""
        spec = self.machine.spec
        found = dict(named_places(self.machine, self.lumped_names, self._n + len(self.lumped_names)))
        if any(name.startswith(GROWTH) for name in self.terms.reads):
            growth = self.machine.growth or GrowthModel(spec, self.machine.mesh, self.machine.operators.order)
            found |= growth_places(growth, self._n + len(self.lumped_names))
        films = [f"{FLUID_PREFIX}{surface}" for film in spec.film for surface in film.surface]
        require_known(
            self.terms.terms,
            places=found,
            fluids=(*films, COOLANT_INLET),
            bearings=[bearing.name for _, bearing in spec.bearings],
            coefficients=self.table.groups,
        )
        for number, term in enumerate(self.terms.terms):
            for name in (*self._capacities[number], *self._losses[number]):
                if name not in found:
                    raise SpecError(f"term {term.name}", f'names "{name}".', did_you_mean(name, found))
        return found

    def _of_parameters(self, factors: Mapping[str, float]) -> dict[str, float]:
        """Factors of coefficients, and of friction by ``heat.<bearing>``."""
        found = {name: self.table.scale(name, factors) for name in self.table.groups}
        for _, bearing in self.machine.spec.bearings:
            own = self.table.heat_groups(bearing.name)
            found[f"heat.{bearing.name}"] = float(np.prod([factors.get(name, 1.0) for name in own]))
        return {name: value for name, value in found.items() if value != 1.0}

    def _added_capacity(self) -> tuple[Array | None, dict[str, float]]:
        """Scale of the capacity matrix, and capacity of lumped nodes, that hold added mass."""
        lumped: dict[str, float] = {}
        scale: Array | None = None
        storage = None
        for capacities in self._capacities:
            for place, capacity in capacities.items():
                mean = self._places[place]
                for node, share in zip(self.lumped_names, mean[self._n :], strict=True):
                    if share:
                        lumped[node] = lumped.get(node, 0.0) + share * capacity
                if not mean[: self._n].any():
                    continue
                if storage is None:
                    operators = self.machine.operators
                    own_capacity = self.machine.volumetric_capacity
                    each = np.array([own_capacity[part] for part in operators.mesh.part_names])
                    storage = operators.matrix(operators.sum_storage(each))
                    scale = np.ones(self._n)
                scale = with_capacity(storage, scale, mean[: self._n] != 0.0, capacity)
        return scale, lumped

    # --------------------------------------------------------------- in time
    @property
    def memory(self) -> Array:
        """Memory of the terms at the end of the last step."""
        return self._begin.memory

    def begin(
        self,
        time: float,
        point: OperatingPoint,
        temperature: Array,
        lumped: Array,
        memory: Array | None = None,
    ) -> None:
        """Start a run, with nothing remembered or what an earlier run left.

        Raises
        ------
        SpecError
            A memory of other terms.
        """
        if memory is not None and memory.shape != self._initial.shape:
            raise SpecError(
                "memory", f"{memory.size} numbers.", f"These terms remember {self._initial.size}."
            )
        sensed = self._sensed(temperature, lumped)
        remembered = self._initial if memory is None else memory
        self._begin = _Begin(time, sensed, remembered, point.inputs)

    def accept(
        self,
        time: float,
        before: OperatingPoint,
        after: OperatingPoint,
        temperature: Array,
        lumped: Array,
    ) -> None:
        """Remember the end of a time step as the start of the next.

        Parameters
        ----------
        time : float, [s]
        before, after : OperatingPoint
            Just before and just after it: inputs may jump.
        temperature, lumped : ndarray, [K]
        """
        sensed = self._sensed(temperature, lumped)
        memory = self._memory(time, sensed, before.inputs)
        self._begin = _Begin(time, sensed, memory, after.inputs)

    def at(self, time: float, point: OperatingPoint, temperature: Array, lumped: Array) -> LoadChange:
        """Change by the terms at a stage of the current time step."""
        sensed, inputs = self._sensed(temperature, lumped), point.inputs
        return self._change(time, point, inputs, sensed, self._memory(time, sensed, inputs))

    def steady(self, point: OperatingPoint, temperature: Array, lumped: Array) -> LoadChange:
        """Change by the terms in the long run: memories settled, time zero."""
        sensed, inputs = self._sensed(temperature, lumped), point.inputs
        return self._change(0.0, point, inputs, sensed, self.settled(point, temperature, lumped))

    def settled(self, point: OperatingPoint, temperature: Array, lumped: Array) -> Array:
        """Memory of terms that have long seen the same."""
        sensed = self._sensed(temperature, lumped)
        return self._advanced(0.0, LONG, point.inputs, sensed, self._initial).value[0]

    # --------------------------------------------------------------- details
    def _sensed(self, temperature: Array, lumped: Array) -> Array:
        """Temperatures read by terms, then those of places that lose heat, [K]."""
        return self._sense @ np.concatenate((temperature, lumped))

    def _advanced(
        self,
        time: float,
        step: float,
        inputs: Mapping[str, float],
        sensed: Array,
        memory: Array,
        derivatives: Derivatives = Derivatives.NONE,
    ) -> Quantities:
        terms = self.terms
        read = sensed[None, : terms.n_sensed]
        return terms.advance(Instants(time, inputs), step, read, memory[None], derivatives)

    def _memory(self, time: float, sensed: Array, inputs: Mapping[str, float]) -> Array:
        """Memory at a time of the step: between what both its ends would make of it."""
        begin = self._begin
        step = time - begin.time
        if not self._initial.size or step <= 0.0:
            return begin.memory
        at_begin = begin.time, step, begin.inputs, begin.sensed, begin.memory
        first = self._advanced(*at_begin, Derivatives.STATE)
        last = self._advanced(begin.time, step, inputs, sensed, begin.memory)
        weight = weight_of_end(np.diagonal(first.by_state[0]))
        return first.value[0] + weight * (last.value[0] - first.value[0])

    def _change(
        self,
        time: float,
        point: OperatingPoint,
        inputs: Mapping[str, float],
        sensed: Array,
        memory: Array,
    ) -> LoadChange:
        terms = self.terms
        read, means = sensed[None, : terms.n_sensed], sensed[terms.n_sensed :]
        answers = terms.at(Instants(time, inputs), read, memory[None], Derivatives.NONE)
        factors = multiplied(
            (
                self._factors,
                *operating_factors(terms.terms, terms.values, point),
                dict(zip(terms.coefficients, answers.factor.value[0].tolist(), strict=True)),
                {
                    f"heat.{name}": value
                    for name, value in zip(terms.bearings, answers.friction.value[0].tolist(), strict=True)
                },
            )
        )
        fluids: dict[str, float] = {}
        nodal: dict[str, Array] = {}
        lumped: dict[str, float] = {}
        inlet = 0.0
        heats = zip(terms.sources, terms.places, answers.heat.value[0].tolist(), strict=True)
        for name, place, heat in heats:
            if place == COOLANT_INLET:
                inlet += heat
            elif place in self._places:
                self._put(name, place, heat, nodal, lumped)
            else:
                surface = place.removeprefix(FLUID_PREFIX)
                fluids[surface] = fluids.get(surface, 0.0) + heat
        warmth = dict(zip(self._lossy, means.tolist(), strict=True))
        for term, losses in zip(terms.terms, self._losses, strict=True):
            for place, conductance in losses.items():
                heat = conductance * (point.ambient_temperature - warmth[place])
                self._put(term.name, place, heat, nodal, lumped)
        return LoadChange(
            friction={n.removeprefix("heat."): v for n, v in factors.items() if n.startswith("heat.")},
            coefficients=self._by_part(factors),
            fluids=fluids,
            inlet=inlet,
            flow=factors.get(FLOW, 1.0),
            nodal_heat=nodal,
            lumped_heat=lumped,
            lumped_capacity=self._lumped_capacity,
            capacity_scale=self._scale,
        )

    def _put(
        self, name: str, place: str, heat: float, nodal: dict[str, Array], lumped: dict[str, float]
    ) -> None:
        """Spread heat of a term over a place, on the mesh and on lumped nodes."""
        mean = self._places[place]
        if mean[: self._n].any():
            nodal[name] = nodal.get(name, 0.0) + heat * mean[: self._n]
        for position in np.flatnonzero(mean[self._n :]):
            node = self.lumped_names[position]
            lumped[node] = lumped.get(node, 0.0) + heat * float(mean[self._n + position])

    def _by_part(self, factors: Mapping[str, float]) -> dict[str, float]:
        """Factors of coefficients with conductivities by part, as the problem has them."""
        found = {}
        materials = {id(item): name for name, item in self.machine.spec.materials.items()}
        for name, value in factors.items():
            if name.startswith("conductivity."):
                for part in self.machine.mesh.part_names:
                    material = materials[id(self.machine.spec.part_material(part))]
                    if f"conductivity.{material}" == name:
                        found[f"conductivity.{part}"] = value
            elif not name.startswith("heat.") and name != FLOW:
                found[name] = value
        return found


def steady_physics(machine: PreparedMachine, physics: Physics) -> Callable[..., LoadChange] | None:
    """Argument ``beyond`` of :func:`.coupled_steady.solve_coupled`; None without physics.

    Memories have settled, time is zero. Pass the machine from
    :func:`with_factors`.
    """
    if not physics.is_there:
        return None
    terms = _terms_of(machine, physics)
    names = terms.lumped_names

    def beyond(point: OperatingPoint, temperature: Array, lumped: Mapping[str, float]) -> LoadChange:
        # Before the first solve, balls and air of gaps are as warm as the parts are on average.
        mean = float(temperature.mean())
        return terms.steady(point, temperature, np.array([lumped.get(name, mean) for name in names]))

    return beyond


def weight_of_end(kept: Array) -> Array:
    """Weight of a step's end in what a first-order lag makes of a quantity that changes evenly over it.

    Parameters
    ----------
    kept : (n,) ndarray
        Share of each memory that is left after the step, ``e^(-h/τ)``; of what is no lag 1.

    Returns
    -------
    (n,) ndarray
        ``1/(1 - kept) - τ/h``: a half of short steps, all of long ones.

    >>> weight_of_end(np.exp(-np.array([1e-6, 1.0, 100.0]))).round(3).tolist()
    [0.5, 0.582, 0.99]
    """
    steps = -np.log(np.clip(kept, np.finfo(float).tiny, 1.0))
    is_short = steps < SHORT_STEPS
    steps = np.where(is_short, 1.0, steps)
    return np.where(is_short, 0.5, -1.0 / np.expm1(-steps) - 1.0 / steps)


def settled_memory(
    machine: PreparedMachine, physics: Physics, point: OperatingPoint, temperature: Array, lumped: Array
) -> Array | None:
    """Memory of the terms in a steady state, such as :func:`steady_physics` makes; None without physics.

    Parameters
    ----------
    machine : PreparedMachine
        Of :func:`with_factors`.
    temperature, lumped : ndarray, [K]
    """
    return _terms_of(machine, physics).settled(point, temperature, lumped) if physics.is_there else None


def _terms_of(machine: PreparedMachine, physics: Physics) -> FieldTerms:
    first = OperatingPoint.of(machine.spec)
    uniform = np.full(machine.operators.n_unknowns, first.ambient_temperature)
    loads, _ = machine.builder.at(first, machine.field_state(uniform, {}))
    return FieldTerms(machine, tuple(node.name for node in loads.lumped), physics)


def with_capacity(storage: sparse.sparray, scale: Array, inside: NDArray[np.bool_], capacity: float) -> Array:
    """Scale of the unknowns' capacity that adds so many J/K over some of them.

    Parameters
    ----------
    storage : (n, n) sparse array, [J/K]
    scale : (n,) ndarray
        So far.
    inside : (n,) bool ndarray
    capacity : float, [J/K]

    With g² the further scale inside, the content is ``D g² + 2 B g + A``: a
    quadratic equation.
    """
    root = np.sqrt(scale)
    within, beyond = np.where(inside, root, 0.0), np.where(inside, 0.0, root)
    square, mixed = float(within @ (storage @ within)), float(within @ (storage @ beyond))
    total = square + 2.0 * mixed + capacity
    growth = (np.sqrt(mixed**2 + square * total) - mixed) / square
    return np.where(inside, scale * growth**2, scale)
