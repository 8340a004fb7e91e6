"""The reference page of machine definitions, written from the models.

``python -m scripts.definition_page > docs/machine_definition.md`` renews it.
"""

from __future__ import annotations

import ast
import inspect
import itertools
import textwrap
from collections.abc import Iterator
from typing import Any

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from spindle_fem.definition.bearing_catalogue import GROOVE_RULE, PRELOAD_RULE, ROLLER_RULE, RULE
from spindle_fem.definition.field_types import MARKS, NAME_RULE
from spindle_fem.definition.machine_spec import MACHINE_SCHEMA, MachineSpec
from spindle_fem.definition.network_tables import NetworkMachineSpec
from spindle_fem.definition.schema import (
    Shape,
    annotation_of,
    is_text,
    literal_values,
    quantity_rule,
    registry_of,
    shape_of,
    value_text,
)
from spindle_fem.definition.standard_materials import GREASES, MATERIALS
from spindle_fem.definition.tolerances import DIAMETER_SHARE, PLACE
from spindle_fem.registry import Registry
from spindle_fem.units import ZERO_CELSIUS_K, Uncertain
from spindle_fem.validity import range_text


def _estimate(rule: str) -> str:
    """Estimate in a rule of the catalogue, beside the standard."""
    return rule.partition("; ")[2]


