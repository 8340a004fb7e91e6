"""Where the places that a diagnosis names lie in the drawing of a machine."""

import numpy as np
import pytest

from spindle_fem.definition.load import load_machine
from spindle_fem.machine.view.meridian_places import centre_of, regions_of
from spindle_fem.machine.view.part_roles import Layout


def test_places_are_those_of_the_drawing():
    spec = load_machine("recorded_spindle")
    probe = next(p for p in spec.probe if p.name == "SP04")
    assert centre_of(spec, "SP04") == (probe.r, probe.z)
    assert centre_of(spec, "near.SP04") == centre_of(spec, "SP04")
    bearing = next(b for _, b in spec.bearings if b.name == "F2")
    radius, place = centre_of(spec, "F2")
    assert place == pytest.approx(sum(bearing.z) / 2.0)
    assert radius == pytest.approx(0.0825)
    assert centre_of(spec, "F2.inner_ring")[0] < radius < centre_of(spec, "F2.outer_ring")[0]
    front = [b.z for group, b in spec.bearings if group.name == "front"]
    assert centre_of(spec, "front_bearings")[1] == pytest.approx(np.mean(front))
    assert centre_of(spec, "nose")[1] < min(front)[0]
    assert centre_of(spec, "drive_end")[1] > max(b.z[1] for _, b in spec.bearings)
    assert centre_of(spec, "ambient") is None


def test_the_channel_lies_within_its_turns():
    spec = load_machine("recorded_spindle")
    (region,) = regions_of(spec, "channel")
    assert region.r == pytest.approx((0.108, 0.118))
    assert region.z == pytest.approx((0.042, 0.174))


def test_the_shaft_between_its_bearings_ends_where_they_sit():
    spec = load_machine("recorded_spindle")
    found = regions_of(spec, "shaft_gap")
    seats = [b.z for _, b in spec.bearings]
    assert min(r.z[0] for r in found) >= max(z[1] for z in seats if z[1] < 0.3)
    assert max(r.z[1] for r in found) <= min(z[0] for z in seats if z[0] > 0.3)


def test_walls_that_face_the_shaft_and_rings_have_a_place():
    spec = load_machine("recorded_spindle")
    walls = regions_of(spec, "standing_gap")
    assert [region.z for region in walls] == [pytest.approx((0.157, 0.180)), pytest.approx((0.180, 0.410))]
    assert [region.r for region in walls] == [pytest.approx((0.095, 0.095)), pytest.approx((0.090, 0.090))]
    # By their areas.
    assert centre_of(spec, "standing_gap")[1] == pytest.approx(0.282, abs=1e-3)
    (ring,) = regions_of(spec, "around.SP04")
    assert ring.z == pytest.approx((0.27845, 0.30155), abs=1e-4)
    assert ring.r == pytest.approx((0.090, 0.10255), abs=1e-4)


def test_the_cover_holds_the_seal_of_the_nose():
    spec = load_machine("recorded_spindle")
    heat = Layout(spec, {"cover", "front_outer_spacer"}).heat()
    assert heat["standing_nose"] == ("cover",)
    assert "standing_drive_end" not in heat
    assert "standing_nose" not in Layout(spec, set()).heat()


def test_a_probe_lies_in_the_largest_segment_around_it():
    spec = load_machine("recorded_spindle")
    probes = {probe.name: probe for probe in spec.probe}
    layout = Layout(spec, {"housing.middle_body", "housing.flange"})
    assert layout.place_of_probe(probes["SP04"]) == "housing.middle_body"
    assert Layout(spec, set()).place_of_probe(probes["SP04"]) == "housing"
