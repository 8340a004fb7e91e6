"""Spoilt result folders and caches: reports refuse or are rebuilt, caches are made anew."""

from __future__ import annotations

import contextlib
import io
import json
import os
import random
import shutil
import tomllib
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from spindle_fem.model.reduced.reduced_cache import KeptBasis
from spindle_fem.model.thermal_model import ThermalModel

from .child import Surroundings, run_command, run_function
from .judged import ACCEPTED, Record
from .material import CACHE, COARSE, MESH, ORIGINALS, SPINDLE
from .mutations import mutated, spoilt_bytes

SHARE_CACHES, SHARE_MODELS = 0.35, 0.5
COMMANDS = {
    "run": ("report", "view"),
    "simulate": ("report", "view"),
    "simulate_spindle": ("report", "view"),
    "diagnose": ("report", "view"),
    "sweep": ("report", "again"),
    "transient": ("view", "restart"),
}


class Poison:
    """Object that runs a command when it is unpickled."""

    def __reduce__(self) -> tuple[object, tuple[str]]:
        return os.system, ("touch outside",)


def try_folder(number: int, chance: random.Random, folder: Path) -> Record:
    """One finished folder with a spoilt file, or one spoilt cache."""
    record = Record("folders", number)
    originals = folder.parents[2] / ORIGINALS
    if chance.random() < SHARE_CACHES:
        _try_cache(record, chance, folder, originals)
    else:
        _try_results(record, chance, folder, originals)
    return record


def _try_results(record: Record, chance: random.Random, folder: Path, originals: Path) -> None:
    name = chance.choice(sorted(COMMANDS))
    command = chance.choice(COMMANDS[name])
    shutil.copytree(originals / name, folder / "out")
    for file in originals.glob("*.toml"):
        shutil.copy(file, folder)
    files = [path for path in sorted((folder / "out").rglob("*")) if path.is_file() and path.suffix != ".png"]
    file = chance.choice(files)
    record.done = [command, name, file.name, _spoil(chance, file, files)]
    arguments = {
        "report": ["report", "out"],
        "view": ["view", "out"],
        "again": ["sweep", SPINDLE, "sweep.toml", "-o", "out", *COARSE],
        "restart": ["transient", "transient.toml", "-o", "out2", "--restart", "out/state.npz", *COARSE],
    }[command]
    record.step(command, run_command(arguments, folder))


def _spoil(chance: random.Random, file: Path, others: list[Path]) -> str:
    kind = chance.choice(("deleted", "bytes", "bytes", "tables", "other", "folder", "pickle", "link"))
    content = file.read_bytes()
    if kind == "tables" and file.suffix in (".json", ".toml"):
        return _other_tables(chance, file, content)
    if kind in ("bytes", "tables"):
        return _other_bytes(chance, file, content)
    file.unlink()
    if kind == "other":
        shutil.copy(other := chance.choice([path for path in others if path != file]), file)
        return f"content of {other.name}"
    if kind == "folder":
        file.mkdir()
    elif kind == "pickle":
        np.savez(file.open("wb"), header=np.array([Poison()], dtype=object))
    elif kind == "link":
        file.symlink_to(file.name)
    return kind


def _other_bytes(chance: random.Random, file: Path, content: bytes) -> str:
    try:
        content.decode("utf-8")
    except UnicodeDecodeError:
        place = chance.randrange(len(content))
        if chance.random() < 0.5:
            file.write_bytes(content[:place])
            return f"cut at byte {place}"
        changed = bytearray(content)
        for _ in range(chance.choice((1, 50))):
            changed[chance.randrange(len(changed))] = chance.randrange(256)
        file.write_bytes(bytes(changed))
        return "bytes changed"
    spoilt, what = spoilt_bytes(chance, content)
    file.write_bytes(spoilt)
    return what


def _other_tables(chance: random.Random, file: Path, content: bytes) -> str:
    """Apply the mutations of definitions, written in the form of the file."""
    tree = json.loads(content) if file.suffix == ".json" else tomllib.loads(content.decode())
    tree = tree if isinstance(tree, dict) else {"list": tree}
    without_null = json.loads(json.dumps(tree), object_hook=_filled)
    spoilt, done = mutated(chance, without_null)
    if file.suffix == ".json":
        with contextlib.suppress(ValueError, RecursionError):
            spoilt = json.dumps(tomllib.loads(spoilt.decode()), default=str).encode()
    file.write_bytes(spoilt)
    return "; ".join(done)


