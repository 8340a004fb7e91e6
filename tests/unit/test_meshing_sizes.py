"""Element sizes of the presets and where they shrink."""

from __future__ import annotations

import math

import pytest

from spindle_fem.errors import BadInputError
from spindle_fem.machine.geometry.assembly import assemble
from spindle_fem.machine.geometry.channel_geometry import ChannelDefinition
from spindle_fem.machine.geometry.part_shapes import AnnularSegment, PartGeometry
from spindle_fem.machine.meshing.sizes import build_sizes, edge_sizes


@pytest.fixture(scope="module")
def assembly():
    body = PartGeometry("body", (AnnularSegment(0.0, 0.2, 0.05, 0.10),))
    thin = PartGeometry("ring", (AnnularSegment(0.05, 0.07, 0.044, 0.05),))
    channel = ChannelDefinition("body", 0.07, 0.01, 0.012, 0.024, 3.0, z_start=0.05)
    return assemble([body, thin], channel=channel)


def test_presets_refine(assembly):
    sizes = [build_sizes(assembly, preset) for preset in ("coarse", "normal", "fine")]
    for part in ("body", "ring"):
        values = [size.part[part] for size in sizes]
        assert values == sorted(values, reverse=True)
        assert len(set(values)) == 3
    assert sizes[0].channel > sizes[1].channel > sizes[2].channel


def test_thin_parts_are_finer(assembly):
    sizes = build_sizes(assembly, "normal")
    assert sizes.part["ring"] == pytest.approx(0.006)
    assert sizes.part["ring"] < sizes.part["body"]


def test_factor_halves_every_length(assembly):
    whole, half = (build_sizes(assembly, "normal", size_factor=factor) for factor in (1.0, 0.5))
    assert half.channel == pytest.approx(0.5 * whole.channel)
    assert dict(half.part) == pytest.approx({name: 0.5 * size for name, size in whole.part.items()})
    assert half.port_segments == 2 * whole.port_segments
    assert edge_sizes(assembly, half) == pytest.approx(
        [0.5 * size for size in edge_sizes(assembly, whole)], rel=0.5
    )


def test_overrides(assembly):
    sizes = build_sizes(assembly, "normal", overrides={"ring": 0.002, "channel": 0.003})
    assert (sizes.part["ring"], sizes.channel) == (0.002, 0.003)


def test_circles_keep_their_segments(assembly):
    sizes = build_sizes(assembly, "coarse", overrides={"body": 1.0, "ring": 1.0})
    for edge, size in zip(assembly.edges, edge_sizes(assembly, sizes), strict=True):
        if edge.is_cylinder:
            assert size <= 2 * math.pi * edge.r[0] / sizes.circle_segments * (1 + 1e-12)


def test_chords_stay_out_of_narrow_gaps():
    inner = PartGeometry(
        "inner", (AnnularSegment(0.0, 0.1, 0.02, 0.0895), AnnularSegment(0.0, 0.01, 0.08, 0.1))
    )
    outer = PartGeometry("outer", (AnnularSegment(0.01, 0.1, 0.09, 0.1),))
    assembly = assemble([inner, outer])
    sizes = build_sizes(assembly, "coarse")
    for edge, size in zip(assembly.edges, edge_sizes(assembly, sizes), strict=True):
        if edge.is_cylinder and edge.r[0] in (0.0895, 0.09):
            assert size**2 / (8 * edge.r[0]) < 0.5 * 0.0005


def test_key_does_not_depend_on_order(assembly):
    one = build_sizes(assembly, "normal", overrides={"ring": 0.002, "body": 0.01})
    two = build_sizes(assembly, "normal", overrides={"body": 0.01, "ring": 0.002})
    assert one.key() == two.key()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"preset": "medium"}, r'mesh.preset: "medium" does not exist. .*Allowed: coarse, normal, fine.'),
        ({"size_factor": 0.0}, r"mesh.size_factor: is 0. Allowed: above 0."),
        ({"overrides": {"rign": 0.001}}, r'mesh.size.rign: names no part. Did you mean "ring"'),
        ({"overrides": {"ring": -0.001}}, r"mesh.size.ring: is -0.001 m. Allowed: above 0."),
    ],
)
def test_bad_sizes(assembly, arguments, message):
    with pytest.raises(BadInputError, match=message):
        build_sizes(assembly, **arguments)


def test_a_solid_shaft_is_no_finer_than_a_hollow_one() -> None:
    def finest(bore: float) -> float:
        shaft = PartGeometry("shaft", (AnnularSegment(0.0, 0.2, bore, 0.03),))
        solid = assemble([shaft])
        return min(edge_sizes(solid, build_sizes(solid, "coarse")))

    # the ends reach the axis, where no circle asks for edges
    assert finest(0.0) >= finest(0.01)
