"""Displacement sensors: what they may look at, and what they read of a machine that is evenly warm."""

from __future__ import annotations

import numpy as np
import pytest

from spindle_fem.commands.machine_commands import check_machine
from spindle_fem.definition.load import load_machine
from spindle_fem.errors import BadInputError, FaultsError, SpecError
from spindle_fem.machine.geometry.assembly import build_assembly
from spindle_fem.machine.meshing.build_mesh import build_mesh
from spindle_fem.machine.view.part_roles import Layout
from spindle_fem.model.elastic.deformed_shape import deformed_shapes, raceway_motions
from spindle_fem.model.elastic.machine_growth import GrowthModel

MACHINE = """schema = "spindle-fem/machine/1"
base = "wu_tan_2016"
name = "sensors"
"""
AXIAL = {"name": "S1", "at": "shaft.nose_end", "direction": "axial"}
TOP = {"name": "S2", "at": {"z": "10 mm", "radius": "90 mm"}, "direction": "radial"}


def text(value) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f'{key} = "{item}"' for key, item in value.items()) + "}"
    return f'"{value}"'


def machine(tmp_path, *sensors: dict, more: str = "", overrides: tuple[str, ...] = ()):
    tables = [
        "\n[[displacement_sensor]]\n" + "\n".join(f"{key} = {text(value)}" for key, value in sensor.items())
        for sensor in sensors
    ]
    path = tmp_path / "sensors.toml"
    path.write_text(MACHINE + more + "\n".join(tables) + "\n")
    return load_machine(path, ["mesh.preset=coarse", *overrides])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"at": "shaft.nose_ent"}, 'S1.at: "shaft.nose_ent" is no surface of a turning part.*nose_end'),
        ({"at": "housing.outside"}, "no surface of a turning part"),
        ({"at": {"z": "10 mm", "radius": "91 mm"}}, "nothing that turns has a face at z 10 mm, radius 91 mm"),
        (
            {"at": {"z": "10 mm", "radius": "90 mm", "angel": "1 deg"}},
            'angel: unknown key. Did you mean "angle"',
        ),
        ({"direction": "sideways"}, "Allowed: axial, radial"),
        (
            {"mount": "flangge"},
            'mount: "flangge" is no segment or surface of a standing part. Did you mean "flange"',
        ),
        ({"mount": "shaft.nose_end"}, "no segment or surface of a standing part"),
        (
            {"mount": {"z": "30 mm", "radius": "149 mm"}},
            "mount: nothing that stands has a face at z 30 mm, radius 149 mm",
        ),
    ],
)
def test_a_sensor_on_nothing_is_refused(tmp_path, change: dict, message: str) -> None:
    with pytest.raises(BadInputError, match=message):
        machine(tmp_path, AXIAL | change)


def test_a_material_without_expansion_is_refused(tmp_path) -> None:
    with pytest.raises(BadInputError, match=r"materials.cast_iron.thermal_expansion: it is 0"):
        machine(tmp_path, AXIAL, overrides=("materials.cast_iron.thermal_expansion=0 1/K",))


@pytest.fixture(scope="module")
def grown(tmp_path_factory):
    """A machine with sensors, all of one material, on a coarse mesh."""
    bottom = TOP | {"name": "S3", "at": TOP["at"] | {"angle": "180 deg"}}
    tip = {"name": "S4", "at": {"z": "0 mm", "radius": "60 mm"}, "direction": "axial"}
    others = [
        tip | {"name": "S5", "mount": {"z": "40 mm", "radius": "170 mm"}},
        TOP | {"name": "S6", "mount": {"z": "50 mm", "radius": "190 mm"}},
        tip | {"name": "S7", "mount": "housing.flange_back"},
        tip | {"name": "S8", "mount": "frame"},
        bottom | {"name": "S9", "mount": {"z": "50 mm", "radius": "190 mm"}},
    ]
    spec = machine(tmp_path_factory.mktemp("sensors"), AXIAL, TOP, bottom, tip, *others)
    steel = {key: m.model_copy(update={"thermal_expansion": 12e-6}) for key, m in spec.materials.items()}
    spec = spec.model_copy(update={"materials": steel})
    mesh = build_mesh(build_assembly(spec), preset="coarse")
    return spec, mesh, GrowthModel(spec, mesh, 1)


def test_an_even_rise_moves_every_spot_by_its_distance(grown) -> None:
    """The flange's back is at z 65 mm; the channel's lands and every ring expand alike."""
    spec, mesh, model = grown
    flange = next(s for p in spec.part for s in p.segment if s.name == "flange")
    rise = np.full(mesh.n_corners, model.assembly_temperature + 10.0)
    read = model.displacements(rise, 0.0)
    assert read["S1"] == pytest.approx(12e-5 * flange.z[1], rel=1e-3)
    assert read["S4"] == pytest.approx(12e-5 * flange.z[1], rel=1e-3)
    assert read["S2"] == pytest.approx(12e-5 * 0.090, rel=1e-3)
    assert read["S3"] == pytest.approx(read["S2"], rel=1e-6)


