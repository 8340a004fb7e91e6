"""Field types of the definition files: text with units in, SI floats out."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, NoReturn

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, PlainSerializer, field_validator
from pydantic_core import PydanticCustomError

from spindle_fem.definition.tolerances import TolerancedLength, toleranced_to_si
from spindle_fem.errors import SpindleFemError, did_you_mean
from spindle_fem.registry import Registry, registry
from spindle_fem.units import ZERO_CELSIUS_K, Uncertain, to_si, uncertain_to_si

MARKS = {
    "P": "the paper",
    "C": "bearing catalogue",
    "A": "assumed",
    "U": "set by the user, without a source",
}


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault inside a table, before the file and the table are known.

    ``key`` is relative to the value being read: empty for the value itself.
    """

    key: str
    what: str
    how_to_fix: str = ""
    error: str = "SpecError"


def raise_faults(faults: Iterable[Fault]) -> None:
    """Hand faults to pydantic, which gathers those of all fields; none raises nothing."""
    listed = tuple(faults)
    if listed:
        text = "; ".join(f"{fault.key}: {fault.what} {fault.how_to_fix}".strip(": ") for fault in listed)
        raise PydanticCustomError("faults", "{text}", {"text": text, "faults": listed})


def _refuse(what: str, how_to_fix: str, *, key: str = "", error: str = "SpecError") -> NoReturn:
    raise_faults([Fault(key, what, how_to_fix, error)])
    raise AssertionError("unreachable")


def _fault_of(error: SpindleFemError, key: str = "") -> Fault:
    return Fault(key or error.where.strip("."), error.what, error.how_to_fix, type(error).__name__)


