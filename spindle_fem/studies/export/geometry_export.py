"""The fast model of a machine with geometry as a state space whose matrices follow speed and coolant."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.machine_spec import MachineSpec, NaturalFilm
from spindle_fem.effects.framework.term import CHANNEL_FILM
from spindle_fem.errors import SpecError
from spindle_fem.model.reduced.class_operators import NO_CHANGES
from spindle_fem.model.reduced.coolant_maps import CoolantMaps, coolant_maps
from spindle_fem.model.reduced.defined_effects import NO_EFFECTS, ActiveEffects
from spindle_fem.model.reduced.drive import LARGEST_STEP, STANDARD, WarmedPoint
from spindle_fem.model.reduced.fast_model import FastModel
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.physics.coolant.properties import coolant_by_name
from spindle_fem.recordings.standard_inputs import standard_inputs
from spindle_fem.studies.export.effect_export import ExportedEffects, heat_tables
from spindle_fem.studies.export.feedback_export import (
    SURROUNDINGS_RANGE,
    FeedbackTable,
    feedback_tables,
    film_heat_of,
)
from spindle_fem.studies.export.interpolation_axes import refined_axis, values_on
from spindle_fem.studies.export.source_export import source_loads
from spindle_fem.studies.export.state_space import (
    CELSIUS,
    CONSTANT,
    TR_BDF2,
    ModelInput,
    PowerLoad,
    StateSpace,
    header_of,
    modal_basis,
    power_load_arrays,
)
from spindle_fem.units import ZERO_CELSIUS_K

Array = NDArray[np.float64]

UNITS = ("rad/s", "N", CELSIUS, CELSIUS, "m**3/s")
# Range of the coolant about the definition's: shares of its flow, kelvin about its inlet temperature.
FLOW_SHARES = (0.25, 2.0)
INLET_RANGE = (-10.0, 20.0)
# What friction may warm the coolant by at the upper end of its properties, K.
OWN_WARMING = 2.0
# Largest thrust, in the larger of the definition's and the heat table's reference.
THRUST_SHARE = 2.0
# Of coefficients, between the points of a table.
TOLERANCE = 5e-5
# Of the coolant's operators, left out with the directions in which they hardly vary.
LEFT_OUT = 1e-7
# Points of the coolant's table.
MOST_POINTS = 3000
PARTS = ("conduction", "load", "output", "feedthrough")


@dataclass(frozen=True, slots=True)
class OperatorTable:
    """Matrices whose sum, weighted by a table over inputs, is added to those of the nominal point.

    Attributes
    ----------
    inputs : tuple of str
        The table's axes.
    axes : tuple of ndarray
    values : (n, ..., m) ndarray
        Weights.
    parts : mapping of str to (m, ., .) ndarray
        ``conduction``, ``load``, ``output``, ``feedthrough``, on the fast model's own unknowns and loads.
    """

    inputs: tuple[str, ...]
    axes: tuple[Array, ...]
    values: Array
    parts: dict[str, Array]


def geometry_state_space(
    fast: FastModel, name: str, highest_speed: float, effects: ActiveEffects = NO_EFFECTS
) -> StateSpace:
    """State space of a fast model.

    A film that follows the channel's wall is no table over inputs: it is taken with the wall as far above
    the inlet as it settles at the definition's operating point, where the film counts.

    Parameters
    ----------
    name : str
        Of the machine.
    highest_speed : float, [rad/s]
    effects : ActiveEffects
        Of its definition.

    Raises
    ------
    FaultsError
        Effects that an exported model cannot hold.
    """
    held = ExportedEffects(fast, effects)
    space, modes = _state_space(fast, name, highest_speed, held, None)
    if fast.channel is None or not fast.channel.film_follows_wall:
        return space
    model = space.model()
    model.settle({})
    wall = fast.channel.walls((modes @ model.state)[None])[0] + ZERO_CELSIUS_K
    inlet = OperatingPoint.of(fast.spec).coolant_inlet_temperature
    space, _ = _state_space(fast, name, highest_speed, held, wall - inlet)
    space.header["notes"].append(
        "the coolant's film is that of a wall as far above the inlet as at the definition's operating point"
    )
    return space


def _state_space(
    fast: FastModel, name: str, highest_speed: float, effects: ExportedEffects, wall_rise: Array | None
) -> tuple[StateSpace, Array]:
    """State space, and the fast model's unknowns of its modes; ``wall_rise`` as :func:`_at_wall` has it."""
    spec = fast.spec
    nominal = OperatingPoint.of(spec)
    film_heat = film_heat_of(fast)
    inputs = _inputs(fast, highest_speed)
    sources = source_loads(spec, inputs)
    effect_tables = heat_tables(effects, inputs)
    inputs += sources.inputs
    position = {item.name: number for number, item in enumerate(inputs)}
    tables = {"speed": _speed_table(fast, effects, nominal, highest_speed)}
    if fast.channel is not None:
        tables["coolant"] = _coolant_table(fast, effects, nominal, wall_rise)
    tables = {key: table for key, table in tables.items() if table.values.shape[-1]}
    # Loads that are inputs or constants come first, those of tables behind.
    n_heat, n_load = len(fast.heat_places), len(fast.load_names)
    by_table = film_heat is None or not film_heat.bearings
    heats = range(n_heat) if by_table else ()
    heat_over_inputs = [*sources.tables, *effect_tables]
    own = range(n_load, n_load + 1 + len(sources.powers) + len(heat_over_inputs))
    order = [*range(n_heat, n_load), *own[: 1 + len(sources.powers)], *heats, *own[1 + len(sources.powers) :]]
    powers = [_fluid_load(fast, load, position) for load in fast.load_names[n_heat:]]
    powers += [PowerLoad(CONSTANT, "1", -1), *sources.powers]
    loads = {load.name: load.unit for load in powers}
    if by_table:
        loads |= {f"heat.{place}": "W" for place in fast.heat_places}
    loads |= {table.load: "W" for table in heat_over_inputs}
    places = [*sources.places, *(table.place for table in heat_over_inputs)]
    # The constant load drives nothing by itself.
    warmed = np.array([np.zeros(fast.model.size), *(fast.model.place(place) for place in places)]).T
    operators = fast.operators(
        _at_wall(nominal, wall_rise),
        effects.factors,
        changes=_changes(fast, effects, nominal),
        conductances=effects.conductances,
    )
    storage = fast.storage(effects.factors, effects.capacities)
    modes = modal_basis(storage, 0.5 * (operators.conduction + operators.conduction.T))

    def arrays_of(conduction: Array, load: Array, output: Array, feedthrough: Array) -> dict[str, Array]:
        load, feedthrough = (
            np.pad(m, (*[(0, 0)] * (m.ndim - 1), (0, len(own)))) for m in (load, feedthrough)
        )
        found = (
            modes.T @ conduction @ modes,
            modes.T @ load[..., order],
            output @ modes,
            feedthrough[..., order],
        )
        return dict(zip(PARTS, found, strict=True))

    arrays = power_load_arrays(powers)
    arrays |= arrays_of(operators.conduction, operators.loads, operators.outputs, operators.output_inputs)
    entering = {CONSTANT, *(load.name for load in sources.powers), *(item.load for item in heat_over_inputs)}
    arrays["load"][:, [load in entering for load in loads]] = modes.T @ warmed
    arrays["uniform"] = modes.T @ storage @ fast.model.one
    sensors = {item.name for item in spec.displacement_sensor}
    outputs = {channel: "um" if channel in sensors else CELSIUS for channel in fast.channels}
    header = header_of(name, TR_BDF2, LARGEST_STEP, inputs, outputs, loads)
    header["notes"] += [*sources.notes, *effects.notes]

    def add_table(key: str, kind: str, axes: tuple[Array, ...], numbers: list[int], values: Array) -> None:
        header[kind].append(key)
        header["table_inputs"][key] = numbers
        arrays[f"{key}.values"] = values
        arrays.update({f"{key}.axis{number}": axis for number, axis in enumerate(axes)})

    if by_table:
        heat_inputs, heat_axes, heat = _heat_table(fast, effects, inputs)
        add_table("heat", "load_tables", heat_axes, [position[item] for item in heat_inputs], heat)
    for table in heat_over_inputs:
        add_table(
            table.key, "load_tables", table.axes, [position[item] for item in table.inputs], table.values
        )
    for key, table in tables.items():
        parts = arrays_of(*(table.parts[part] for part in PARTS))
        for sensor, line in effects.sensors:
            for part in ("output", "feedthrough"):
                parts[part][:, fast.channels.index(sensor)] *= line.gain
        arrays |= {f"{key}.{part}": value for part, value in parts.items()}
        add_table(key, "operator_tables", table.axes, [position[item] for item in table.inputs], table.values)
    effects.read(fast.channels, list(loads), arrays["output"], arrays["feedthrough"])
    followed = feedback_tables(fast, CONSTANT, highest_speed, effects)
    for number, table in enumerate(followed):
        numbers = [len(inputs) + number, *(position[item] for item in table.inputs)]
        add_table(f"follows{number}", "feedback_tables", table.axes, numbers, table.values)
    if followed:
        arrays |= _feedback_arrays(followed, modes, list(loads))
    return StateSpace(header, arrays), modes


