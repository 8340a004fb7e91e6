"""The map from one channel to another: what stays, moves and is refused; the lattice of sources."""

from dataclasses import replace

import numpy as np
import pytest

from spindle_fem.definition.load import load_machine
from spindle_fem.errors import GeometryError
from spindle_fem.machine.geometry.assembly import build_assembly
from spindle_fem.studies.sweep.channel_map import build_map
from spindle_fem.studies.sweep.channel_measures import channel_measures
from spindle_fem.studies.sweep.morphing import lattice_assembly, lattice_machine

MACHINES = ("wu_tan_2016", "recorded_spindle", "small_two_start")
CHANGES = {
    "depth": {"depth": 1.15},
    "width": {"width": 0.95},
    "pitch": {"pitch": 1.02},
    "all": {"depth": 0.9, "width": 0.94, "pitch": 1.015},
}


def machine(name, **factors):
    base = load_machine(name).channel
    return load_machine(name, [f"channel.{key}={getattr(base, key) * f!r} m" for key, f in factors.items()])


def both(name, factors):
    return build_assembly(machine(name)), build_assembly(machine(name, **factors))


def at(radius, angle, z):
    radius, angle, z = np.broadcast_arrays(radius, angle, z)
    return np.column_stack([-radius * np.sin(angle), radius * np.cos(angle), z])


def wall_points(channel, start, share, radius, side):
    """Points of one start at a share of its length, a radius, and a side in widths from its middle."""
    definition = channel.definition
    angle = channel.start_angles[start] + channel.angle_span * share
    z = definition.z_start + definition.pitch * definition.turns * share + side * definition.width
    return at(radius, angle, z)


@pytest.mark.parametrize("name", MACHINES)
def test_a_machine_onto_itself_moves_nothing(name):
    assembly = build_assembly(machine(name))
    low, high = assembly.channel.z_bounds
    points = np.random.default_rng(1).uniform([-0.2, -0.2, low - 0.05], [0.2, 0.2, high + 0.05], (20000, 3))
    assert (build_map(assembly, assembly)(points) == points).all()


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("name", MACHINES)
def test_walls_go_to_the_walls_of_the_new_channel(name, change):
    """Every wall of every start, ports aside: corners of the section to corners, helix to helix."""
    source, target = both(name, CHANGES[change])
    channel_map = build_map(source, target)
    share = np.linspace(0.12, 0.88, 60)  # ports aside
    before, after = source.channel, target.channel
    for start in range(before.definition.starts):
        for side in (-0.5, 0.0, 0.5):
            for height in (0.0, 0.4, 1.0):
                radius = before.definition.inner_radius + height * before.definition.depth
                new_radius = after.definition.inner_radius + height * after.definition.depth
                moved = channel_map(wall_points(before, start, share, radius, side))
                wanted = wall_points(after, start, share, new_radius, side)
                assert moved == pytest.approx(wanted, abs=1e-12)


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("name", MACHINES)
def test_other_surfaces_stay(name, change):
    """Cylinders keep their radius and planes their place; circles where they meet do not move at all."""
    source, target = both(name, CHANGES[change])
    channel_map = build_map(source, target)
    angle = np.linspace(-np.pi, np.pi, 91)
    for edge in source.edges:
        for share in np.linspace(0.0, 1.0, 5):
            z = edge.z[0] + share * (edge.z[1] - edge.z[0])
            radius = edge.r[0] + share * (edge.r[1] - edge.r[0])
            points = at(radius, angle, z)
            moved = channel_map(points)
            if edge.is_cylinder:
                assert np.hypot(moved[:, 0], moved[:, 1]) == pytest.approx(radius, abs=1e-12)
            else:
                assert moved[:, 2] == pytest.approx(z, abs=1e-12)
            if share in (0.0, 1.0):
                assert (moved == points).all()


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("name", ["wu_tan_2016", "small_two_start"])
def test_ports_go_to_the_new_ports(name, change):
    """The cylinder of each drilling to the new one, from its flat start to where it opens."""
    source, target = both(name, CHANGES[change])
    channel_map = build_map(source, target)
    around = np.linspace(0.0, 2.0 * np.pi, 73)
    sense = np.sign(source.channel.angle_span)
    for port in channel_map.ports:
        is_inlet = abs(port.source.z - source.channel.definition.z_start) < 1e-9
        # The half that stands in metal, on the other side of the channel's end.
        outer = np.sin(around) * sense * (-1.0 if is_inlet else 1.0) > 1e-9
        for first, second in ((port.source, port.target),):
            across, axial = first.radius * np.sin(around[outer]), first.radius * np.cos(around[outer])
            for along in np.linspace(first.start_radius, port.exit_radius - 1e-3, 9):
                x, y = first.direction
                points = np.column_stack([along * x - across * y, along * y + across * x, first.z + axial])
                moved = channel_map(points)
                new_x, new_y = second.direction
                new_across = moved[:, 1] * new_x - moved[:, 0] * new_y
                distance = np.hypot(new_across, moved[:, 2] - second.z)
                assert distance == pytest.approx(second.radius, abs=1e-9)
                if along == first.start_radius:
                    assert moved[:, :2] @ second.direction == pytest.approx(second.start_radius, abs=1e-9)


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("name", MACHINES)
def test_no_space_turns_inside_out(name, change):
    """The determinant of the map's gradient, by differences, is positive in all metal around the channel."""
    source, target = both(name, CHANGES[change])
    channel_map = build_map(source, target)
    room, rng = channel_map.room, np.random.default_rng(2)
    number = 40000
    points = at(
        rng.uniform(room.inner, room.outer, number),
        rng.uniform(-np.pi, np.pi, number),
        rng.uniform(room.front, room.rear, number),
    )
    definition = source.channel.definition
    radius, angle = np.hypot(points[:, 0], points[:, 1]), np.arctan2(-points[:, 0], points[:, 1])
    turn = np.sign(source.channel.angle_span) * angle / (2 * np.pi) * definition.starts
    height = (points[:, 2] - definition.z_start) * definition.starts / definition.pitch - turn
    clearance = np.abs(height - np.round(height)) * definition.pitch / definition.starts
    void = (radius > definition.inner_radius) & (radius < source.channel.outer_radius)
    points = points[~(void & (clearance < 0.5 * definition.width))]
    step = 1e-7
    gradient = np.stack(
        [
            (channel_map(points + step * one) - channel_map(points - step * one)) / (2 * step)
            for one in np.eye(3)
        ],
        axis=1,
    )
    assert np.linalg.det(gradient).min() > 0.3


