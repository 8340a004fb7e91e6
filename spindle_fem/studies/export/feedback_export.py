"""Temperature-dependent parts of an exported model: friction and ball rows, films of natural convection."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.machine_spec import NaturalFilm
from spindle_fem.model.reduced.fast_model import FastModel
from spindle_fem.model.reduced.film_heat import film_heat_of
from spindle_fem.operation.coefficients import film_coefficient, fluid_temperature, natural_reference
from spindle_fem.operation.friction_map import CONDUCTANCES, FILM_TEMPERATURES, MOMENT
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.studies.export.effect_export import ExportedEffects
from spindle_fem.studies.export.interpolation_axes import refined_axis, values_on
from spindle_fem.studies.export.preload_export import ExportedPreload
from spindle_fem.studies.export.state_space import FeedbackTable
from spindle_fem.units import ZERO_CELSIUS_K

Array = NDArray[np.float64]

# Relative error of heats and coefficients between the points of a table.
TOLERANCE = 1e-4
# Range of a wall above its surroundings, K, and of the surroundings, °C.
WALL_RANGE, SURROUNDINGS_RANGE = (-60.0, 120.0), (-10.0, 50.0)
# Raceways and balls count for the temperature of a film.
FILM_SHARES = (0.25, 0.25, 0.5)


def preload_of(fast: FastModel) -> ExportedPreload | None:
    """Preload that follows the temperatures, where the model's bearings do."""
    term = film_heat_of(fast)
    return None if term is None or term.preload is None else ExportedPreload(fast, term.preload)


def feedback_tables(
    fast: FastModel, constant: str, highest: float, effects: ExportedEffects
) -> list[FeedbackTable]:
    """Every table of a fast model's own terms.

    Parameters
    ----------
    constant : str
        Load that is 1.
    highest : float, [rad/s]
    """
    found = [] if film_heat_of(fast) is None else _bearing_tables(fast, constant, highest, effects.factors)
    preload = preload_of(fast)
    if preload is not None and preload.joints:
        found.append(preload.joint_table(effects))
    return found + [
        _natural_table(fast, film, surface, effects)
        for film in fast.spec.film
        if isinstance(film, NaturalFilm)
        for surface in film.surface
    ]


def _bearing_tables(
    fast: FastModel, constant: str, highest: float, scaled: Mapping[str, float]
) -> list[FeedbackTable]:
    """Friction heat and what ball rows conduct beyond what the operators hold, of every bearing."""
    term, names = film_heat_of(fast), fast.bearings
    known = term.friction_map
    films = np.linspace(*FILM_TEMPERATURES, 3)
    factors = np.array([group.heat_factor.value for group, _ in fast.spec.bearings]) * bool(term.bearings)
    followed = np.isin(np.arange(len(names)), term.follow)

    def at(speed: float, thrust: float, film: Array) -> Array:
        """Friction heat, conductances, and those that the operators hold, (n_bearings, 5, k)."""
        series = known.at(speed, thrust)
        kelvin = np.tile(film, (len(names), 1))
        heat = speed * np.exp(series.at(kelvin, MOMENT)) * factors[:, None, None]
        now = np.exp(series.at(kelvin, CONDUCTANCES)) * followed[:, None, None]
        nominal = known.nominal_conductance(speed, thrust)[:, :, None] * followed[:, None, None]
        return np.concatenate((heat, now, np.broadcast_to(nominal, now.shape)), axis=1)

    thrusts = known.thrust
    middle = float(thrusts[thrusts.size // 2])
    speeds = refined_axis(lambda speed: at(speed, middle, films).ravel(), 0.0, highest, TOLERANCE)
    kelvin = refined_axis(
        lambda film: at(0.5 * highest, middle, np.array([film])).ravel(), *FILM_TEMPERATURES, TOLERANCE
    )
    loads = thrusts
    if thrusts.size > 1:
        loads = refined_axis(
            lambda thrust: at(0.5 * highest, thrust, films[1:2])[:, 0].ravel() + 1e-9,
            float(thrusts[0]),
            float(thrusts[-1]),
            TOLERANCE,
        )
    values = np.array([[at(speed, thrust, kelvin) for thrust in loads] for speed in speeds])
    # Speed, thrust, bearing, quantity, film to bearing, film, speed, thrust, quantity.
    values = values.transpose(2, 4, 0, 1, 3)
    inputs, axes = ("speed", "thrust"), (kelvin - ZERO_CELSIUS_K, speeds, loads)
    if loads.size == 1:
        values, inputs, axes = values[:, :, :, 0], inputs[:1], axes[:2]
    shares, _ = fast.inputs.friction_loads(np.eye(len(names)), scaled)
    none = np.zeros(fast.model.size)
    mounted = preload_of(fast)
    found = []
    for row, name in enumerate(names):
        inner, outer, balls = (
            fast.model.place(f"{name}.{side}") for side in ("inner_raceway", "outer_raceway", "balls")
        )
        warmed = shares[row, list(fast.heat_rows(name))] @ np.array([inner, outer, balls])
        found.append(
            FeedbackTable(
                FILM_SHARES @ np.array([inner, outer, balls]),
                {},
                inputs,
                axes,
                values[row],
                np.arange(3),
                np.array([warmed, inner - balls, outer - balls]),
                np.array([none, balls - inner, balls - outer]),
                [{constant: 1.0}, {}, {}],
                less=np.array([-1, 3, 4]),
                response=None if mounted is None else np.array(mounted.bearings[name]),
            )
        )
    return found


def _natural_table(
    fast: FastModel, film: NaturalFilm, surface: str, effects: ExportedEffects
) -> FeedbackTable:
    """A natural film beyond what the operators hold, over the wall's rise and its surroundings."""
    coefficient = f"film.{surface}"
    fluid = fast.inputs.fluid_input(coefficient)
    reference = natural_reference(fast.spec, film)
    scale = fast.table.scale(coefficient, effects.factors)
    scale *= effects.changes(OperatingPoint.of(fast.spec)).get(coefficient, 1.0)

    def more(rise: float, surroundings: float) -> Array:
        kelvin = fluid_temperature(film, surroundings + ZERO_CELSIUS_K)
        point = OperatingPoint(0.0, 0.0, kelvin, kelvin, 0.0)
        return scale * (film_coefficient(film, point, np.array([kelvin + rise]), kelvin)[0] - reference)

    usual = np.mean(SURROUNDINGS_RANGE)
    rises = refined_axis(lambda rise: more(rise, usual) + scale * reference, *WALL_RANGE, TOLERANCE)
    axes, inputs = (rises,), ()
    if fluid == "ambient":
        low, high = SURROUNDINGS_RANGE
        axes = (rises, refined_axis(lambda air: more(10.0, air) + scale * reference, low, high, TOLERANCE))
        inputs = ("ambient",)
    values = values_on(more if inputs else lambda rise: more(rise, 0.0), axes)
    vectors, spectrum = fast.directions.of(coefficient)
    uniform = vectors.T @ fast.model.one
    return FeedbackTable(
        fast.model.place(surface),
        {fluid: -1.0},
        inputs,
        axes,
        values,
        np.zeros(len(spectrum), dtype=np.int64),
        vectors.T,
        -spectrum[:, None] * vectors.T,
        [{fluid: float(weight)} for weight in spectrum * uniform],
    )
