"""A machine in a page: joints, air and gaps by named rules, what the file gives, ten mistakes at once."""

from __future__ import annotations

import tomllib
from types import SimpleNamespace

import pytest

from spindle_fem.commands.checked_machine import load_buildable
from spindle_fem.commands.machine_commands import check_machine
from spindle_fem.definition.load import examine, find_machine, load_machine, read_definition, write_machine
from spindle_fem.errors import FaultsError
from spindle_fem.machine.geometry.assembly import build_assembly
from spindle_fem.machine.geometry.joint_groups import group_of_contacts
from spindle_fem.operation.driven_flow import channel_warnings
from spindle_fem.operation.operating_limits import lost_to_air, speeds_beyond_catalogues
from spindle_fem.physics.surroundings.rotating_surfaces import rotating_film
from spindle_fem.report import run_report
from spindle_fem.studies.heat_study import RPM, usual_speeds
from spindle_fem.studies.sweep.prepared_study import prepare_study
from spindle_fem.units import Uncertain
from spindle_fem.validity import CHANGES_RESULT, CodedWarning, by_consequence
from tests.support import page_machine

PAGE = find_machine("motor_spindle")


@pytest.fixture(scope="module")
def page():
    return read_definition(PAGE)


def test_the_page_is_short_and_everything_assumed_is_listed() -> None:
    assert len(PAGE.read_text(encoding="utf-8").splitlines()) <= 70
    content = check_machine(PAGE)
    assumed = {row["name"] for row in content["assumed"]}
    assert assumed >= {"bearing_types.7014_C", "grease", "joint.workshop_inner_seats", "gap.workshop_gap_1"}
    assert {row["detail"].partition(":")[0] for row in content["contacts"]} == {
        name.removeprefix("joint.") for name in assumed if name.startswith("joint.")
    }


def test_a_completed_machine_written_out_stays_as_it_is(page) -> None:
    spec = examine(page).spec
    again = examine(tomllib.loads(write_machine(spec)))
    assert (again.spec, again.assumed) == (spec, ())


def test_outer_faces_lose_heat_and_inner_ones_do_not(page) -> None:
    spec = examine(page).spec
    films = {name for film in spec.film for name in film.surface}
    assert {name.split("_")[1].split(".")[0] for name in films} == {"shaft", "housing", "F1", "R2"}
    area = {}
    for edge in build_assembly(spec).edges:
        area[edge.name] = area.get(edge.name, 0.0) + edge.area
    assert area["workshop_housing_cylinder"] == pytest.approx(
        3.14159 * (0.28 * 0.02 + 0.23 * 0.326), rel=1e-4
    )
    assert area["workshop_gap_1.turning"] == pytest.approx(3.14159 * 0.098 * 0.15, rel=1e-4)


def test_turning_films_are_known_at_the_highest_speeds_of_machines_that_ship() -> None:
    for name in ("motor_spindle", "grinding_spindle", "externally_driven"):
        spec = load_machine(name)
        turning = [film for film in spec.film if film.kind == "rotating"]
        assert len(turning) > 2
        for film in turning:
            found = rotating_film(film.correlation, spec.highest_speed, film.diameter, minimum=film.minimum)
            assert found.in_range, (name, film.name)


