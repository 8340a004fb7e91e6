"""Mutations of a TOML file: of its tables, and of its bytes."""

from __future__ import annotations

import datetime
import math
import random
import re
from collections.abc import Callable
from typing import Any

import tomli_w

HOSTILE = (
    "<script>alert(1)</script>",
    '"><img src=x onerror=alert(1)>',
    "{{ 7 * 7 }}{% for x in ().__class__.__base__.__subclasses__() %}{% endfor %}",
    "../../../outside",
    "/tmp/outside",
    "a/b\\c:d*?",
    "$(touch outside)`touch outside`;touch outside",
    "'; DROP TABLE designs; --",
    "=cmd|' /C calc'!A0",
    "%s%s%n%x {0} {name}",
    "__import__('os').system('touch outside')",
    "\u202eright to left",
    "e\u0301 \U0001f600 \u4e3b\u8f74",
    "a\nb",
    "a\x7fb",
    "a.b|c:face",
    "*",
    "",
    " ",
    "CON",
    "N" * 5000,
)
NUMBERS = (0, -1, 1, 1e-300, 1e300, 1e9, -1e9, 1e-12, math.nan, math.inf, -math.inf, 2**63, 10**40, 0.5)
UNITS = ("mm", "m", "um", "degC", "K", "W", "N", "rpm", "W/m/K", "W/m**2/K", "J/K", "kg/m**3", "L/min")
UNITS = (*UNITS, "deg", "Pa", "GPa", "mm**2/s", "1/K", "h", "s", "%", "parsec")
ODD = ("nan mm", "inf rpm", "1e400 mm", "-0 mm", "mm", "3", "3 furlong", "1 mm mm", "1/0 mm", "10**10**10 mm")
ODD = (*ODD, "1e5000 K", "0x10 mm", "١٢ mm", "3 mm + 4 mm", "__import__('os') mm", "(1, 2) mm", "1_000 mm")
TYPES = (True, 3, 2.5, "text", [], {}, [1, "two"], {"value": "1 mm"}, [[]], datetime.date(2024, 2, 29))
_QUANTITY = re.compile(r"^\s*([-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*(\S.*)$")
# How far a number is moved, as decades: to another machine of this kind, of any kind, and to none.
MILD_DECADES, STRONG_DECADES, ROUGH_DECADES = 0.15, 1.0, 9.0

Path = tuple[Any, ...]


def paths(tree: Any, at: Path = ()) -> list[Path]:
    """Paths of everything in a tree, tables and lists too."""
    found = []
    items = tree.items() if isinstance(tree, dict) else enumerate(tree) if isinstance(tree, list) else ()
    for key, value in items:
        found += [(*at, key), *paths(value, (*at, key))]
    return found


def value_at(tree: Any, path: Path) -> Any:
    """Value at a path."""
    for key in path:
        tree = tree[key]
    return tree


def _replace(tree: Any, path: Path, value: Any) -> None:
    value_at(tree, path[:-1])[path[-1]] = value


def _shown(path: Path) -> str:
    return ".".join(map(str, path))


def _is_leaf(value: Any) -> bool:
    return not isinstance(value, (dict, list))


def _some(chance: random.Random, tree: Any, wanted: Callable[[Any], bool]) -> Path | None:
    found = [path for path in paths(tree) if wanted(value_at(tree, path))]
    return chance.choice(found) if found else None


def drop(chance: random.Random, tree: dict[str, Any]) -> str:
    """Leave out a key, a table or an entry of a list."""
    path = _some(chance, tree, lambda value: True)
    if path is None:
        return ""
    del value_at(tree, path[:-1])[path[-1]]
    return f"drop {_shown(path)}"


def misspell(chance: random.Random, tree: dict[str, Any]) -> str:
    """Misspell a key, or add an unknown one."""
    table = _some(chance, tree, lambda value: isinstance(value, dict) and bool(value))
    inside = tree if table is None else value_at(tree, table)
    if not inside:
        return ""
    key = chance.choice(list(inside))
    new = chance.choice([key + "s", key[:-1] or "x", key.upper(), "unknown", chance.choice(HOSTILE)])
    value = inside[key] if chance.random() < 0.5 else inside.pop(key)
    inside[new] = value
    return f"key {key} as {new[:40]!r}"


