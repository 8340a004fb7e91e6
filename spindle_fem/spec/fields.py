"""Field types of the definition files: text with units in, SI floats out."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, PlainSerializer, model_validator

from spindle_fem.errors import SpindleFemError
from spindle_fem.units import ZERO_CELSIUS_K, Uncertain, to_si, uncertain_to_si


def _read_with(function: Any, *arguments: Any, **keywords: Any) -> BeforeValidator:
    # pydantic gathers ValueErrors of all fields; the place is added by the loader.
    def read(value: Any) -> Any:
        try:
            return function(value, *arguments, where="", **keywords)
        except SpindleFemError as error:
            raise ValueError(f"{error.what} {error.how_to_fix}".strip()) from error

    return BeforeValidator(read)


def _plain_text(value: float, unit: str, kind: str) -> Any:
    if kind == "temperature":
        return f"{value - ZERO_CELSIUS_K:.10g} degC"
    return f"{value!r} {unit}" if unit else value


def _rounded_si(value: Any, unit: str, kind: str, *, where: str) -> float:
    # Conversion leaves "410 mm" at 0.41000000000000003 m; 13 digits make equal texts equal.
    return float(f"{to_si(value, unit, where=where, kind=kind):.13g}")


def _rounded_uncertain(value: Any, unit: str, *, where: str) -> Uncertain:
    read = uncertain_to_si(value, unit, where=where)
    return Uncertain(float(f"{read.value:.13g}"), float(f"{read.sigma_log:.13g}"))


def quantity_field(unit: str, kind: str = "quantity") -> Any:
    """Annotated float that reads text with a unit and writes it back."""
    return Annotated[
        float,
        _read_with(_rounded_si, unit, kind),
        PlainSerializer(lambda value: _plain_text(value, unit, kind)),
    ]


def uncertain_field(unit: str) -> Any:
    """Annotated :class:`Uncertain`: a quantity, or one with a prior."""

    def write(value: Uncertain) -> Any:
        text = _plain_text(value.value, unit, "quantity")
        return text if value.is_fixed else {"value": text, "sigma_rel": value.sigma_log}

    return Annotated[Uncertain, _read_with(_rounded_uncertain, unit), PlainSerializer(write)]


Length = quantity_field("m")
Angle = quantity_field("rad")
Temperature = quantity_field("K", "temperature")
TemperatureDifference = quantity_field("K", "temperature_difference")
Pressure = quantity_field("Pa")
Density = quantity_field("kg/m**3")
Conductivity = quantity_field("W/m/K")
HeatCapacity = quantity_field("J/K")
SpecificHeat = quantity_field("J/kg/K")
KinematicViscosity = quantity_field("m**2/s")
VolumeFlow = quantity_field("m**3/s")
Force = quantity_field("N")
Power = quantity_field("W")
RotationalSpeed = quantity_field("rad/s")
PressureViscosity = quantity_field("1/Pa")
Fraction = quantity_field("")
Number = quantity_field("")
FilmCoefficient = quantity_field("W/m**2/K")

UncertainNumber = uncertain_field("")
UncertainFilm = uncertain_field("W/m**2/K")
UncertainConductance = uncertain_field("W/K")

Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.]*$", max_length=64)]
Range = Annotated[tuple[Length, Length], Field(description="from, to")]


class SpecModel(BaseModel):
    """Base of every table of a definition file: frozen, no unknown keys.

    ``marks`` says where values come from: ``"A"`` for all of the table, or
    ``{default = "A", outer_diameter = "C"}``; P paper, C catalogue, A assumed.
    """

    model_config: ClassVar[ConfigDict] = ConfigDict(
        extra="forbid", frozen=True, arbitrary_types_allowed=True, validate_default=False
    )
    marks: dict[str, str] = Field(default_factory=dict)

    @model_validator(mode="before")
    @classmethod
    def _read_marks(cls, data: Any) -> Any:
        if not isinstance(data, dict) or "marks" not in data:
            return data
        marks = data["marks"]
        marks = {"default": marks} if isinstance(marks, str) else marks
        if not isinstance(marks, dict):
            raise ValueError('marks must be a text or a table such as {default = "A", bore = "C"}.')
        allowed = [name for name in cls.model_fields if name != "marks"]
        for key, mark in marks.items():
            if key != "default" and key not in allowed:
                raise ValueError(f'marks names "{key}". Allowed: default, {", ".join(allowed)}.')
            if mark not in ("P", "C", "A"):
                raise ValueError(f'mark "{mark}" of {key}. Allowed: P (paper), C (catalogue), A (assumed).')
        return {**data, "marks": dict(marks)}

    def mark_of(self, field: str) -> str:
        """Source mark of one field, ``""`` where the file gives none."""
        return self.marks.get(field, self.marks.get("default", ""))
