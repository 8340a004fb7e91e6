"""Loads of a machine at an operating point and a temperature field."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.machine_spec import BearingSet, MachineSpec, StreamFilm
from spindle_fem.machine.meshing.tagged_mesh import TaggedMesh
from spindle_fem.operation.bearing_heat import BearingTemperatures, HeatModel
from spindle_fem.operation.channel_cells import ChannelCells, build_channel_cells
from spindle_fem.operation.circuits import coolant_temperatures
from spindle_fem.operation.coefficients import (
    ball_conductances,
    ball_row_capacity,
    film_coefficient,
    fluid_temperature,
    gap_coefficient,
    stream_coefficients,
)
from spindle_fem.operation.coolant_loop import CoolantLoop, CoolantState
from spindle_fem.operation.facet_centres import facet_centres
from spindle_fem.operation.gap_bands import GapBands, angle_of, build_gap_bands
from spindle_fem.operation.heat_shares import heat_shares
from spindle_fem.operation.loads import NO_CHANGE, BearingHeat, FilmLoad, LoadChange, Loads, LumpedLoad
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.operation.seat_joints import SeatJoints
from spindle_fem.recordings.source_heat import source_heat
from spindle_fem.validity import CodedWarning, fold_warnings

GAP_BAND_WIDTH = 0.02
SECTORS_WITHOUT_AVERAGING = 24


@dataclass(frozen=True, slots=True)
class FieldState:
    """Temperatures that the loads depend on.

    Attributes
    ----------
    facets : mapping of surface to (n_facets,) ndarray, [K]
        Mean over each facet.
    lumped : mapping of lumped-node name to float, [K]
    joints : mapping of joint to (float, float), [K]
        Mean of the first and of the second part's side.
    shifts : mapping of bearing to (4,) ndarray, [m]
        What temperature does to seats and raceways of rings that elastic bodies carry.
    """

    facets: Mapping[str, NDArray[np.float64]]
    joints: Mapping[str, tuple[float, float]]
    lumped: Mapping[str, float]
    shifts: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)


class LoadsBuilder:
    """Evaluates the loads of one machine on one mesh, again and again.

    Everything that only depends on geometry is sorted once at construction.

    Attributes
    ----------
    film_bounds : bool
        Whether coolant states hold the spread of correlations about the channel's film.
    """

    film_bounds: bool = True

    def __init__(
        self,
        spec: MachineSpec,
        mesh: TaggedMesh,
        facet_area: Mapping[str, NDArray[np.float64]],
        heat_model: HeatModel,
        seat_joints: SeatJoints | None = None,
    ) -> None:
        self.spec = spec
        self.seat_joints = seat_joints
        self.mesh = mesh
        self.heat_model = heat_model
        self.n_sectors = 1 if spec.mesh.circumferential_averaging else SECTORS_WITHOUT_AVERAGING
        self._rows = {
            row: np.full(self.n_sectors, film.element_surface / self.n_sectors)
            for row, film in spec.wetted_rows.items()
        }
        self.facet_area = {**facet_area, **self._rows}
        # What a watt per kelvin of a ball row is over the facets of its raceways, (n_sectors, n_facets) 1/m².
        self._raceway_shares = {
            surface: self._sector_shares(surface)
            for _, bearing in spec.bearings
            for surface in (f"{bearing.name}.inner_raceway", f"{bearing.name}.outer_raceway")
        }
        self.cells: ChannelCells | None = None
        self.coolant_loop: CoolantLoop | None = None
        if spec.channel is not None:
            self.cells = build_channel_cells(mesh, facet_area, spec.channel)
            self.coolant_loop = CoolantLoop(spec, self.cells)
        self.gaps: dict[str, GapBands] = {
            gap.name: build_gap_bands(
                mesh, facet_area, gap.rotating, gap.standing, GAP_BAND_WIDTH, self.n_sectors
            )
            for gap in spec.gap
        }
        self._gap_radii = {
            gap.name: (self._mean_radius((gap.rotating,)), self._mean_radius(gap.standing))
            for gap in spec.gap
        }

    def _sector_shares(self, surface: str) -> NDArray[np.float64]:
        """Share of each sector over its own part of a raceway, (n_sectors, n_facets) 1/m²."""
        centres = facet_centres(self.mesh.points, self.mesh.surfaces[surface])
        number = self.n_sectors
        sector = np.minimum((angle_of(centres) / (2.0 * np.pi) * number).astype(int), number - 1)
        inside = sector == np.arange(number)[:, None]
        area = (inside @ self.facet_area[surface])[:, None]
        return np.divide(1.0 / number, area, out=np.zeros(inside.shape), where=inside)

    def _mean_radius(self, surfaces: Sequence[str]) -> float:
        """Area mean of the distance from the axis over one side of a gap, m."""
        centres = np.concatenate([facet_centres(self.mesh.points, self.mesh.surfaces[n]) for n in surfaces])
        areas = np.concatenate([self.facet_area[name] for name in surfaces])
        return float(areas @ np.hypot(centres[:, 0], centres[:, 1]) / areas.sum())

    # ------------------------------------------------------------------ means
    def surface_mean(self, surface: str, state: FieldState) -> float:
        """Area mean of the temperature over a surface, or of a row of balls, K."""
        if surface in self._rows:
            return self.ball_temperature(surface.removesuffix(".balls"), state)
        areas = self.facet_area[surface]
        return float(areas @ state.facets[surface] / areas.sum())

    def wall_temperature(self, state: FieldState) -> NDArray[np.float64]:
        """Area mean of the wetted wall in each coolant cell, (n_starts, n) in K."""
        cells = self.cells
        total = np.zeros(cells.cell_area.size)
        for surface in cells.surfaces:
            weighted = cells.areas[surface] * state.facets[surface]
            total += np.bincount(cells.facet_cell[surface], weighted, total.size)
        return total.reshape(cells.cell_area.shape) / cells.cell_area

    def bearing_temperatures(self, state: FieldState) -> dict[str, BearingTemperatures]:
        """Mean raceway and ball temperatures of every bearing, K."""
        found = {}
        for _, bearing in self.spec.bearings:
            inner = self.surface_mean(f"{bearing.name}.inner_raceway", state)
            outer = self.surface_mean(f"{bearing.name}.outer_raceway", state)
            ball = self.ball_temperature(bearing.name, state)
            shaft = self._seat(f"{bearing.name}.inner_ring", state, default=inner)
            housing = self._seat(f"{bearing.name}.outer_ring", state, default=outer)
            found[bearing.name] = BearingTemperatures(
                inner, outer, ball, shaft, housing, state.shifts.get(bearing.name)
            )
        return found

    def ball_temperature(self, bearing: str, state: FieldState) -> float:
        """Mean temperature of the balls of a bearing; that of its raceways where the state has none, K."""
        balls = [state.lumped[name] for name in self.ball_nodes(bearing) if name in state.lumped]
        if balls:
            return float(np.mean(balls))
        return 0.5 * sum(self.surface_mean(f"{bearing}.{side}_raceway", state) for side in ("inner", "outer"))

    def _seat(self, ring: str, state: FieldState, default: float) -> float:
        """Temperature of what a ring sits on; a ring that is fused has its own."""
        for name, (first, second) in state.joints.items():
            parts = name.split("|")
            if ring in parts:
                return second if parts[0] == ring else first
        return default

    def ball_nodes(self, bearing: str) -> tuple[str, ...]:
        """Names of the lumped nodes of a ball row (one, or one a sector)."""
        if self.n_sectors == 1:
            return (f"{bearing}.balls",)
        return tuple(f"{bearing}.balls[{sector}]" for sector in range(self.n_sectors))

    @property
    def _air_names(self) -> set[str]:
        """What warnings of air films and gaps begin with."""
        return {name for film in self.spec.film for name in film.surface} | {
            gap.name for gap in self.spec.gap
        }

    @property
    def lumped_names(self) -> tuple[str, ...]:
        """Names of the lumped nodes, ball rows and gap air, in the order of every :class:`Loads`."""
        balls = [node for _, bearing in self.spec.bearings for node in self.ball_nodes(bearing.name)]
        air = [f"{gap.name}[{cell}]" for gap in self.spec.gap for cell in range(self.gaps[gap.name].n_cells)]
        return (*balls, *air)

    # ------------------------------------------------------------------ loads
    def at(
        self, point: OperatingPoint, state: FieldState, change: LoadChange = NO_CHANGE
    ) -> tuple[Loads, CoolantState | None]:
        """Loads at an operating point, with every coefficient at the given field.

        Parameters
        ----------
        change : LoadChange
            Physics beyond the machine's own.
        """
        warnings: list[CodedWarning] = []
        heats, heat_warnings = self.heat_model(point, self.bearing_temperatures(state))
        heats = {name: _scaled(heat, change.friction.get(name, 1.0)) for name, heat in heats.items()}
        warnings += heat_warnings
        fits = {} if self.seat_joints is None else self.seat_joints.factors(heats)
        if fits:
            joined = {name: value * change.factor(name) for name, value in fits.items()}
            change = replace(change, coefficients={**change.coefficients, **joined})
        surface_heat: dict[str, float] = {}
        heat_to: dict[str, dict[str, float]] = {}
        lumped: list[LumpedLoad] = []
        for group, bearing in self.spec.bearings:
            heat = heats[bearing.name]
            shares = {body: share * heat.total for body, share in heat_shares(self.spec.heat).items()}
            heat_to[bearing.name] = shares
            surface_heat[f"{bearing.name}.inner_raceway"] = shares["inner"]
            surface_heat[f"{bearing.name}.outer_raceway"] = shares["outer"]
            lumped += self._ball_row(group, bearing.name, heat, shares["balls"], change)
        films = self._air_films(point, state, warnings, change)
        lumped += self._gap_nodes(point, warnings, change)
        coolant = None
        if self.coolant_loop is not None:
            flowing = replace(
                point,
                coolant_inlet_temperature=point.coolant_inlet_temperature + change.inlet,
                coolant_flow=point.coolant_flow * change.flow,
            )
            coolant = self.coolant_loop.at(
                flowing,
                self.wall_temperature(state),
                film_factor=change.factor("channel.film"),
                bounds=self.film_bounds,
            )
            films |= self._channel_films(coolant)
            warnings += coolant.warnings
        loads = Loads(
            surface_heat,
            films,
            tuple(lumped),
            heats,
            heat_to,
            fold_warnings(warnings, {*heats, *self._air_names}),
            change,
            {source.name: float(source_heat(source, point.inputs)) for source in self.spec.source},
            {film.name: point.inlet_of(film) for film in self.spec.circuits},
        )
        return loads, coolant

    def _ball_row(
        self, group: BearingSet, name: str, heat: BearingHeat, ball_heat: float, change: LoadChange
    ) -> list[LumpedLoad]:
        conductances = [
            value * change.factor(f"balls.{name}.{side}")
            for value, side in zip(ball_conductances(group, heat), ("inner", "outer"), strict=True)
        ]
        bearing = next(item for item in group.bearing if item.name == name)
        capacity = ball_row_capacity(self.spec, group, bearing)
        raceways = (f"{name}.inner_raceway", f"{name}.outer_raceway")
        nodes = []
        for sector, node in enumerate(self.ball_nodes(name)):
            connections = {
                surface: conductance * self._raceway_shares[surface][sector]
                for surface, conductance in zip(raceways, conductances, strict=True)
            }
            own_capacity = capacity / self.n_sectors + change.lumped_capacity.get(node, 0.0)
            own_heat = ball_heat / self.n_sectors + change.lumped_heat.get(node, 0.0)
            nodes.append(LumpedLoad(node, own_capacity, own_heat, connections))
        return nodes

    def _air_films(
        self, point: OperatingPoint, state: FieldState, warnings: list[CodedWarning], change: LoadChange
    ) -> dict[str, FilmLoad]:
        films = {}
        for film in self.spec.film:
            if isinstance(film, StreamFilm):
                films |= self._circuit_films(film, point, state, warnings, change)
                continue
            fluid = fluid_temperature(film, point.ambient_temperature)
            for surface in film.surface:
                wall = state.facets[surface]
                coefficient, said = film_coefficient(film, point, wall, fluid)
                warnings += said
                films[surface] = FilmLoad(
                    surface,
                    coefficient * change.factor(f"film.{surface}"),
                    np.full(wall.shape, fluid + change.fluids.get(surface, 0.0)),
                )
        return films

    def _circuit_films(
        self,
        film: StreamFilm,
        point: OperatingPoint,
        state: FieldState,
        warnings: list[CodedWarning],
        change: LoadChange,
    ) -> dict[str, FilmLoad]:
        """Films of a circuit's walls, its coolant warmed by those that it has passed."""
        values, said = stream_coefficients(film, point)
        warnings += said
        coefficients = {
            surface: np.full(self.facet_area[surface].shape, value * change.factor(f"film.{surface}"))
            for surface, value in values.items()
        }
        coolant, _ = self.circuit_coolant(film, coefficients, state, point.inlet_of(film))
        return {
            surface: FilmLoad(
                surface,
                coefficient,
                np.full(coefficient.shape, coolant[surface] + change.fluids.get(surface, 0.0)),
            )
            for surface, coefficient in coefficients.items()
        }

    def circuit_coolant(
        self,
        film: StreamFilm,
        coefficients: Mapping[str, NDArray[np.float64]],
        state: FieldState,
        inlet: float,
    ) -> tuple[dict[str, float], float]:
        """Coolant of a circuit at each of its walls and at its outlet, K.

        Parameters
        ----------
        coefficients : mapping of surface to (n_facets,) ndarray, [W/(m²·K)]
        inlet : float, [K]
        """
        conductance = {
            surface: float(coefficients[surface] @ self.facet_area[surface]) for surface in film.surface
        }
        walls = {surface: self.surface_mean(surface, state) for surface in film.surface}
        return coolant_temperatures(film, conductance, walls, inlet)

    def _gap_nodes(
        self, point: OperatingPoint, warnings: list[CodedWarning], change: LoadChange
    ) -> list[LumpedLoad]:
        nodes = []
        for gap in self.spec.gap:
            bands = self.gaps[gap.name]
            coefficient, said = gap_coefficient(gap, point, *self._gap_radii[gap.name])
            warnings += said
            # Half the resistance on either side of the mixed air.
            conductance = 2.0 * coefficient * change.factor(f"gap.{gap.name}") * bands.conductance_share
            on_rotating = (conductance / bands.rotating_area)[bands.rotating_cell]
            on_standing = {
                name: (conductance / bands.standing_area)[cells]
                for name, cells in bands.standing_cells.items()
            }
            for cell in range(bands.n_cells):
                connections = {gap.rotating: np.where(bands.rotating_cell == cell, on_rotating, 0.0)}
                for name, cells in bands.standing_cells.items():
                    connections[name] = np.where(cells == cell, on_standing[name], 0.0)
                nodes.append(LumpedLoad(f"{gap.name}[{cell}]", 0.0, 0.0, connections))
        return nodes

    def _channel_films(self, coolant: CoolantState) -> dict[str, FilmLoad]:
        cells = self.cells
        coefficient = coolant.film_coefficient.ravel()
        bulk = np.broadcast_to(coolant.march.march.bulk_temperature, cells.cell_area.shape).ravel()
        return {
            surface: FilmLoad(surface, coefficient[index], bulk[index])
            for surface, index in cells.facet_cell.items()
        }


def _scaled(heat: BearingHeat, factor: float) -> BearingHeat:
    """Friction heat and its terms times a factor."""
    if factor == 1.0:
        return heat
    terms = {name: value * factor for name, value in heat.terms.items()}
    return replace(heat, total=heat.total * factor, terms=terms)