_MARKS = "; ".join(f"{letter} {meaning}" for letter, meaning in MARKS.items())
_INTRODUCTION = f"""\
# Machine definitions

<!-- Written by `python -m scripts.definition_page`; edit the models, not this page. -->

A machine is one [TOML](https://toml.io) file. `spindle-fem check FILE` reads it, names every fault at
once with file, key, value and what is allowed, and exits with 2 if there is any. Unknown keys are
faults. The machines that ship, in `geometry/`, are the examples to start from.

z runs along the axis from the nose (0) to the drive end, r is the radius, angle 0 points up; the axis
lies horizontal.

## Values

A **quantity** is a text with one number and its unit: `"19 mm"`, `"3000 rpm"`, `"20 L/min"`,
`"10 W/m**2/K"` (also `W/(m²·K)` or `W/m²/°C`). Any unit of the right dimension will do; a bare number is
refused wherever a unit is needed. A temperature takes `degC` or `K`. Rotational speed takes `rpm` or
`rad/s`, not Hz.

An **uncertain** value takes a quantity, which is then fixed, or a prior: `{{value = "10 W/m**2/K",
sigma_rel = 0.3}}` (sigma_rel is one standard deviation of the logarithm) or `{{low = "5 W/m**2/K", high =
"20 W/m**2/K"}}` (between them lie 90 %). `[[factor]]` makes one factor common to several values.

A length that says so takes a **tolerance**: `{{value = "280 mm", sigma = "1 mm"}}` (one standard
deviation) or `{{value = "280 mm", sigma_rel = 0.01}}`; `sigma = "0 mm"` says that it was measured. It tells
`diagnose` what may be misdescribed rather than missing physics, and changes no other result. Where the
definition does not say, one standard deviation is {100.0 * DIAMETER_SHARE:g} % of the outer diameters of a
standing part, which then are wrong in proportion, and {1e3 * PLACE:g} mm of a channel's radius, depth and
place: what drawings and mounting leave open of a machine that nobody has measured, not a machinist's
tolerance.

**Marks** say where a value comes from: {_MARKS}.
`marks = "A"` holds for the whole table, `marks = {{default = "A", bore_diameter = "C"}}` key by key. Every
table takes them.

**Names** are made of {NAME_RULE}.

## Building on another definition

`base = "wu_tan_2016"`, or a file beside this one, lays this file over that one. Tables merge key by key;
lists of tables (`[[part]]`, `[[film]]`, segments, bearings) merge by `name`, so an entry gives its name and
what changes. `key = "none"` leaves a key out, `remove = true` an entry. Any other list replaces the base's.
A changed value takes the mark that this file gives it, else U.

`--set path=value` on the command line changes one value: `channel.depth=19mm`,
`bearing_set.front.preload=900N`, `part.shaft.segment.nose.outer_diameter=178mm`,
`heat.table.heat.F1[7]=160W` (positions count from 1), `channel.ports=none`. Such values carry the mark U.
What rules add to the file is set by its name too: `joint.workshop_inner_seats.conductance=5000W/m**2/K`.

## What ships

`bearing_type = "7014 C"` names a bearing that ships (spaces as in `"7014 AC HC"`): 719xx, 70xx and 72xx with
C (15°), E or AC (25°), N10xx and NN30xx with cylindrical rollers (`NN3014 K`), 60xx and 62xx with deep
grooves, bores of 20 to 200 mm, with HC at the end for balls or rollers of silicon nitride. Boundary
dimensions are those of ISO 15; the rest is estimated. Balls: {_estimate(RULE)}. Deep grooves:
{_estimate(GROOVE_RULE)}; 10 µm of clearance as mounted.
Rollers: {_estimate(ROLLER_RULE)}; no clearance as mounted. Makers' balls and rollers
differ by up to a tenth in diameter and two in number. `[bearing_types.NN3014_K]` with single
keys (or `--set bearing_types.NN3014_K.radial_clearance=-3um`) changes what that bearing has,
`[bearing_types.front]` with `catalogue = "7014 C"` makes a type of another name of it.

Checked against rows of one open catalogue (IBC TI-I-5050.0, 2010;
`tests/published/test_bearing_catalogue_rows.py`): outer raceways of 19 N10 and NN30 within 0.7 %;
static load ratings of 35 of them within 11 % (NN3006 and NN3007, up to 37 % too high, are not as the rule has
them) and of 18 ball bearings within 18 %; boundary dimensions where its columns are sure.
Of a second one (NTN-SNR ULTAGE, 2015) 23 rows of 70xx and
719xx with 15° and 25° and bores from 30 mm on were compared: the same boundary dimensions, static load
ratings within 14 %, axial stiffness of pairs within 12 %. The other rows stand on ISO 15 alone.

`check` and `run` warn of bearings that turn faster than a catalogue allows single ones. Speed times pitch
diameter may reach, with balls of 15° and 25°, 1.17e6 and 1.02e6 rpm mm in grease, 1.87e6 and 1.64e6 in oil
(NTN-SNR ULTAGE), with deep grooves 0.70e6 and with cylindrical rollers 0.97e6 (SKF general catalogue 6000,
standard cages). Sets and preload bring that down; elements of silicon nitride, which are allowed more, are
not judged.

`preload = "light"`, `"medium"` or `"heavy"` of a set of ball bearings that ship: {PRELOAD_RULE}. 24 rows of
that catalogue are within 5 %; other makers' classes differ by half. `spacers = "steel"` draws the rings
between bearings of a set that stand apart.

 Materials that need no table: {", ".join(MATERIALS)}.
Greases for `grease = {{catalogue = NAME}}`: {", ".join(GREASES)}. `spindle-fem check` lists what
was taken (`assumed`).

## Surroundings by rule

`surroundings = "workshop"` gives joints, outer surfaces and air gaps where the file gives none:

- contacts that no `[[joint]]` covers join `workshop_inner_seats` (10000 W/(m²·K)), `workshop_outer_seats`
  (4000), `workshop_turning_seats` (8000), `workshop_standing_seats` (4000) or `workshop_clamped_faces`
  (8000), each with 30 or 40 %;
- faces that no `[[surface]]` names and that see the room from outside (`workshop_PART_cylinder`,
  `workshop_PART_plane_front` and `workshop_PART_plane_rear`) lose heat by natural convection and
  radiation (emissivity 0.6) where they stand, by `becker` and `disc` where they turn;
- a turning cylinder within 5 mm of a standing one is a gap by `becker_kaye`;
- what is left is adiabatic.

An entry of the file with the name of such a one replaces the values that it gives. `check` lists every
one; contacts between rotating and stationary parts have no rule. `geometry/motor_spindle.toml`,
`belt_lathe.toml` and `router_spindle.toml` are written this way, and so is what `spindle-fem new` writes.

## Contacts and surfaces

Where two parts touch there is a joint, named `part_a|part_b` (parts in sorted order) on a cylinder and
`part_a|part_b:face` on a plane. Every joint needs a conductance from exactly one `[[joint]]`; `*` in its
`contacts` stands for any text. The rings of bearing F1 are the parts `F1.inner_ring` and `F1.outer_ring`,
their raceways the surfaces `F1.inner_raceway` and `F1.outer_raceway`.

Every other face is exposed. A `[[surface]]` names some of a part's faces, and each named surface takes one
`[[film]]` or one side of a `[[gap]]`. What no surface names is adiabatic if
`remaining_surfaces = "adiabatic"` says so, else a fault.
"""

