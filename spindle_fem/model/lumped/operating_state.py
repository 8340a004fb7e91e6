"""A machine's network at one operating point: links, sources, streams and laws."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.machine_spec import NaturalFilm
from spindle_fem.definition.stream_films import StreamFilm
from spindle_fem.model.lumped.ball_contacts import BallContactLaw, ContactFaces
from spindle_fem.model.lumped.friction_table import FrictionTables
from spindle_fem.model.lumped.heat_laws import (
    ChannelFilm,
    CircuitLaw,
    CoolantLaw,
    FrictionLaw,
    WallFilmLaw,
    faces_by_cell,
)
from spindle_fem.model.lumped.links import SurfacePatch
from spindle_fem.model.lumped.machine_network import MachineNetwork
from spindle_fem.operation.bearing_heat import BearingTemperatures, HeatModel
from spindle_fem.operation.circuits import CircuitMarch, wall_cells
from spindle_fem.operation.coefficients import (
    ball_conductances,
    film_coefficient,
    gap_coefficient,
    stream_coefficients,
)
from spindle_fem.operation.friction_map import film_temperature
from spindle_fem.operation.heat_shares import heat_shares
from spindle_fem.operation.loads import BearingHeat
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.physics.coolant.regimes import ChannelState, select_film
from spindle_fem.recordings.source_heat import source_heat

Array = NDArray[np.float64]
Law = WallFilmLaw | CoolantLaw | CircuitLaw | FrictionLaw | BallContactLaw
# Wall less fluid, K; the points lie close because the coefficient has a cusp where both are equal.
FILM_RANGE = (-60.0, 140.0)
FILM_POINTS = 801


@dataclass(frozen=True, slots=True)
class Raceway:
    """Mean temperature of a raceway from nodes, balls and heat.

    ``T = node_weights @ T[nodes] + ball_weight * T_balls + per_heat * heat``.
    ``bypass`` is the share of the heat that leaves the raceway straight to the
    balls, node by node.
    """

    nodes: NDArray[np.int64]
    node_weights: Array
    ball_weight: float
    per_heat: float
    bypass: Array


@dataclass(frozen=True, slots=True)
class OperatingNetwork:
    """Equations of a machine network at an operating point.

    Ends of links are positions in nodes, then boundaries.

    Attributes
    ----------
    boundary_temperature : (b,) ndarray, [K]
    first, second : (m,) int64 ndarray
    conductance : (m,) ndarray, [W/K]
    kind : (m,) object ndarray of str
        ``solid``, ``balls``, ``gap``, or the name of a film's surface.
    heat : (n,) ndarray, [W]
        Given heat into each node.
    streams : tuple of (upstream, downstream) int64 ndarrays
    stream_rate : float, [W/K]
    raceways : mapping of bearing to (inner, outer) Raceway
    bearing_heat : mapping of bearing to BearingHeat
        At the state that conductances were taken at.
    heat_to : mapping of bearing to {"inner", "outer", "balls"}
        Shares of the friction heat.
    """

    machine: MachineNetwork
    point: OperatingPoint
    boundary_names: tuple[str, ...]
    boundary_temperature: Array
    first: NDArray[np.int64]
    second: NDArray[np.int64]
    conductance: Array
    kind: NDArray[np.object_]
    heat: Array
    streams: tuple[NDArray[np.int64], NDArray[np.int64]]
    stream_rate: float
    laws: tuple[Law, ...]
    raceways: Mapping[str, tuple[Raceway, Raceway]]
    bearing_heat: Mapping[str, BearingHeat]
    heat_to: Mapping[str, Mapping[str, float]]
    coolant_law: CoolantLaw | None

    @property
    def n_nodes(self) -> int:
        """Number of unknown temperatures."""
        return self.machine.n_nodes

    def raceway_temperatures(self, temperature: Array, name: str) -> tuple[float, float]:
        """Mean temperature of the inner and the outer raceway of a bearing, K."""
        heat = self.friction_heat(temperature)[name]
        ball = temperature[self.machine.ball_nodes[name]]
        return tuple(
            float(way.node_weights @ temperature[way.nodes] + way.ball_weight * ball + way.per_heat * heat)
            for way in self.raceways[name]
        )

    def friction_heat(self, temperature: Array) -> dict[str, float]:
        """Friction heat of every bearing at a state, W."""
        heat = {name: value.total for name, value in self.bearing_heat.items()}
        for law in self.laws:
            if isinstance(law, FrictionLaw):
                heat |= dict(zip(law.names, law.heat(temperature)[0].tolist(), strict=True))
        return heat


def operate(
    machine: MachineNetwork,
    point: OperatingPoint,
    heat_model: HeatModel,
    *,
    around: Mapping[str, BearingTemperatures] | None = None,
    friction: FrictionTables | None = None,
    coolant: CoolantLaw | None = None,
) -> OperatingNetwork:
    """Equations of a machine network at an operating point.

    Parameters
    ----------
    around : mapping of bearing to BearingTemperatures, optional
        State at which contacts conduct and heat without ``friction`` is made;
        the ambient temperature by default.
    friction : FrictionTables, optional
        Heat and contacts over film temperature (see :func:`tabulate_friction`);
        without it they are the heat model's at ``around``.
    coolant : CoolantLaw, optional
        Of the same machine and point, where it is at hand.
    """
    spec = machine.spec
    names = [bearing.name for _, bearing in spec.bearings]
    ambient = point.ambient_temperature
    if around is None:
        around = {name: BearingTemperatures(*(ambient,) * 5) for name in names}
    if friction is None:
        heats, _ = heat_model(point, around)
    else:
        films = {name: film_temperature(at.inner, at.outer, at.ball) for name, at in around.items()}
        heats = {name: friction.at(name, float(films[name])) for name in names}
    boundaries: dict[str, float] = {"ambient": ambient}
    links: list[tuple[NDArray, NDArray, Array, str]] = [
        (machine.links.first, machine.links.second, machine.links.conductance, "solid")
    ]
    laws: list[Law] = []
    heat = np.zeros(machine.n_nodes)
    raceways, heat_to, spreads = {}, {}, {}
    for group, bearing in spec.bearings:
        name = bearing.name
        raceways[name], heat_to[name], spreads[name] = _bearing(machine, group, name, heats[name], links)
    if friction is None:
        for name, spread in spreads.items():
            heat += heats[name].total * spread
    else:
        law_of_friction = _friction_law(machine, friction, raceways, spreads)
        laws.append(law_of_friction)
        faces = _contact_faces(machine, friction, heats, heat_to)
        if faces:
            laws.append(BallContactLaw.of(faces, law_of_friction, machine.n_nodes))
    for source in spec.source:
        heat += float(source_heat(source, point.inputs)) * machine.spread(source.place)
    _air(machine, point, boundaries, links, laws)
    streams, rate, law = (np.empty(0, int), np.empty(0, int)), 0.0, None
    if machine.coolant is not None:
        boundaries["coolant_inlet"] = point.coolant_inlet_temperature
        law = coolant_law(machine, point) if coolant is None else coolant
        rate = law.capacity_rate
        if isinstance(law.film, float):
            conductance = law.conductances(np.full(len(law.nodes), law.film))[0]
            links.append((law.patch.node, law.nodes[law.cell], conductance, "coolant"))
        else:
            laws.append(law)
        inlet = machine.n_nodes + list(boundaries).index("coolant_inlet")
        streams = (np.where(law.upstream >= 0, law.upstream, inlet), law.nodes)
        heat[law.nodes] += _pumping(machine, point)
    order = {name: machine.n_nodes + i for i, name in enumerate(boundaries)}
    first = [item[0] for item in links]
    second = [
        item[1] if not isinstance(item[1], str) else np.full(len(item[0]), order[item[1]]) for item in links
    ]
    conductance = np.concatenate([item[2] for item in links])
    kind = np.concatenate([np.full(len(item[0]), item[3], dtype=object) for item in links])
    ends, conductance, kind = _merged(np.concatenate(first), np.concatenate(second), conductance, kind)
    return OperatingNetwork(
        machine=machine,
        point=point,
        boundary_names=tuple(boundaries),
        boundary_temperature=np.array(list(boundaries.values())),
        first=ends[:, 0],
        second=ends[:, 1],
        conductance=conductance,
        kind=kind,
        heat=heat,
        streams=streams,
        stream_rate=rate,
        laws=tuple(laws),
        raceways=raceways,
        bearing_heat=heats,
        heat_to=heat_to,
        coolant_law=law,
    )


def _merged(first, second, conductance, kind):
    """Sum parallel links of the same pair and kind."""
    kinds, code = np.unique(kind.astype(str), return_inverse=True)
    keys = np.column_stack([first, second, code])
    unique, inverse = np.unique(keys, axis=0, return_inverse=True)
    summed = np.bincount(inverse.ravel(), conductance, len(unique))
    return unique[:, :2], summed, kinds.astype(object)[unique[:, 2]]


def _bearing(machine, group, name, heat: BearingHeat, links):
    """Links of a ball row, and the distribution of its heat."""
    shares, conductances = heat_shares(machine.spec.heat), ball_conductances(group, heat)
    ball = machine.ball_nodes[name]
    spread = np.zeros(machine.n_nodes)
    spread[ball] = shares["balls"]
    ways = []
    for side, conductance in zip(("inner", "outer"), conductances, strict=True):
        patch = machine.raceway(name, side)
        part = patch.area / patch.area.sum()
        contact = conductance * part
        loss = 1.0 / (1.0 + contact * patch.resistance)
        links.append((patch.node, np.full(len(part), ball), contact * loss, "balls"))
        given = shares[side] * part
        np.add.at(spread, patch.node, given * loss)
        spread[ball] += float(given @ (1.0 - loss))
        nodes, inverse = np.unique(patch.node, return_inverse=True)
        ways.append(
            Raceway(
                nodes,
                np.bincount(inverse.ravel(), part * loss, len(nodes)),
                float(part @ (1.0 - loss)),
                float(part @ (given * patch.resistance * loss)),
                np.bincount(inverse.ravel(), given * (1.0 - loss), len(nodes)),
            )
        )
    return tuple(ways), shares, spread


def _friction_law(machine, friction: FrictionTables, raceways, spreads) -> FrictionLaw:
    """Heat over the film's temperature: a quarter of each raceway's, half of the balls'."""
    weights = np.zeros((len(friction.heat), machine.n_nodes))
    feedback = np.zeros(len(friction.heat))
    for row, name in enumerate(friction.heat):
        weights[row, machine.ball_nodes[name]] += 0.5
        for way in raceways[name]:
            weights[row, way.nodes] += 0.25 * way.node_weights
            weights[row, machine.ball_nodes[name]] += 0.25 * way.ball_weight
            feedback[row] += 0.25 * way.per_heat
    spread = np.column_stack([spreads[name] for name in friction.heat])
    return FrictionLaw.of(friction.heat, weights, feedback, spread)


