# ruff: noqa: E501  (a case a line)
"""Definition files: found, inherited, overridden, written back."""

from __future__ import annotations

import tomllib

import pytest

from spindle_fem.definition.consistency import find_faults
from spindle_fem.definition.inherit import apply_overrides, merge, without_none
from spindle_fem.definition.load import (
    examine_machine,
    find_machine,
    load_machine,
    machine_folder,
    read_definition,
    read_layers,
    shipped_machines,
    validate,
    write_machine,
)
from spindle_fem.errors import FaultsError, SpecError
from spindle_fem.units import Uncertain

WITH_GEOMETRY = tuple(
    name for name in shipped_machines() if "part" in read_definition(machine_folder() / f"{name}.toml")
)


def test_the_shipped_machines_are_found_by_name_and_by_path():
    assert {"wu_tan_2016", "recorded_spindle", "small_two_start", "uncooled"} <= set(WITH_GEOMETRY)
    path = find_machine("wu_tan_2016")
    assert find_machine(path) == path == machine_folder() / "wu_tan_2016.toml"


@pytest.mark.parametrize(
    ("name", "parts"),
    [
        ("wu_tan", ("is neither a file nor a machine that ships", 'Did you mean "wu_tan_2016"')),
        ("nowhere/x.toml", ("there is no such file", "recorded_spindle")),
    ],
)
def test_a_machine_that_does_not_exist_is_refused_with_those_that_do(name, parts):
    with pytest.raises(SpecError) as caught:
        find_machine(name)
    assert all(part in str(caught.value) for part in (name, *parts))


def test_a_folder_is_no_machine(tmp_path):
    with pytest.raises(SpecError, match="is a folder"):
        find_machine(tmp_path)


@pytest.mark.parametrize("name", WITH_GEOMETRY)
def test_a_machine_written_out_reads_back_equal(name):
    spec = load_machine(name)
    assert validate(tomllib.loads(write_machine(spec)), "written") == spec


@pytest.mark.parametrize("name", WITH_GEOMETRY)
def test_every_value_of_a_shipped_machine_carries_a_mark(name):
    spec = load_machine(name)
    tables = [spec.operation, spec.heat, spec.channel, spec.coolant, spec.grease, *spec.materials.values()]
    tables += [*spec.bearing_types.values(), *spec.bearing_set, *(bearing for _, bearing in spec.bearings)]
    tables += [segment for part in spec.part for segment in part.segment]
    tables += [film for film in spec.film if not getattr(film, "made", False)]
    tables += [*spec.joint, *spec.gap, *spec.factor, *spec.probe]
    tables += [group.ball_row for group in spec.bearing_set if group.ball_row.marks]
    for table in tables:
        for field in table.model_fields_set if table is not None else ():
            assert field == "marks" or table.mark_of(field) in ("P", "C", "A"), (table, field)


# ---------------------------------------------------------------- base

BASE = 'base = "wu_tan_2016"\nschema = "spindle-fem/machine/1"\nname = "changed"\n'


def derived(tmp_path, text):
    path = tmp_path / "changed.toml"
    path.write_text(BASE + text)
    return load_machine(path)


def test_a_base_gives_everything_that_is_not_changed(tmp_path):
    base, spec = load_machine("wu_tan_2016"), derived(tmp_path, '[channel]\ndepth = "19 mm"')
    assert spec.channel.depth == 0.019
    assert spec.model_copy(update={"channel": base.channel, "name": base.name}) == base


def test_entries_of_lists_are_changed_by_name_and_new_ones_added(tmp_path):
    spec = derived(
        tmp_path,
        """
        [[part]]
        name = "shaft"
        [[part.segment]]
        name = "nose"
        outer_diameter = "178 mm"
        [[probe]]
        name = "NEW"
        part = "cover"
        r = "120 mm"
        z = "30 mm"
        """,
    )
    shaft = spec.part[0]
    assert (shaft.segment[0].outer_diameter, shaft.segment[0].inner_diameter) == (0.178, 0.06)
    assert len(shaft.segment) == 7
    assert spec.probe[-1].name == "NEW"
    assert len(spec.probe) == 7


def test_entries_are_removed_by_name(tmp_path):
    spec = derived(tmp_path, '[[probe]]\nname = "SP04"\nremove = true')
    assert [probe.name for probe in spec.probe] == ["SP01", "SP02", "SP03", "SP05", "COOLANT_OUT"]