def test_raceways_move_with_an_even_rise_and_turn_where_it_grows_along_the_axis(grown) -> None:
    """α ΔT z from the flange's back, no turn; with T growing along z raceways widen like cones."""
    spec, mesh, model = grown
    flange = next(s for p in spec.part for s in p.segment if s.name == "flange")
    even = np.full(mesh.n_corners, model.assembly_temperature + 10.0)
    shapes = deformed_shapes(model, even, 0.0, model.assembly_forces)
    found = raceway_motions(model, shapes)
    for ring in model.rings:
        motion = found[ring.seat.bearing, "shaft" if ring.seat.is_inner else "housing"]
        middle = np.mean(ring.seat.raceway.z)
        assert motion.axial == pytest.approx(12e-5 * (middle - max(flange.z)), abs=2e-8)
        assert abs(motion.twist) < 1e-6
    slope = even + 200.0 * mesh.points[: mesh.n_corners, 2]
    shapes = deformed_shapes(model, slope, 0.0, model.assembly_forces)
    found = raceway_motions(model, shapes)
    for ring in model.rings:
        motion = found[ring.seat.bearing, "shaft" if ring.seat.is_inner else "housing"]
        if ring.seat.bearing == "F1":
            assert motion.twist == pytest.approx(12e-6 * 200.0 * ring.seat.raceway.r[0], rel=1e-3)


def test_a_bent_housing_lifts_one_side_and_lowers_the_other(grown) -> None:
    """T grows upwards: readings at top and bottom differ by twice the lift of the axis."""
    _, mesh, model = grown
    warm_above = model.assembly_temperature + 10.0 * mesh.points[: mesh.n_corners, 1]
    read = model.displacements(warm_above, 0.0)
    growth = model.at(warm_above, 0.0, model.assembly_forces)
    lift = growth.nose_radial[0] + 0.010 * growth.nose_tilt[0]
    assert read["S2"] - read["S3"] == pytest.approx(2.0 * lift, rel=1e-6)
    assert abs(lift) > 1e-9
    # the tip above the axis goes against the way that it tilts
    assert read["S4"] - read["S1"] == pytest.approx(0.060 * growth.nose_tilt[0], abs=2e-9)


def test_a_holder_on_the_housing_moves_with_it(grown) -> None:
    """Evenly warm, target and holder move apart by α ΔT times their distance along the sensor's direction."""
    _, mesh, model = grown
    rise = np.full(mesh.n_corners, model.assembly_temperature + 10.0)
    read = model.displacements(rise, 0.0)
    assert read["S5"] == pytest.approx(12e-5 * 0.040, rel=1e-3)
    assert read["S6"] == pytest.approx(12e-5 * (0.090 - 0.190), rel=1e-3)
    assert read["S7"] == pytest.approx(read["S4"], rel=1e-9)
    assert read["S8"] == read["S4"]


def test_a_holder_on_a_bent_housing_takes_its_own_shift_off(grown) -> None:
    """What sensors on the housing read less than those on the frame is the shift of the place itself.

    The field that the mesh has around the ports is 1 % off the even slope.
    """
    _, mesh, model = grown
    warm_above = model.assembly_temperature + 10.0 * mesh.points[: mesh.n_corners, 1]
    read = model.displacements(warm_above, 0.0)
    places = {"S5": (0.040, 0.170), "S6": (0.050, 0.190)}
    shifts = {name: _of_housing(model, *place) for name, place in places.items()}
    # S4 and S5 look backwards at the tip: away from the mount is forwards.
    assert read["S4"] - read["S5"] == pytest.approx(-shifts["S5"][0], rel=0.02)
    assert read["S2"] - read["S6"] == pytest.approx(shifts["S6"][1], rel=0.02)
    assert read["S3"] - read["S9"] == pytest.approx(-shifts["S6"][1], rel=0.02)
    assert min(abs(shifts["S5"][0]), abs(shifts["S6"][1])) > 1e-8


def _of_housing(model, z, r):
    """Shift (along, outwards) of a spot on top of the housing from the plane behind the flange, at 10 K/m."""
    body, (back, mount, turn) = model._bent_housing, model._frame
    moved = body.solve(body.expansion_load @ (10.0 * body.section.mesh.p[1]))
    side = body.side_at(z, r)
    middle = body.middle_of(side)
    along = body.mean_shift(side, (1.0, 0.0, 0.0)) @ moved + middle[1] * (turn @ moved)
    out = body.mean_shift(side, (0.0, 1.0, 0.0)) @ moved - mount @ moved
    return along, out - (middle[0] - back.z[0]) * (turn @ moved)