def test_values_that_the_rules_add_are_set_and_the_others_follow_the_geometry() -> None:
    longer = ["joint.workshop_inner_seats.conductance=5000 W/m**2/K",
              "joint.workshop_inner_seats.conductance.sigma_rel=0.1",
              "film.workshop_shaft_cylinder.minimum=12 W/m**2/K",
              "part.shaft.segment.nose.outer_diameter=86 mm"]  # fmt: skip
    usual, spec = load_machine(PAGE), load_machine(PAGE, longer)
    before, after = (
        next(group for group in item.joint if group.name == "workshop_inner_seats") for item in (usual, spec)
    )
    assert after.conductance == Uncertain(5000.0, pytest.approx(0.1))
    assert after.marks == {"default": "A", "conductance": "U"}
    assert after.contacts == before.contacts
    film = next(film for film in spec.film if film.name == "workshop_shaft_cylinder")
    assert (film.minimum, film.diameter) == (12.0, 0.086)
    assert after != before


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("joint.workshop_iner_seats.conductance=1 W/m**2/K", 'Did you mean "workshop_inner_seats"'),
        ("joint.workshop_inner_seats.conductanc=1 W/m**2/K", 'Did you mean "conductance"'),
        ("joint.workshop_inner_seats=none", 'is given by surroundings = "workshop"'),
        ("film.workshop_shaft_cylinder.minimum=none", "Set another value"),
    ],
)
def test_what_cannot_be_set_of_the_rules_is_refused(override, words) -> None:
    with pytest.raises(FaultsError, match=words):
        load_machine(PAGE, [override])


def test_a_study_varies_what_the_rules_add(tmp_path) -> None:
    study = tmp_path / "seats.toml"
    study.write_text(
        'schema = "spindle-fem/study/1"\nname = "Seats"\n[study]\noutputs = ["temperature.max_degC"]\n'
        '[[parameter]]\npath = "joint.workshop_inner_seats.conductance"\n'
        'values = ["5000 W/m**2/K", "20000 W/m**2/K"]\n'
    )
    tasks = prepare_study(PAGE, study).tasks
    groups = [next(g for g in task.spec.joint if g.name == "workshop_inner_seats") for task in tasks]
    assert [group.conductance.value for group in groups][:2] == [5000.0, 20000.0]


def test_what_the_file_gives_is_kept(page) -> None:
    own = {
        "joint": [
            {"name": "rotor_seat", "conductance": "5000 W/m**2/K", "contacts": ["rotor|shaft"]},
            {"name": "workshop_clamped_faces", "conductance": "3000 W/m**2/K"},
        ],
        "surface": [
            {"name": "mount", "part": "housing", "where": [{"facing": "rear", "z": "60 mm"}]},
        ],
        "film": [{"kind": "constant", "surface": ["mount"], "coefficient": "200 W/m**2/K"}],
    }
    result = examine({**page, **own})
    assert not result.faults
    groups = group_of_contacts(result.spec, build_assembly(result.spec).joint_names)
    assert groups["rotor|shaft"].name == "rotor_seat"
    assert groups["inner_spacer|shaft"].name == "workshop_turning_seats"
    faces = groups["F1.inner_ring|shaft:face"]
    assert (faces.name, faces.conductance.value) == ("workshop_clamped_faces", 3000.0)


MISTAKES = {
    "a bearing that there is none of": ('"7014 C"', '"7014 Q"'),
    "a material that there is none of": ('"case_hardening_steel"', '"case_hardened_steel"'),
    "no unit": ('speed = "9000 rpm"', "speed = 9000"),
    "a unit of something else": ('preload = "200 N"', 'preload = "200 mm"'),
    "a key that there is none of": ('thrust = "300 N"', 'thrust = "300 N", radial = "10 N"'),
    "a coolant that there is none of": ('"ethylene_glycol_30"', '"ethylene_glycol_35"'),
    "a source in no part": ('part = "rotor", heat', 'part = "motor", heat'),
    "a probe outside its part": ('z = "50 mm", r = "57 mm"', 'z = "50 mm", r = "157 mm"'),
    "a channel without land": ('width = "12 mm"', 'width = "19 mm"'),
    "a heat model that there is none of": ('"palmgren"', '"palmgreen"'),
}


def _faults(tmp_path, mistakes):
    text = PAGE.read_text(encoding="utf-8")
    for old, new in mistakes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    file = tmp_path / "draft.toml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(FaultsError) as refused:
        load_buildable(file, ())
    return refused.value.faults


def test_ten_mistakes_are_ten_faults_at_once(tmp_path) -> None:
    faults = _faults(tmp_path, MISTAKES.values())
    assert len(faults) == len(MISTAKES), "\n".join(map(str, faults))