def _at_wall(point: OperatingPoint, wall_rise: Array | None) -> OperatingPoint:
    """A point at which the channel's wall is so far above the inlet, cell by cell [K]; at it where None."""
    if wall_rise is None:
        return point
    own = {name: getattr(point, name) for name in OperatingPoint.__slots__}
    return WarmedPoint(**own, channel_wall=point.coolant_inlet_temperature + wall_rise)


def _feedback_arrays(tables: list[FeedbackTable], modes: Array, loads: list[str]) -> dict[str, Array]:
    """Arrays of all heats that follow temperatures, one behind the other."""

    def rows(weights: list[dict[str, float]]) -> Array:
        return np.array([[own.get(name, 0.0) for name in loads] for own in weights])

    first = np.cumsum([0, *(table.values.shape[-1] for table in tables)])
    columns = [table.column + start for table, start in zip(tables, first, strict=False)]
    return {
        "feedback.sense": np.array([table.sense for table in tables]) @ modes,
        "feedback.sense_load": rows([table.sense_load for table in tables]),
        "feedback.column": np.concatenate(columns).astype(float),
        "feedback.out": np.concatenate([table.out for table in tables]) @ modes,
        "feedback.into": np.concatenate([table.into for table in tables]) @ modes,
        "feedback.load": rows([own for table in tables for own in table.load]),
    }