def _filled(table: dict[str, object]) -> dict[str, object]:
    """TOML has no null."""
    return {key: value for key, value in table.items() if value is not None}


def _try_cache(record: Record, chance: random.Random, folder: Path, originals: Path) -> None:
    cache = folder / CACHE
    shutil.copytree(originals / CACHE, cache)
    model, basis = (next(cache.glob(f"{kind}-*.npz")) for kind in ("reduced", "basis"))
    if chance.random() < SHARE_MODELS:
        file, load, names = chance.choice(
            (
                (model, ThermalModel.load, ThermalModel.__slots__),
                (basis, lambda path: KeptBasis.beside(model), KeptBasis.__slots__),
            )
        )
        sound = file.read_bytes()
        record.done = [file.name.partition("-")[0], _spoil_entry(chance, file)]
        record.step("model", run_function(lambda: _read_again(file, sound, load, names), folder))
        return
    # the mesh is read only where the model is not there
    of_model = ("reduced", "basis", "operators")
    file = next(path for path in cache.glob("*.npz") if path.name.partition("-")[0] not in of_model)
    record.done = ["mesh", _spoil_entry(chance, file)]
    around = Surroundings({"SPINDLE_FEM_CACHE": str(cache)})
    if record.step("mesh", run_command(list(MESH), folder, around)) == ACCEPTED:
        if (folder / "out.msh").read_bytes() != (originals / "out.msh").read_bytes():
            record.fault("another mesh")
        elif not file.is_dir() and not _holds(file):
            record.fault("the damaged entry was not replaced")


def _read_again(file: Path, sound: bytes, load: Callable[[Path], object | None], names: Sequence[str]) -> int:
    """Status 0 if an entry is read as it was, or not at all: then it is made again."""
    found = load(file)
    if found is None:
        return 0
    file.write_bytes(sound)
    was = load(file)
    return int(any(not _same(getattr(found, name), getattr(was, name)) for name in names))


def _same(one: object, other: object) -> bool:
    return np.array_equal(one, other) if isinstance(one, np.ndarray) else one == other


def _holds(file: Path) -> bool:
    with contextlib.suppress(OSError, ValueError, EOFError, zipfile.BadZipFile), np.load(file) as data:
        return "header" in data.files
    return False


def _spoil_entry(chance: random.Random, file: Path) -> str:
    kind = chance.choice(
        ("bytes", "bytes", "poison", "schema", "folder", "empty", "missing array", "garbage")
    )
    content = file.read_bytes()
    if kind == "bytes":
        return _other_bytes(chance, file, content)
    if kind == "empty":
        file.write_bytes(b"")
    elif kind == "garbage":
        file.write_bytes(random.Random(1).randbytes(5000))
    elif kind == "folder":
        file.unlink()
        file.mkdir()
    else:
        members = _members(content)
        name = chance.choice(sorted(members))
        if kind == "missing array":
            del members[name]
        elif kind == "poison":
            stream = io.BytesIO()
            np.save(stream, np.array([Poison()], dtype=object), allow_pickle=True)
            members[name] = stream.getvalue()
        else:
            members["header.npy"] = _other_header(members["header.npy"])
            name = "header.npy"
        with zipfile.ZipFile(file, "w") as archive:
            for member, data in members.items():
                archive.writestr(member, data)
        return f"{kind} {name}"
    return kind


def _members(content: bytes) -> dict[str, bytes]:
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def _other_header(content: bytes) -> bytes:
    """The header of an entry with the schema of a version that is not there yet."""
    old = np.load(io.BytesIO(content), allow_pickle=False)
    text = old.tobytes().decode() if old.dtype == np.uint8 else str(old)
    table = json.loads(text) | {"schema": "spindle-fem/none/99"}
    changed = json.dumps(table)
    stream = io.BytesIO()
    np.save(stream, np.frombuffer(changed.encode(), np.uint8) if old.dtype == np.uint8 else np.array(changed))
    return stream.getvalue()