def test_a_machine_that_loses_no_heat_to_air_is_warned_of() -> None:
    codes = [
        item["code"] for item in check_machine(PAGE, overrides=["remaining_surfaces=adiabatic"])["warnings"]
    ]
    assert "no_heat_to_air" not in codes
    removed = ["surface.housing.outside=none", "surface.cover.outside=none", "surface.housing.mount=none"]
    removed += ["film.outside=none", "film.mount=none"]
    codes = [item["code"] for item in check_machine("small_two_start", overrides=removed)["warnings"]]
    assert "no_heat_to_air" in codes
    # A run says so as well, above what its checks say.
    spec = load_machine("small_two_start", removed)
    assert [item.code for item in lost_to_air(spec)] == ["no_heat_to_air"]
    assert "no_heat_to_air" in CHANGES_RESULT
    mounted = load_machine("small_two_start", [*removed[:2], "film.outside=none"])
    assert not lost_to_air(mounted)
    still = [
        film.model_copy(update={"coefficient": Uncertain(0.0)}) if film.name == "mount" else film
        for film in mounted.film
    ]
    assert lost_to_air(mounted.model_copy(update={"film": tuple(still)}))


def test_air_that_no_heat_crosses_is_warned_of_where_a_source_stands_beside_it(tmp_path) -> None:
    text = PAGE.read_text(encoding="utf-8").replace('z = "225 mm", r = "60 mm"', 'z = "225 mm", r = "80 mm"')
    file = tmp_path / "wide.toml"

    def warned(old: str, new: str) -> list[str]:
        assert text.count(old) == 1
        file.write_text(text.replace(old, new), encoding="utf-8")
        return [w["text"] for w in check_machine(file)["warnings"] if w["code"] == "gap_without_exchange"]

    # The rule's own gap, a wider one, and one so wide that it is a cavity.
    bore = 'inner_diameter = "99 mm"'
    assert warned(bore, bore) == []
    (said,) = warned(bore, 'inner_diameter = "112 mm"')
    assert "the 7 mm of air between rotor (diameter 98 mm) and stator (112 mm), z 150 to 300 mm" in said
    assert "ends at 5 mm" in said
    assert "[[gap]]" in said
    assert warned(bore, 'inner_diameter = "150 mm"') == []
    assert "gap_without_exchange" in CHANGES_RESULT


def test_ends_of_a_part_are_surfaces_of_their_own(page) -> None:
    spec = examine(page).spec
    ends = {edge.name: edge.z for edge in build_assembly(spec).edges if "shaft_plane" in edge.name}
    assert ends["workshop_shaft_plane_front"] == (0.0, 0.0)
    assert ends["workshop_shaft_plane_rear"][0] > 0.3
    assert len(ends) == 2


def test_what_there_is_of_channel_streams_and_bare_faces_is_listed() -> None:
    content = check_machine(PAGE)
    channel = {row["name"]: row["detail"] for row in content["channel"]}
    assert channel["kind"] == "helical in housing, 7 turns of 20 mm, right hand"
    assert channel["section"] == "12 mm wide, 8 mm deep, from r 92 mm"
    assert float(channel["length"].removesuffix(" m")) == pytest.approx(7 * 2 * 3.1416 * 0.096, rel=2e-3)
    bare = {row["name"]: row for row in content["adiabatic"]}
    assert bare["F2.inner_ring"]["faces"] == ["rear z 120 mm, r 35 to 41.19 mm"]
    assert bare["F2.inner_ring"]["area_m2"] == pytest.approx(3.14159 * (0.04119**2 - 0.035**2), rel=1e-3)
    assert "6 faces, the largest inward r 15 mm" in bare["shaft"]["detail"]
    sources = {row["name"]: row["detail"] for row in content["sources"]}
    assert all("W into" in detail for detail in sources.values())
    assert check_machine("uncooled")["channel"] == []