def test_none_leaves_a_key_out(tmp_path):
    assert derived(tmp_path, '[channel]\nports = "none"').channel.ports is None


def test_a_base_of_a_base_and_a_file_beside(tmp_path):
    (tmp_path / "middle.toml").write_text(BASE + '[channel]\nwidth = "10 mm"')
    (tmp_path / "top.toml").write_text('base = "middle.toml"\n[channel]\ndepth = "12 mm"')
    channel = load_machine(tmp_path / "top.toml").channel
    assert (channel.width, channel.depth, channel.pitch) == (0.010, 0.012, 0.024)
    assert [layer.source for layer in read_layers(tmp_path / "top.toml")] == [
        "wu_tan_2016.toml",
        "middle.toml",
        "top.toml",
    ]


def test_a_changed_value_does_not_keep_the_mark_of_the_old_one(tmp_path):
    unmarked = derived(tmp_path, '[channel]\ndepth = "19 mm"').channel
    assert [unmarked.mark_of(key) for key in ("depth", "width")] == ["U", "A"]
    marked = derived(
        tmp_path, '[coolant]\nmarks = "C"\nflow = "30 L/min"\ninlet_temperature = "15 degC"'
    ).coolant
    assert [marked.mark_of(key) for key in ("flow", "inlet_temperature", "film_model")] == ["C", "P", "A"]


def test_a_value_with_a_prior_is_replaced_as_one():
    base = {"coefficient": {"value": "10 W/m**2/K", "sigma_rel": 0.3}}
    assert merge(base, {"coefficient": "20 W/m**2/K"}) == {"coefficient": "20 W/m**2/K"}
    bounds = {"coefficient": {"low": "1 W/m**2/K", "high": "2 W/m**2/K"}}
    assert merge(base, bounds) == bounds


def test_lists_of_values_and_empty_lists_replace():
    assert merge({"speed": [1, 2, 3]}, {"speed": [4]}) == {"speed": [4]}
    assert merge({"probe": [{"name": "a"}]}, {"probe": []}) == {"probe": []}


def test_merging_leaves_both_sides_as_they_were():
    base, change = (
        {"a": {"b": 1}, "l": [{"name": "x", "v": 1}]},
        {"a": {"b": 2}, "l": [{"name": "x", "v": 2}]},
    )
    merge(base, change)
    assert base == {"a": {"b": 1}, "l": [{"name": "x", "v": 1}]}
    assert change == {"a": {"b": 2}, "l": [{"name": "x", "v": 2}]}


def test_none_is_taken_out_at_every_depth():
    assert without_none({"a": "none", "b": [{"c": "none", "d": 1}]}) == {"b": [{"d": 1}]}


# ---------------------------------------------------------------- overrides

STANDARD = [
    ("operation.speed=2500rpm", lambda spec: spec.operation.speed, 261.7993877991),
    ("operation.thrust=500 N", lambda spec: spec.operation.thrust, 500.0),
    ("operation.ambient_temperature=25degC", lambda spec: spec.operation.ambient_temperature, 298.15),
    ("coolant.inlet_temperature=31 degC", lambda spec: spec.coolant.inlet_temperature, 304.15),
    ("coolant.flow=12L/min", lambda spec: spec.coolant.flow, 2.0e-4),
    ("channel.depth=7mm", lambda spec: spec.channel.depth, 0.007),
    ("channel.width=6mm", lambda spec: spec.channel.width, 0.006),
    ("channel.pitch=28mm", lambda spec: spec.channel.pitch, 0.028),
    ("channel.turns=1.5", lambda spec: spec.channel.turns, 1.5),
    ("channel.starts=1", lambda spec: spec.channel.starts, 1),
    ("channel.hand=right", lambda spec: spec.channel.hand, "right"),
    ("heat.model=skf", lambda spec: spec.heat.model, "skf"),
    ("heat.model=table", lambda spec: spec.heat.model, "table"),
    ("mesh.preset=fine", lambda spec: spec.mesh.preset, "fine"),
]


