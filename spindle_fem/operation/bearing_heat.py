"""Bearing heat by any heat model, through one interface.

A heat model is called with the operating point and the temperatures of every
bearing and returns :class:`BearingHeat` for each. A new model is a
function of that form, entered in :func:`heat_model_of`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spindle_fem.definition.machine_spec import BearingSet, MachineSpec
from spindle_fem.errors import OutOfValidityError
from spindle_fem.operation.assembled_sets import assembled_set, require_known_friction
from spindle_fem.operation.bearing_lubricants import SetLubricant
from spindle_fem.operation.loads import BearingHeat
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.operation.radial_loads import radial_loads
from spindle_fem.physics.bearings import mounting
from spindle_fem.physics.bearings.bearing_set import solve_bearing_set, solve_states
from spindle_fem.physics.bearings.bearing_state import BearingState
from spindle_fem.physics.bearings.contact_conduction import BallConductance, ball_conductance
from spindle_fem.physics.bearings.heat_model import HeatOptions
from spindle_fem.physics.bearings.heat_models import HEAT_MODELS
from spindle_fem.physics.bearings.roller_set import RollerSet, solve_roller_set
from spindle_fem.physics.bearings.seat_contact import SeatBodies
from spindle_fem.validity import CodedWarning


@dataclass(frozen=True, slots=True)
class BearingTemperatures:
    """Mean temperatures around one bearing, K.

    ``shaft`` and ``housing`` are those of the seats on the other side of the
    joints. ``shifts`` (4,) [m] is what temperature does to seats and raceways where elastic bodies carry
    the rings, as ``SeatBodies.law`` takes it.
    """

    inner: float
    outer: float
    ball: float
    shaft: float
    housing: float
    shifts: NDArray[np.float64] | None = None

    @property
    def kelvins(self) -> tuple[float, ...]:
        """The temperatures alone."""
        return self.inner, self.outer, self.ball, self.shaft, self.housing

    @classmethod
    def of_state(cls, state: NDArray[np.float64]) -> BearingTemperatures:
        """Restore from :attr:`state`."""
        return cls(*state[:5].tolist(), 1.0e-6 * state[5:] if state.size > 5 else None)

    @property
    def state(self) -> NDArray[np.float64]:
        """Temperatures in K, then any shifts in µm: all inputs of the heat, similar in size."""
        return np.append(self.kelvins, () if self.shifts is None else 1.0e6 * self.shifts)


@dataclass(frozen=True, slots=True, eq=False)
class FilmCurves:
    """Heat and conductances of one bearing over the temperature of its film, without expansion.

    Attributes
    ----------
    temperature : (n,) ndarray, [K]
    heat : (n,) ndarray, [W]
    conductance_inner, conductance_outer : (n,) ndarray, [W/K]
        Between raceway and balls.
    """

    temperature: NDArray[np.float64]
    heat: NDArray[np.float64]
    conductance_inner: NDArray[np.float64]
    conductance_outer: NDArray[np.float64]


HeatModel = Callable[
    [OperatingPoint, Mapping[str, BearingTemperatures]],
    tuple[Mapping[str, BearingHeat], tuple[CodedWarning, ...]],
]


def heat_model_of(spec: MachineSpec) -> HeatModel:
    """Heat model selected by a definition."""
    if not spec.bearing_set:
        return lambda point, temperatures: ({}, ())
    if spec.heat.model != "table":
        return BearingMechanics(spec)
    needs_contacts = any(group.ball_row.kind == "contact" for group in spec.bearing_set)
    mechanics = BearingMechanics(spec) if needs_contacts else None

    def by_table(
        point: OperatingPoint, temperatures: Mapping[str, BearingTemperatures]
    ) -> tuple[Mapping[str, BearingHeat], tuple[CodedWarning, ...]]:
        values, warnings = table_heat(spec, point)
        if mechanics is None:
            return {name: BearingHeat(value, {"table": value}) for name, value in values.items()}, warnings
        states, said = mechanics(point, temperatures)
        heat = {
            name: replace(states[name], total=value, terms={"table": value}) for name, value in values.items()
        }
        return heat, warnings + said

    return by_table


def grows(spec: MachineSpec) -> bool:
    """Whether elastic bodies carry rings whose fits change with temperature."""
    return spec.follows_preload and any(group.fit for group in spec.bearing_set)


def at_assembly_size(spec: MachineSpec) -> MachineSpec:
    """The machine with bearings that keep their size at assembly."""
    return spec.model_copy(update={"heat": spec.heat.model_copy(update={"thermal_preload": False})})


def table_heat(spec: MachineSpec, point: OperatingPoint) -> tuple[dict[str, float], tuple[CodedWarning, ...]]:
    """Heat of every bearing by the table, W: linear in speed, first order in thrust.

    Beyond the last speed the last segment is continued and a warning says so.
    """
    end = spec.heat.table.speed[-1]
    warnings: tuple[CodedWarning, ...] = ()
    if point.speed > end * (1.0 + 1e-9):
        text = (
            f"Speed {point.speed * 30 / np.pi:.0f} rpm lies beyond the heat table, which ends at "
            f"{end * 30 / np.pi:.0f} rpm; its last segment was continued."
        )
        warnings = (CodedWarning("heat_table_extrapolated", text),)
    names = [bearing.name for _, bearing in spec.bearings]
    heat = heat_of_table(spec, np.array([point.speed]), np.array([point.thrust]))[0]
    return dict(zip(names, heat.tolist(), strict=True)), warnings


def heat_of_table(
    spec: MachineSpec, speed: NDArray[np.float64], thrust: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Heat of every bearing by the table, (n, n_bearings) W, in the order of ``spec.bearings``.

    Parameters
    ----------
    speed : (n,) ndarray, [rad/s]
    thrust : (n,) ndarray, [N]
    """
    table = spec.heat.table
    columns = [
        group.heat_factor.value
        * HEAT_MODELS["table"](
            speed,
            table.speed,
            table.heat[bearing.name],
            thrust,
            thrust_coefficient=table.thrust_coefficient.get(bearing.name, 0.0),
            reference_thrust=table.reference_thrust,
        )
        for group, bearing in spec.bearings
    ]
    return np.stack(columns, axis=-1) if columns else np.empty((len(speed), 0))


