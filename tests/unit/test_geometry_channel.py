"""Whether a channel and its ports fit, and what a misfit is told."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scripts.design_space import draw_valid_designs
from spindle_fem.errors import FaultsError
from spindle_fem.machine.geometry.assembly import assemble
from spindle_fem.machine.geometry.channel_geometry import ChannelDefinition, ChannelGeometry
from spindle_fem.machine.geometry.part_shapes import AnnularSegment, PartGeometry


def ring(z_start, z_end, inner, outer):
    """Segment in millimetres."""
    return AnnularSegment(z_start * 1e-3, z_end * 1e-3, inner * 1e-3, outer * 1e-3)


# The reference spindle's housing without what lies inside.
HOUSING = PartGeometry(
    "housing",
    (ring(40, 65, 95, 190), ring(65, 180, 95, 150), ring(180, 410, 90, 150), ring(410, 490, 82.5, 130)),
)
REFERENCE = ChannelDefinition("housing", 0.108, 0.010, 0.012, 0.024, 5.0, z_start=0.048, port_diameter=0.010)


def fit(part=HOUSING, others=(), **changes):
    return assemble([part, *others], channel=replace(REFERENCE, **changes))


def faults_of(part=HOUSING, others=(), **changes):
    with pytest.raises(FaultsError) as caught:
        fit(part, others, **changes)
    return [str(fault) for fault in caught.value.faults]


def test_reference_wall_area_and_length():
    """0.1562 m² and 3.552 m: shared/reference/spindle.md."""
    channel = fit().channel
    assert channel.wall_area == pytest.approx(0.1562, abs=5e-5)
    mean_radius = 0.113
    length = channel.angle_span * math.hypot(mean_radius, 0.024 / (2 * math.pi))
    assert length == pytest.approx(3.552, abs=5e-4)
    assert channel.volume == pytest.approx(10 * math.pi * 0.5 * (0.118**2 - 0.108**2) * 0.012, rel=1e-12)


@given(
    turns=st.floats(0.5, 8.0),
    pitch=st.floats(0.014, 0.04),
    starts=st.integers(1, 4),
    radius=st.floats(0.02, 0.2),
)
def test_wall_area_is_that_of_the_quadrature(turns, pitch, starts, radius):
    definition = ChannelDefinition("housing", radius, 0.01, 0.005, pitch, turns, starts)
    steps = 2000
    slope = pitch / (2 * math.pi)
    width = 0.01 / steps
    helicoid = sum(math.hypot(radius + (i + 0.5) * width, slope) * width for i in range(steps))
    span = 2 * math.pi * turns
    expected = starts * span * (2 * helicoid + 0.005 * (2 * radius + 0.01))
    assert ChannelGeometry(definition).wall_area == pytest.approx(expected, rel=1e-6)


def test_surface_names_follow_the_ports():
    assert fit().channel.surface_names == ("housing.channel_wall", "housing.channel_ports")
    assert fit(port_diameter=None).channel.surface_names == ("housing.channel_wall", "housing.channel_ends")


def test_reference_ports_lie_on_top():
    inlet, outlet = fit().channel.ports
    assert inlet.direction == pytest.approx((0.0, 1.0))
    assert outlet.direction == pytest.approx((0.0, 1.0), abs=1e-12)
    assert (inlet.z, outlet.z) == pytest.approx((0.048, 0.168))
    assert inlet.end_radius > 0.190
    assert 0.150 < outlet.end_radius < 0.190
    assert not fit().notes


def test_left_hand_turns_the_other_way():
    quarter = fit(turns=2.25, hand="left").channel.ports[1]
    assert quarter.direction == pytest.approx((1.0, 0.0), abs=1e-12)
    assert fit(turns=2.25).channel.ports[1].direction == pytest.approx((-1.0, 0.0), abs=1e-12)


def test_second_start_begins_opposite():
    channel = fit(starts=2, pitch=0.030, turns=3.0).channel
    assert channel.start_angles == pytest.approx((0.0, math.pi))
    assert len(channel.ports) == 4
    assert channel.ports[2].direction == pytest.approx((0.0, -1.0), abs=1e-12)


def test_land_between_turns():
    (text,) = faults_of(pitch=0.0149)
    assert text == (
        "channel.width: 12 mm + 3 mm exceeds pitch / starts = 14.9 mm, neighbouring turns leave less than "
        "3 mm of metal. Allowed: a width up to 11.9 mm."
    )
    assert fit(pitch=0.015).channel is not None


def test_two_starts_halve_the_room():
    (text,) = faults_of(starts=2)
    assert "channel.width: 12 mm + 3 mm exceeds pitch / starts = 12 mm" in text


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"depth": 0.0401}, "channel.depth"),
        ({"depth": 0.045}, "outer radius 153 mm (inner_radius + depth), breaks through the outer wall"),
        ({"inner_radius": 0.0969}, "inner radius 96.9 mm, leaves a wall of only 1.9 mm"),
        ({"inner_radius": 0.090}, "breaks through the inner wall"),
        ({"z_start": 0.0479}, "front edge z 41.9 mm (z_start - width/2), leaves a wall of only 1.9 mm"),
        ({"z_start": 0.040}, "breaks through the front wall"),
        (
            {"turns": 18.125},
            "rear edge z 489 mm (z_start + pitch * turns + width/2), leaves a wall of only 1 mm",
        ),
    ],
)
def test_thin_walls_are_refused_by_name(changes, message):
    changes = {"port_diameter": None, **changes}
    texts = faults_of(**changes)
    assert any(message in text for text in texts)
    assert all("Allowed: at least 2 mm of metal on every side." in text for text in texts)


@pytest.mark.parametrize("changes", [{"depth": 0.040}, {"inner_radius": 0.097}, {"z_start": 0.048}])
def test_two_millimetres_are_enough(changes):
    assert fit(port_diameter=None, **changes).channel is not None


def test_corner_distance_counts_as_a_wall():
    """A step of the bore reaches within 2 mm of the channel's rear inner corner (z 150, r 108) diagonally."""
    far = PartGeometry("housing", (ring(40, 151, 95, 150), ring(151, 300, 106, 150)))
    near = PartGeometry("housing", (ring(40, 152, 107, 150), ring(152, 300, 95, 150)))
    assert any("wall of only 1 mm" in text for text in faults_of(near, port_diameter=None, turns=4.0))
    diagonal = PartGeometry("housing", (ring(40, 151, 95, 150), ring(151, 300, 109.5, 150)))
    texts = faults_of(diagonal, port_diameter=None, turns=4.0, inner_radius=0.111)
    assert any("leaves a wall of only 1.80278 mm" in text for text in texts)
    assert fit(far, port_diameter=None, turns=4.0).channel is not None