@pytest.mark.parametrize("machine", WITH_GEOMETRY)
@pytest.mark.parametrize(("override", "value_of", "expected"), STANDARD, ids=[case[0] for case in STANDARD])
def test_the_standard_paths_can_be_set_in_every_machine(machine, override, value_of, expected):
    if override.startswith(("channel.", "coolant.")) and load_machine(machine).channel is None:
        with pytest.raises(SpecError) as caught:
            load_machine(machine, [override])
        assert f"this machine has no [{override.partition('.')[0]}]" in str(caught.value)
        return
    if override == "heat.model=table" and load_machine(machine).heat.table is None:
        with pytest.raises(SpecError, match=r"heat\.table: is missing"):
            load_machine(machine, [override])
        return
    value = value_of(load_machine(machine, [override]))
    assert value == (pytest.approx(expected, rel=1e-12) if isinstance(expected, float) else expected)


DEEP = [
    ("part.shaft.segment.nose.outer_diameter=178mm", lambda s: s.part[0].segment[0].outer_diameter, 0.178),
    ("part.shaft.segment[1].outer_diameter=178mm", lambda s: s.part[0].segment[0].outer_diameter, 0.178),
    ("part[1].segment.nose.outer_diameter=178mm", lambda s: s.part[0].segment[0].outer_diameter, 0.178),
    ("bearing_set.front.preload=900 N", lambda s: s.bearing_set[0].preload, 900.0),
    ("bearing_set.front.bearing.F1.takes_thrust=towards_rear", lambda s: s.bearings[0][1].takes_thrust, "towards_rear"),
    ("bearing_types.71928_CD.ball_count=29", lambda s: s.bearing_types["71928_CD"].ball_count, 29),
    ("materials.cast_iron.thermal_conductivity=48 W/m/K", lambda s: s.materials["cast_iron"].thermal_conductivity, 48.0),
    ("film.outside.coefficient=20 W/m²/°C", lambda s: s.film[0].coefficient, Uncertain(20.0, 0.3)),
    ("film.outside.coefficient.sigma_rel=0.5", lambda s: s.film[0].coefficient, Uncertain(10.0, 0.5)),
    ('film.outside.coefficient={value = "5 W/m**2/K", sigma_rel = 0.1}', lambda s: s.film[0].coefficient, Uncertain(5.0, 0.1)),
    ("surface.shaft.gap.where[1].z=[\"157 mm\", \"400 mm\"]", lambda s: s.surface[3].where[0].z, (0.157, 0.4)),
    ("heat.table.heat.F1[7]=160 W", lambda s: s.heat.table.heat["F1"][6], 160.0),
    ("heat.table.thrust_coefficient.R1=0.2", lambda s: s.heat.table.thrust_coefficient["R1"], 0.2),
    ("mesh.size.housing=8mm", lambda s: s.mesh.size["housing"], 0.008),
    ("channel.ports=none", lambda s: s.channel.ports, None),
    ("channel.ports.diameter=8 mm", lambda s: s.channel.ports.diameter, 0.008),
    ("probe.SP04=none", lambda s: len(s.probe), 5),
    ("coolant.pumping_heat=true", lambda s: s.coolant.pumping_heat, True),
    ("title=2016", lambda s: s.title, "2016"),
    ('title="a = b"', lambda s: s.title, "a = b"),
]  # fmt: skip


@pytest.mark.parametrize(("override", "value_of", "expected"), DEEP, ids=[case[0] for case in DEEP])
def test_any_value_can_be_set_by_its_path(override, value_of, expected):
    assert value_of(load_machine("wu_tan_2016", [override])) == expected


def test_a_table_that_was_left_out_can_be_given_by_its_only_needed_key():
    spec = load_machine("recorded_spindle", ["channel.ports.diameter=8mm"])
    assert spec.channel.ports.diameter == 0.008


def test_later_overrides_win_and_the_value_is_marked_as_the_users():
    spec = load_machine("wu_tan_2016", ["channel.depth=12mm", "channel.depth=19mm"])
    assert spec.channel.depth == 0.019
    assert spec.channel.mark_of("depth") == "U"
    assert spec.channel.mark_of("width") == "A"