def test_speeds_above_those_of_catalogues_are_warned_of() -> None:
    # 7014 C: 1.17e6 rpm mm over 90 mm are 13 000 rpm in grease, 20 800 rpm in oil
    spec = load_machine(PAGE)
    assert not speeds_beyond_catalogues(spec, 12_900 * RPM)
    (said,) = speeds_beyond_catalogues(spec, 13_100 * RPM)
    assert said.code == "speed_above_catalogue"
    assert said.text.startswith("F1: speed times pitch diameter is 1.18e6 rpm mm")
    assert said.text.endswith("Likewise F2.")
    hybrid = load_machine(PAGE, ["bearing_set.front.bearing_type=7014 C HC"])
    assert not speeds_beyond_catalogues(hybrid, 13_100 * RPM)
    codes = [item["code"] for item in check_machine(PAGE, overrides=["operation.speed=13100rpm"])["warnings"]]
    assert "speed_above_catalogue" in codes


def test_rollers_and_oil_have_speeds_of_their_own() -> None:
    lathe, grinder = load_machine("belt_lathe"), load_machine("grinding_spindle")
    # NN3018: 0.97e6 rpm mm over 115 mm; 7018 AC: 1.015e6 in grease
    told = speeds_beyond_catalogues(lathe, 8_600 * RPM)
    assert {item.text[:2] for item in told} == {"F1"}
    assert not speeds_beyond_catalogues(grinder, 18_000 * RPM)
    assert speeds_beyond_catalogues(grinder, 18_500 * RPM)


def test_speeds_follow_the_machine() -> None:
    rpm = [speed / RPM for speed in usual_speeds(load_machine("wu_tan_2016"))]
    assert rpm == pytest.approx(range(500, 4501, 500))
    assert max(usual_speeds(load_machine(PAGE))) / RPM == pytest.approx(13500.0)


def test_a_load_that_was_left_out_stands_above_the_checks() -> None:
    warning = {"code": "thermal_preload_omitted", "text": "3727 N instead of 733 N."}
    assert "733 N" in _first_notice([warning])
    assert "checks" in _first_notice([])


def test_a_flow_that_no_pump_drives_is_warned_of() -> None:
    spec = SimpleNamespace(has_pump_limit=False)
    assert not channel_warnings(spec, 1e-3, 4e5)
    (warning,) = channel_warnings(spec, 1e-3, 23e5)
    assert "23 bar at 60 L/min" in warning.text
    assert by_consequence([CodedWarning("race_control_doubtful", ""), warning])[0] is warning


def test_check_says_what_no_pump_drives_before_anything_is_solved(tmp_path) -> None:
    def told(machine, *overrides) -> list[str]:
        return [item["text"] for item in check_machine(machine, overrides=overrides)["warnings"]]

    assert told("router_spindle") == []
    (text,) = told("router_spindle", "coolant.flow=60L/min")
    assert text.startswith("The channel takes 28 bar at 60 L/min")
    (text,) = told("router_spindle", "coolant.flow=60L/min", "coolant.pressure_limit=5bar")
    assert text.startswith("The pump drives 2")
    # A jacket of half a millimetre.
    narrow = tmp_path / "narrow.toml"
    text = page_machine.PAGE.replace('"182 mm"', '"177 mm"').replace("12 L/min", "300 L/min")
    narrow.write_text(text, encoding="utf-8")
    (text,) = told(narrow)
    assert text.startswith("Circuit jacket takes")


def _first_notice(warnings) -> str:
    values = {"checks": [{"name": "a", "passed": True}], "energy": {"imbalance_relative": 0.0}}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(run_report.tables, "headline", lambda summary: [])
        return run_report._headline({**values, "warnings": warnings})[0].text


@pytest.mark.slow
def test_the_page_solves_and_its_heat_balances() -> None:
    import spindle_fem

    result = spindle_fem.solve(spindle_fem.load_machine(str(PAGE), ["mesh.preset=coarse"]))
    celsius = {name: value - 273.15 for name, value in result.probes.items()}
    assert all(check.passed for check in result.checks)
    assert 21.0 < celsius["COOLANT_OUT"] < celsius["STATOR"] < celsius["FRONT_SEAT"] < 60.0