def _contact_faces(machine, friction: FrictionTables, heats, heat_to) -> list[ContactFaces]:
    """Raceways whose conductance to the balls is computed, and so follows the film."""
    order = {name: row for row, name in enumerate(friction.heat)}
    faces = []
    for group, bearing in machine.spec.bearings:
        if group.ball_row.kind != "contact":
            continue
        name = bearing.name
        made_with = (heats[name].conductance_inner, heats[name].conductance_outer)
        for side, conductance, table in zip(
            ("inner", "outer"), made_with, friction.conductance[name], strict=True
        ):
            patch = machine.raceway(name, side)
            part = patch.area / patch.area.sum()
            faces.append(
                ContactFaces(
                    order[name], patch.node, machine.ball_nodes[name], part, patch.resistance,
                    heat_to[name][side] * part, conductance, table,
                )
            )  # fmt: skip
    return faces


def _air(machine: MachineNetwork, point: OperatingPoint, boundaries, links, laws) -> None:
    """Films to the surroundings and the bands of mixed air."""
    spec = machine.spec
    for film in spec.film:
        if isinstance(film, StreamFilm):
            laws.append(_circuit(machine, film, point))
            continue
        if film.temperature == "ambient":
            boundary = "ambient"
        else:
            boundary = f"{film.name}.fluid"
            boundaries[boundary] = film.temperature
        fluid = boundaries[boundary]
        for surface in film.surface:
            patch = machine.surfaces[surface]
            if isinstance(film, NaturalFilm):
                wall = fluid + np.linspace(*FILM_RANGE, FILM_POINTS)
                value, _ = film_coefficient(film, point, wall, fluid)
                laws.append(WallFilmLaw.of(patch, wall, value * (wall - fluid), surface))
                continue
            value, _ = film_coefficient(film, point, np.array([fluid]), fluid)
            links.append(
                (
                    patch.node,
                    boundary,
                    1.0 / (patch.resistance + 1.0 / (float(value[0]) * patch.area)),
                    surface,
                )
            )
    start = machine.air_start
    for gap in spec.gap:
        bands = machine.gaps[gap.name]
        value, _ = gap_coefficient(gap, point, *bands.radii)
        # half the resistance on either side of the mixed air
        whole = 2.0 * value * bands.area
        for patch, band in ((bands.rotating, bands.rotating_band), (bands.standing, bands.standing_band)):
            share = patch.area / np.bincount(band, patch.area, bands.n_bands)[band]
            links.append(
                (
                    patch.node,
                    start + band,
                    1.0 / (patch.resistance + 1.0 / (whole[band] * share)),
                    f"gap.{gap.name}",
                )
            )
        start += bands.n_bands


