"""A machine as effects see it: what can be heated, cooled, scaled and read, by component.

Components carry the names that a diagnosis reports: ``front_bearings`` (a
bearing set), one bearing, ``shaft``, ``housing``, ``channel``, ``flange``,
``drive_end``, ``nose``, ``ambient``, a probe, or a node or link of a network.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.machine_spec import HeatSource
from spindle_fem.effects.framework.preload_response import PreloadResponse
from spindle_fem.physics.bearings.heat_models import HEAT_MODELS
from spindle_fem.physics.coolant.properties import coolant_by_name

Array = NDArray[np.float64]
NOTHING: Mapping = MappingProxyType({})


def fluid_place(coefficient: str) -> str:
    """Place of a term that shifts the fluid of a film or boundary link.

    >>> fluid_place("film.housing.outside")
    'fluid.housing.outside'
    """
    return "fluid." + coefficient.removeprefix("film.").removeprefix("link.")


@dataclass(frozen=True, slots=True)
class Seat:
    """Contacts that may conduct differently from nominal, all by one factor.

    Attributes
    ----------
    component : str
        Where a finding places them.
    form : str
        Which contacts of it: ``outer ring seats``, a joint group's name.
    coefficients : tuple of str
        Of the model.
    parameter : str
        The machine's own factor on exactly these; empty where it has none.
    """

    component: str
    form: str
    coefficients: tuple[str, ...]
    parameter: str = ""


@dataclass(frozen=True, slots=True)
class FrictionTable:
    """Friction heat of one bearing as the definition has it.

    Attributes
    ----------
    speed : tuple of float, [rad/s]
    heat : tuple of float, [W]
        At the reference thrust, factors of the definition included.
    thrust_coefficient : float
        c of the factor ``1 + c (thrust / reference_thrust - 1)``.
    reference_thrust : float, [N]
    """

    speed: tuple[float, ...]
    heat: tuple[float, ...]
    thrust_coefficient: float = 0.0
    reference_thrust: float = 1750.0

    def heat_at(self, speed: Array, thrust: Array) -> Array:
        """Heat at speeds (n,) [rad/s] and thrusts (n,) [N], (n,) [W].

        Beyond the table's ends the last straight line goes on; heat is never negative.
        """
        return HEAT_MODELS["table"](
            speed,
            self.speed,
            self.heat,
            thrust,
            thrust_coefficient=self.thrust_coefficient,
            reference_thrust=self.reference_thrust,
        )


@dataclass(frozen=True, slots=True)
class ChannelFlow:
    """Duct data and coolant, from which the Reynolds number follows.

    Attributes
    ----------
    fluid : str
        As :func:`spindle_fem.physics.coolant.properties.coolant_by_name` knows it.
    hydraulic_diameter : float, [m]
    area : float, [m²]
        Of the flow, all starts together.
    """

    fluid: str
    hydraulic_diameter: float
    area: float

    def reynolds_number(self, flow: float, temperature: float) -> float:
        """Reynolds number on the hydraulic diameter, for the flow of all starts [m³/s] at the inlet [K]."""
        viscosity = float(coolant_by_name(self.fluid).properties(temperature).kinematic_viscosity)
        return flow / self.area * self.hydraulic_diameter / viscosity


@dataclass(frozen=True, slots=True)
class RecordedQuantity:
    """Something recorded that heat may follow by a law.

    Attributes
    ----------
    name : str
        In findings: ``thrust``, ``change of speed``, a covariate's column.
    input : str
        As :class:`spindle_fem.model.reduced.drive.Drive` names it.
    highest : float
        Largest magnitude in the recording, SI.
    varies : float
        Range of the magnitude as a share of ``highest``.
    levels : tuple of float
        Magnitudes while it is on, quantiles over time, SI; of changes the sizes of those of the square.
    changes : bool
        Whether its changes are followed instead of itself.
    beside : bool
        Whether it was recorded beside the inputs (a covariate).
    """

    name: str
    input: str
    highest: float
    varies: float
    levels: tuple[float, ...]
    unit: str = ""
    changes: bool = False
    beside: bool = False


def no_mechanics(component: str) -> None:
    """No mechanics: how the friction of a set follows its rings is unknown."""


@dataclass(frozen=True, slots=True)
class MachineView:
    """Names of one machine.

    Attributes
    ----------
    kind : str
        "geometry" or "network".
    sets : mapping of component to tuple of str
        Bearings of each set (``front_bearings``); single bearings map to
        themselves. Sources of a network likewise.
    inner, outer : mapping of bearing to str
        Places of its rings; for a network source, the node that it heats and
        what that node is joined to.
    heat : mapping of component to tuple of str
        Places that take heat which belongs to a component.
    films : mapping of component to tuple of str
        Coefficients of the films to the surroundings there (a network: links
        to boundaries), rotating surfaces under ``shaft``, ``nose``, ``drive_end``.
    joints : mapping of component to tuple of str
        Parameters of the machine that scale the contacts there.
    joint_coefficients : mapping of component to tuple of str
        Coefficients of the outer ring seats there; a network: of the link.
    parameters : mapping of str to float
        1 σ of the logarithm of every uncertain parameter of the definition.
    channels : tuple of str
        Temperature channels of the recording.
    inputs : tuple of str
        Inputs of the recording.
    quantities : tuple of RecordedQuantity
        Recorded quantities that heat without a law of the catalogue may follow.
    has : frozenset of str
        Effects that the definition already switches on, by id, or
        ``<id> @ <component>`` where that is all they concern.
    reference_temperature : float, [K]
        Of the surroundings, nominal.
    highest_speed : float, [rad/s]
        In the recording.
    duration : float, [s]
        Of the recording.
    lowest_speed : float, [rad/s]
        Lowest that the recording holds, standstill apart.
    spots : mapping of str to tuple of str
        Places where heat may come and go unrecorded, by a name of their own.
    sides : mapping of str to (str, str)
        First harmonics around the axis, along y and along -x, of the spots that have them.
    focal : mapping of str to str
        Place of a spot where a share of its heat may be concentrated.
    reported : mapping of str to str
        Component that a finding names for a spot, source or link; itself where absent.
    near : mapping of str to str
        Component in which each probe lies that a finding may name.
    walls : mapping of coefficient to str
        Place whose temperature drives a film.
    fluids : mapping of coefficient to str or float
        Input that gives the temperature on a film's other side, or that temperature [K].
    probes : mapping of channel to str
        Probe of every temperature channel.
    outlets : tuple of str
        Channels that read the mixed coolant after the channel.
    speed_inputs : mapping of component to tuple of str
        Inputs that give the rotational speed there.
    input_scale : mapping of str to float
        Largest magnitude of every input in the recording.
    capacity : mapping of component to float, [J/K]
    typical_heat : float, [W]
        All recorded heat at full load.
    typical_rise : float, [K]
        Above the surroundings, in the recording.
    circuits : tuple of str
        Circuits beside the channel; ``film.NAME`` scales the film of one.
    reynolds : (float, float)
        Range that occurs; zeros without a channel.
    friction : mapping of bearing to FrictionTable
    inner_share : float
        Nominal share of the inner ring in a bearing's heat, of what rings take.
    ring_share : float
        Share of both rings together.
    viscosity : (float, float), [m²/s]
        Kinematic, of the oil or the grease's oil at 40 and 100 °C.
    oiled : tuple of str
        Bearings in oil instead of grease.
    coolant_links : mapping of boundary to tuple of str
        Links of a network to one coolant, in the order in which it passes them.
    conductance : mapping of coefficient to float, [W/K]
        Nominal, of a network's links.
    source_inputs : mapping of source to str
        Input that drives a network's source.
    source_heat : mapping of source to float, [W]
        Mean heat of a network's driven sources while they are on.
    surroundings : mapping of component to tuple of str
        Films whose fluid is that of ``ambient``, or of one boundary of a network.
    sources : tuple of HeatSource
        Of a machine with geometry, that give heat.
    preload : callable
        Component of a bearing set to how its friction follows rings and fits; to None where a
        definition does not say enough.
    """

    kind: Literal["geometry", "network"]
    sets: Mapping[str, tuple[str, ...]]
    inner: Mapping[str, str]
    outer: Mapping[str, str]
    heat: Mapping[str, tuple[str, ...]]
    films: Mapping[str, tuple[str, ...]]
    joints: Mapping[str, tuple[str, ...]]
    joint_coefficients: Mapping[str, tuple[str, ...]]
    parameters: Mapping[str, float]
    channels: tuple[str, ...]
    inputs: tuple[str, ...]
    quantities: tuple[RecordedQuantity, ...]
    has: frozenset[str]
    reference_temperature: float
    highest_speed: float
    duration: float
    lowest_speed: float = 0.0
    seats: tuple[Seat, ...] = ()
    spots: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    sides: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    focal: Mapping[str, str] = field(default_factory=dict)
    reported: Mapping[str, str] = field(default_factory=dict)
    near: Mapping[str, str] = field(default_factory=dict)
    walls: Mapping[str, str] = field(default_factory=dict)
    fluids: Mapping[str, str | float] = field(default_factory=dict)
    probes: Mapping[str, str] = field(default_factory=dict)
    outlets: tuple[str, ...] = ()
    speed_inputs: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    input_scale: Mapping[str, float] = field(default_factory=dict)
    capacity: Mapping[str, float] = field(default_factory=dict)
    typical_heat: float = 100.0
    typical_rise: float = 10.0
    channel: ChannelFlow | None = None
    circuits: tuple[str, ...] = ()
    reynolds: tuple[float, float] = (0.0, 0.0)
    friction: Mapping[str, FrictionTable] = field(default_factory=dict)
    inner_share: float = 0.5
    ring_share: float = 1.0
    # Klueber Isoflex NBU 15, a usual grease of spindle bearings.
    viscosity: tuple[float, float] = (21.0e-6, 4.7e-6)
    oiled: tuple[str, ...] = ()
    coolant_links: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    conductance: Mapping[str, float] = field(default_factory=dict)
    source_inputs: Mapping[str, str] = field(default_factory=dict)
    source_heat: Mapping[str, float] = field(default_factory=dict)
    surroundings: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    sources: tuple[HeatSource, ...] = ()
    preload: Callable[[str], PreloadResponse | None] = no_mechanics

    @property
    def groups(self) -> tuple[str, ...]:
        """Bearing sets; every source of a network."""
        sets = tuple(key for key, members in self.sets.items() if members != (key,))
        return sets or tuple(self.sets)

    def speeds(self, component: str) -> tuple[str, ...]:
        """Inputs that give the rotational speed there."""
        return self.speed_inputs.get(component, ())

    def running(self, component: str) -> tuple[str, ...]:
        """Input that shows whether there is friction or other heat there, if any."""
        own = self.source_inputs.get(component)
        found = self.speeds(component) or (() if own is None else (own,))
        return found[:1]

    def highest(self, name: str) -> float:
        """Largest magnitude of an input in the recording; the highest speed where it is not known."""
        return self.input_scale.get(name, self.highest_speed)

    def grease_places(self, bearing: str) -> tuple[str, ...]:
        """Places whose mean temperature the grease has."""
        if self.kind == "network":
            return (self.inner[bearing],)
        return (self.inner[bearing], self.outer[bearing])

    def component(self, key: str) -> str:
        """Component that a finding names for a spot, source or link."""
        return self.reported.get(key, key)

    def form(self, key: str, form: str = "") -> str:
        """Form that distinguishes a spot or source from others of the same component."""
        own = "" if self.component(key) == key else key
        return " ".join(part for part in (own, form) if part)

    def switched_on(self, effect: str, component: str) -> bool:
        """Whether the definition already holds an effect there."""
        return effect in self.has or f"{effect} @ {component}" in self.has