_NETWORK = """\
## A machine without drawings

A machine may be a thermal network instead: lumps with one temperature each, and what they exchange heat
with. `simulate`, `diagnose`, `watch` and `export` take it as they take one with geometry;
`geometry/bench_motor.toml` and `examples/pump.toml` are written this way. A node that no chain of links
joins to a boundary and a name that is nobody's are faults. Besides `[network]` and what is in it, the file
has only the keys of the first table.
"""


def reference_page() -> str:
    """Markdown text that lists every table and key of a machine definition."""
    sections = [_INTRODUCTION, "## Tables\n"]
    sections += list(key_sections("", Shape("table", (MachineSpec,)), in_list=False))
    sections.append(_NETWORK)
    sections.append(_key_table(NetworkMachineSpec))
    network = Shape("table", (NetworkMachineSpec.model_fields["network"].annotation,))
    sections += list(key_sections("network", network, in_list=False))
    sections += list(_choices())
    return "\n".join(sections).rstrip() + "\n"


def options(path: str = "", model: type[BaseModel] = MachineSpec) -> dict[str, Registry]:
    """Options of a table and of those in it that name a registered thing, by their path."""
    found: dict[str, Registry] = {}
    for key, field in _fields(model):
        annotation, own = annotation_of(field), f"{path}.{key}".lstrip(".")
        things = registry_of(annotation)
        if things is not None:
            found[own] = things
        inner = shape_of(annotation)
        while inner.kind in ("list", "mapping"):
            own += ".NAME" if inner.kind == "mapping" else ""
            inner = shape_of(inner.inner)
        for nested in written(inner):
            found |= options(own, nested)
    return found


def _choices() -> Iterator[str]:
    """Everything that an option names, with its source and range."""
    yield "## What options name\n"
    yield "One file each; a program adds its own with `register` or `add` (`examples/`).\n"
    for option, things in options().items():
        yield f"### `{option}`\n"
        yield "| name | what it is | range |\n|---|---|---|"
        for name in things:
            yield f"| `{name}` | {things.summary(name).rstrip('.')} | {_range_text(things[name])} |"
        yield ""


def _range_text(thing: Any) -> str:
    """Range of validity in words."""
    if hasattr(thing, "lowest_temperature"):
        low, high = (
            value - ZERO_CELSIUS_K for value in (thing.lowest_temperature, thing.highest_temperature)
        )
        return f"{low:.6g} to {high:.6g} °C"
    limits = getattr(thing, "ranges", {})
    return "; ".join(f"{name.replace('_', ' ')} {range_text(*ends)}" for name, ends in limits.items())


def key_sections(path: str, shape: Shape, *, in_list: bool) -> Iterator[str]:
    """Lines that list the keys of a table and of those in it."""
    for model in written(shape):
        kind = (
            f" with kind {value_text(annotation_of(model.model_fields['kind']))}"
            if len(shape.models) > 1
            else ""
        )
        header = f"[[{path}]]" if in_list else f"[{path}]"
        yield f"### {f'`{header}`{kind}' if path else 'Top level'}\n"
        yield _prose(model) + "\n"
        yield _key_table(model)
        for key, field in _fields(model):
            inner = shape_of(annotation_of(field))
            nested = f"{path}.{key}".strip(".")
            if inner.kind == "table":
                yield from key_sections(nested, inner, in_list=False)
            elif inner.kind in ("list", "mapping"):
                entries = shape_of(inner.inner)
                nested += "" if inner.kind == "list" else ".NAME"
                if entries.kind == "table":
                    yield from key_sections(nested, entries, in_list=inner.kind == "list")


