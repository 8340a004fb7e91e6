"""Uncertainties of a coarsely defined network: small masses, laws not quite constant, a room not read."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spindle_fem.inference import tuned
from spindle_fem.inference.candidate_response import BaseRun
from spindle_fem.inference.heat_misdescriptions import clock_change
from spindle_fem.inference.misdescription import Change, Misdescription
from spindle_fem.inference.predictor import Predictor
from spindle_fem.model.reduced.network_operators import LINK

Array = NDArray[np.float64]

DAY = 86400.0
# Modes of a room below this standard deviation, K, are left out; instants at which they are worked out, of a
# recording and of a day at least, where the steps are as short.
LEAST_MODE, INSTANTS, INSTANTS_OF_A_DAY = 0.05, 400, 4
# Times that a small mass takes to follow its node, as shares of the node's own time constant.
LAG_SHARES = {"soon": 0.02, "later": 0.15}


@dataclass(frozen=True, slots=True)
class MassBeside:
    """A share of a node's capacity that follows it with a lag, instead of at once.

    Attributes
    ----------
    node : str
    lag : float, [s]
    """

    node: str
    lag: float

    def __call__(self, base: BaseRun) -> Change:
        """Heat that the mass takes up later than the node, for a share of one."""
        fast = base.predictor.fast
        capacity = fast.inputs.capacities()[f"capacity.{self.node}"] * base.values.get(
            f"capacity.{self.node}", 1.0
        )
        own = base.place_temperature(self.node)
        behind, taken = own[0], np.empty(len(base.drive.steps))
        restarts = set(base.drive.restarts)
        kept = np.exp(-base.drive.steps / self.lag)
        # Exact for a node that moves evenly over each step: it is followed at a distance.
        distance = self.lag * np.diff(own) / base.drive.steps
        for step, (share, apart) in enumerate(zip(kept.tolist(), distance.tolist(), strict=True)):
            if step in restarts:
                behind = own[step]
            after = own[step + 1] - apart + (behind - own[step] + apart) * share
            taken[step] = after - behind
            behind = after
        # Beside the same mass at once, which the node's own capacity has.
        heat = capacity * (np.diff(own) - taken) / base.drive.steps
        load = heat[:, None] * fast.model.place(self.node)
        return Change(load, load)


@dataclass(frozen=True, slots=True)
class TemperatureConductance:
    """A conductance that grows by a share with each kelvin above its mean temperature.

    Attributes
    ----------
    coefficient : str
    ends : tuple of str
        Nodes; what is a boundary is left out.
    """

    coefficient: str
    ends: tuple[str, ...]

    def __call__(self, base: BaseRun) -> Change:
        """Loads of what it conducts more, for a share of one per kelvin."""
        warm = np.mean([base.place_temperature(end) for end in self.ends], axis=0)
        above = (warm - warm.mean()) * len(self.ends) / 2.0
        strength = base.strength(self.coefficient)
        return Change(
            -(above[:-1] * strength)[:, None] * base.flow(self.coefficient, True),
            -(above[1:] * strength)[:, None] * base.flow(self.coefficient, False),
        )


@dataclass(frozen=True, slots=True)
class OtherExponent:
    """Heat of a source with another exponent, the same where it gives most.

    Attributes
    ----------
    source : str
    exponent : float
        As written.
    """

    source: str
    exponent: float

    def __call__(self, base: BaseRun) -> Change:
        """Loads for an exponent larger by one."""
        fast = base.predictor.fast
        (row,) = fast.heat_rows(self.source)
        place = fast.model.place(fast.heat_places[row])
        start, end = base.run.friction_start[:, row], base.run.friction_end[:, row]
        largest = max(float(np.abs(start).max()), float(np.abs(end).max()), 1e-12)

        def added(heat: Array) -> Array:
            share = np.maximum(np.abs(heat) / largest, 1e-9)
            return (heat * np.log(share) / self.exponent)[:, None] * place

        return Change(added(start), added(end))


@dataclass(frozen=True, slots=True)
class BentHeat:
    """Heat of a source that differs from its law by a half wave, or waves, over the range of its input.

    Attributes
    ----------
    source : str
    exponent : float
    waves : int
        Half waves over the range.
    """

    source: str
    exponent: float
    waves: int

    def __call__(self, base: BaseRun) -> Change:
        """Loads for a share of one at the crest."""
        fast = base.predictor.fast
        (row,) = fast.heat_rows(self.source)
        place = fast.model.place(fast.heat_places[row])
        start, end = base.run.friction_start[:, row], base.run.friction_end[:, row]
        largest = max(float(np.abs(start).max()), float(np.abs(end).max()), 1e-12)

        def added(heat: Array) -> Array:
            part = (np.abs(heat) / largest) ** (1.0 / self.exponent)
            return (heat * np.sin(self.waves * np.pi * part))[:, None] * place

        return Change(added(start), added(end))


@dataclass(frozen=True, slots=True)
class RoomCourse:
    """A boundary whose temperature follows a course.

    Attributes
    ----------
    films : tuple of str
        Links that end at it.
    times, shift : tuple of float, [s], [K]
        For an amplitude of one.
    """

    films: tuple[str, ...]
    times: tuple[float, ...]
    shift: tuple[float, ...]

    def __call__(self, base: BaseRun) -> Change:
        """Loads of the shift."""
        model = base.predictor.fast.model
        shift = np.interp(base.drive.grid, self.times, self.shift)
        each = sum(
            base.strength(film)[:, None] * model.fluid_load[model.fluid_names.index(film)]
            for film in self.films
        )
        return Change(shift[:-1, None] * each, shift[1:, None] * each)


def room_modes(times: Array) -> list[tuple[float, Array]]:
    """Independent courses of an unrecorded room temperature, the largest first.

    A Gaussian process of zero mean: a daily swing whose size and phase wander over days, and weather and
    doors over hours; its Karhunen-Loève modes.

    Source: Rasmussen & Williams (2006), Gaussian Processes for Machine Learning, chapter 4.

    Returns
    -------
    list of (float, (n,) ndarray)
        Standard deviation [K] of each and its course, whose largest magnitude is 1.
    """
    apart = times[:, None] - times
    daily = np.cos(2.0 * np.pi * apart / DAY) * np.exp(-0.5 * (apart / tuned.ROOM_DAYS) ** 2)
    hours = np.exp(-0.5 * (apart / tuned.ROOM_HOURS) ** 2)
    values, vectors = np.linalg.eigh(tuned.ROOM_DAILY**2 * daily + tuned.ROOM_SLOW**2 * hours)
    found = []
    for value, vector in zip(values[::-1], vectors.T[::-1], strict=True):
        peak = vector[np.argmax(np.abs(vector))]
        size = float(np.sqrt(max(value, 0.0)) * abs(peak))
        if size < LEAST_MODE:
            break
        found.append((size, vector / peak))
    return found


def room_instants(grid: Array) -> Array:
    """Instants at which courses of a room are worked out, from the ends of a drive's steps [s]."""
    number = max(INSTANTS, round(INSTANTS_OF_A_DAY * (grid[-1] - grid[0]) / DAY))
    return np.linspace(grid[0], grid[-1], min(number, len(grid)))