def _changes(fast: FastModel, effects: ExportedEffects, point: OperatingPoint) -> dict[str, float]:
    """Factors on coefficients at a point: effects, and ball rows whose contacts follow speed and thrust."""
    film_heat = film_heat_of(fast)
    return effects.changes(point, NO_CHANGES if film_heat is None else film_heat.operating_factor(point, {}))


def _inputs(fast: FastModel, highest_speed: float) -> list[ModelInput]:
    """The standard inputs; the coolant's where there is one."""
    spec, film_heat = fast.spec, film_heat_of(fast)
    usual = standard_inputs(spec)
    thrusts = _thrust_range(spec) if film_heat is None else film_heat.friction_map.thrust[[0, -1]].tolist()
    follows = any(isinstance(film, NaturalFilm) and film.temperature == "ambient" for film in spec.film)
    ranges: dict[str, tuple[float | None, float | None]] = {
        "speed": (0.0, highest_speed),
        "thrust": tuple(thrusts),
        "ambient": SURROUNDINGS_RANGE if follows else (None, None),
        "coolant_inlet": _inlet_range(spec),
        "coolant_flow": tuple(usual["coolant_flow"] * share for share in FLOW_SHARES),
    }
    found = []
    for name, unit in zip(STANDARD, UNITS, strict=True):
        if spec.channel is None and name.startswith("coolant"):
            continue
        default = round(usual[name] - ZERO_CELSIUS_K, 9) if unit == CELSIUS else usual[name]
        found.append(ModelInput(name, unit, default, *ranges[name], magnitude=name == "speed"))
    return found


def _inlet_range(spec: MachineSpec) -> tuple[float, float]:
    """Inlet temperatures about the definition's, °C, where the coolant's properties are known."""
    if spec.coolant is None:
        return -np.inf, np.inf
    coolant, usual = coolant_by_name(spec.coolant.fluid), spec.coolant.inlet_temperature
    low = max(usual + INLET_RANGE[0], coolant.lowest_temperature)
    high = max(usual, min(usual + INLET_RANGE[1], coolant.highest_temperature - OWN_WARMING))
    return low - ZERO_CELSIUS_K, high - ZERO_CELSIUS_K


