"""The fast model of a machine with geometry as a state space whose matrices follow speed and coolant."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.machine_spec import MachineSpec, NaturalFilm
from spindle_fem.model.reduced.defined_effects import NO_EFFECTS, ActiveEffects
from spindle_fem.model.reduced.drive import LARGEST_STEP, STANDARD
from spindle_fem.model.reduced.fast_model import FastModel
from spindle_fem.model.reduced.film_heat import film_heat_of
from spindle_fem.model.reduced.resolved_jumps import least_jump, rule_of_jumps
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.physics.coolant.properties import coolant_by_name
from spindle_fem.recordings.standard_inputs import standard_inputs
from spindle_fem.studies.export.coolant_export import (
    SCALED_FLOW,
    WALL_TOLERANCE,
    CoolantOperators,
    WallRise,
    coolant_table,
    wall_feedback,
)
from spindle_fem.studies.export.effect_export import ExportedEffects, heat_tables
from spindle_fem.studies.export.feedback_export import (
    SURROUNDINGS_RANGE,
    feedback_tables,
    preload_of,
)
from spindle_fem.studies.export.operator_tables import PARTS, changes_at, circuit_table, speed_table
from spindle_fem.studies.export.source_export import source_loads
from spindle_fem.studies.export.state_space import (
    CELSIUS,
    CONSTANT,
    TR_BDF2,
    FeedbackTable,
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
# Warming of the coolant by friction allowed for at the upper end of its properties, K.
OWN_WARMING = 2.0
# Load that is the square of the speed.
ROTATION = "rotation"
# Largest thrust, in the larger of the definition's and the heat table's reference.
THRUST_SHARE = 2.0


def geometry_state_space(
    fast: FastModel, name: str, highest_speed: float, effects: ActiveEffects = NO_EFFECTS
) -> StateSpace:
    """State space of a fast model.

    A film that follows the channel's wall is taken with the wall as far above the inlet as it settles at the
    definition's operating point; what it changes beyond follows the wall's mean temperature.

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
    follows = fast.channel is not None and fast.channel.film_follows_wall
    return _state_space(fast, name, highest_speed, held, WallRise.of(fast) if follows else None)