REFUSED = {
    "channel.dept=19mm": ("--set channel.dept", 'no key "dept" in channel', 'Did you mean "depth"'),
    "chanel.depth=19mm": ("--set chanel.depth", 'no key "chanel" in the definition', 'Did you mean "channel"'),
    "film.outsid.coefficient=2 W/m**2/K": ('no "outsid" in film', 'Did you mean "outside"'),
    "surface.shaft.gab.part=housing": ("in surface", "shaft.gap"),
    "part.shaft.segment.noze.z=none": ('no "noze" in part.shaft.segment', 'Did you mean "nose"'),
    "part.shaft.segment[9].z=none": ("part.shaft.segment has 7 entries", "[1] to [7]"),
    "part.shaft.segment[0].z=none": ("part.shaft.segment", "nose"),
    "materials.iron.density=7 kg/m**3": ('no "iron" in materials', 'Did you mean "cast_iron"'),
    "channel.depth.inner=3mm": ("channel.depth is one value", "no inner"),
    "gap.labyrinth.factor.sigma_rel=0.2": ("gap.labyrinth.factor is not given", "sigma_rel = ...}"),
    "channel.depth": ("not of the form path=value", "channel.depth=19mm"),
    "=3": ("not of the form path=value",),
    "channel.depth=19": ("--set channel.depth: ", 'bare number 19', '"19 mm"'),
    "channel.depth=19degC": ("--set channel.depth: ", "19degC", "units of m"),
    "channel.depth=": ("--set channel.depth: ", "cannot be read"),
    "channel.starts=2.0": ("--set channel.starts: ", "2.0", "a whole number from 1 to 4"),
    "channel.hand=rihgt": ("--set channel.hand: ", '"rihgt"', 'Did you mean "right"'),
    "channel.width=22mm": ("--set channel.width: ", "22 mm", "at most 21 mm"),
    "operation.speed=3000": ("--set operation.speed: ", "bare number 3000", "3000 rpm"),
    "operation=none": ("operation", "is missing"),
    "heat.table.heat.F1[7]=-5 W": ("--set heat.table.heat.F1[7]: ", "-5 W", "at least 0 W"),
    "mesh.preset={size = 3}": ("--set mesh.preset: ", "is not allowed", "coarse, normal, fine"),
}  # fmt: skip


@pytest.mark.parametrize("override", REFUSED)
def test_an_override_that_leads_nowhere_or_gives_no_value_is_refused(override):
    with pytest.raises(SpecError) as caught:
        load_machine("wu_tan_2016", [override])
    assert caught.value.exit_status == 2
    assert all(part in str(caught.value) for part in REFUSED[override]), str(caught.value)
    assert isinstance(caught.value, FaultsError)
    assert len(caught.value.faults) == 1


def test_faults_of_overrides_and_of_the_file_come_together(tmp_path):
    path = tmp_path / "machine.toml"
    path.write_text(BASE + "[coolant]\nflow = 20")
    with pytest.raises(FaultsError) as caught:
        load_machine(path, ["channel.dept=19mm", "channel.hand=up"])
    text = str(caught.value)
    assert "--set channel.dept: there is no key" in text
    assert '--set channel.hand: "up" is not allowed' in text
    assert "machine.toml: coolant.flow: bare number 20" in text
    assert len(caught.value.faults) == 3


def test_overriding_leaves_the_definition_as_it_was():
    content = {"channel": {"depth": "10 mm", "marks": "A"}}
    changed = apply_overrides(content, ["channel.depth=19mm"])
    assert content == {"channel": {"depth": "10 mm", "marks": "A"}}
    assert changed == {"channel": {"depth": "19mm", "marks": {"default": "A", "depth": "U"}}}


# ---------------------------------------------------------------- examination


def test_sound_tables_survive_an_examination_for_further_checks(tmp_path):
    path = tmp_path / "machine.toml"
    path.write_text(BASE + '[[film]]\nname = "outside"\ncoefficient = 10\n[coolant]\nflow = "3 kg"')
    result = examine_machine(path)
    assert [fault.where.partition(": ")[2] for fault in result.faults] == [
        "coolant.flow",
        "film.outside.coefficient",
    ]
    assert result.unsound == {"coolant", "film"}
    assert [part.name for part in result.spec.part] == [
        part.name for part in load_machine("wu_tan_2016").part
    ]
    assert [film.name for film in result.spec.film] == ["flange_back", "nose_end", "drive_end"]
    assert result.spec.coolant is None
    assert result.spec.channel is not None


def test_a_machine_built_in_python_can_be_checked_too():
    spec = load_machine("wu_tan_2016")
    assert find_faults(spec) == []
    broken = spec.model_copy(update={"film": spec.film[1:]})
    assert [fault.where for fault in find_faults(broken)] == [
        "surface.cover.outside",
        "surface.housing.outside",
    ]