def test_a_machine_without_a_flange_has_sensors_on_its_housing(grown, tmp_path) -> None:
    """Its nose is not defined, as nothing says what stands still; its sensors' readings are."""
    spec, mesh, _ = grown
    held = {"z": "50 mm", "radius": "190 mm"}
    sensors = (AXIAL | {"mount": held}, TOP | {"mount": held})
    plain = machine(tmp_path, *sensors)
    narrow = [
        part.model_copy(
            update={
                "segment": tuple(
                    s.model_copy(update={"name": "front"}) if s.name == "flange" else s for s in part.segment
                )
            }
        )
        for part in plain.part
    ]
    bare = plain.model_copy(update={"part": tuple(narrow), "materials": spec.materials})
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Layout, "_flange", lambda self: "")
        found = GrowthModel(bare, mesh, 1)
        rise = np.full(mesh.n_corners, found.assembly_temperature + 10.0)
        read = found.displacements(rise, 0.0)
        assert found.at(rise, 0.0, found.assembly_forces).nose_axial is None
        with pytest.raises(SpecError, match="the housing has no flange"):
            GrowthModel(plain.model_copy(update={"displacement_sensor": spec.displacement_sensor}), mesh, 1)
    assert read["S1"] == pytest.approx(12e-5 * 0.050, rel=0.02)
    assert read["S2"] == pytest.approx(-12e-6, rel=1e-3)


def test_a_surface_of_several_faces_holds_no_sensor(grown, tmp_path) -> None:
    spec = machine(tmp_path, AXIAL | {"mount": "housing.outside"})
    with pytest.raises(SpecError, match=r'mount: "housing\.outside" is more than one plane or cylinder'):
        GrowthModel(spec, grown[1], 1)


def test_fast_running_stretches_the_nose(grown) -> None:
    """About as a free disc of 180 mm with a bore of 60 mm (Timoshenko & Goodier, section 32)."""
    spec, mesh, model = grown
    cold = np.full(mesh.n_corners, model.assembly_temperature)
    steel = spec.part_material("shaft")
    disc = 0.7 * 0.09**2 + 3.3 * 0.03**2
    expected = steel.density * 314.0**2 * 0.09 / (4.0 * steel.young_modulus) * disc
    assert model.displacements(cold, 314.0)["S2"] == pytest.approx(expected, rel=0.1)


def test_bodies_that_are_evenly_warm_keep_their_proportions(grown) -> None:
    """Every body moves away from the flange's back and from the axis by α ΔT times its distance."""
    spec, mesh, model = grown
    flange = next(s for p in spec.part for s in p.segment if s.name == "flange")
    rise = np.full(mesh.n_corners, model.assembly_temperature + 10.0)
    shapes = deformed_shapes(model, rise, 0.0, model.assembly_forces)
    assert {"shaft", "housing", "F1.inner_ring", "R2.outer_ring", "front_inner_spacer"} <= set(shapes)
    for shape in shapes.values():
        expected = 12e-5 * (shape.points - [flange.z[1], 0.0])
        np.testing.assert_allclose(shape.shift, expected, atol=2e-8)


def test_a_mount_that_is_no_flange_is_refused(grown, tmp_path) -> None:
    other = next(s.name for s in machine(tmp_path).part[1].segment if s.name != "flange")
    spec = machine(tmp_path, AXIAL | {"mount": other})
    with pytest.raises(SpecError, match="is not the flange of the housing"):
        GrowthModel(spec, grown[1], 1)


def test_without_a_flange_only_what_can_hold_a_sensor_is_offered(tmp_path) -> None:
    file = tmp_path / "own.toml"
    file.write_text(
        'schema = "spindle-fem/machine/1"\nbase = "router_spindle"\nname = "own"\n'
        'displacement_sensor = [{name = "nose", at = {z = "0 mm", radius = "15 mm"}, direction = "axial"}]\n',
        encoding="utf-8",
    )
    with pytest.raises(FaultsError, match=r"1 fault\n.*neither a segment nor a frame.* Or z and") as told:
        check_machine(file)
    assert "frame" not in str(told.value).partition("Allowed:")[2]


def test_check_finds_a_sensor_on_a_flange_that_is_none(tmp_path) -> None:
    file = tmp_path / "own.toml"
    file.write_text(
        'schema = "spindle-fem/machine/1"\nbase = "router_spindle"\nname = "own"\n'
        "displacement_sensor = [\n"
        '{name = "nose", at = {z = "0 mm", radius = "15 mm"}, direction = "axial", mount = "frame"},\n'
        '{name = "side", at = {z = "0 mm", radius = "15 mm"}, direction = "axial", mount = "frame"}]\n',
        encoding="utf-8",
    )
    with pytest.raises(FaultsError, match=r"nose\.mount: the housing has no flange: .* 1\.1") as told:
        check_machine(file)
    assert "side.mount: the housing has no flange" in str(told.value)