@dataclass(frozen=True, slots=True)
class QuantityRule:
    """Allowed values of one quantity; also the source of the reference page.

    Attributes
    ----------
    unit : str
        SI unit, ``""`` for a pure number.
    kind : str
        As for :func:`spindle_fem.units.to_si`.
    above, at_least, at_most : float or None
        Limits in ``unit``.
    words : tuple of str
        Texts allowed in place of a value, such as ``"ambient"``.
    uncertain : bool
        Whether a prior may be given.
    toleranced : bool
        Whether one standard deviation may be given.
    laws : Registry or None
        Laws that may give the value, ``{law = NAME, quantity = ..., ...}``.
    """

    unit: str
    kind: str = "quantity"
    above: float | None = None
    at_least: float | None = None
    at_most: float | None = None
    words: tuple[str, ...] = ()
    uncertain: bool = False
    laws: Registry | None = None
    toleranced: bool = False

    def allowed(self) -> str:
        """The limits in words, ``""`` where there are none."""
        unit = f" {self.unit}" if self.unit else ""
        if self.at_least is not None and self.at_most is not None:
            return f"{self.at_least:g} to {self.at_most:g}{unit}"
        if self.above is not None and self.at_most is not None:
            return f"above {self.above:g} up to {self.at_most:g}{unit}"
        if self.above is not None:
            return f"above {self.above:g}{unit}"
        if self.at_least is not None:
            return f"at least {self.at_least:g}{unit}"
        return ""

    def holds(self, value: float) -> bool:
        """Whether a value in ``unit`` keeps the limits."""
        return (
            (self.above is None or value > self.above)
            and (self.at_least is None or value >= self.at_least)
            and (self.at_most is None or value <= self.at_most)
        )

    def read(self, value: Any) -> Any:
        """SI value of what the file gives."""
        if isinstance(value, str) and value in self.words:
            return value
        if self.words and isinstance(value, str) and re.fullmatch(r"[A-Za-z_]+", value.strip()):
            _refuse(f'"{value}" is not known.', did_you_mean(value, self.words) + " Or a quantity.")
        try:
            if self.laws is not None and isinstance(value, dict) and "law" in value:
                return self._read_law(value)
            if self.uncertain:
                return self._read_uncertain(value)
            if self.toleranced:
                return self._read_toleranced(value)
            # Conversion leaves "410 mm" at 0.41000000000000003 m; 13 digits make equal texts equal.
            result = _rounded(to_si(value, self.unit, where="", kind=self.kind))
        except SpindleFemError as error:
            raise_faults([_fault_of(error)])
        self._require_limits(result, value)
        return result

    def _read_uncertain(self, value: Any) -> Uncertain:
        read = uncertain_to_si(value, self.unit, where="")
        result = Uncertain(_rounded(read.value), _rounded(read.sigma_log))
        self._require_limits(result.value, value)
        return result

    def _read_toleranced(self, value: Any) -> TolerancedLength:
        read = toleranced_to_si(value, self.unit)
        result = TolerancedLength(_rounded(read), read.sigma)
        self._require_limits(result, value)
        return result

    def _read_law(self, value: dict[str, Any]) -> Uncertain:
        """Value of a law at the quantities given, with ``sigma_rel`` of its logarithm."""
        name = ChoiceRule(self.laws).read(value["law"])
        law, given = self.laws[name], {key: item for key, item in value.items() if key != "law"}
        sigma = to_si(given.pop("sigma_rel", 0.0), "", where="sigma_rel")
        faults = [
            Fault(key, "is unknown.", did_you_mean(key, [*law.units, "sigma_rel"]), "UnknownKeyError")
            for key in given
            if key not in law.units
        ]
        faults += [
            Fault(key, "is missing.", f'law = "{name}" needs it.') for key in law.required if key not in given
        ]
        raise_faults(faults)
        quantities = {key: to_si(item, law.units[key], where=key) for key, item in given.items()}
        return Uncertain(_rounded(float(law(**quantities))), _rounded(sigma))

    def _require_limits(self, result: float, value: Any) -> None:
        if not self.holds(result):
            shown = value.get("value", value) if isinstance(value, dict) else value
            shown = f'"{shown}"' if isinstance(shown, str) else shown
            _refuse(f"{shown} is outside what is possible.", f"Allowed: {self.allowed()}.")

    def write(self, value: Any) -> Any:
        """Text that reads back as the same value."""
        if isinstance(value, str):
            return value
        if isinstance(value, Uncertain):
            text = self._plain(value.value)
            return text if value.is_fixed else {"value": text, "sigma_rel": value.sigma_log}
        if isinstance(value, TolerancedLength) and value.sigma is not None:
            return {"value": self._plain(float(value)), "sigma": self._plain(value.sigma)}
        if isinstance(value, TolerancedLength):
            value = float(value)
        return self._plain(value)

    def _plain(self, value: float) -> Any:
        if self.kind == "temperature":
            celsius = round(value - ZERO_CELSIUS_K, 10)
            if _rounded(celsius + ZERO_CELSIUS_K) == value:
                return f"{celsius!r} degC"
        return f"{value!r} {self.unit}" if self.unit else value


def _rounded(value: float) -> float:
    return float(f"{value:.13g}")


def _field(python_type: Any, rule: QuantityRule) -> Any:
    return Annotated[python_type, BeforeValidator(rule.read), PlainSerializer(rule.write), rule]


def quantity_field(
    unit: str,
    kind: str = "quantity",
    *,
    above: float | None = None,
    at_least: float | None = None,
    at_most: float | None = None,
    words: tuple[str, ...] = (),
) -> Any:
    """Annotated float (or one of ``words``) that reads text with a unit and writes it back."""
    rule = QuantityRule(unit, kind, above, at_least, at_most, words)
    return _field(float | str if words else float, rule)


def uncertain_field(
    unit: str,
    *,
    above: float | None = None,
    at_least: float | None = None,
    at_most: float | None = None,
    words: tuple[str, ...] = (),
    laws: str = "",
) -> Any:
    """Annotated :class:`Uncertain`: a quantity, one with a prior, or one by a law of a package."""
    known = registry(laws) if laws else None
    rule = QuantityRule(unit, "quantity", above, at_least, at_most, words, uncertain=True, laws=known)
    return _field(Uncertain | str if words else Uncertain, rule)


