"""Oil lubrication: balances by hand, factors of friction, what a definition may say."""

import math
from dataclasses import replace

import numpy as np
import pytest

from spindle_fem.definition.load import load_machine
from spindle_fem.definition.lubrication_tables import Lubrication
from spindle_fem.errors import FaultsError
from spindle_fem.operation.bearing_heat import BearingMechanics, BearingTemperatures
from spindle_fem.operation.bearing_lubricants import SetLubricant, bearing_stream
from spindle_fem.operation.circuits import (
    capacity_rate,
    coolant_temperatures,
    stream_answer,
    stream_warnings,
    wall_coefficients,
)
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.physics.bearings.bearing_set import solve_bearing
from spindle_fem.physics.bearings.heat_model import HeatOptions
from spindle_fem.physics.bearings.heat_models.palmgren import palmgren_moment
from spindle_fem.physics.coolant.lubrication_kind import film_harris, flooded_fill, path_fill_parker
from spindle_fem.results.thermal_result import BearingResult
from tests.support.oiled_machine import oiled

RPM = math.pi / 30.0


@pytest.fixture(scope="module")
def spec(tmp_path_factory):
    return load_machine(str(oiled(tmp_path_factory.mktemp("oiled"))))


def film(spec, bearing):
    return next(film for film in spec.circuits if film.name == f"{bearing}.lubrication")


def test_air_through_a_bearing_by_hand(spec):
    # 7006 C: 55 and 30 mm, 7.1 mm balls; 30 L/min of air of 1.204 kg/m3 and 1006 J/(kg K).
    answer = stream_answer(film(spec, "F1"), 12_000 * RPM)
    assert answer.capacity_rate == pytest.approx(1.204 * 1006.0 * 0.5e-3, rel=1e-3)
    stream = bearing_stream(film(spec, "F1"), 12_000 * RPM)
    cage = 0.5 * 12_000 * RPM * (1.0 - stream.relative_size) * 0.5 * stream.pitch_diameter
    through = 0.5e-3 / (0.25 * math.pi * (stream.outer_diameter**2 - stream.inner_diameter**2))
    assert answer.velocity == pytest.approx(math.hypot(cage, through), rel=1e-12)
    assert answer.coefficient == pytest.approx(9.7 + 5.33 * answer.velocity**0.8, rel=1e-12)
    assert 40.0 < answer.coefficient < 60.0


def test_oil_through_a_bearing_by_hand(spec):
    # 0.5 L/min of VG 10: 0.843 kg/L and some 1.92 kJ/(kg K) at 25 degC.
    answer = stream_answer(film(spec, "R1"), 12_000 * RPM)
    assert answer.capacity_rate == pytest.approx(843.0 * 1920.0 * 0.5e-3 / 60.0, rel=0.02)
    assert 1_000.0 < answer.coefficient < 3_000.0
    twice = stream_answer(film(spec, "R1"), 48_000 * RPM)
    assert twice.coefficient == pytest.approx(2.0 * answer.coefficient, rel=1e-12)


def test_at_rest_oil_still_conducts_through_its_slit(spec):
    own = film(spec, "R1")
    answer = stream_answer(own, 0.0)
    width = own.outer_diameter - own.inner_diameter
    assert answer.coefficient == pytest.approx(7.541 * 0.136 / width, rel=0.03)


def test_air_around_balls_by_hand(spec):
    # 7.1 mm balls that turn about their own axes in air which goes around with the cage (Whitaker 1972).
    own = film(spec, "F1")
    answer, stream = stream_answer(own, 12_000 * RPM), bearing_stream(own, 12_000 * RPM)
    pitch, ball = stream.pitch_diameter, stream.element_diameter
    turning = 12_000 * RPM * pitch / (2.0 * ball) * (1.0 - stream.relative_size**2)
    through = 0.5e-3 / (0.25 * math.pi * (stream.outer_diameter**2 - stream.inner_diameter**2))
    reynolds = math.hypot(0.5 * turning * ball, through) * ball / 1.506e-5
    prandtl = 1.204 * 1006.0 * 1.506e-5 / 0.0259
    nusselt = 2.0 + (0.4 * reynolds**0.5 + 0.06 * reynolds ** (2.0 / 3.0)) * prandtl**0.4
    assert answer.element_coefficient == pytest.approx(nusselt * 0.0259 / ball, rel=1e-12)
    kind = next(spec.bearing_types[g.type_name(b)] for g, b in spec.bearings if b.name == "F1")
    assert own.element_surface == pytest.approx(kind.ball_count * math.pi * ball**2, rel=1e-12)
    assert wall_coefficients(own, answer) == pytest.approx(
        own.factor.value * np.array([answer.coefficient, answer.coefficient, answer.element_coefficient])
    )