def _circuit(machine: MachineNetwork, film: StreamFilm, point: OperatingPoint) -> CircuitLaw:
    """The coolant of a circuit, eliminated: it holds no heat of its own."""
    values, _ = stream_coefficients(film, point)
    patches = [machine.surfaces[surface] for surface in values]
    patch, faces = SurfacePatch.joined(patches), [len(item.node) for item in patches]
    cell, value = np.repeat(wall_cells(film), faces), np.repeat(list(values.values()), faces)
    conductance = 1.0 / (patch.resistance + 1.0 / (value * patch.area))
    march = CircuitMarch.of(film, conductance, cell)
    return CircuitLaw(patch, conductance, march.warming, point.inlet_of(film), film.name)


def _pumping(machine: MachineNetwork, point: OperatingPoint) -> Array:
    """Friction heat of the flow in each coolant cell, W."""
    coolant = machine.coolant
    power = coolant.loop.pumping_power(point.coolant_flow, point.coolant_inlet_temperature)
    return power * coolant.area / coolant.area.sum()


def coolant_law(machine: MachineNetwork, point: OperatingPoint) -> CoolantLaw:
    """The enthalpy march as streams and conductances; film by the definition's correlation."""
    coolant, settings = machine.coolant, machine.spec.coolant
    loop, inlet = coolant.loop, point.coolant_inlet_temperature
    properties = loop.coolant.properties(inlet)
    rate = float(properties.density * properties.specific_heat_capacity) * point.coolant_flow
    start, n = machine.coolant_start, len(coolant.area)
    nodes = np.arange(start, start + n)
    factor = settings.film_factor.value
    film: ChannelFilm | float
    if settings.properties_at == "bulk":
        film = ChannelFilm(loop.coolant, loop.section, settings.film_model, point.coolant_flow, factor)
    else:
        state = ChannelState(loop.coolant, point.coolant_flow, np.float64(inlet), None)
        film = factor * float(select_film(settings.film_model, loop.section, state).value)
    return CoolantLaw(
        patch=coolant.patch,
        cell=coolant.cell,
        upstream=np.concatenate([[-1], nodes[:-1]]),
        nodes=nodes,
        share=coolant.patch.area / coolant.area[coolant.cell],
        pairs=faces_by_cell(coolant.cell),
        capacity_rate=rate,
        inlet=inlet,
        film=film,
    )