def test_only_depth_width_and_pitch_may_differ():
    source = build_assembly(machine("wu_tan_2016"))
    for override in ("channel.turns=4.5", "channel.hand=left", "channel.inner_radius=107 mm"):
        target = build_assembly(load_machine("wu_tan_2016", [override]))
        with pytest.raises(GeometryError, match="differ in more than depth, width, pitch"):
            build_map(source, target)
    without = build_assembly(load_machine("uncooled"))
    with pytest.raises(GeometryError, match="there is no channel"):
        build_map(without, without)
    with pytest.raises(GeometryError, match="differ in more than"):
        build_map(source, build_assembly(machine("recorded_spindle")))


def test_a_port_beside_an_edge_is_refused():
    assembly = build_assembly(machine("wu_tan_2016"))
    channel = assembly.channel
    ports = tuple(replace(port, z=port.z - 2.5e-3) for port in channel.ports)
    near_edge = replace(assembly, channel=replace(channel, ports=ports))
    with pytest.raises(GeometryError, match="too near to an edge"):
        build_map(near_edge, near_edge)


def test_the_lattice_point_depends_on_the_design_alone():
    spec = load_machine("recorded_spindle", ["channel.depth=11.2 mm", "channel.pitch=23.7 mm"])
    source = lattice_machine(spec).channel
    assert (source.depth, source.width, source.pitch) == (0.010, 0.012, 0.024)
    assert (
        source.model_copy(update={"depth": spec.channel.depth, "pitch": spec.channel.pitch}) == spec.channel
    )
    # Halves go up, whatever their last binary digit.
    for depth, expected in (
        ("11.25 mm", 0.0125),
        ("11.249 mm", 0.010),
        ("18.75 mm", 0.020),
        ("1 mm", 0.0025),
    ):
        chosen = lattice_machine(load_machine("recorded_spindle", [f"channel.depth={depth}"]))
        assert chosen.channel.depth == expected
    assert lattice_machine(load_machine("recorded_spindle", ["channel.depth=20 mm"])) is None
    assert lattice_machine(load_machine("uncooled")) is None


def test_many_turns_make_the_pitch_step_finer():
    """The end of the channel moves by turns times the change of pitch, never by more than 2.5 mm."""
    for turns, pitch in ((5, 0.024), (9, 0.0135), (11, 0.0105)):
        overrides = [f"channel.turns={turns}", f"channel.pitch={pitch} m", "channel.width=6 mm"]
        for shift in np.linspace(0.0, 1e-3, 21).tolist():
            spec = load_machine("recorded_spindle", [*overrides, f"channel.pitch={pitch + shift!r} m"])
            source = lattice_machine(spec)
            if source is not None:
                assert abs(source.channel.pitch - spec.channel.pitch) * turns <= 2.5e-3 + 1e-12


def test_an_impossible_lattice_point_means_a_new_mesh():
    """From radius 108.5 mm to 150 mm, depth 38.8 mm leaves 2.7 mm of metal, its lattice point 1.5 mm."""
    overrides = ["channel.inner_radius=108.5 mm"]
    fits = load_machine("recorded_spindle", [*overrides, "channel.depth=38.6 mm"])
    assert lattice_machine(fits).channel.depth == 0.0375
    assert lattice_assembly(fits) is not None
    edge = load_machine("recorded_spindle", [*overrides, "channel.depth=38.8 mm"])
    build_assembly(edge)
    assert lattice_machine(edge).channel.depth == 0.040
    assert lattice_assembly(edge) is None


def test_measures_of_a_straight_drilling():
    """Far from the axis a port is a straight tube: its openings are discs, its volume that of cylinders."""
    channel = build_assembly(machine("wu_tan_2016")).channel
    port = channel.ports[0]
    exits = [0.190, 0.150]
    found = channel_measures(channel, exits)
    bare = channel_measures(replace(channel, ports=()))
    disc = np.pi * port.radius**2
    assert found.openings == pytest.approx([disc, disc], rel=5e-4)
    assert bare.wall - found.wall == pytest.approx(disc, rel=5e-4)  # half a disc at each end
    start, roof = port.start_radius, channel.outer_radius
    lengths = sum(0.5 * (exit_radius - roof) + 0.5 * (exit_radius - start) for exit_radius in exits)
    assert found.volume - bare.volume == pytest.approx(disc * lengths, rel=1e-3)