@pytest.mark.parametrize(
    "key", ["inner_radius", "depth", "width", "pitch", "turns", "starts", "port_diameter"]
)
def test_values_must_be_positive(key):
    assert any(f"channel.{key}: is 0. Allowed: above 0." in text for text in faults_of(**{key: 0}))


def test_unknown_hand_and_part():
    assert any('channel.hand: is "up". Allowed: right, left.' in text for text in faults_of(hand="up"))
    assert len(faults_of(hand="up", depth=-1.0)) == 2


def test_channel_in_a_part_that_is_not_there():
    with pytest.raises(FaultsError, match=r'part "housng" does not exist. Did you mean "housing"'):
        assemble([HOUSING], channel=replace(REFERENCE, part="housng"))


def test_wide_port_is_narrowed_and_said_so():
    assembly = fit(width=0.008, z_start=0.046)
    assert {round(port.radius * 1e3, 6) for port in assembly.channel.ports} == {3.0}
    assert any("drilled Ø6 mm instead of Ø10 mm" in note for note in assembly.notes)


def test_port_keeps_clear_of_a_step_of_the_outside():
    """The outlet at z 64 would all but touch the flange's back at z 65."""
    assembly = fit(pitch=0.016, turns=1.0)
    outlet = assembly.channel.ports[1]
    step = abs(0.065 - outlet.z)
    assert outlet.radius <= step - 2.0e-3 + 1e-9 or outlet.radius >= step + 1.0e-3 - 1e-9
    assert outlet.radius < outlet.seam_radius - 0.118 or outlet.seam_radius < 0.150


def test_port_that_hits_another_part():
    sleeve = PartGeometry("sleeve", (ring(150, 190, 150, 160),))
    (text,) = faults_of(others=[sleeve])
    assert 'channel.ports: outlet port at z 168 mm hits part "sleeve" outside r 150 mm.' in text


def test_draws_repeat_and_differ_by_seed():
    def channels(seed):
        return [design.channel.definition for design in draw_valid_designs([HOUSING], REFERENCE, 5, seed)]

    assert channels(3) == channels(3)
    assert channels(3) != channels(4)


def test_drawn_designs_obey_the_rules():
    for assembly in draw_valid_designs([HOUSING], REFERENCE, 40, 7):
        channel = assembly.channel.definition
        assert channel.width + 3e-3 <= channel.pitch / channel.starts + 1e-12
        assert 0.005 <= channel.depth <= 0.030
        assert channel.z_start - 0.5 * channel.width == pytest.approx(0.042)
        assert 1 <= channel.turns <= 8
        for port in assembly.channel.ports:
            assert 2 * port.radius <= channel.width - 2e-3 + 1e-12
