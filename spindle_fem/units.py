"""The only pint registry: quantities with units outside, SI floats inside.

Temperatures (``degC``, ``K``) and temperature differences (``K``,
``delta_degC``) are two kinds: pint would silently turn ``10 °C`` into
283.15 K inside a product, so a difference refuses ``degC``.
"""

from __future__ import annotations

import math
import numbers
import re
from dataclasses import dataclass
from functools import cache
from typing import Any

from spindle_fem.errors import UnitError

ZERO_CELSIUS_K = 273.15

# In a metre. Models and fits take displacements in micrometres, as large in number as temperatures are.
MICROMETRES = 1.0e6

# Units of recorded inputs as pint writes them.
TEMPERATURE_UNIT = "kelvin"
ANGULAR_SPEED_UNIT = "radian / second"

# 90 % of a normal distribution lie within this many standard deviations.
NORMAL_90_PERCENT = 1.6448536269514722

# A log-normal prior wider than this is a slip (30 written for 30 %).
LARGEST_SIGMA_REL = 3.0

_NUMBER_AND_UNIT = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*", re.DOTALL)
# Products and quotients of unit names with small powers, one level of brackets: what is
# not of this form never reaches pint, whose parser would also evaluate arithmetic.
_FACTOR = r"(?:%|Δ?°[^\W\d]*|[^\W\d]+)(?:(?:\*\*|\^)-?\d|⁻?[¹²³⁴])?"
_CHAIN = rf"{_FACTOR}(?:\s*[*/·]\s*{_FACTOR}|\s+{_FACTOR})*"
_UNIT = re.compile(rf"(?:1\s*/\s*)?(?:{_CHAIN}|\({_CHAIN}\))(?:\s*[*/·]\s*(?:{_FACTOR}|\({_CHAIN}\)))*")
# Factors from the usual units of definitions to SI, to pint's last digit (a test compares
# them): pint takes half a second to load, a quarter of what ``check`` takes, and is left to other units.
_USUAL = {
    ("mm", "m"): 1e-3,
    ("um", "m"): 1e-6,
    ("rpm", "rad/s"): math.pi / 30.0,
    ("deg", "rad"): math.pi / 180.0,
    ("mm**2/s", "m**2/s"): 1e-6,
    ("L/min", "m**3/s"): 1.666666666666667e-05,
    ("cm**3/h", "m**3/s"): 2.777777777777778e-10,
    ("kN", "N"): 1e3,
    ("GPa", "Pa"): 1e9,
    ("bar", "Pa"): 1e5,
    ("min", "s"): 60.0,
    ("h", "s"): 3600.0,
    **{
        (unit, unit): 1.0
        for unit in (
            "m",
            "W",
            "N",
            "N*m",
            "K",
            "s",
            "kg/m**3",
            "1/K",
            "1/Pa",
            "W/K",
            "J/K",
            "W/m/K",
            "J/kg/K",
            "W/m**2/K",
        )
    },
}
_TEMPERATURE_SCALES = ("degree_Celsius", "degree_Fahrenheit", "degree_Reaumur")


@cache
def registry() -> Any:
    """The application's pint registry (made on first use; pint is slow to import)."""
    import pint

    return pint.UnitRegistry(autoconvert_offset_to_baseunit=True)


def to_si(value: Any, unit: str, *, where: str, kind: str = "quantity") -> float:
    """SI magnitude of a quantity given as text with a unit.

    Parameters
    ----------
    value : str or pint.Quantity
        One number and its unit, for example ``"19 mm"``. Dimensionless kinds
        also take a bare number.
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
        Bare number, unknown unit, wrong dimension, not finite, or a
        temperature below absolute zero.

    Notes
    -----
    ``°C`` in a compound unit is a difference: pint's own reading of
    ``"10 W/m²/°C"`` would divide by 274.15 K. A frequency in Hz is refused
    for a rotational speed, since pint would take 1 Hz for 1 rad/s.

    >>> to_si("19 mm", "m", where="channel.depth")
    0.019
    >>> round(to_si("15 degC", "K", where="inlet", kind="temperature"), 2)
    288.15
    >>> to_si("10 W/m²/°C", "W/m**2/K", where="film")
    10.0
    """
    if isinstance(value, bool) or value is None or isinstance(value, (list, tuple, dict)):
        raise UnitError(
            where, f"{value!r} is not a quantity.", f"Write it as {quantity_example(unit, kind)}."
        )
    if isinstance(value, numbers.Real):
        magnitude = _pure_number(value, value, unit, kind, where)
    else:
        magnitude = _convert(value, unit, kind, where)
    if not math.isfinite(magnitude):
        raise UnitError(
            where,
            f"{_shown(value)} is not finite.",
            f"Allowed: a finite value in {_allowed_unit(unit, kind)}.",
        )
    if kind == "temperature" and magnitude < 0.0:
        raise UnitError(where, f"{_shown(value)} is below absolute zero.", "Allowed: above -273.15 degC.")
    return magnitude