def other_type(chance: random.Random, tree: dict[str, Any]) -> str:
    """Another type in place of a value."""
    path = _some(chance, tree, lambda value: True)
    if path is None:
        return ""
    value = chance.choice(TYPES)
    _replace(tree, path, value)
    return f"{_shown(path)} = {value!r}"


def odd_number(chance: random.Random, tree: dict[str, Any]) -> str:
    """A huge, tiny or impossible number, with its unit or bare."""
    path = _some(chance, tree, _is_leaf)
    if path is None:
        return ""
    match = _QUANTITY.match(str(value_at(tree, path)))
    number = chance.choice(NUMBERS)
    value = f"{number} {match[2]}" if match and chance.random() < 0.8 else number
    _replace(tree, path, value)
    return f"{_shown(path)} = {value!r}"


def odd_quantity(chance: random.Random, tree: dict[str, Any]) -> str:
    """A text that looks like a quantity and is none."""
    path = _some(chance, tree, lambda value: isinstance(value, str) and bool(_QUANTITY.match(value)))
    if path is None:
        return ""
    value = chance.choice(ODD)
    _replace(tree, path, value)
    return f"{_shown(path)} = {value!r}"


def other_unit(chance: random.Random, tree: dict[str, Any]) -> str:
    """The number with another unit."""
    path = _some(chance, tree, lambda value: isinstance(value, str) and bool(_QUANTITY.match(value)))
    if path is None:
        return ""
    number = _QUANTITY.match(value_at(tree, path))[1]
    value = f"{number} {chance.choice(UNITS)}"
    _replace(tree, path, value)
    return f"{_shown(path)} = {value!r}"


def exchange(chance: random.Random, tree: dict[str, Any]) -> str:
    """Two values in each other's place."""
    one, other = (_some(chance, tree, _is_leaf) for _ in range(2))
    if one is None or other is None:
        return ""
    first, second = value_at(tree, one), value_at(tree, other)
    _replace(tree, one, second)
    _replace(tree, other, first)
    return f"exchange {_shown(one)} and {_shown(other)}"


def hostile_text(chance: random.Random, tree: dict[str, Any]) -> str:
    """Insert a text that means something elsewhere wherever the old text occurred, as a rename would."""
    path = _some(chance, tree, lambda value: isinstance(value, str))
    if path is None:
        return ""
    old, new = value_at(tree, path), chance.choice(HOSTILE)
    everywhere = chance.random() < 0.5
    for other in paths(tree) if everywhere else [path]:
        if value_at(tree, other) == old:
            _replace(tree, other, new)
    return f"{_shown(path)}{' and alike' if everywhere else ''} = {new[:40]!r}"


def repeat(chance: random.Random, tree: dict[str, Any]) -> str:
    """An entry of a list twice, or the list in another order."""
    path = _some(chance, tree, lambda value: isinstance(value, list) and bool(value))
    if path is None:
        return ""
    entries = value_at(tree, path)
    if chance.random() < 0.5:
        entries.append(chance.choice(entries))
        return f"{_shown(path)}: one entry twice"
    chance.shuffle(entries)
    return f"{_shown(path)}: another order"


def _scaled(chance: random.Random, tree: dict[str, Any], decades: float) -> str:
    path = _some(chance, tree, lambda value: bool(_number_of(value)))
    if path is None:
        return ""
    value = value_at(tree, path)
    number, unit = _number_of(value)
    factor = 10.0 ** chance.uniform(-decades, decades)
    # Celsius has its zero elsewhere: what is mild is so many kelvins.
    scaled = number + 20.0 * math.log10(factor) / decades if unit == "degC" else number * factor
    scaled = float(f"{scaled:.6g}")
    if isinstance(value, int) and not isinstance(value, bool):
        scaled = round(scaled)
    _replace(tree, path, f"{scaled} {unit}" if unit else scaled)
    return f"{_shown(path)} = {scaled:.6g} {unit}".rstrip()


