"""The manifest of a recording: which column means what."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, TypeVar

import pint
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from spindle_fem.definition.faults import validation_faults
from spindle_fem.definition.load import read_toml
from spindle_fem.errors import FaultsError, RecordingError, SpecError, SpindleFemError, UnitError
from spindle_fem.units import registry

RECORDING_SCHEMA = "spindle-fem/recording/1"
DATA_SUFFIXES = (".csv", ".csv.gz", ".parquet")
STANDARD_INPUT = "-"

# Inputs of machines with geometry; a network machine may name other boundaries and sources.
DRIVES_UNITS = {
    "speed": "rad/s",
    "thrust": "N",
    "ambient": "K",
    "coolant_inlet": "K",
    "coolant_flow": "m**3/s",
}
# Keys of a channel beside column and role: needed, and allowed.
ROLE_KEYS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "temperature": (("probe", "unit"), ("sigma",)),
    "displacement": (("probe", "unit"), ("sigma",)),
    "input": (("drives", "unit"), ("hold", "sigma")),
    "covariate": ((), ("unit", "sigma")),
}
# Schemas of machines, studies and results: nothing else in such a file is a fault of a manifest.
_OF_OTHER_FILES = re.compile(r"spindle-fem/(?!recording\b)")
_ROTATION_UNITS = ("revolution", "turn", "radian", "degree")


class _ManifestModel(BaseModel):
    model_config: ClassVar[ConfigDict] = ConfigDict(extra="forbid", frozen=True, defer_build=True)


Table = TypeVar("Table", bound=_ManifestModel)


class TimeColumn(_ManifestModel):
    """Time column and its unit."""

    column: str
    """Column of the data file. Rows may be repeated or out of order."""
    unit: str | None = None
    """Unit of a column that counts: `s`, `ms`, `min`, `hour`. Without it the column holds ISO 8601 stamps;
    those without a zone count as UTC."""


class Channel(_ManifestModel):
    """One column and its meaning."""

    column: str
    """Column of the data file; one channel per column. Columns without a channel are left out and counted."""
    role: Literal["temperature", "displacement", "input", "covariate"]
    """Role in the model; it determines the other keys, see below."""
    unit: str | None = None
    """Unit of the column, such as `degC`, `rpm`, `l/min`, `percent`. A covariate without one is a pure
    number."""
    probe: str | None = None
    """Sensor: a probe or a network node of the machine; for a displacement, a
    `[[displacement_sensor]]`."""
    sigma: float | None = None
    """White noise, one standard deviation: above 0, in K, of a displacement in its unit. Measured from the
    readings where it is not given."""
    drives: str | None = None
    """Input that it drives, one channel for each, see below."""
    hold: Literal["previous", "linear"] | None = None
    """Between readings: the last one holds, or a straight line, which none given means too."""


class Manifest(_ManifestModel):
    """The whole file. At least one channel is a temperature."""

    schema_: Annotated[Literal["spindle-fem/recording/1"], Field(alias="schema")]
    """Form of this file."""
    name: str
    """Name of the recording in reports."""
    description: str = ""
    """Free text."""
    data: str
    """File beside the manifest that ends in `.csv`, `.csv.gz` or `.parquet`; for `watch` also `-`, standard
    input."""
    time: TimeColumn
    """The column of times."""
    channel: Annotated[tuple[Channel, ...], Field(min_length=1)]
    """Every column that counts."""


@dataclass(frozen=True, slots=True)
class ColumnUnit:
    """Affine conversion of a column to SI: ``scale · x + offset``.

    Attributes
    ----------
    unit : str
        SI base unit, ``""`` for a pure number.
    is_temperature : bool
        Absolute temperature, in K after conversion.
    """

    scale: float
    offset: float
    unit: str
    is_temperature: bool


def column_unit(text: str, where: str) -> ColumnUnit:
    """Conversion of a column's unit to SI base units.

    Raises
    ------
    UnitError
        The unit is unknown.

    >>> column_unit("degC", "SP01")
    ColumnUnit(scale=1.0, offset=273.15, unit='kelvin', is_temperature=True)
    >>> column_unit("percent", "load").scale
    0.01
    """
    units = registry()
    how = 'Allowed: a unit such as "degC", "rpm", "N", "W", "percent".'
    try:
        unit = units.Unit(text.strip())
        zero, one = (units.Quantity(number, unit).to_base_units() for number in (0.0, 1.0))
    except (pint.errors.PintError, ValueError, TypeError, SyntaxError, AttributeError) as error:
        raise UnitError(where, f'"{text}" is not a known unit.', how) from error
    except Exception as error:  # pint's tokenizer raises its own undocumented classes on garbage
        raise UnitError(where, f'"{text}" cannot be read as a unit.', how) from error
    base = "" if one.units.dimensionless and str(one.units) == "dimensionless" else str(one.units)
    absolute = str(one.units) == "kelvin" and not str(unit).startswith("delta_")
    return ColumnUnit(
        float(one.magnitude) - float(zero.magnitude), round(float(zero.magnitude), 9), base, absolute
    )


def find_manifest(path: str | Path) -> Path:
    """The manifest file of a recording given as a folder or as the file itself.

    Raises
    ------
    RecordingError
        There is none, or the folder holds several and none is ``recording.toml``.
    """
    path = Path(path)
    if path.is_dir():
        if (path / "recording.toml").is_file():
            return path / "recording.toml"
        found = sorted(path.glob("*.toml"))
        if len(found) == 1:
            return found[0]
        names = ", ".join(item.name for item in found) or "none"
        raise RecordingError(str(path), "holds no recording.toml.", f"Name one .toml file; found: {names}.")
    if not path.is_file():
        raise RecordingError(
            str(path), "does not exist.", "Give a folder with recording.toml, or a .toml file."
        )
    if path.suffix != ".toml":
        raise RecordingError(
            str(path),
            "is not a manifest.",
            "Give the .toml file beside the data, which says what each column is.",
        )
    return path


def load_manifest(path: str | Path, *, growing: bool = False) -> tuple[Manifest, Path]:
    """Read and check a manifest.

    Parameters
    ----------
    growing : bool
        Whether its data are followed while they are written: the file may be missing yet, and ``-`` stands
        for standard input.

    Returns
    -------
    Path
        The data file.

    Raises
    ------
    FaultsError
        Every fault at once: file, key, value, what is allowed.
    RecordingError
        No manifest or no data file.
    """
    file = find_manifest(path)
    content = read_toml(file)
    source = str(file)
    faults = _schema_faults(content.get("schema", RECORDING_SCHEMA), source)
    if _OF_OTHER_FILES.match(str(content.get("schema"))):
        raise FaultsError(source, faults)
    try:
        Manifest.model_validate(content)
    except ValidationError as error:
        told = {fault.where for fault in faults}
        faults += [item for item in validation_faults(error, source, Manifest) if item.where not in told]
    found = [*_contradictions(content), *_data_faults(content.get("data"), file.parent, growing)]
    faults += [type(fault)(f"{source}: {fault.where}", fault.what, fault.how_to_fix) for fault in found]
    if faults:
        raise FaultsError(source, faults)
    manifest = Manifest.model_validate(content)
    standard = growing and manifest.data == STANDARD_INPUT
    return manifest, Path(STANDARD_INPUT) if standard else file.parent / manifest.data


def _schema_faults(schema: Any, source: str) -> list[SpindleFemError]:
    if schema == RECORDING_SCHEMA:
        return []
    return [SpecError(f"{source}: schema", f"{schema!r} is not known.", f'Allowed: "{RECORDING_SCHEMA}".')]


def _data_faults(data: Any, folder: Path, growing: bool) -> list[SpindleFemError]:
    if not isinstance(data, str) or (growing and data == STANDARD_INPUT):
        return []
    if not data.endswith(DATA_SUFFIXES):
        allowed = f"Allowed: {', '.join(DATA_SUFFIXES)}."
        return [SpecError("data", f'"{data}" is of unknown kind.', allowed)]
    if not growing and not (folder / data).is_file():
        return [RecordingError("data", f'"{data}" does not exist beside the manifest.')]
    return []


def _contradictions(content: Mapping[str, Any]) -> list[SpindleFemError]:
    """Contradictions between keys, each named, of the tables that are well formed by themselves."""
    faults: list[SpindleFemError] = []
    time = _well_formed(TimeColumn, content.get("time"))
    if time is not None and time.unit is not None:
        faults += _unit_faults(time.unit, "time.unit", "s")
    columns = {} if time is None else {time.column: "time.column"}
    driven: dict[str, str] = {}
    tables = content.get("channel")
    entries = [_well_formed(Channel, table) for table in tables] if isinstance(tables, list) else []
    for number, channel in enumerate(entries, 1):
        if channel is None:
            continue
        where = f"channel[{number}]"
        if channel.column in columns:
            what = f'"{channel.column}" is already {columns[channel.column]}.'
            faults.append(SpecError(f"{where}.column", what, "One channel a column."))
        columns.setdefault(channel.column, f"{where}.column")
        faults += _role_faults(channel, where)
        if channel.role == "input" and channel.drives is not None:
            if channel.drives in driven:
                what = f'"{channel.drives}" is already driven by {driven[channel.drives]}.'
                faults.append(SpecError(f"{where}.drives", what, "One channel for each driven quantity."))
            driven.setdefault(channel.drives, where)
    if entries and not any(channel is None or channel.role == "temperature" for channel in entries):
        faults.append(
            SpecError("channel", "no channel is a temperature.", 'Give at least one role = "temperature".')
        )
    return faults


def _well_formed(model: type[Table], table: Any) -> Table | None:
    """A table of a manifest, None where it is none by itself."""
    try:
        return model.model_validate(table)
    except ValidationError:
        return None


def _role_faults(channel: Channel, where: str) -> list[SpindleFemError]:
    faults: list[SpindleFemError] = []
    role, label = channel.role, f'"{channel.column}"'
    needed, optional = ROLE_KEYS[role]
    allowed = (*needed, *optional)
    for key in needed:
        if getattr(channel, key) is None:
            faults.append(SpecError(f"{where}.{key}", f"is missing for {label}, a channel of role {role}."))
    for key in ("probe", "unit", "sigma", "drives", "hold"):
        if getattr(channel, key) is not None and key not in allowed:
            faults.append(
                SpecError(
                    f"{where}.{key}",
                    f"{getattr(channel, key)!r} has no meaning for role {role}.",
                    f"Allowed: column, role, {', '.join(allowed)}.",
                )
            )
    if channel.sigma is not None and not 0.0 < channel.sigma < float("inf"):
        faults.append(
            SpecError(
                f"{where}.sigma",
                f"is {channel.sigma:g}.",
                "Allowed: above 0, in K or, of a displacement, its unit.",
            )
        )
    if channel.unit is None:
        return faults
    expected: str | None = {"temperature": "K", "displacement": "m"}.get(role)
    if role == "input" and channel.drives is not None:
        expected = "W" if channel.drives.startswith("heat.") else DRIVES_UNITS.get(channel.drives)
    return faults + _unit_faults(channel.unit, f"{where}.unit", expected)


def _unit_faults(text: str, where: str, expected: str | None) -> list[SpindleFemError]:
    try:
        conversion = column_unit(text, where)
    except UnitError as error:
        return [error]
    if expected is None:
        return []
    units = registry()
    if units.Unit(conversion.unit).dimensionality != units.Unit(expected).dimensionality:
        return [UnitError(where, f'"{text}" has the wrong dimension.', f"Allowed: units of {expected}.")]
    if expected == "K" and not conversion.is_temperature:
        return [UnitError(where, f'"{text}" is a temperature difference.', "Allowed: degC, K, degF.")]
    if expected == "rad/s" and not any(word in str(units.Unit(text)) for word in _ROTATION_UNITS):
        return [UnitError(where, f'"{text}" does not say turns or radians.', 'Allowed: "rpm", "rad/s".')]
    return []


def conversions(manifest: Manifest) -> dict[str, ColumnUnit]:
    """Conversion to SI of every channel's column; a covariate without unit is a pure number."""
    plain = ColumnUnit(1.0, 0.0, "", False)
    return {
        channel.column: plain if channel.unit is None else column_unit(channel.unit, channel.column)
        for channel in manifest.channel
    }


def time_scale(manifest: Manifest) -> float | None:
    """Seconds in one unit of the time column, None for ISO stamps."""
    return None if manifest.time.unit is None else column_unit(manifest.time.unit, "time.unit").scale


def describe(manifest: Manifest) -> dict[str, Any]:
    """Roles and meanings by column, for reports."""
    return {
        channel.column: {"role": channel.role, "means": channel.probe or channel.drives, "unit": channel.unit}
        for channel in manifest.channel
    }