def _pure_number(number: Any, value: Any, unit: str, kind: str, where: str) -> float:
    if unit:
        raise UnitError(
            where,
            f"bare number {_shown(value)}, a unit is needed.",
            f"Write it with its unit, such as {quantity_example(unit, kind)}.",
        )
    try:
        return float(number)
    except OverflowError:  # an integer beyond the floats: not finite, as the caller says
        return math.inf


def _shown(value: Any) -> str:
    text = f'"{value}"' if isinstance(value, str) else str(value)
    return text if len(text) <= 80 else text[:77] + "..."


def _convert(value: Any, unit: str, kind: str, where: str) -> float:
    if isinstance(value, str):
        number, written = _split(value, unit, kind, where)
        if (written, unit) in _USUAL:
            return number * _USUAL[written, unit]
        if kind == "temperature" and written == "degC":
            return number + ZERO_CELSIUS_K
    units = registry()
    if isinstance(value, units.Quantity):
        number, written = value.magnitude, str(value.units)
    else:
        number, written = _split(str(value), unit, kind, where)
    if written in ("", "dimensionless"):
        return _pure_number(number, value, unit, kind, where)
    parsed, root = _parse_unit(written)
    if parsed is None:
        raise UnitError(
            where,
            f'{_shown(value)} has the unknown unit "{written}".',
            f"Allowed: units of {_allowed_unit(unit, kind)}, such as {quantity_example(unit, kind)}.",
        )
    name = str(parsed)
    if kind == "temperature_difference" and name in _TEMPERATURE_SCALES:
        raise UnitError(
            where,
            f"{_shown(value)} is a temperature, a difference is needed.",
            "Write it in K or delta_degC.",
        )
    if kind == "temperature" and name.startswith("delta_"):
        raise UnitError(
            where, f"{_shown(value)} is a difference, a temperature is needed.", "Write it in degC or K."
        )
    if root != _root_of(unit):
        raise UnitError(
            where,
            f"{_shown(value)} has the wrong dimension.",
            f"Allowed: units of {_allowed_unit(unit, kind)}, such as {quantity_example(unit, kind)}.",
        )
    return float(units.Quantity(float(number), parsed).to(unit or "dimensionless").magnitude)


def _split(text: str, unit: str, kind: str, where: str) -> tuple[float, str]:
    match = _NUMBER_AND_UNIT.fullmatch(text.replace("\N{MINUS SIGN}", "-"))
    if match is None:
        raise UnitError(
            where,
            f"{_shown(text)} cannot be read as a quantity.",
            f"Write one number and its unit, such as {quantity_example(unit, kind)}.",
        )
    return float(match[1]), match[2]


@cache
def _parse_unit(text: str) -> tuple[Any, str]:
    """Unit and its root units as text; ``(None, "")`` when the text is no unit."""
    import pint

    if _UNIT.fullmatch(text) is None:
        return None, ""
    units = registry()
    try:
        parsed = units.parse_units(text)
        return parsed, str(units.Quantity(1.0, parsed).to_root_units().units)
    except (pint.errors.PintError, TypeError, ValueError):
        return None, ""


@cache
def _root_of(unit: str) -> str:
    units = registry()
    return str(units.Quantity(1.0, unit or "dimensionless").to_root_units().units)


def _allowed_unit(unit: str, kind: str) -> str:
    if kind == "temperature":
        return "temperature"
    return unit or "a pure number"


def quantity_example(unit: str, kind: str = "quantity") -> str:
    """Example of a quantity of a unit in a definition file.

    >>> quantity_example("m")
    '"19 mm"'
    """
    if kind == "temperature":
        return '"15 degC"'
    customary = {
        "m": "19 mm",
        "rad/s": "3000 rpm",
        "rad": "15 deg",
        "m**3/s": "20 L/min",
        "m**2/s": "21 mm**2/s",
        "K": "5 K",
        "N": "1750 N",
        "W": "155 W",
        "Pa": "206 GPa",
        "1/Pa": "1.8e-8 1/Pa",
        "kg/m**3": "7850 kg/m**3",
        "W/m/K": "45 W/m/K",
        "J/kg/K": "470 J/kg/K",
        "W/m**2/K": "10 W/m**2/K",
    }
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
        if not 0.0 <= sigma <= LARGEST_SIGMA_REL:
            raise UnitError(
                f"{where}.sigma_rel".lstrip("."),
                f"sigma_rel is {sigma:g}.",
                f"Allowed: 0 to {LARGEST_SIGMA_REL:g}, 1 sigma of the logarithm (30 % is 0.3).",
            )
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