def test_what_its_walls_give_the_stream_carries_away(spec):
    own = film(spec, "R1")
    names, conductance = own.surface, dict(zip(own.surface, (3.0, 5.0, 2.0), strict=True))
    wall = dict(zip(names, (330.0, 310.0, 345.0), strict=True))
    bulk, outlet = coolant_temperatures(own, conductance, wall, own.inlet_temperature)
    given = sum(conductance[name] * (wall[name] - bulk[name]) for name in names)
    assert given == pytest.approx(capacity_rate(own) * (outlet - own.inlet_temperature), rel=1e-12)
    # One mixed stream past walls of their common mean: 1 - exp(-N) of the rise.
    mean = (3.0 * 330.0 + 5.0 * 310.0 + 2.0 * 345.0) / 10.0
    units = 10.0 / capacity_rate(own)
    expected = own.inlet_temperature - (mean - own.inlet_temperature) * math.expm1(-units)
    assert outlet == pytest.approx(expected, rel=1e-12)


def test_friction_follows_the_oil_of_each_set(spec):
    mechanics, point = BearingMechanics(spec), OperatingPoint.of(spec)
    warm = {bearing.name: BearingTemperatures(*(313.15,) * 5) for _, bearing in spec.bearings}
    states = mechanics.states(point, warm, expand=False)
    for name, factor, viscosity in (("F1", 1.7, 22.0e-6), ("R1", 6.6, 10.0e-6)):
        state = states[name]
        moment = palmgren_moment(
            state.geometry, point.speed, viscosity, state.axial_force, state.radial_force,
            lubrication_factor=factor,
        )  # fmt: skip
        assert state.heat.total == pytest.approx(moment.total * point.speed, rel=1e-3)
        assert state.heat.terms["viscous"] > state.heat.terms["load"]


def test_the_path_that_oil_fills_follows_flow_and_speed(spec):
    # NASA TP 2275: 2 gal/min through 120 mm bore at 20 000 rpm fill some 2 to 3 %.
    assert 0.02 < float(path_fill_parker(7571.0, 20.0e3, 155.0)) < 0.03
    rear = next(group for group in spec.bearing_set if group.name == "rear")
    lubricant = SetLubricant(spec, rear)
    stream = bearing_stream(film(spec, "R1"), 24_000 * RPM)
    assert lubricant.at(24_000 * RPM).path_fill == flooded_fill(stream)
    assert lubricant.at(24_000 * RPM).path_fill < lubricant.at(20_000 * RPM).path_fill
    assert lubricant.at(0.0).path_fill == 0.0


def test_inlets_are_flooded_where_oil_stands(spec):
    mechanics, point = BearingMechanics(spec), OperatingPoint.of(spec)
    lubricants = {group.name: SetLubricant(spec, group) for group in spec.bearing_set}
    full = HeatOptions("full")
    assert lubricants["rear"].options(full).flooded
    assert not lubricants["front"].options(full).flooded
    warm = {bearing.name: BearingTemperatures(*(313.15,) * 5) for _, bearing in spec.bearings}
    state = mechanics.states(point, warm, expand=False)["R1"]
    kept = replace(lubricants["rear"].options(full), flooded=False)
    case, oil = (state.geometry, point.speed, state.axial_force), lubricants["rear"].at(point.speed)
    rolling = [
        solve_bearing(*case, lubricant=oil, heat=heat).heat.terms["outer_rolling"]
        for heat in (kept, replace(kept, flooded=True))
    ]
    assert 1.3 < rolling[1] / rolling[0] < 2.5


def test_beyond_its_range_a_law_says_so(spec):
    own = film(spec, "R1")
    (warning,) = stream_warnings(own, stream_answer(own, 1_000 * RPM))
    assert warning.code == "circuit_film_extrapolated"
    assert "R1.lubrication" in warning.text
    assert "speed is 1000" in warning.text
    assert not stream_warnings(film(spec, "F1"), stream_answer(film(spec, "F1"), 1_000 * RPM))


def test_the_catalogue_formula_says_that_it_leaves_drag_out(spec, tmp_path):
    other = load_machine(str(oiled(tmp_path)), ["heat.model=skf"])
    mechanics = BearingMechanics(other)
    warm = {bearing.name: BearingTemperatures(*(313.15,) * 5) for _, bearing in other.bearings}
    said = {item.code: item.text for item in mechanics(OperatingPoint.of(other), warm)[1]}
    assert "rear" in said["oil_drag_omitted"]
    assert "front" not in said["oil_drag_omitted"]


