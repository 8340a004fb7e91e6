"""Possible deviations of a machine with geometry: heat and balls over speed, materials, sensors, clocks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.effects.framework.effect import Reported
from spindle_fem.effects.framework.filters import delayed, first_order_lag
from spindle_fem.inference import tuned
from spindle_fem.inference.candidate_response import BaseRun
from spindle_fem.inference.misdescription import EVERY_CHANNEL, Change, Misdescription
from spindle_fem.inference.predictor import Predictor

Array = NDArray[np.float64]

# Points of the range of speed at which the modes of a table's shape are worked out.
MODE_POINTS = 61
# Modes that hold less than this share of the variance are left out.
LEAST_VARIANCE = 0.02


@dataclass(frozen=True, slots=True)
class SpeedShape:
    """Friction of some bearings, changed by a share that follows speed.

    Attributes
    ----------
    bearings : tuple of str
    speed : tuple of float, [rad/s]
        Increasing.
    share : tuple of float
        At each speed; linear between.
    """

    bearings: tuple[str, ...]
    speed: tuple[float, ...]
    share: tuple[float, ...]

    def __call__(self, base: BaseRun) -> Change:
        """Loads of the added heat."""
        fast, run = base.predictor.fast, base.run
        rows = [row for bearing in self.bearings for row in fast.heat_rows(bearing)]
        loads = np.array([fast.model.place(fast.heat_places[row]) for row in rows])

        def added(friction: Array, inputs: dict[str, Array]) -> Array:
            share = np.interp(inputs["speed"], self.speed, self.share)
            return (share[:, None] * friction[:, rows]) @ loads

        return Change(added(run.friction_start, base.start_inputs), added(run.friction_end, base.end_inputs))

    def corrected(self, spec: MachineSpec, value: float) -> MachineSpec:
        """The machine with a table that is right, where its heat is by table."""
        table = spec.heat.table
        if spec.heat.model != "table":
            return spec
        factor = 1.0 + value * np.interp(table.speed, self.speed, self.share)
        heat = {
            name: tuple((factor * own).tolist()) if name in self.bearings else own
            for name, own in table.heat.items()
        }
        changed = table.model_copy(update={"heat": heat})
        return spec.model_copy(update={"heat": spec.heat.model_copy(update={"table": changed})})


@dataclass(frozen=True, slots=True)
class SpeedConductance:
    """Coefficients that grow by a share in proportion to speed.

    Attributes
    ----------
    coefficients : tuple of str
    highest : float, [rad/s]
        Speed at which the share is one.
    """

    coefficients: tuple[str, ...]
    highest: float

    def __call__(self, base: BaseRun) -> Change:
        """Loads of what they conduct more."""
        start, end = (inputs["speed"] / self.highest for inputs in (base.start_inputs, base.end_inputs))
        return _more(base, self.coefficients, start, end)


@dataclass(frozen=True, slots=True)
class Conductivity:
    """Another conductivity of one material."""

    material: str

    @property
    def parameter(self) -> str:
        """Its coefficient."""
        return f"conductivity.{self.material}"

    def __call__(self, base: BaseRun) -> Change:
        """Loads of what it conducts more, for as much again."""
        return _more(base, (self.parameter,), 1.0, 1.0)

    def corrected(self, spec: MachineSpec, value: float) -> MachineSpec:
        """The machine with the conductivity that it has."""
        return with_material(spec, self.material, "thermal_conductivity", 1.0 + value)

    def quantity(self, spec: MachineSpec) -> Reported:
        """Its conductivity."""
        return Reported(spec.materials[self.material].thermal_conductivity, "W/(m·K)")

    def of_factor(self, factor: float) -> float:
        """Its logarithm."""
        return float(np.log(factor))

    def redefined(self, spec: MachineSpec, value: float) -> MachineSpec:
        """The machine with another conductivity.

        To first order a share adds conductance where paths are in parallel and takes resistance where they
        are in series; the exponential lies between.
        """
        return with_material(spec, self.material, "thermal_conductivity", float(np.exp(value)))


def with_material(spec: MachineSpec, material: str, key: str, factor: float) -> MachineSpec:
    """The machine with one property of a material changed by a factor."""
    own = spec.materials[material]
    changed = own.model_copy(update={key: factor * getattr(own, key)})
    return spec.model_copy(update={"materials": {**spec.materials, material: changed}})


def _more(base: BaseRun, coefficients: Sequence[str], start: Array | float, end: Array | float) -> Change:
    """Loads of coefficients that are larger by shares at both ends of the steps, (G,)."""
    loads = []
    for share, before in ((start, True), (end, False)):
        flows = [(share * base.strength(name))[:, None] * base.flow(name, before) for name in coefficients]
        loads.append(-np.sum(flows, axis=0))
    return Change(*loads)


def clock_change(base: BaseRun) -> Change:
    """Temperatures stamped later than the inputs, per second: the secant over the usual shift both ways.

    At either end as far as there is time.
    """
    grid, felt, shift = base.drive.grid, base.before_sensors(), tuned.CLOCK_SIGMA
    later, earlier = (delayed(grid, felt, np.full(felt.shape[1], way * shift)).real for way in (1.0, -1.0))
    apart = np.minimum(shift, grid - grid[0]) + np.minimum(shift, grid[-1] - grid)
    return Change(direct=(later - earlier) / apart[:, None])


@dataclass(frozen=True, slots=True)
class Response:
    """Delay of a channel: its sensor shows the temperature of some seconds before."""

    channel: str

    def __call__(self, base: BaseRun) -> Change:
        """What a lag of the usual size changes, per second of it."""
        names = base.predictor.recordings[base.number].temperature_names
        felt = base.before_sensors()
        late = np.zeros_like(felt)
        if self.channel in names:
            column, lag = names.index(self.channel), np.array([tuned.RESPONSE_SIGMA])
            own = felt[:, column, None]
            late[:, column] = (first_order_lag(base.drive.grid, own, lag).real - own)[:, 0] / lag
        return Change(direct=late)


def shape_modes(speed: Array, length: float) -> list[tuple[float, Array]]:
    """Independent shapes of a curve over speed beside its mean, by falling size.

    A Gaussian process of unit variance, correlated over ``length`` of the range, less its mean
    (which the heat factor has): its Karhunen-Loève modes.

    Source: Rasmussen & Williams (2006), Gaussian Processes for Machine Learning, section 4.3.

    Returns
    -------
    list of (float, (n,) ndarray)
        Standard deviation of each and its shape, whose largest magnitude is 1.
    """
    part = (speed - speed[0]) / (speed[-1] - speed[0])
    kernel = np.exp(-0.5 * ((part[:, None] - part) / length) ** 2)
    kernel -= kernel.mean(axis=0)
    kernel -= kernel.mean(axis=1)[:, None]
    values, vectors = np.linalg.eigh(kernel)
    found = []
    for value, vector in zip(values[::-1], vectors.T[::-1], strict=True):
        if value < LEAST_VARIANCE * values.sum():
            break
        peak = vector[np.argmax(np.abs(vector))]
        found.append((float(np.sqrt(value) * abs(peak)), vector / peak))
    return found


def heat_misdescriptions(predictor: Predictor) -> Iterator[Misdescription]:
    """Heat over speed, balls that conduct better with speed, conductivities, sensors' response, and clocks.

    Widths: ``HEAT_SHAPE_SIGMA``, ``BALL_SPEED_SIGMA``, ``CONDUCTIVITY_SIGMA``, ``RESPONSE_SIGMA`` and
    ``CLOCK_SIGMA`` of :mod:`spindle_fem.inference.tuned`.
    """
    if predictor.is_network:
        return
    if predictor.fast.spec.heat.table is not None:
        yield from _over_speed(predictor)
    for material in predictor.fast.spec.materials:
        if f"conductivity.{material}" in predictor.fast.model.coefficient_names:
            yield Misdescription(
                f"conductivity.{material}",
                f"materials.{material}.thermal_conductivity",
                "",
                tuned.CONDUCTIVITY_SIGMA,
                f"share by which {material} conducts better",
                Conductivity(material),
            )
    channels = dict.fromkeys(
        name for item in predictor.recordings for name in item.temperature_names[: item.temperature_count]
    )
    for channel in channels:
        yield Misdescription(
            f"response.{channel}",
            f"sensor {channel}",
            "s",
            tuned.RESPONSE_SIGMA,
            f"time by which {channel} answers later than the machine",
            Response(channel),
            of_sensor=True,
            delays=channel,
        )
    for number in range(len(predictor.recordings)):
        yield Misdescription(
            "clock",
            "clock of the recording",
            "s",
            tuned.CLOCK_SIGMA,
            "time by which temperatures are stamped later than inputs",
            clock_change,
            number,
            of_sensor=True,
            delays=EVERY_CHANNEL,
        )


def _over_speed(predictor: Predictor) -> Iterator[Misdescription]:
    """Directions that depend on speed."""
    spec = predictor.fast.spec
    highest = float(max(spec.heat.table.speed))
    speed = np.linspace(0.0, highest, MODE_POINTS)
    for group in spec.bearing_set:
        bearings = tuple(item.name for item in group.bearing)
        for number, (size, shape) in enumerate(shape_modes(speed, tuned.HEAT_SHAPE_LENGTH)):
            at = f"{speed[np.argmax(np.abs(shape))] * 30.0 / np.pi:.0f} rpm"
            yield Misdescription(
                f"heat_shape.{group.name}.{number + 1}",
                "heat.table",
                "",
                tuned.HEAT_SHAPE_SIGMA * size,
                f"share by which the heat of the {group.name} bearings differs from its table at {at}, "
                f"in the smooth shape {number + 1} over speed",
                SpeedShape(bearings, tuple(speed), tuple(shape)),
            )
    rows = tuple(name for name in predictor.fast.model.coefficient_names if name.startswith("balls."))
    if rows:
        yield Misdescription(
            "ball_conductance_over_speed",
            "bearing_set.ball_row.conductance",
            "",
            tuned.BALL_SPEED_SIGMA,
            f"share by which balls conduct better at {highest * 30.0 / np.pi:.0f} rpm than at rest",
            SpeedConductance(rows, highest),
        )
