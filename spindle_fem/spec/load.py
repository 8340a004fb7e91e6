"""Definition files: read, inherit, override, validate with every fault at once."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import tomli_w
from pydantic import BaseModel, ValidationError

from spindle_fem.errors import FaultsError, SpecError, SpindleFemError, UnitError, UnknownKeyError, did_you_mean
from spindle_fem.spec.consistency import find_faults
from spindle_fem.spec.model import MACHINE_SCHEMA, MachineSpec

Model = TypeVar("Model", bound=BaseModel)


def machine_folder() -> Path:
    """Folder of the definitions that ship: in the wheel, or beside the package in a checkout."""
    package = Path(__file__).resolve().parents[1]
    installed = package / "machines"
    return installed if installed.is_dir() else package.parent / "geometry"


def shipped_machines() -> tuple[str, ...]:
    """Names of the definitions that ship."""
    return tuple(sorted(path.stem for path in machine_folder().glob("*.toml")))


def find_machine(machine: str | Path) -> Path:
    """Path of a definition given as a path or by the name of one that ships.

    Raises
    ------
    SpecError
        Neither exists.
    """
    path = Path(machine)
    if path.suffix == ".toml" or path.exists():
        if path.is_file():
            return path
        raise SpecError(str(machine), "there is no such file.", f"Or name one that ships: {_names()}.")
    shipped = machine_folder() / f"{machine}.toml"
    if not shipped.is_file():
        raise SpecError(
            str(machine), "is neither a file nor a machine that ships.", did_you_mean(str(machine), shipped_machines())
        )
    return shipped


def _names() -> str:
    return ", ".join(shipped_machines())


def read_toml(path: Path) -> dict[str, Any]:
    """Content of a TOML file.

    Raises
    ------
    SpecError
        The file is missing, not UTF-8, or not TOML (with line and column).
    """
    try:
        with path.open("rb") as file:
            return tomllib.load(file)
    except OSError as error:
        raise SpecError(str(path), f"cannot be read ({error.strerror}).") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise SpecError(str(path), f"is not valid TOML: {error}.") from error


def merge(base: Any, change: Any) -> Any:
    """Lay one definition over another.

    Tables merge key by key, lists of named tables by ``name``; any other value
    replaces the base's, and ``"none"`` removes a key.
    """
    if isinstance(base, Mapping) and isinstance(change, Mapping):
        if set(change) & {"value", "sigma_rel", "low", "high"} or set(base) & {"value", "sigma_rel", "low", "high"}:
            return change  # a quantity with a prior is one value
        merged = dict(base)
        for key, value in change.items():
            if isinstance(value, str) and value == "none":
                merged.pop(key, None)
            else:
                merged[key] = merge(base[key], value) if key in base else value
        return merged
    if _named_tables(base) and _named_tables(change):
        by_name = {item["name"]: item for item in base}
        for item in change:
            by_name[item["name"]] = merge(by_name.get(item["name"], {}), item)
        return list(by_name.values())
    return change


def _named_tables(value: Any) -> bool:
    return isinstance(value, list) and all(isinstance(item, Mapping) and "name" in item for item in value)


def read_definition(path: Path, visited: tuple[Path, ...] = ()) -> dict[str, Any]:
    """Raw tables of a definition file with its ``base`` files laid under it."""
    content = read_toml(path)
    if "base" not in content:
        return content
    base_name = content.pop("base")
    where = f"{path}: base"
    if not isinstance(base_name, str):
        raise SpecError(where, f"{base_name!r} is not a name.", "Allowed: a file beside this one or " + _names() + ".")
    beside = path.parent / base_name
    base_path = beside if beside.is_file() else find_machine(base_name)
    if base_path.resolve() in {item.resolve() for item in (*visited, path)}:
        raise SpecError(where, f'"{base_name}" leads back to this file.')
    return merge(read_definition(base_path, (*visited, path)), content)


def apply_overrides(content: dict[str, Any], overrides: Iterable[str]) -> dict[str, Any]:
    """Apply ``path=value`` texts, for example ``channel.depth=19mm``.

    Lists of named tables are entered by name (``bearing_set.front.preload``).

    Raises
    ------
    UnknownKeyError
        The path does not lead to a key that the definition may have.
    """
    for override in overrides:
        path, separator, text = override.partition("=")
        if not separator or not path.strip():
            raise SpecError(f"--set {override}", "is not of the form path=value.", "For example channel.depth=19mm.")
        content = _with_value(content, path.strip().split("."), _typed(text.strip()), f"--set {path.strip()}")
    return content


def _typed(text: str) -> Any:
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return text


def _with_value(content: Any, path: list[str], value: Any, where: str) -> Any:
    if not path:
        if isinstance(content, Mapping) and "value" in content and not isinstance(value, Mapping):
            return {**content, "value": value}
        return value
    key, rest = path[0], path[1:]
    if _named_tables(content) and content:
        names = [item["name"] for item in content]
        if key not in names:
            raise UnknownKeyError(where, f'there is no "{key}" here.', did_you_mean(key, names))
        return [_with_value(item, rest, value, where) if item["name"] == key else item for item in content]
    if not isinstance(content, Mapping):
        raise UnknownKeyError(where, f'"{key}" leads into a plain value.')
    if key not in content:
        if rest:
            raise UnknownKeyError(where, f'there is no "{key}" here.', did_you_mean(key, content))
        return {**content, key: value}  # a default made explicit; unknown keys fail in validation
    return {**content, key: _with_value(content[key], rest, value, where)}


def validation_faults(error: ValidationError, source: str, model: type[BaseModel]) -> list[SpindleFemError]:
    """Our errors for each of pydantic's, with the key path as the file writes it."""
    faults: list[SpindleFemError] = []
    for item in error.errors():
        where = f"{source}: {_key_path(item['loc'])}"
        kind, message = item["type"], item["msg"]
        if kind == "extra_forbidden":
            allowed = _allowed_keys(model, item["loc"][:-1])
            faults.append(UnknownKeyError(where, "unknown key.", did_you_mean(str(item["loc"][-1]), allowed)))
        elif kind == "missing":
            faults.append(SpecError(where, "is missing."))
        elif kind == "value_error":
            text = message.removeprefix("Value error, ")
            fault = UnitError if "unit is needed" in text or "dimension" in text else SpecError
            faults.append(fault(where, text))
        else:
            faults.append(SpecError(where, f"{_short(item['input'])}: {message}."))
    return faults


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 80 else text[:77] + "..."


