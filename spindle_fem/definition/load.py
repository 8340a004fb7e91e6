"""Definition files: read, inherit, override, validate with every fault at once."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import tomli_w
from pydantic import TypeAdapter, ValidationError

from spindle_fem.definition.completion import (
    Assumption,
    complete,
    unknown_catalogues,
    with_named_types,
    without_supplied,
)
from spindle_fem.definition.consistency import Declared, find_faults
from spindle_fem.definition.faults import validation_faults
from spindle_fem.definition.inherit import (
    Layer,
    apply_overrides,
    merge,
    relabelled,
    split_override,
    without_none,
)
from spindle_fem.definition.machine_spec import MACHINE_SCHEMA, MachineSpec
from spindle_fem.definition.mended_tables import mended
from spindle_fem.definition.overridden import overridden
from spindle_fem.definition.schema import annotation_of, names_of
from spindle_fem.errors import BadInputError, FaultsError, SpecError, SpindleFemError, did_you_mean

__all__ = [
    "Examination",
    "apply_overrides",
    "examine",
    "examine_machine",
    "find_machine",
    "load_machine",
    "machine_folder",
    "merge",
    "read_definition",
    "read_toml",
    "shipped_machines",
    "validate",
    "validation_faults",
    "write_machine",
]


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
    if path.is_file():
        return path
    shipped = shipped_machines()
    if path.suffix == ".toml" or path.exists():
        what = "is a folder." if path.is_dir() else "there is no such file."
        raise SpecError(str(machine), what, f"Or name a machine that ships: {', '.join(shipped)}.")
    if str(machine) not in shipped:
        raise SpecError(
            str(machine), "is neither a file nor a machine that ships.", did_you_mean(str(machine), shipped)
        )
    return machine_folder() / f"{machine}.toml"


def read_toml(path: Path) -> dict[str, Any]:
    """Content of a TOML file.

    Raises
    ------
    SpecError
        The file is missing, not UTF-8, not TOML (with line and column), or nested without end.
    """
    try:
        with path.open("rb") as file:
            return tomllib.load(file)
    except OSError as error:
        raise SpecError(str(path), f"cannot be read ({error.strerror}).") from error
    except UnicodeDecodeError as error:
        raise SpecError(
            str(path), f"is not UTF-8 (byte {error.start + 1}).", "Save it as UTF-8 text."
        ) from error
    except tomllib.TOMLDecodeError as error:
        raise SpecError(
            str(path), f"is not valid TOML: {error}.", "See https://toml.io for the format."
        ) from error
    except RecursionError as error:
        raise SpecError(str(path), "has lists or tables that are nested too deeply.") from error


def read_layers(path: Path, visited: tuple[Path, ...] = ()) -> list[Layer]:
    """A definition file after its ``base`` files, each as it is written."""
    content = read_toml(path)
    base_name = content.pop("base", None)
    layer = Layer(path.name, content)
    if base_name is None:
        return [layer]
    where = f"{path.name}: base"
    if not isinstance(base_name, str):
        raise SpecError(
            where,
            f"{base_name!r} is not a name.",
            f"Allowed: a file beside this one, or {', '.join(shipped_machines())}.",
        )
    beside = path.parent / base_name
    try:
        base_path = beside if beside.is_file() else find_machine(base_name)
    except SpecError as error:
        raise SpecError(where, f'"{base_name}" {error.what}', error.how_to_fix) from error
    chain = (*visited, path)
    if base_path.resolve() in {item.resolve() for item in chain}:
        trail = " -> ".join([*(item.name for item in chain), base_path.name])
        raise SpecError(
            where, f'"{base_name}" leads back to this file ({trail}).', "A base must end somewhere."
        )
    return [*read_layers(base_path, chain), layer]


def read_definition(path: Path) -> dict[str, Any]:
    """Raw tables of a definition file with its ``base`` files laid under it."""
    return _merged(read_layers(path))


def _merged(layers: Iterable[Layer]) -> dict[str, Any]:
    content: Any = {}
    for layer in layers:
        content = merge(content, layer.content) if content else dict(layer.content)
    return content


@dataclass(frozen=True, slots=True)
class Readable:
    """What of a faulty machine's geometry can be relied on.

    Attributes
    ----------
    parts : frozenset of str
        Parts and rings as the file means them.
    surfaces : frozenset of str
        Surfaces that the file names, and walls of circuits: not those that rules give.
    every_part : bool
        Whether no part is missing or faulty.
    channel : bool
        Whether the channel is as the file means it.
    """

    parts: frozenset[str]
    surfaces: frozenset[str]
    every_part: bool
    channel: bool

    @classmethod
    def of(
        cls,
        spec: MachineSpec,
        written: Mapping[str, Any],
        content: Mapping[str, Any],
        faults: Iterable[SpindleFemError],
    ) -> Readable:
        """Places whose tables can be read, from the file before and after completion and its faults."""
        places = [fault.where for fault in faults if not fault.where.endswith(_NO_GEOMETRY)]
        declared = Declared.of(content)
        owners = {part.name: (f"part.{part.name}",) for part in spec.part}
        for group, bearing in spec.bearings:
            kind = group.type_name(bearing)
            if kind in spec.bearing_types:
                paths = (f"bearing_set.{group.name}.bearing.{bearing.name}", f"bearing_types.{kind}")
                owners |= {f"{bearing.name}.{side}_ring": paths for side in ("inner", "outer")}
        sound = {
            name
            for name, paths in owners.items()
            if not any(_is_inside(where, path) for where in places for path in paths)
        }
        walls = {name for film in spec.circuits for name in film.surface}
        return cls(
            frozenset(sound),
            frozenset({*names_of(written.get("surface")), *walls}),
            sound.issuperset(declared.names["part"]),
            spec.channel is not None and not any(_is_inside(where, "channel") for where in places),
        )


# Keys whose faults leave a part or bearing where it is.
_NO_GEOMETRY = (".material", ".preload", ".takes_thrust", ".rotating", ".segment")


@dataclass(frozen=True, slots=True)
class Examination:
    """Content of a definition, sound or not.

    Attributes
    ----------
    spec : MachineSpec or None
        The machine; where there are faults only its sound tables, so that
        checks that need no more can still run. None where nothing can be read.
    faults : tuple of SpindleFemError
        In file order; empty for a valid machine.
    unsound : frozenset of str
        Top-level keys with a fault inside, whose entries ``spec`` may lack.
    can_be_built : bool
        Whether all that the geometry needs is sound, whatever else is not.
    readable : Readable or None
        What of the geometry can be relied on where it cannot be built.
    assumed : tuple of Assumption
        What the file leaves out and rules gave.
    """

    spec: MachineSpec | None
    faults: tuple[SpindleFemError, ...]
    unsound: frozenset[str] = frozenset()
    can_be_built: bool = False
    assumed: tuple[Assumption, ...] = ()
    readable: Readable | None = None


def examine(content: Mapping[str, Any], layers: Iterable[Layer] | str = "machine") -> Examination:
    """Every fault of raw tables, those within tables and those between them.

    Parameters
    ----------
    content : mapping
        Merged raw tables.
    layers : iterable of Layer, or str
        Where the keys come from, for the messages.
    """
    layers = (Layer(layers, {}),) if isinstance(layers, str) else tuple(layers)
    content = without_none(dict(content))
    fault = _schema_fault(content)
    if fault is not None:
        return Examination(None, (relabelled(fault, layers),))
    written = content
    content, assumed = complete(content)
    try:
        spec, faults = MachineSpec.model_validate(content), []
    except ValidationError as error:
        faults = without_supplied(validation_faults(error, "", MachineSpec, content), content)
        spec = _read_around(content, error)
    faults = [*unknown_catalogues(content), *faults]
    keys = [field.alias or name for name, field in MachineSpec.model_fields.items()]
    unsound = frozenset(key for key in keys if any(_is_inside(fault.where, key) for fault in faults))
    reported = [fault.where for fault in faults]
    found = find_faults(spec, Declared.of(content, unsound))
    between = [fault for fault in found if not any(_is_inside(fault.where, where) for where in reported)]
    can_be_built = not unsound & _GEOMETRY_KEYS and not any(
        _concerns_geometry(fault.where) for fault in between
    )
    readable = None if can_be_built else Readable.of(spec, written, content, (*faults, *between))
    located = tuple(relabelled(fault, layers) for fault in (*faults, *between))
    return Examination(spec, located, unsound, can_be_built, assumed, readable)


_GEOMETRY_KEYS = frozenset(
    {"part", "bearing_types", "bearing_set", "channel", "surface", "remaining_surfaces", "mesh"}
)


def _concerns_geometry(where: str) -> bool:
    """Whether a fault between tables keeps the geometry from being built."""
    if where in ("part", "surface", "bearing_set.bearing", "channel.part") or where.endswith(".bearing_type"):
        return True
    named_part = where.startswith("part.") and not where.endswith((".material", ".segment"))
    return named_part or (where.startswith("surface.") and where.endswith(".part"))


def _is_inside(where: str, key: str) -> bool:
    return where == key or where.startswith((key + ".", key + "["))


def _schema_fault(content: Mapping[str, Any]) -> SpindleFemError | None:
    allowed = f'Allowed: "{MACHINE_SCHEMA}".'
    if not content:
        return SpecError("file", "holds nothing.", f'A machine starts with schema = "{MACHINE_SCHEMA}".')
    if "schema" not in content:
        return SpecError("schema", "is missing.", allowed)
    if content["schema"] != MACHINE_SCHEMA:
        shown = content["schema"]
        shown = f'"{shown}"' if isinstance(shown, str) else repr(shown)
        return SpecError("schema", f"{shown} is not known.", allowed)
    if "network" in content and "part" not in content:
        return SpecError(
            "network",
            "is a machine without geometry.",
            "Only simulate and diagnose take one; this needs [[part]].",
        )
    return None


def _read_around(content: Mapping[str, Any], error: ValidationError) -> MachineSpec:
    """The machine without its faulty values, or else without the tables that they leave unreadable."""
    content = mended(content, error, MachineSpec)
    try:
        return MachineSpec.model_validate(content)
    except ValidationError as left:
        return _sound_tables(content, left)


def _sound_tables(content: Mapping[str, Any], error: ValidationError) -> MachineSpec:
    """The machine without its faulty tables, never validated as a whole."""
    faulty: dict[str, set[Any]] = {}
    for item in error.errors(include_url=False, include_context=False, include_input=False):
        top, *deeper = item["loc"]
        faulty.setdefault(str(top), set()).add(deeper[0] if deeper else None)
    values: dict[str, Any] = {}
    for name, field in MachineSpec.model_fields.items():
        key = field.alias or name
        given = content.get(key)
        if key not in content or (key in faulty and None in faulty[key]):
            continue
        if key in faulty and isinstance(given, list):
            given = [item for position, item in enumerate(given) if position not in faulty[key]]
        elif key in faulty and key in ("materials", "bearing_types"):
            given = {entry: table for entry, table in given.items() if entry not in faulty[key]}
        elif key in faulty:
            continue
        try:
            values[name] = TypeAdapter(annotation_of(field)).validate_python(given)
        except ValidationError:
            values[name] = ()  # every entry of a list that needs one was faulty
    empty = {"materials": {}, "part": (), "operation": None, "heat": None, "name": ""}
    return MachineSpec.model_construct(**{**empty, **values})


def validate(content: Mapping[str, Any], source: str | Iterable[Layer] = "machine") -> MachineSpec:
    """Typed machine of raw tables; every fault at once.

    Parameters
    ----------
    content : mapping
        Merged raw tables.
    source : str or iterable of Layer
        File name for the messages, or the layers that were merged.

    Raises
    ------
    FaultsError
        One or more faults; each names file, key, value and what is allowed.
    """
    layers = (Layer(source, {}),) if isinstance(source, str) else tuple(source)
    result = examine(content, layers)
    return _sound_machine(result.spec, result.faults, layers)


def _layers_and_content(machine: str | Path, overrides: Iterable[str]) -> tuple[list[Layer], dict[str, Any]]:
    layers = read_layers(find_machine(machine))
    content = with_named_types(_merged(layers))
    faults: list[SpindleFemError] = []
    for override in overrides:
        try:
            content = overridden(content, override)
            path, _ = split_override(override)
            layers.append(Layer(f"--set {path}", {}, path))
        except SpecError as error:
            faults.append(error)
    if faults:
        faults += examine(content, layers).faults
        raise FaultsError(str(machine), faults)
    return layers, content


def examine_machine(machine: str | Path, overrides: Iterable[str] = ()) -> Examination:
    """Every fault of a definition file, with its sound tables.

    Raises
    ------
    SpecError
        The file or its base cannot be read, or an override leads nowhere.
    """
    layers, content = _layers_and_content(machine, overrides)
    return examine(content, layers)


def load_machine(
    machine: str | Path,
    overrides: Iterable[str] = (),
    checks: Iterable[Callable[[MachineSpec], object]] = (),
    partly: Iterable[Callable[[MachineSpec, Readable], object]] = (),
) -> MachineSpec:
    """Read a definition file, or one that ships by its name.

    Parameters
    ----------
    overrides : iterable of str
        ``path=value`` texts applied before validation.
    checks : iterable of callable
        Further checks, such as building the geometry: each is called with the
        machine where its geometric tables are sound, and the bad input that it
        raises is reported together with the faults of the definition.
    partly : iterable of callable
        Called in their place where those tables are not sound: with what can be read of the machine.

    Raises
    ------
    SpecError
        Anything wrong with the file, its base or the overrides.

    >>> round(load_machine("wu_tan_2016", ["channel.depth=19mm"]).channel.depth, 6)
    0.019
    """
    layers, content = _layers_and_content(machine, overrides)
    result = examine(content, layers)
    faults = list(result.faults)
    if result.spec is not None:
        calls = [partial(check, result.spec) for check in checks if result.can_be_built]
        calls += [partial(check, result.spec, result.readable) for check in partly if not result.can_be_built]
        for call in calls:
            try:
                call()
            except FaultsError as error:
                faults += [relabelled(fault, layers) for fault in error.faults]
            except BadInputError as error:
                faults.append(relabelled(error, layers))
    return _sound_machine(result.spec, faults, layers)


def _sound_machine(
    spec: MachineSpec | None, faults: Sequence[SpindleFemError], layers: Iterable[Layer]
) -> MachineSpec:
    if faults or spec is None:
        files = [layer.source for layer in layers if not layer.override]
        raise FaultsError(files[-1] if files else "machine", faults)
    return spec


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