def _thrust_range(spec: MachineSpec) -> tuple[float, float]:
    """Thrusts at which no bearing's heat is cut off at zero, N."""
    table = spec.heat.table
    steepest = max((abs(value) for value in table.thrust_coefficient.values()), default=0.0)
    lowest = table.reference_thrust * (1.0 - 1.0 / steepest) if steepest > 1.0 else 0.0
    return lowest, THRUST_SHARE * max(table.reference_thrust, spec.operation.thrust)


def _fluid_load(fast: FastModel, name: str, position: dict[str, int]) -> PowerLoad:
    """A fluid's temperature, or the coolant's own friction, whose load is for 1."""
    if name in position:
        return PowerLoad(name, CELSIUS, position[name])
    if name.startswith("fixed["):
        number = int(name.removeprefix("fixed[").removesuffix("]"))
        return PowerLoad(name, CELSIUS, -1, fast.inputs.fixed_fluids[number] - ZERO_CELSIUS_K)
    # Without a coolant its inlet drives nothing.
    return PowerLoad(name, "1", -1, float(name == "coolant_friction"))


def _heat_table(
    fast: FastModel, effects: ExportedEffects, inputs: list[ModelInput]
) -> tuple[tuple[str, ...], tuple[Array, ...], Array]:
    """Heat of every place over speed, and over thrust where it follows that."""
    table = fast.spec.heat.table
    speed, thrust = inputs[0], inputs[1]
    speeds = np.unique([*(s for s in table.speed if s < speed.high), 0.0, speed.high])
    thrusts = np.array([thrust.low, thrust.high])
    grid = np.array(np.meshgrid(speeds, thrusts, indexing="ij")).reshape(2, -1).T
    rest = np.tile([thrust.default] * (len(STANDARD) - 2), (len(grid), 1))
    loads, _ = fast.load_inputs(STANDARD, np.hstack((grid, rest)), effects.factors)
    heat = loads[:, : len(fast.heat_places)].reshape(speeds.size, thrusts.size, -1)
    if any(table.thrust_coefficient.values()):
        return ("speed", "thrust"), (speeds, thrusts), heat
    return ("speed",), (speeds,), heat[:, 0]