def scaled_mildly(chance: random.Random, tree: dict[str, Any]) -> str:
    """A number of another machine of this kind."""
    return _scaled(chance, tree, MILD_DECADES)


def scaled_strongly(chance: random.Random, tree: dict[str, Any]) -> str:
    """A number of a machine that may just be possible."""
    return _scaled(chance, tree, STRONG_DECADES)


def scaled_roughly(chance: random.Random, tree: dict[str, Any]) -> str:
    """A number some decades away."""
    return _scaled(chance, tree, ROUGH_DECADES)


def _number_of(value: Any) -> tuple[float, str] | None:
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return float(value), ""
    match = _QUANTITY.match(value) if isinstance(value, str) else None
    try:
        return (float(match[1]), match[2]) if match else None
    except ValueError:
        return None


ROUGH = (drop, misspell, other_type, odd_number, odd_quantity, other_unit, exchange, hostile_text, repeat)
ROUGH = (*ROUGH, scaled_roughly)
MILD = (scaled_mildly, scaled_mildly, scaled_strongly)


def spoilt_bytes(chance: random.Random, content: bytes) -> tuple[bytes, str]:
    """A file as a bad copy, another editor or a mischief leaves it."""
    place = chance.randrange(len(content) + 1)
    kind = chance.choice(("truncated", "flipped", "inserted", "encoded", "line", "nested", "long", "empty"))
    if kind == "truncated":
        return content[:place], f"truncated at byte {place}"
    if kind == "flipped":
        changed = bytearray(content)
        for _ in range(chance.choice((1, 5, 50))):
            changed[chance.randrange(len(changed))] = chance.randrange(256)
        return bytes(changed), "bytes changed"
    if kind == "inserted":
        piece = chance.choice(PIECES)
        return content[:place] + piece + content[place:], f"{piece!r} at byte {place}"
    if kind == "encoded":
        name = chance.choice(("utf-16", "utf-8-sig", "utf-32", "cp037"))
        return content.decode("utf-8").encode(name, "replace"), f"encoded as {name}"
    if kind == "line":
        lines = content.splitlines(keepends=True)
        number = chance.randrange(len(lines))
        lines[number : number + 1] = [] if chance.random() < 0.5 else [lines[number]] * 2
        return b"".join(lines), f"line {number + 1} left out or twice"
    if kind == "nested":
        depth = chance.choice((50, 5000, 100000))
        piece = chance.choice((b"[" * depth + b"]" * depth, b"{a=" * depth + b"1" + b"}" * depth))
        return content + b"\nname2 = " + piece + b"\n", f"nested {depth} deep"
    if kind == "long":
        return content + b'\nname2 = "' + b"x" * 3_000_000 + b'"\n', "a line of 3 MB"
    return chance.choice((b"", b"\n", b"\x00" * 100, b"{}", b"schema = 1")), "emptied"


# A null, marks of other encodings, half a character, another end of line, what opens and never closes.
PIECES = (b"\x00", b"\xff\xfe", b"\xef\xbb\xbf", b"\xed\xa0\x80", b"\r\n", b'"""', b"[[")
# Shares of all files mutated as bytes, and mutated mildly, so that they can be run.
SHARE_BYTES, SHARE_MILD = 0.12, 0.55
MOST_CHANGES = 3


def mutated(chance: random.Random, tree: dict[str, Any]) -> tuple[bytes, list[str]]:
    """Bytes of a TOML file after some changes of a copy of its tables, and what they were."""
    tree = copied(tree)
    if chance.random() < SHARE_BYTES:
        content, what = spoilt_bytes(chance, tomli_w.dumps(tree).encode("utf-8"))
        return content, [what]
    kinds = MILD if chance.random() < SHARE_MILD else ROUGH
    done = [chance.choice(kinds)(chance, tree) for _ in range(chance.randint(1, MOST_CHANGES))]
    return tomli_w.dumps(tree).encode("utf-8", "replace"), [what for what in done if what]


def copied(tree: Any) -> Any:
    """Tables and lists anew, so that a change leaves the original alone."""
    if isinstance(tree, dict):
        return {key: copied(value) for key, value in tree.items()}
    return [copied(item) for item in tree] if isinstance(tree, list) else tree