class BearingMechanics:
    """Equilibrium, films and friction of every bearing set of a machine.

    The heat level is the definition's; with ``heat.model = "table"`` only the
    mechanics are used.

    Parameters
    ----------
    seats : mapping of bearing set to SeatBodies, optional
        Elastic bodies that carry rings with fits; thick-walled cylinders without.
    """

    def __init__(self, spec: MachineSpec, seats: Mapping[str, SeatBodies] | None = None) -> None:
        self.spec = spec
        self.lubricants = {group.name: SetLubricant(spec, group) for group in spec.bearing_set}
        level = spec.heat.model
        self.options = HeatOptions(
            level="palmgren" if level == "table" else level,
            palmgren_f0=spec.heat.palmgren_f0,
            skf_friction_ehl=spec.heat.skf_mu_ehl,
        )
        require_known_friction(spec)
        elastic, self.sets = seats or {}, {}
        for group in spec.bearing_set:
            mounted = assembled_set(spec, group)
            if group.name in elastic:
                mounted = replace(mounted, seats=elastic[group.name], recent={})
            self.sets[group.name] = mounted
        self.radial_loads = radial_loads(spec)

    def states(
        self,
        point: OperatingPoint,
        temperatures: Mapping[str, BearingTemperatures],
        *,
        expand: bool,
        options: HeatOptions | None = None,
    ) -> dict[str, BearingState]:
        """Mechanical state of every bearing.

        Parameters
        ----------
        expand : bool
            Whether the parts grow with their temperature, or keep the size they
            were assembled with; the film has its temperature either way.
        options : HeatOptions, optional
            Another heat model than the definition's.

        Raises
        ------
        NoEquilibriumError, OutOfValidityError
        """
        found: dict[str, BearingState] = {}
        for group in self.spec.bearing_set:
            around = [[temperatures[bearing.name] for bearing in group.bearing]]
            if isinstance(self.sets[group.name], RollerSet):
                (states,) = self._roller_states(group, point, around, expand, options)
            else:
                mounted, (set_temperatures,) = self._mounted(group, around, expand)
                states = solve_bearing_set(
                    mounted,
                    point.speed,
                    self._load(group, point),
                    set_temperatures,
                    lubricant=self.lubricants[group.name].at(point.speed),
                    control=_control(options or self.options),
                    heat=self.lubricants[group.name].options(options or self.options),
                )
                if group.spring_force:
                    states = tuple(replace(state, preload=state.axial_force) for state in states)
            found |= {state.name: state for state in states}
        return found

    def states_over_thrust(
        self,
        group: BearingSet,
        point: OperatingPoint,
        thrusts: Sequence[float],
        temperatures: Mapping[str, BearingTemperatures],
    ) -> tuple[tuple[BearingState, ...], ...]:
        """States of one set at several thrusts (N), without the preload that would remain.

        Parts keep the size of assembly.
        """
        around = [[temperatures[bearing.name] for bearing in group.bearing]] * len(thrusts)
        points = [replace(point, thrust=float(thrust)) for thrust in thrusts]
        if isinstance(self.sets[group.name], RollerSet):
            return tuple(self._roller_states(group, own, around[:1], False)[0] for own in points)
        mounted, kelvins = self._mounted(group, around, False)
        lubricant, loads = self.lubricants[group.name], [self._load(group, own) for own in points]
        return solve_states(
            mounted, point.speed, loads, kelvins, lubricant=lubricant.at(point.speed),
            control=_control(self.options), heat=lubricant.options(self.options),
        )  # fmt: skip

    def knows(self, temperature: float) -> bool:
        """Whether the viscosity of every lubricant is known at a temperature (K)."""
        try:
            for lubricant in self.lubricants.values():
                lubricant.at(0.0).kinematic_viscosity(temperature)
        except OutOfValidityError:
            return False
        return True

    def over_film_temperature(self, point: OperatingPoint, temperatures: ArrayLike) -> dict[str, FilmCurves]:
        """Heat and contacts of every bearing over its film temperature, at the size of assembly.

        Parameters
        ----------
        temperatures : (n,) array_like, [K]

        Raises
        ------
        NoEquilibriumError, OutOfValidityError
        """
        kelvin = np.asarray(temperatures, dtype=float)
        names = [bearing.name for _, bearing in self.spec.bearings]
        around = [dict.fromkeys(names, BearingTemperatures(*(value,) * 5)) for value in kelvin.tolist()]
        heat, conductance = self.heat_and_conductance(point, around, expand=False)
        return {
            name: FilmCurves(kelvin, heat[:, index], *conductance[:, index].T)
            for index, name in enumerate(names)
        }

    def heat_and_conductance(
        self,
        point: OperatingPoint,
        temperatures: Sequence[Mapping[str, BearingTemperatures]],
        *,
        expand: bool,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Heat (n, n_bearings) [W] and ball conductances (n, n_bearings, 2) [W/K] at n states at once.

        Parameters
        ----------
        expand : bool
            As of :meth:`states`.

        Raises
        ------
        NoEquilibriumError, OutOfValidityError
            One of the states does not exist.
        """
        heat, conductance = [], []
        for group in self.spec.bearing_set:
            around = [[state[bearing.name] for bearing in group.bearing] for state in temperatures]
            if isinstance(self.sets[group.name], RollerSet):
                found = self._roller_states(group, point, around, expand)
            else:
                mounted, set_temperatures = self._mounted(group, around, expand)
                found = solve_states(
                    mounted,
                    point.speed,
                    self._load(group, point),
                    set_temperatures,
                    lubricant=self.lubricants[group.name].at(point.speed),
                    control=_control(self.options),
                    heat=self.lubricants[group.name].options(self.options),
                )
            for states in zip(*found, strict=True):
                paths = [self._ball_path(group, state) for state in states]
                heat.append([group.heat_factor.value * state.heat.total for state in states])
                conductance.append([(path.inner, path.outer) for path in paths])
        return np.array(heat).T, np.array(conductance).swapaxes(0, 1)

    def _load(self, group: BearingSet, point: OperatingPoint) -> mounting.ExternalLoad:
        """External load of a set."""
        return mounting.ExternalLoad(self.spec.axial_load(group, point.thrust), self.radial_loads[group.name])

    def _roller_states(
        self,
        group: BearingSet,
        point: OperatingPoint,
        around: list[list[BearingTemperatures]],
        expand: bool,
        options: HeatOptions | None = None,
    ) -> tuple[tuple[BearingState, ...], ...]:
        """Roller bearings of a set at several states."""
        return solve_roller_set(
            self.sets[group.name],
            point.speed,
            self._load(group, point),
            self._set_temperatures(group, around, expand),
            lubricant=self.lubricants[group.name].at(point.speed),
            heat=self.lubricants[group.name].options(options or self.options),
        )

    def _set_temperatures(
        self, group: BearingSet, around: list[list[BearingTemperatures]], expand: bool
    ) -> list[mounting.SetTemperatures]:
        if expand:
            return [self._expanded(state, group.assembly_temperature) for state in around]
        return [self._as_assembled(state) for state in around]

    def _mounted(
        self, group: BearingSet, around: list[list[BearingTemperatures]], expand: bool
    ) -> tuple[mounting.BearingSet, list[mounting.SetTemperatures]]:
        """A set and its temperatures at several states, as the mechanics takes them."""
        mounted = self.sets[group.name]
        found = self._set_temperatures(group, around, expand)
        return (mounted if expand else mounted.with_rigid_rings()), found

    def _ball_path(self, group: BearingSet, state: BearingState) -> BallConductance:
        bearing = next(item for item in group.bearing if item.name == state.name)
        kind, lubricant = self.spec.bearing_types[group.type_name(bearing)], self.lubricants[group.name]
        return ball_conductance(
            state,
            lubricant.at(state.speed),
            ring_conductivity=self.spec.materials[kind.ring_material].thermal_conductivity,
            ball_conductivity=self.spec.materials[kind.element_material].thermal_conductivity,
            wetted_share=lubricant.wetted_share,
        )

    @staticmethod
    def _expanded(around: list[BearingTemperatures], assembly: float) -> mounting.SetTemperatures:
        return mounting.SetTemperatures(
            bearings=tuple(
                mounting.BearingTemperatures(
                    item.inner, item.outer, item.ball, shaft_seat=item.shaft, housing_seat=item.housing
                )
                for item in around
            ),
            shaft=float(np.mean([item.shaft for item in around])),
            housing=float(np.mean([item.housing for item in around])),
            assembly=assembly,
            shifts=np.stack([item.shifts for item in around]) if around[0].shifts is not None else None,
        )

    @staticmethod
    def _as_assembled(around: list[BearingTemperatures]) -> mounting.SetTemperatures:
        cold = mounting.ROOM_TEMPERATURE
        return mounting.SetTemperatures(
            bearings=tuple(
                mounting.BearingTemperatures(
                    cold, cold, cold, mounting.BearingTemperatures(item.inner, item.outer, item.ball).film
                )
                for item in around
            ),
            shaft=cold,
            housing=cold,
        )

    def __call__(
        self, point: OperatingPoint, temperatures: Mapping[str, BearingTemperatures]
    ) -> tuple[dict[str, BearingHeat], tuple[CodedWarning, ...]]:
        """Heat, contacts and films of every bearing; the heat model's interface."""
        states = self.states(point, temperatures, expand=self.spec.follows_preload)
        factors = {bearing.name: group.heat_factor.value for group, bearing in self.spec.bearings}
        groups = {bearing.name: group for group, bearing in self.spec.bearings}
        heat, warnings = {}, []
        seats = self._seats(point, temperatures, states) if self.spec.follows_preload else {}
        for name, state in states.items():
            path = self._ball_path(groups[name], state)
            terms = {term: factors[name] * value for term, value in state.heat.terms.items()}
            heat[name] = BearingHeat(
                total=factors[name] * state.heat.total,
                terms=terms,
                contact_angle_inner=state.contact_angle_inner,
                contact_angle_outer=state.contact_angle_outer,
                preload=state.preload,
                axial_load=state.axial_force,
                axial_stiffness=state.axial_stiffness,
                film_thickness=state.thinnest_film,
                film_thickness_ratio=state.smallest_film_ratio,
                conductance_inner=path.inner,
                conductance_outer=path.outer,
                contact_pressure=float(np.max(state.balls.pressure)),
                ball_forces=state.ball_forces,
                **seats.get(name, {}),
            )
            warnings += state.warnings
        for lubricant in self.lubricants.values():
            warnings += lubricant.warnings(self.options)
        return heat, tuple(warnings)

    def _seats(
        self,
        point: OperatingPoint,
        temperatures: Mapping[str, BearingTemperatures],
        states: Mapping[str, BearingState],
    ) -> dict[str, dict[str, tuple[float, float]]]:
        """Pressures and gaps of the seats of every bearing that elastic bodies carry."""
        found = {}
        for group in self.spec.bearing_set:
            mounted = self.sets[group.name]
            if isinstance(mounted, RollerSet) or mounted.seats is None:
                continue
            seats = mounted.seats
            own = [states[bearing.name] for bearing in group.bearing]
            inner, outer = np.array([state.ball_forces for state in own]).T
            thermal = np.stack([temperatures[state.name].shifts for state in own])
            pressure, gap = seats.law(thermal, point.speed, outer - inner).seats(inner)
            for index, state in enumerate(own):
                pair = slice(2 * index, 2 * index + 2)
                found[state.name] = {
                    "seat_pressure": tuple(pressure[pair].tolist()),
                    "seat_gap": tuple(gap[pair].tolist()),
                }
        return found

    def assembled_seats(self) -> dict[str, tuple[tuple[float, float], ...]]:
        """Pressure (Pa) and gap (m) of every bearing's inner and outer seat as assembled."""
        found = {}
        for mounted in self.sets.values():
            if isinstance(mounted, RollerSet) or mounted.seats is None:
                continue
            radial = np.array([state.radial_force for state in mounted.mounted_states()])
            pressure, gap = mounted.seats.law().seats(radial)
            for index, bearing in enumerate(mounted.bearings):
                pair = slice(2 * index, 2 * index + 2)
                found[bearing.name] = tuple(zip(pressure[pair].tolist(), gap[pair].tolist(), strict=True))
        return found


def _control(options: HeatOptions) -> str:
    """Raceway control (attitude of the balls) that the heat model needs."""
    return HEAT_MODELS[options.level].ball_attitude