def network_misdescriptions(predictor: Predictor) -> Iterator[Misdescription]:
    """Directions of a written network; widths in ``tuned``: ``MASS_BESIDE`` and what follows it."""
    if not predictor.is_network:
        return
    network, inputs = predictor.fast.network, predictor.fast.inputs
    # A value that is given without uncertainty is meant as it stands.
    open_to = {item.name for item in network.parameters if item.sigma_log > 0.0}
    if not open_to:
        return
    joined = np.zeros(network.n_nodes)
    for first, second, value in zip(
        network.link_first, network.link_second, network.link_conductance, strict=True
    ):
        for end in (first, second):
            if end < network.n_nodes:
                joined[end] += value
    for node, capacity, conductance in zip(network.node_names, network.capacity, joined, strict=True):
        for word, share in LAG_SHARES.items() if conductance > 0.0 and f"capacity.{node}" in open_to else ():
            lag = share * float(capacity / conductance)
            yield Misdescription(
                f"mass_beside.{node}.{word}",
                f"network.node.{node}.capacity",
                "",
                tuned.MASS_BESIDE,
                f"share of the capacity of {node} that follows it with {lag:.3g} s instead of at once",
                MassBeside(node, lag),
            )
    names = (*network.node_names, *network.boundary_names)
    for link, first, second in zip(network.link_names, network.link_first, network.link_second, strict=True):
        if f"conductance.{link}" not in open_to:
            continue
        ends = tuple(names[end] for end in (first, second) if end < network.n_nodes)
        yield Misdescription(
            f"over_temperature.{link}",
            f"network.link.{link}.conductance",
            "1/K",
            tuned.CONDUCTANCE_PER_K,
            f"share by which {link} conducts better with each kelvin",
            TemperatureConductance(f"{LINK}{link}", ends),
        )
    for source, name, exponent in zip(
        network.source_names, network.source_input, network.source_exponent, strict=True
    ):
        if name is not None and f"gain.{source}" in open_to:
            yield Misdescription(
                f"exponent.{source}",
                f"network.source.{source}.exponent",
                "",
                tuned.EXPONENT_SIGMA,
                f"exponent of {source} beyond the {exponent:.3g} of the definition",
                OtherExponent(source, float(exponent)),
            )
            for waves in (1, 2):
                yield Misdescription(
                    f"heat_bend.{source}.{waves}",
                    f"network.source.{source}.gain",
                    "",
                    tuned.HEAT_BEND / waves,
                    f"share by which the heat of {source} differs from its power amid the range of its input",
                    BentHeat(source, float(exponent), waves),
                )
    for number, (recording, drive) in enumerate(zip(predictor.recordings, predictor.drives, strict=True)):
        spacing = float(np.median(np.diff(recording.times)))
        yield Misdescription(
            "clock",
            "clock of the recording",
            "s",
            spacing,
            "time by which temperatures are stamped later than inputs: rows may be means stamped at their "
            "start, inputs written more rarely than they change",
            clock_change,
            number,
        )
        times = room_instants(drive.grid)
        modes = room_modes(times)
        for boundary, driven in zip(network.boundary_names, network.boundary_input, strict=True):
            films = tuple(film for film, other in inputs.boundary_of.items() if other == boundary)
            if driven is None and films and f"temperature.{boundary}" in open_to:
                for order, (size, course) in enumerate(modes, 1):
                    yield Misdescription(
                        f"course.{boundary}.{order}",
                        f"network.boundary.{boundary}.temperature",
                        "K",
                        size,
                        f"temperature of {boundary}, which was not recorded, over its mean: mode {order}",
                        RoomCourse(films, tuple(times.tolist()), tuple(course.tolist())),
                        number,
                    )