def toleranced_field(*, above: float | None = None) -> Any:
    """Annotated :class:`TolerancedLength`: a length, or one with one standard deviation."""
    return _field(TolerancedLength, QuantityRule("m", above=above, toleranced=True))


Length = quantity_field("m")
UncertainPlace = toleranced_field()
UncertainLength = toleranced_field(above=0.0)
PositiveLength = quantity_field("m", above=0.0)
Radius = quantity_field("m", at_least=0.0)
Angle = quantity_field("rad")
Temperature = quantity_field("K", "temperature")
AmbientOrTemperature = quantity_field("K", "temperature", words=("ambient",))
Pressure = quantity_field("Pa", above=0.0)
Density = quantity_field("kg/m**3", above=0.0)
Conductivity = quantity_field("W/m/K", above=0.0)
HeatCapacity = quantity_field("J/K", above=0.0)
SpecificHeat = quantity_field("J/kg/K", above=0.0)
# Above 2 mm²/s, where the law of its temperature (ASTM D341) begins.
OilViscosity = quantity_field("m**2/s", at_least=2.0e-6)
VolumeFlow = quantity_field("m**3/s", above=0.0)
Force = quantity_field("N")
PositiveForce = quantity_field("N", above=0.0)
Preload = quantity_field("N", at_least=0.0)
Power = quantity_field("W", at_least=0.0)
Torque = quantity_field("N*m", at_least=0.0)
PositiveTorque = quantity_field("N*m", above=0.0)
RotationalSpeed = quantity_field("rad/s", at_least=0.0)
PressureViscosity = quantity_field("1/Pa", above=0.0)
Fraction = quantity_field("", at_least=0.0, at_most=1.0)
Number = quantity_field("")
PositiveNumber = quantity_field("", above=0.0)
FilmCoefficient = quantity_field("W/m**2/K", at_least=0.0)

UncertainNumber = uncertain_field("", above=0.0)
UncertainShare = uncertain_field("", at_least=0.0, at_most=1.0)
UncertainFilm = uncertain_field("W/m**2/K", at_least=0.0)
JOINT_LAWS = "spindle_fem.physics.surroundings.joint_laws"
FilmOrPerfect = uncertain_field("W/m**2/K", at_least=0.0, words=("perfect",), laws=JOINT_LAWS)
UncertainConductance = uncertain_field("W/K", above=0.0)

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.]{0,63}")
NAME_RULE = "letters, digits, _ and . (first a letter or digit), at most 64 characters"


def is_name(value: Any) -> bool:
    """Whether a value may name a table."""
    return isinstance(value, str) and _NAME.fullmatch(value) is not None


def _read_name(value: Any) -> str:
    if not is_name(value):
        shown = f'"{value}"' if isinstance(value, str) else repr(value)
        _refuse(f"{shown} is not a name.", f"Allowed: {NAME_RULE}.")
    return value


Name = Annotated[str, BeforeValidator(_read_name)]
Flag = Annotated[bool, Field(strict=True)]

_LENGTH_RULE = QuantityRule("m")


def _read_range(value: Any) -> tuple[float, float]:
    if not isinstance(value, (list, tuple)) or len(value) != 2:
        _refuse(f"{value!r} is not a range.", 'Allowed: from and to, such as ["45 mm", "137 mm"].')
    ends, faults = [], []
    for position, item in enumerate(value):
        try:
            ends.append(_rounded(to_si(item, "m", where="")))
        except SpindleFemError as error:
            faults.append(_fault_of(error, f"[{position + 1}]"))
    raise_faults(faults)
    return ends[0], ends[1]


def _require_order(ends: tuple[float, float], value: Any, *, may_be_equal: bool) -> None:
    if ends[1] < ends[0] or (ends[1] == ends[0] and not may_be_equal):
        _refuse(
            f"runs from {ends[0] * 1e3:g} mm to {ends[1] * 1e3:g} mm.", "Allowed: an end beyond the start."
        )


def _read_extent(value: Any) -> tuple[float, float]:
    ends = _read_range(value)
    _require_order(ends, value, may_be_equal=False)
    return ends