def test_rollers_in_oil_have_the_factor_of_their_lubrication(tmp_path):
    oil = """
schema = "spindle-fem/machine/1"
base = "belt_lathe"
name = "oiled_lathe"
[[bearing_set]]
name = "{name}"
[bearing_set.lubrication]
kind = "circulating_oil"
oil = "iso_vg_22"
oil_flow = "1 L/min"
inlet_temperature = "25 degC"
"""
    plain = load_machine("belt_lathe")
    group = next(g for g in plain.bearing_set if g.bearing_type.startswith("NN3018"))
    path = tmp_path / "lathe.toml"
    path.write_text(oil.format(name=group.name), encoding="utf-8")
    name, heats = group.bearing[0].name, []
    for change in ((), (f"bearing_set.{group.name}.lubrication.palmgren_f0=4.4",)):
        own = load_machine(str(path), list(change))
        warm = {bearing.name: BearingTemperatures(*(313.15,) * 5) for _, bearing in own.bearings}
        heats.append(BearingMechanics(own)(OperatingPoint.of(own), warm)[0][name])
    # 2.2 of the kind against 4.4 of the definition, of the part that needs no load.
    assert heats[1].terms["viscous"] == pytest.approx(2.0 * heats[0].terms["viscous"], rel=1e-12)
    assert heats[1].terms["load"] == pytest.approx(heats[0].terms["load"], rel=1e-12)


def test_a_fill_that_is_cut_off_is_told(spec):
    flooded = film(spec, "R1")
    more = flooded.model_copy(
        update={"lubrication": flooded.lubrication.model_copy(update={"oil_flow": 1.0e-4})}
    )
    texts = [item.text for item in stream_warnings(more, stream_answer(more, 12_000 * RPM))]
    assert any("0.15 is taken" in text for text in texts)


def test_streams_are_made_once(spec):
    again = type(spec).model_validate(spec.model_dump(mode="json", by_alias=True))
    assert [film.name for film in again.circuits] == [film.name for film in spec.circuits]
    assert len(again.film) == len(spec.film)


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        ("bearing_set.front.lubrication.oil=tar", "iso_vg_10"),
        ("bearing_set.front.lubrication.air_flow=-1 L/min", "air_flow"),
        ("bearing_set.rear.lubrication.air_flow=10 L/min", 'Only kind = "oil_air" takes it.'),
        ("bearing_set.rear.lubrication.kind=bath", "oil_jet"),
        ("bearing_set.rear.lubrication.kinematic_viscosity_100=20 mm**2/s", "thins"),
    ],
)
def test_faults_say_what_is_allowed(tmp_path, change, fault):
    with pytest.raises(FaultsError) as raised:
        load_machine(str(oiled(tmp_path)), [change])
    assert fault in str(raised.value)


def test_oil_is_as_warm_as_the_warmest_that_it_wets_and_grease_as_its_rings():
    nothing = {name: float("nan") for name in ("contact_angle_inner", "contact_angle_outer", "preload")}
    nothing |= dict.fromkeys(("film_thickness", "film_thickness_ratio"), float("nan"))
    state = BearingResult(
        heat=1.0, terms={}, heat_to={}, temperature_inner=350.0, temperature_outer=330.0,
        temperature_ball=360.0, **nothing,
    )  # fmt: skip
    assert (state.lubricant_temperature("grease"), state.lubricant_temperature("oil")) == (350.0, 360.0)


def test_own_oils_need_no_name():
    table = {
        "kind": "oil_jet",
        "kinematic_viscosity_40": "12 mm**2/s",
        "kinematic_viscosity_100": "3.1 mm**2/s",
        "oil_flow": "1 L/min",
        "inlet_temperature": "30 degC",
    }
    assert np.isclose(Lubrication.model_validate(table).oil_flow, 1.0e-3 / 60.0)


def test_film_of_oil_against_a_plate_at_the_speed_of_the_cage():
    """Harris' film is 8 % below the mean one of a laminar boundary layer along the pitch diameter."""
    rpm, viscosity, conductivity, prandtl, size, pitch = 10.0e3, 1.0e-5, 0.13, 150.0, 0.1, 0.09
    cage = 0.5 * rpm * RPM * (1.0 - size) * 0.5 * pitch
    plate = 0.664 * math.sqrt(cage * pitch / viscosity) * prandtl ** (1.0 / 3.0) * conductivity / pitch
    found = float(film_harris(rpm, viscosity, conductivity, prandtl, size))
    assert found == pytest.approx(plate / 1.09, rel=0.005)
