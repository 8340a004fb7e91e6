"""The only pint registry: quantities with units outside, SI floats inside.

Temperatures (``degC``, ``K``) and temperature differences (``K``,
``delta_degC``) are two kinds: pint would silently turn ``10 °C`` into
283.15 K inside a product, so a difference refuses ``degC``.
"""

from __future__ import annotations

import math
import numbers
from dataclasses import dataclass
from functools import cache
from typing import Any

from spindle_fem.errors import UnitError

ZERO_CELSIUS_K = 273.15

# 90 % of a normal distribution lie within this many standard deviations.
NORMAL_90_PERCENT = 1.6448536269514722


@cache
def registry() -> Any:
    """The application's pint registry (made on first use; pint is slow to import)."""
    import pint

    units = pint.UnitRegistry(autoconvert_offset_to_baseunit=True)
    units.define("percent = 0.01 = %")
    return units


def to_si(value: Any, unit: str, *, where: str, kind: str = "quantity") -> float:
    """SI magnitude of a quantity given as text with a unit.

    Parameters
    ----------
    value : str or pint.Quantity
        For example ``"19 mm"``. Dimensionless kinds also take a bare number.
    unit : str
        The SI unit that the value must convert to, ``""`` for a pure number,
        ``"K"`` with ``kind="temperature"`` or ``kind="temperature_difference"``.
    where : str
        File and key for the message.
    kind : {"quantity", "temperature", "temperature_difference"}

    Returns
    -------
    float
        Magnitude in ``unit``.

    Raises
    ------
    UnitError
        Bare number, unknown unit, wrong dimension, or not finite.

    >>> to_si("19 mm", "m", where="channel.depth")
    0.019
    >>> round(to_si("15 degC", "K", where="inlet", kind="temperature"), 2)
    288.15
    """
    expected = unit or "a pure number"
    if isinstance(value, bool) or value is None:
        raise UnitError(where, f"{value!r} is not a quantity.", f"Give text such as {_example(unit, kind)}.")
    if isinstance(value, numbers.Real):
        if unit:
            raise UnitError(
                where, f"bare number {value!r}, a unit is needed.", f"Write it as {_example(unit, kind)}."
            )
        magnitude = float(value)
    else:
        magnitude = _parse(value, unit, kind, where, expected)
    if not math.isfinite(magnitude):
        raise UnitError(where, f"{value!r} is not finite.", f"Allowed: a finite value in {expected}.")
    return magnitude


def _parse(value: Any, unit: str, kind: str, where: str, expected: str) -> float:
    import pint

    units = registry()
    try:
        quantity = value if isinstance(value, units.Quantity) else units.parse_expression(str(value).strip())
    except (pint.errors.PintError, TypeError, ValueError, SyntaxError, AttributeError, ArithmeticError) as error:
        raise UnitError(
            where, f"{value!r} cannot be read as a quantity ({error}).", f"Write it as {_example(unit, kind)}."
        ) from error
    except Exception as error:  # pint's tokenizer raises its own undocumented classes on garbage
        raise UnitError(
            where, f"{value!r} cannot be read as a quantity.", f"Write it as {_example(unit, kind)}."
        ) from error
    if not isinstance(quantity, units.Quantity):
        if unit:
            raise UnitError(
                where, f"bare number {value!r}, a unit is needed.", f"Write it as {_example(unit, kind)}."
            )
        return float(quantity)
    name = str(quantity.units)
    if kind == "temperature_difference" and name in ("degree_Celsius", "degree_Fahrenheit"):
        raise UnitError(
            where, f"{value!r} is a temperature, a difference is needed.", "Write it in K or delta_degC."
        )
    if kind == "temperature" and name.startswith("delta_"):
        raise UnitError(where, f"{value!r} is a difference, a temperature is needed.", "Write it in degC or K.")
    try:
        return float(quantity.to(unit or "dimensionless").magnitude)
    except pint.errors.PintError as error:
        raise UnitError(
            where, f"{value!r} has the wrong dimension ({error}).", f"Allowed: units of {expected}."
        ) from error


def _example(unit: str, kind: str) -> str:
    if kind == "temperature":
        return '"15 degC"'
    customary = {"m": "19 mm", "rad/s": "3000 rpm", "rad": "15 deg", "m**3/s": "20 L/min", "K": "5 K"}
    return f'"{customary.get(unit, "1 " + unit)}"' if unit else "1.0"


@dataclass(frozen=True, slots=True)
class Uncertain:
    """A positive value in SI with an optional log-normal prior.

    ``sigma_log`` is one standard deviation of the natural logarithm; 0 means
    the value is fixed.
    """

    value: float
    sigma_log: float = 0.0

    @property
    def is_fixed(self) -> bool:
        """Whether the value carries no uncertainty."""
        return self.sigma_log == 0.0


def uncertain_to_si(value: Any, unit: str, *, where: str) -> Uncertain:
    """Read a plain quantity, ``{value, sigma_rel}`` or ``{low, high}`` (90 %).

    >>> uncertain_to_si({"low": "1 W/K", "high": "4 W/K"}, "W/K", where="link").value
    2.0
    """
    if not isinstance(value, dict):
        return value if isinstance(value, Uncertain) else Uncertain(to_si(value, unit, where=where))
    allowed = 'Allowed: a quantity, {value = "...", sigma_rel = ...} or {low = "...", high = "..."}.'
    if set(value) == {"value", "sigma_rel"}:
        magnitude = to_si(value["value"], unit, where=f"{where}.value")
        sigma = to_si(value["sigma_rel"], "", where=f"{where}.sigma_rel")
        if sigma < 0.0:
            raise UnitError(where, f"sigma_rel is {sigma:g}, it must not be negative.", allowed)
        if magnitude <= 0.0 and sigma > 0.0:
            raise UnitError(where, f"value is {magnitude:g}, a log-normal prior needs it above 0.", allowed)
        return Uncertain(magnitude, sigma)
    if set(value) == {"low", "high"}:
        low = to_si(value["low"], unit, where=f"{where}.low")
        high = to_si(value["high"], unit, where=f"{where}.high")
        if not 0.0 < low < high:
            raise UnitError(where, f"low {low:g} and high {high:g} must obey 0 < low < high.", allowed)
        return Uncertain(math.sqrt(low * high), math.log(high / low) / (2.0 * NORMAL_90_PERCENT))
    raise UnitError(where, f"keys {sorted(value)} do not make a value.", allowed)


def kelvin_to_celsius(temperature: Any) -> Any:
    """Temperature in °C of one in K (scalar or array)."""
    return temperature - ZERO_CELSIUS_K


def celsius_to_kelvin(temperature: Any) -> Any:
    """Temperature in K of one in °C (scalar or array)."""
    return temperature + ZERO_CELSIUS_K