def _read_place(value: Any) -> tuple[float, float]:
    single = not isinstance(value, (list, tuple))
    if single:
        place = _LENGTH_RULE.read(value)
        return place, place
    ends = _read_range(value)
    _require_order(ends, value, may_be_equal=True)
    return ends


@dataclass(frozen=True, slots=True)
class RangeRule:
    """Metadata of a field that takes from and to; a place may be a single length too."""

    single: bool
    example: str = '["45 mm", "137 mm"]'


@dataclass(frozen=True, slots=True, eq=False)
class ChoiceRule:
    """Allowed values of a field that names a registered thing; also the source of the reference page."""

    things: Registry
    keep: Callable[[str], bool] | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Allowed names."""
        return tuple(name for name in self.things if self.keep is None or self.keep(name))

    def read(self, value: Any) -> str:
        """The name, if there is such a thing."""
        names = self.names
        if not isinstance(value, str) or value not in names:
            shown = f'"{value}"' if isinstance(value, str) else repr(value)
            _refuse(f"{shown} is not allowed.", did_you_mean(str(value), names))
        return value


def choice_field(package: str, keep: Callable[[str], bool] | None = None) -> Any:
    """Annotated text: the name of a thing that a registry has, one file each in a package.

    Parameters
    ----------
    keep : callable, optional
        Which names count; all where none is given.
    """
    rule = ChoiceRule(registry(package), keep)
    return Annotated[str, BeforeValidator(rule.read), rule]


@dataclass(frozen=True, slots=True)
class FreeQuantityRule:
    """Metadata of a field that takes a quantity of any dimension, kept as it is written."""


@dataclass(frozen=True, slots=True)
class AllowedText:
    """Metadata of a field of a special type: allowed values, in words."""

    text: str


def _write_range(ends: tuple[float, float]) -> list[str]:
    return [_LENGTH_RULE.write(end) for end in ends]


# Pydantic's own tuple schema would hide the two-value message behind one per item.
Range = Annotated[
    tuple[Any, Any], BeforeValidator(_read_extent), PlainSerializer(_write_range), RangeRule(False)
]
Place = Annotated[
    tuple[Any, Any], BeforeValidator(_read_place), PlainSerializer(_write_range), RangeRule(True)
]


class SpecModel(BaseModel):
    """Base of every table of a definition file: frozen, no unknown keys.

    ``marks`` says where values come from: ``"A"`` for all of the table, or
    ``{default = "A", outer_diameter = "C"}``. P the paper, C bearing
    catalogue, A assumed, U set by the user without a source.
    """

    model_config: ClassVar[ConfigDict] = ConfigDict(
        extra="forbid",
        frozen=True,
        arbitrary_types_allowed=True,
        validate_default=False,
        # of the tables that a file has not, none is needed
        defer_build=True,
    )
    marks: dict[str, str] = Field(default_factory=dict)
    """Origin of the values: P, C, A or U, for the table or key by key."""

    @field_validator("marks", mode="before")
    @classmethod
    def _read_marks(cls, marks: Any) -> Any:
        marks = {"default": marks} if isinstance(marks, str) else marks
        if not isinstance(marks, dict):
            _refuse(
                f"{marks!r} are no marks.",
                'Allowed: a letter for the whole table, or such as {default = "A", width = "C"}.',
            )
        keys = [
            "default",
            *(field.alias or name for name, field in cls.model_fields.items() if name != "marks"),
        ]
        letters = ", ".join(f"{letter} ({meaning})" for letter, meaning in MARKS.items())
        faults = [
            Fault(key, "is no key of this table.", did_you_mean(str(key), keys), "UnknownKeyError")
            for key in marks
            if key not in keys
        ]
        faults += [
            Fault("" if key == "default" else key, f"{mark!r} is no mark.", f"Allowed: {letters}.")
            for key, mark in marks.items()
            if not isinstance(mark, str) or mark not in MARKS
        ]
        raise_faults(faults)
        return dict(marks)

    def mark_of(self, field: str) -> str:
        """Source mark of one field, ``""`` where the file gives none."""
        return self.marks.get(field, self.marks.get("default", ""))