_VARIANTS = ("constant", "natural_convection_radiation", "rotating", "function-before", "function-after")


def _key_path(location: tuple[int | str, ...]) -> str:
    text = ""
    for item in location:
        if isinstance(item, int):
            text += f"[{item + 1}]"
        elif str(item).startswith(_VARIANTS) and text.startswith("film"):
            continue
        elif str(item).startswith(("literal[", "function-", "tuple[", "float", "constrained")):
            continue
        else:
            text += f".{item}" if text else str(item)
    return text or "file"


def _allowed_keys(model: Any, location: tuple[int | str, ...]) -> list[str]:
    from typing import get_args

    candidates: list[type[BaseModel]] = [model]
    for item in location:
        if isinstance(item, int):
            continue
        following: list[type[BaseModel]] = []
        for candidate in candidates:
            for name, field in candidate.model_fields.items():
                if item in (name, field.alias):
                    following += _models_in(field.annotation, get_args)
        if following:
            candidates = following
        else:
            matching = [c for c in candidates if item in _kinds(c)]
            candidates = matching or candidates
    keys: dict[str, None] = {}
    for candidate in candidates:
        for name, field in candidate.model_fields.items():
            keys[field.alias or name] = None
    return list(keys)


def _kinds(model: type[BaseModel]) -> tuple[str, ...]:
    from typing import get_args

    field = model.model_fields.get("kind")
    return get_args(field.annotation) if field else ()


def _models_in(annotation: Any, get_args: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    found: list[type[BaseModel]] = []
    for argument in get_args(annotation):
        found += _models_in(argument, get_args)
    return found


def validate(content: dict[str, Any], source: str) -> MachineSpec:
    """Typed machine of raw tables; every fault at once.

    Raises
    ------
    FaultsError
        One or more faults; each names file, key, value and what is allowed.
    """
    schema = content.get("schema")
    if schema != MACHINE_SCHEMA:
        raise FaultsError(
            source, [SpecError(f"{source}: schema", f"{schema!r} is not known.", f'Allowed: "{MACHINE_SCHEMA}".')]
        )
    try:
        spec = MachineSpec.model_validate(content)
    except ValidationError as error:
        raise FaultsError(source, validation_faults(error, source, MachineSpec)) from error
    faults = [type(fault)(f"{source}: {fault.where}", fault.what, fault.how_to_fix) for fault in find_faults(spec)]
    if faults:
        raise FaultsError(source, faults)
    return spec


def load_machine(machine: str | Path, overrides: Iterable[str] = ()) -> MachineSpec:
    """Read a definition file, or one that ships by its name.

    Parameters
    ----------
    machine : str or Path
    overrides : iterable of str
        ``path=value`` texts applied before validation.

    Raises
    ------
    SpecError
        Anything wrong with the file, its base or the overrides.
    """
    path = find_machine(machine)
    content = apply_overrides(read_definition(path), overrides)
    return validate(content, path.name)


def write_machine(spec: MachineSpec) -> str:
    """TOML text of a machine with everything resolved; reads back to an equal machine."""
    content = spec.model_dump(mode="json", by_alias=True, exclude_none=True, exclude_defaults=False)
    return tomli_w.dumps(_without_empty(content))


def _without_empty(value: Any) -> Any:
    if isinstance(value, dict):
        cleaned = {key: _without_empty(item) for key, item in value.items()}
        return {key: item for key, item in cleaned.items() if item not in ({}, [])}
    if isinstance(value, (list, tuple)):
        return [_without_empty(item) for item in value]
    return value
