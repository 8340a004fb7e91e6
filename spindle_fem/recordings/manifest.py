"""The manifest of a recording: which column means what."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import pint
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from spindle_fem.definition.faults import validation_faults
from spindle_fem.definition.load import read_toml
from spindle_fem.errors import FaultsError, RecordingError, SpecError, SpindleFemError, UnitError
from spindle_fem.units import registry

RECORDING_SCHEMA = "spindle-fem/recording/1"
DATA_SUFFIXES = (".csv", ".csv.gz", ".parquet")
STANDARD_INPUT = "-"

# What the machines with geometry know; a network machine may name other boundaries and sources.
DRIVES_UNITS = {
    "speed": "rad/s",
    "thrust": "N",
    "ambient": "K",
    "coolant_inlet": "K",
    "coolant_flow": "m**3/s",
}
_ROTATION_UNITS = ("revolution", "turn", "radian", "degree")


class _ManifestModel(BaseModel):
    model_config: ClassVar[ConfigDict] = ConfigDict(extra="forbid", frozen=True)


class TimeColumn(_ManifestModel):
    """Where the time stands: seconds and the like with ``unit``, ISO 8601 stamps without."""

    column: str
    unit: str | None = None


class Channel(_ManifestModel):
    """One column and what it means."""

    column: str
    role: Literal["temperature", "displacement", "input", "covariate"]
    unit: str | None = None
    probe: str | None = None
    sigma: float | None = None
    drives: str | None = None
    hold: Literal["previous", "linear"] | None = None


class Manifest(_ManifestModel):
    """A recording's ``.toml`` file."""

    schema_: Annotated[Literal["spindle-fem/recording/1"], Field(alias="schema")]
    name: str
    description: str = ""
    data: str
    time: TimeColumn
    channel: Annotated[tuple[Channel, ...], Field(min_length=1)]


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
    schema = content.get("schema")
    if schema != RECORDING_SCHEMA:
        fault = SpecError(f"{source}: schema", f"{schema!r} is not known.", f'Allowed: "{RECORDING_SCHEMA}".')
        raise FaultsError(source, [fault])
    try:
        manifest = Manifest.model_validate(content)
    except ValidationError as error:
        raise FaultsError(source, validation_faults(error, source, Manifest)) from error
    faults = manifest_faults(manifest)
    data = file.parent / manifest.data
    if growing and manifest.data == STANDARD_INPUT:
        data = Path(STANDARD_INPUT)
    elif not manifest.data.endswith(DATA_SUFFIXES):
        faults.append(
            SpecError(
                "data", f'"{manifest.data}" is of unknown kind.', f"Allowed: {', '.join(DATA_SUFFIXES)}."
            )
        )
    elif not data.is_file() and not growing:
        faults.append(RecordingError("data", f'"{manifest.data}" does not exist beside the manifest.'))
    if faults:
        located = [type(f)(f"{source}: {f.where}", f.what, f.how_to_fix) for f in faults]
        raise FaultsError(source, located)
    return manifest, data


def manifest_faults(manifest: Manifest) -> list[SpindleFemError]:
    """Contradictions of a well-formed manifest, each named by key."""
    faults: list[SpindleFemError] = []
    if manifest.time.unit is not None:
        faults += _unit_faults(manifest.time.unit, "time.unit", "s")
    columns: dict[str, str] = {manifest.time.column: "time.column"}
    driven: dict[str, str] = {}
    for number, channel in enumerate(manifest.channel, 1):
        where = f"channel[{number}]"
        if channel.column in columns:
            earlier = columns[channel.column]
            faults.append(
                SpecError(
                    f"{where}.column", f'"{channel.column}" is already {earlier}.', "One channel a column."
                )
            )
        columns.setdefault(channel.column, f"{where}.column")
        faults += _role_faults(channel, where)
        if channel.role == "input" and channel.drives is not None:
            if channel.drives in driven:
                faults.append(
                    SpecError(
                        f"{where}.drives",
                        f'"{channel.drives}" is already driven by {driven[channel.drives]}.',
                        "One channel for each driven quantity.",
                    )
                )
            driven.setdefault(channel.drives, where)
    if not any(channel.role == "temperature" for channel in manifest.channel):
        faults.append(
            SpecError("channel", "no channel is a temperature.", 'Give at least one role = "temperature".')
        )
    return faults


def _role_faults(channel: Channel, where: str) -> list[SpindleFemError]:
    needed: dict[str, tuple[str, ...]] = {
        "temperature": ("probe", "unit"),
        "displacement": ("probe", "unit"),
        "input": ("drives", "unit"),
        "covariate": (),
    }
    allowed: dict[str, tuple[str, ...]] = {
        "temperature": ("probe", "unit", "sigma"),
        "displacement": ("probe", "unit", "sigma"),
        "input": ("drives", "unit", "hold", "sigma"),
        "covariate": ("unit", "sigma"),
    }
    faults: list[SpindleFemError] = []
    role, label = channel.role, f'"{channel.column}"'
    for key in needed[role]:
        if getattr(channel, key) is None:
            faults.append(SpecError(f"{where}.{key}", f"is missing for {label}, a channel of role {role}."))
    for key in ("probe", "unit", "sigma", "drives", "hold"):
        if getattr(channel, key) is not None and key not in allowed[role]:
            faults.append(
                SpecError(
                    f"{where}.{key}",
                    f"{getattr(channel, key)!r} has no meaning for role {role}.",
                    f"Allowed: column, role, {', '.join(allowed[role])}.",
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