def _state_space(
    fast: FastModel, name: str, highest_speed: float, effects: ExportedEffects, wall: WallRise | None
) -> StateSpace:
    """State space; films in the channel follow its wall where one is given."""
    spec = fast.spec
    nominal = OperatingPoint.of(spec)
    film_heat = film_heat_of(fast)
    if film_heat is not None and film_heat.preload is None:
        film_heat.friction_map.require_complete()
    inputs = _inputs(fast, highest_speed)
    sources = source_loads(spec, inputs)
    effect_tables = heat_tables(effects, inputs)
    inputs += sources.inputs
    position = {item.name: number for number, item in enumerate(inputs)}
    tables = {"speed": speed_table(fast, effects, nominal, highest_speed)}
    circuits = circuit_table(fast, effects, nominal, highest_speed)
    tables |= {} if circuits is None else {"circuits": circuits}
    coolant = CoolantOperators(fast, effects, nominal, wall)
    if fast.channel is not None:
        ends = _flow_range(nominal), _inlet_range(spec)
        coolant, axes = coolant.over(*ends)
        tables["coolant"] = coolant_table(coolant, axes)
    tables = {key: table for key, table in tables.items() if table.values.shape[-1]}
    # Loads that are inputs or constants come first, those of tables behind.
    n_heat, n_load = len(fast.heat_places), len(fast.load_names)
    by_table = film_heat is None or not film_heat.bearings
    heats = range(n_heat) if by_table else ()
    heat_over_inputs = [*sources.tables, *effect_tables]
    # Rotation stretches what displacement sensors read.
    spins = fast.model.probe_spins
    turning = [PowerLoad(ROTATION, "rad**2/s**2", position["speed"], 1.0, 2.0)] if np.any(spins) else []
    beside = [PowerLoad(CONSTANT, "1", -1), *turning, *sources.powers]
    own = range(n_load, n_load + len(beside) + len(heat_over_inputs))
    order = [*range(n_heat, n_load), *own[: len(beside)], *heats, *own[len(beside) :]]
    powers = [_fluid_load(fast, load, position) for load in fast.load_names[n_heat:]]
    powers += beside
    loads = {load.name: load.unit for load in powers}
    if by_table:
        loads |= {f"heat.{place}": "W" for place in fast.heat_places}
    loads |= {table.load: "W" for table in heat_over_inputs}
    places = [*sources.places, *(table.place for table in heat_over_inputs)]
    # The constant load and rotation heat nothing.
    cold = (1 + len(turning)) * [np.zeros(fast.model.size)]
    warmed = np.array([*cold, *(fast.model.place(place) for place in places)]).T
    operators = fast.operators(
        nominal if wall is None else coolant.at_wall(nominal),
        effects.factors,
        changes=changes_at(fast, effects, nominal),
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
    entering = {*(load.name for load in beside), *(item.load for item in heat_over_inputs)}
    arrays["load"][:, [load in entering for load in loads]] = modes.T @ warmed
    if turning:
        arrays["feedthrough"][fast.point_rows, list(loads).index(ROTATION)] = spins
    arrays["uniform"] = modes.T @ storage @ fast.model.one
    sensors = {item.name for item in spec.displacement_sensor}
    outputs = {channel: "um" if channel in sensors else CELSIUS for channel in fast.channels}
    header = header_of(name, TR_BDF2, LARGEST_STEP, inputs, outputs, loads)
    header["notes"] += [*sources.notes, *effects.notes]
    header["jumps"] = rule_of_jumps()
    largest = [(item.name, item.default if item.high is None else item.high) for item in inputs]
    arrays["least_jump"] = np.array([least_jump(*item) for item in largest])
    if coolant.scaling is not None:
        header[SCALED_FLOW] = [position[name] for name in ("coolant_flow", "coolant_inlet")]
        position[SCALED_FLOW] = -1
        arrays |= {"scaled_flow.axis": coolant.scaling.inlet, "scaled_flow.values": coolant.scaling.factor}

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
    of_wall = None if wall is None else wall_feedback(coolant, coolant.axes(*ends, WALL_TOLERANCE))
    followed += [] if of_wall is None else [of_wall]
    for number, table in enumerate(followed):
        numbers = [len(inputs) + number, *(position[item] for item in table.inputs)]
        add_table(f"follows{number}", "feedback_tables", table.axes, numbers, table.values)
    if of_wall is not None:
        header["held_tables"].append(header["feedback_tables"][-1])
    mounted = preload_of(fast)
    if mounted is not None:
        header["responses"] = mounted.header(position)
        arrays |= mounted.arrays(modes)
    if followed:
        arrays |= _feedback_arrays(followed, modes, list(loads), len(fast.channels))
        for sensor, line in effects.sensors:
            arrays["feedback.read"][:, fast.channels.index(sensor)] *= line.gain
    return StateSpace(header, arrays)


def _feedback_arrays(
    tables: list[FeedbackTable], modes: Array, loads: list[str], outputs: int
) -> dict[str, Array]:
    """Arrays of all heats that follow temperatures, one behind the other."""

    def rows(weights: list[dict[str, float]]) -> Array:
        return np.array([[own.get(name, 0.0) for name in loads] for own in weights])

    first = np.cumsum([0, *(table.values.shape[-1] for table in tables)])
    columns = [table.column + start for table, start in zip(tables, first, strict=False)]
    none = [np.full(len(table.column), -1) for table in tables]
    less = [
        own if table.less is None else np.where(table.less < 0, -1, table.less + start)
        for table, own, start in zip(tables, none, first, strict=False)
    ]
    response = [
        own if table.response is None else table.response for table, own in zip(tables, none, strict=True)
    ]
    return {
        "feedback.sense": np.array([table.sense for table in tables]) @ modes,
        "feedback.sense_load": rows([table.sense_load for table in tables]),
        "feedback.column": np.concatenate(columns).astype(float),
        "feedback.less": np.concatenate(less).astype(float),
        "feedback.response": np.concatenate(response).astype(float),
        "feedback.out": np.concatenate([table.out for table in tables]) @ modes,
        "feedback.into": np.concatenate([table.into for table in tables]) @ modes,
        "feedback.load": rows([own for table in tables for own in table.load]),
        "feedback.read": np.concatenate(
            [np.zeros((len(table.column), outputs)) if table.read is None else table.read for table in tables]
        ),
    }


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
        "coolant_flow": _flow_range(OperatingPoint.of(spec)),
    }
    found = []
    for name, unit in zip(STANDARD, UNITS, strict=True):
        if spec.channel is None and name.startswith("coolant"):
            continue
        default = round(usual[name] - ZERO_CELSIUS_K, 9) if unit == CELSIUS else usual[name]
        found.append(ModelInput(name, unit, default, *ranges[name], magnitude=name == "speed"))
    return found


def _flow_range(point: OperatingPoint) -> tuple[float, float]:
    """Flows about a point's, m³/s."""
    low, high = (point.coolant_flow * share for share in FLOW_SHARES)
    return low, high


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
    if name in fast.inputs.inlets:
        return PowerLoad(name, CELSIUS, -1, fast.inputs.inlets[name] - ZERO_CELSIUS_K)
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
