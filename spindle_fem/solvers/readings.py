"""Readings of probes and bearings at any state, as rows over the unknowns."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from spindle_fem.model.elastic.machine_growth import GrowthModel, Motions
from spindle_fem.model.mesh.evaluate import mean_matrix, probe_matrix
from spindle_fem.operation.circuits import CircuitMarch, stream_answer, wall_cells, wall_coefficients
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.solvers.prepared_machine import PreparedMachine

Array = NDArray[np.float64]
CoolantAt = Callable[[float], tuple[OperatingPoint, float]]
# Samples whose coolant is marched at once.
MOST_WALLS = 256


@dataclass(frozen=True, slots=True)
class ReadingRows:
    """Linear outputs of a machine and how readings follow from them.

    Attributes
    ----------
    rows : (n_outputs, n + m) sparse array
        Point probes, raceway means of every bearing, ball rows, walls of circuits, motions, channel cells.
    probes : tuple of str
        In the order of the definition.
    """

    machine: PreparedMachine
    rows: sparse.csr_array
    probes: tuple[str, ...]
    bearings: tuple[str, ...]
    _points: tuple[str, ...]
    motions: Motions | None = None

    @classmethod
    def of(cls, machine: PreparedMachine, lumped_names: tuple[str, ...]) -> ReadingRows:
        """Rows of a machine whose lumped nodes have these names."""
        spec, operators = machine.spec, machine.operators
        points = [probe for probe in spec.probe if probe.kind == "point"]
        bearings = tuple(bearing.name for _, bearing in spec.bearings)
        blocks = []
        if points:
            places = [(-p.r * np.sin(p.angle), p.r * np.cos(p.angle), p.z) for p in points]
            blocks.append(probe_matrix(operators, places, [p.part for p in points]))
        surfaces = [f"{name}.{ring}_raceway" for name in bearings for ring in ("inner", "outer")]
        if surfaces:
            blocks.append(mean_matrix(operators, surfaces))
        width = operators.n_unknowns + len(lumped_names)
        blocks = [_widened(block, width) for block in blocks]
        if bearings:
            balls = sparse.lil_array((len(bearings), width))
            for row, name in enumerate(bearings):
                nodes = machine.builder.ball_nodes(name)
                for node in nodes:
                    balls[row, operators.n_unknowns + lumped_names.index(node)] = 1.0 / len(nodes)
            balls = sparse.csr_array(balls)
            blocks.append(balls)
        for film in spec.circuits:
            walls = [name for name in film.surface if name != film.ball_row]
            blocks.append(_widened(mean_matrix(operators, walls), width))
            if film.ball_row is not None:
                own = bearings.index(film.ball_row.removesuffix(".balls"))
                blocks.append(balls[[own]])
        growth = machine.growth
        if growth is None and spec.displacement_sensor:
            # Sensors see growth whether or not preload follows it.
            growth = GrowthModel(spec, machine.mesh, operators.order)
        motions = None if growth is None else growth.motions
        if motions is not None:
            blocks.append(_widened(sparse.csr_array(motions.rows), width))
        if machine.builder.cells is not None:
            blocks.append(_widened(_cell_means(machine), width))
        rows = sparse.csr_array(sparse.vstack(blocks)) if blocks else sparse.csr_array((0, width))
        probes = tuple(probe.name for probe in spec.probe)
        return cls(machine, rows, probes, bearings, tuple(p.name for p in points), motions)

    def probe_readings(self, outputs: Array, times: Array, coolant_at: CoolantAt) -> Array:
        """Temperature of every probe, (n_times, n_probes) [K].

        Parameters
        ----------
        outputs : (n_times, n_outputs) ndarray, [K]
        times : (n_times,) ndarray, [s]
        coolant_at : callable
            Time [s] to the operating point of the channel and a factor on its film.
        """
        readings = np.empty((len(times), len(self.probes)))
        for column, probe in enumerate(self.machine.spec.probe):
            if probe.kind == "coolant_outlet":
                readings[:, column] = self._coolant_outlet(outputs, times, coolant_at)
            elif probe.kind == "circuit_outlet":
                readings[:, column] = self._circuit_outlet(outputs, times, coolant_at, probe.circuit)
            else:
                readings[:, column] = outputs[:, self._points.index(probe.name)]
        return readings

    def bearing_temperatures(self, outputs: Array) -> tuple[Array, Array, Array]:
        """Inner raceway, outer raceway and balls of every bearing, each (n_times, n_bearings) [K]."""
        first, number = len(self._points), len(self.bearings)
        rings = outputs[:, first : first + 2 * number]
        return rings[:, 0::2], rings[:, 1::2], outputs[:, first + 2 * number : first + 3 * number]

    def displacements(self, outputs: Array, times: Array, coolant_at: CoolantAt) -> Array:
        """Motions of the nose and readings of displacement sensors since assembly, (n_times, k) m and rad."""
        if self.motions is None:
            return np.zeros((len(times), 0))
        cells = self.machine.builder.cells
        end = outputs.shape[1] - (0 if cells is None else cells.cell_area.size)
        speed = np.array([coolant_at(float(time))[0].speed for time in times])
        return self.motions.at(outputs[:, end - len(self.motions.rows) : end], speed)

    def _circuit_outlet(self, outputs: Array, times: Array, coolant_at: CoolantAt, name: str) -> Array:
        """Outlet of a circuit, its films those of the definition: (n_times,) K."""
        machine, first = self.machine, len(self._points) + 3 * len(self.bearings)
        for film in machine.spec.circuits:
            if film.name == name:
                break
            first += len(film.surface)
        points = [coolant_at(float(time))[0] for time in times]
        inlet = np.array([point.inlet_of(film) for point in points])
        walls = outputs[:, first : first + len(film.surface)] - inlet[:, None]
        areas = np.array([machine.builder.facet_area[name].sum() for name in film.surface])
        speeds = np.array([point.speed for point in points])
        found = np.empty(len(times))
        for speed in np.unique(speeds):
            values = wall_coefficients(film, stream_answer(film, float(speed)))
            weights = CircuitMarch.of(film, values * areas, wall_cells(film)).outlet
            then = speeds == speed
            found[then] = inlet[then] + walls[then] @ weights
        return found

    def _coolant_outlet(self, outputs: Array, times: Array, coolant_at: CoolantAt) -> Array:
        builder = self.machine.builder
        shape = builder.cells.cell_area.shape
        walls = outputs[:, outputs.shape[1] - builder.cells.cell_area.size :].reshape(-1, *shape)
        given = [coolant_at(float(time)) for time in times]
        alike: dict[tuple[float, float, float], list[int]] = {}
        for index, (point, factor) in enumerate(given):
            # what the coolant's march knows of an operating point
            state = (point.coolant_flow, point.coolant_inlet_temperature, factor)
            alike.setdefault(state, []).append(index)
        found = np.empty(len(times))
        for own in alike.values():
            point, factor = given[own[0]]
            for begin in range(0, len(own), MOST_WALLS):
                some = own[begin : begin + MOST_WALLS]
                found[some] = builder.coolant_loop.outlets(point, walls[some], film_factor=factor)
        return found


def _widened(block: sparse.sparray, width: int) -> sparse.csr_array:
    missing = sparse.csr_array((block.shape[0], width - block.shape[1]))
    return sparse.csr_array(sparse.hstack((block, missing)))


def _cell_means(machine: PreparedMachine) -> sparse.csr_array:
    """Rows of the mean wall temperature in each coolant cell, (n_cells, n_unknowns)."""
    cells, operators = machine.builder.cells, machine.operators
    area = cells.cell_area.ravel()
    rows = []
    for cell in range(area.size):
        total = np.zeros(operators.n_unknowns)
        for surface, index in cells.facet_cell.items():
            inside = np.where(index == cell, 1.0, 0.0)
            if inside.any():
                total += operators.facet_vector(inside, operators.surface_rows[surface])
        rows.append(sparse.csr_array(total[None, :] / area[cell]))
    return sparse.csr_array(sparse.vstack(rows))