def written(shape: Shape) -> tuple[type[BaseModel], ...]:
    """Tables of a shape that a file gives, without those that are made of others."""
    return tuple(model for model in shape.models if not getattr(model, "made", False))


def _fields(model: type[BaseModel]) -> list[tuple[str, FieldInfo]]:
    return [(field.alias or name, field) for name, field in model.model_fields.items() if name != "marks"]


def meanings(model: type[BaseModel]) -> dict[str, str]:
    """The text under each key of a table, its own and those that it inherits."""
    found: dict[str, str] = {}
    for kind in reversed(model.__mro__):
        if not issubclass(kind, BaseModel) or kind is BaseModel:
            continue
        (written,) = ast.parse(textwrap.dedent(inspect.getsource(kind))).body
        for key, text in itertools.pairwise(written.body):
            if isinstance(key, ast.AnnAssign) and isinstance(text, ast.Expr):
                found[key.target.id] = inspect.cleandoc(ast.literal_eval(text.value))
    return {field.alias or name: found.get(name, "") for name, field in model.model_fields.items()}


def _prose(model: type[BaseModel]) -> str:
    return inspect.cleandoc(model.__doc__ or "").replace("``", "`")


def _key_table(model: type[BaseModel]) -> str:
    lines = ["| key | meaning | allowed | default |", "|---|---|---|---|"]
    texts = meanings(model)
    for key, field in _fields(model):
        annotation = annotation_of(field)
        meaning = " ".join(texts[key].replace("``", "`").split())
        cells = (f"`{key}`", meaning, _allowed(annotation, key), _default(field, annotation))
        lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return "\n".join(lines) + "\n"


def _allowed(annotation: Any, key: str) -> str:
    shape = shape_of(annotation)
    if key == "schema":
        return f'`"{next(iter(literal_values(annotation)), MACHINE_SCHEMA)}"`'
    if shape.kind == "table":
        beside = "a name, or " if is_text(annotation) else ""
        beside = "a quantity, or " if quantity_rule(annotation) else beside
        return f"{beside}a table, see below"
    if shape.kind == "mapping":
        inner = shape_of(shape.inner)
        return "tables by name, see below" if inner.kind == "table" else f"by name: {_entries(inner)}"
    if shape.kind == "list":
        inner = shape_of(shape.inner)
        return "a list of tables, see below" if inner.kind == "table" else f"a list: {_entries(inner)}"
    return _value(annotation)


def _entries(shape: Shape) -> str:
    if shape.kind == "list":
        return f"a list: {_entries(shape_of(shape.inner))}"
    if shape.kind == "mapping":
        return "a table"
    return _value(shape.annotation)


def _value(annotation: Any) -> str:
    rule = quantity_rule(annotation)
    text = value_text(annotation)
    if rule is not None and rule.toleranced:
        return f"{text}, or one with a tolerance"
    return f"uncertain: {text}" if rule is not None and rule.uncertain else text


def _default(field: FieldInfo, annotation: Any) -> str:
    if field.is_required():
        return "**required**"
    value = field.get_default(call_default_factory=True)
    rule = quantity_rule(annotation)
    if value is None or value in ((), {}, ""):
        return "none"
    if isinstance(value, BaseModel):
        return "its defaults"
    if rule is not None and (isinstance(value, (float, int, Uncertain))):
        return f"`{rule.write(value)}`"
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    return f"`{value}`"


def main() -> None:
    """Print the page."""
    print(reference_page(), end="")


if __name__ == "__main__":
    main()