def _speed_table(
    fast: FastModel, effects: ExportedEffects, nominal: OperatingPoint, highest: float
) -> OperatorTable:
    """Coefficients that follow the speed, ball rows also the thrust, each with its own matrices."""
    names = [name for name in fast.model.coefficient_names if name != CHANNEL_FILM]

    def at(speed: float, thrust: float = nominal.thrust) -> Array:
        point = replace(nominal, speed=speed, thrust=thrust)
        found = fast.coefficients(point, effects.factors, _changes(fast, effects, point))
        return np.array([found[name] for name in names])

    inputs, axes = ("speed",), (refined_axis(at, 0.0, highest, TOLERANCE),)
    film_heat = film_heat_of(fast)
    if film_heat is not None and film_heat.friction_map.thrust.size > 1:
        ends = film_heat.friction_map.thrust[[0, -1]].tolist()
        inputs, axes = (
            ("speed", "thrust"),
            (*axes, refined_axis(lambda thrust: at(0.5 * highest, thrust), *ends, TOLERANCE)),
        )
    values = values_on(at, axes)
    base = at(nominal.speed)
    every = values.reshape(-1, len(names))
    moving = np.flatnonzero(np.any(every != base, axis=0))
    parts: dict[str, list[Array]] = {part: [] for part in PARTS}
    factors = effects.factors
    own = fast.coefficients(nominal, factors)
    for row in moving:
        # Twice the coefficient less once: its own share of the operators.
        point, value = nominal, own[names[row]]
        if value == 0.0:
            turning = float(axes[0][np.argmax(np.abs(every[:: every.shape[0] // axes[0].size, row]))])
            point = replace(nominal, speed=turning)
            value = fast.coefficients(point, factors)[names[row]]
        change = fast.change(point, factors, ({names[row]: 2.0}, {names[row]: 1.0}), ({}, {}))
        matrices = (change.conduction, change.loads, change.outputs, change.output_inputs)
        for part, matrix in zip(PARTS, matrices, strict=True):
            parts[part].append(matrix / value)
    stacked = {part: np.array(matrices) for part, matrices in parts.items()}
    return OperatorTable(inputs, axes, values[..., moving] - base[moving], stacked)


def _coolant_table(
    fast: FastModel, effects: ExportedEffects, nominal: OperatingPoint, wall_rise: Array | None
) -> OperatorTable:
    """What the coolant adds over flow and inlet temperature, on the few directions in which it varies."""

    def film(flow: float, inlet: float) -> tuple[Array, float, float]:
        point = replace(nominal, coolant_flow=flow, coolant_inlet_temperature=inlet + ZERO_CELSIUS_K)
        return fast.channel.film(_at_wall(point, wall_rise), effects.factors, effects.changes(point))

    def values(flow: float, inlet: float) -> Array:
        cells, rate, friction = film(flow, inlet)
        return np.array([cells.mean(), rate, friction])

    flow, inlet = nominal.coolant_flow, nominal.coolant_inlet_temperature - ZERO_CELSIUS_K
    flows = refined_axis(
        lambda at: values(at, inlet), *(flow * share for share in FLOW_SHARES), tolerance=TOLERANCE
    )
    inlets = refined_axis(lambda at: values(flow, at), *_inlet_range(fast.spec), tolerance=TOLERANCE)
    if flows.size * inlets.size > MOST_POINTS:
        raise SpecError(
            "coolant",
            f"its film changes so sharply that a table would need {flows.size * inlets.size} points.",
            "Export the machine without the effect or correlation that jumps; simulate takes it.",
        )
    shapes = _shapes(fast)
    sample = _coolant_sampler(fast, film)
    base = sample(flow, inlet)
    ends = np.cumsum([np.prod(shape) for shape in shapes])
    # Heats, loads and temperatures count alike.
    scale = np.concatenate(
        [np.full(part.shape, np.linalg.norm(part) or 1.0) for part in np.split(base, ends[:-1])]
    )
    rows = np.array([(sample(a, b) - base) / scale for a in flows for b in inlets])
    squares, directions = np.linalg.eigh(rows @ rows.T)
    kept = squares > LEFT_OUT**2 * len(rows)
    # Orthonormal directions of the operators, and every sample's coordinates along them.
    basis = (directions[:, kept].T @ rows) / np.sqrt(squares[kept])[:, None]
    weights = (rows @ basis.T).reshape(flows.size, inlets.size, -1)
    split = np.split(basis * scale, ends[:-1], axis=1)
    parts = {part: own.reshape(-1, *shape) for part, own, shape in zip(PARTS, split, shapes, strict=True)}
    return OperatorTable(("coolant_flow", "coolant_inlet"), (flows, inlets), weights, parts)


def _shapes(fast: FastModel) -> tuple[tuple[int, int], ...]:
    size, n_load, n_out = fast.model.size, len(fast.load_names), len(fast.channels)
    return (size, size), (size, n_load), (n_out, size), (n_out, n_load)


def _coolant_sampler(
    fast: FastModel, film: Callable[[float, float], tuple[Array, float, float]]
) -> Callable[[float, float], Array]:
    """Everything that the coolant adds at a flow [m³/s] and inlet [°C], one behind the other."""
    inlet, friction = (fast.load_names.index(name) for name in ("coolant_inlet", "coolant_friction"))
    outlets = [row for row, probe in enumerate(fast.spec.probe) if probe.kind == "coolant_outlet"][:1]

    def sample(flow: float, temperature: float) -> Array:
        maps: CoolantMaps = coolant_maps(fast.model, *film(flow, temperature))
        conduction, load, output, feedthrough = (np.zeros(shape) for shape in _shapes(fast))
        conduction += maps.conduction
        load[:, inlet], load[:, friction] = maps.inlet_load, maps.constant_load
        output[outlets], feedthrough[outlets, inlet] = maps.outlet, maps.outlet_inlet
        feedthrough[outlets, friction] = maps.outlet_constant
        return np.concatenate([part.ravel() for part in (conduction, load, output, feedthrough)])

    return sample
