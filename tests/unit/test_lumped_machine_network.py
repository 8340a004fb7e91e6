"""The paper's network of a machine definition: its nodes, what they hold, and its laws."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from spindle_fem.definition.load import load_machine
from spindle_fem.errors import FaultsError, NoSteadyStateError, OutOfValidityError, SpecError
from spindle_fem.machine.geometry.assembly import build_assembly
from spindle_fem.machine.geometry.coolant_path import CoolantPath
from spindle_fem.model.lumped.cells import build_cells, channel_zone, side_wall_area
from spindle_fem.model.lumped.friction_table import tabulate_friction
from spindle_fem.model.lumped.heat_laws import FILM_STEP, ChannelFilm, FrictionLaw
from spindle_fem.model.lumped.machine_balance import SparseBalance
from spindle_fem.model.lumped.machine_network import build_machine_network
from spindle_fem.model.lumped.operating_state import operate
from spindle_fem.operation.bearing_heat import heat_model_of
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.physics.coolant.regimes import ChannelState, select_film
from spindle_fem.solvers.machine_network_steady import solve_machine_network
from spindle_fem.solvers.newton import newton

MACHINES = ("recorded_spindle", "small_two_start", "uncooled")


@pytest.fixture(scope="module")
def spindle():
    return load_machine("recorded_spindle")


@pytest.fixture(scope="module")
def network(spindle):
    return build_machine_network(spindle)


def test_the_reference_spindle_has_nine_columns_of_eight_nodes(network):
    columns = [column.name for column in network.partition.columns]
    assert columns == ["front_end", "F1", "F2", "F2_F3", "F3", "F3_R1", "R1", "R2", "rear_end"]
    assert network.n_nodes == 72
    of_column = [sum(name.startswith(f"{column}.") for name in network.node_names) for column in columns]
    assert of_column == [8] * 9


def test_nodes_are_named_by_part(network):
    of_f1 = {name for name in network.node_names if name.startswith("F1.")}
    assert of_f1 == {
        "F1.shaft", "F1.inner_ring", "F1.balls", "F1.outer_ring",
        "F1.housing.inside", "F1.housing.lands", "F1.coolant", "F1.housing.outside",
    }  # fmt: skip


def test_more_bearings_make_more_columns():
    network = build_machine_network(load_machine("uncooled"))
    assert [column.bearing for column in network.partition.columns if column.bearing] == [
        "F1",
        "F2",
        "R1",
        "R2",
    ]
    assert network.n_nodes % len(network.partition.columns) == 0


def test_spans_are_divided_about_bearings_and_where_cooling_begins_and_ends():
    spec = load_machine("motor_spindle")
    columns = build_machine_network(spec).partition.columns
    edges = np.array([columns[0].z[0], *(column.z[1] for column in columns)])
    for end in channel_zone(spec.channel):
        at = int(np.abs(edges - end).argmin())
        assert edges[at] == pytest.approx(end, abs=1e-12)
        # at most one and a half bearings wide on either side, half of one at least
        assert all(0.5 * 0.018 <= width <= 1.5 * 0.018 for width in np.diff(edges)[at - 1 : at + 1])
    assert len({column.name for column in columns}) == len(columns) == 21
    assert [column.bearing for column in columns if column.bearing] == ["F1", "F2", "R1", "R2"]
    # Heat leaves a bearing in spans that nothing cools, too.
    for name in ("uncooled", "motor_spindle"):
        spec = load_machine(name)
        columns = build_machine_network(spec).partition.columns
        widest = 1.5 * max(bearing.z[1] - bearing.z[0] for _, bearing in spec.bearings)
        beside = [
            one if one.bearing is None else other
            for one, other in pairwise(columns)
            if (one.bearing is None) != (other.bearing is None)
        ]
        assert all(column.z[1] - column.z[0] <= widest for column in beside)
    assert len(build_machine_network(load_machine("wu_tan_2016")).partition.columns) == 9


@pytest.mark.parametrize("machine", ["belt_lathe", "uncooled", "motor_spindle"])
def test_rings_are_as_warm_as_of_a_fine_network(machine):
    """Rings up to 4.8 K off with one column for each span that nothing cools, and lands that end at none."""
    spec = load_machine(machine, ["heat.thermal_preload=false"])
    coarse, fine = (
        solve_machine_network(build_machine_network(spec, refinement=number)).bearing_temperatures()
        for number in (1, 6)
    )
    for name, item in coarse.items():
        assert item.inner == pytest.approx(fine[name].inner, abs=1.8)
        assert item.outer == pytest.approx(fine[name].outer, abs=2.3)


def test_rings_beside_a_channel_are_as_warm_as_of_a_fine_network():
    """A channel that begins 15 mm behind a bearing: with one column for the whole span 12 K too hot."""
    changes = ("heat.thermal_preload=false", "channel.z_start=135 mm", "channel.turns=9")
    spec = load_machine("motor_spindle", changes)
    found = []
    for refinement in (1, 3):
        state = solve_machine_network(build_machine_network(spec, refinement=refinement))
        assert state.imbalance_relative < 1e-10
        found.append(
            [state.network.raceway_temperatures(state.temperature, b.name) for _, b in spec.bearings]
        )
    lumps, fine = np.array(found)
    assert np.abs(lumps - fine).max() < 4.0


@pytest.mark.parametrize("machine", MACHINES)
def test_volume_and_capacity_are_those_of_the_parts(machine):
    spec = load_machine(machine)
    assembly = build_assembly(spec)
    network = build_machine_network(spec)
    cells = network.cells
    full = {
        part.name: sum(
            np.pi * (s.outer_radius**2 - s.inner_radius**2) * (s.z_end - s.z_start) for s in part.segments
        )
        for part in assembly.parts
    }
    if spec.channel is not None:
        c = spec.channel
        section = np.pi * ((c.inner_radius + c.depth) ** 2 - c.inner_radius**2)
        full[c.part] -= section * c.starts * c.width * c.turns
    for index, name in enumerate(cells.part_names):
        # shoulders overlap no other segment in these machines
        assert cells.volume[cells.part == index].sum() == pytest.approx(full[name], rel=1e-9), name
    materials = [spec.part_material(name).volumetric_heat_capacity for name in cells.part_names]
    expected = sum(volume * capacity for volume, capacity in zip(full.values(), materials, strict=True))
    solid = network.capacity[: network.n_solid].sum()
    assert solid == pytest.approx(expected * spec.heat_capacity_factor.value, rel=1e-9)


@pytest.mark.parametrize("channelling", ["smeared", "rings"])
def test_smeared_helix_and_rings_keep_wetted_area_and_volume(spindle, channelling):
    network = build_machine_network(spindle, refinement=2, channelling=channelling)
    # exact area of the reference spindle's channel, end faces apart
    assert network.coolant.area.sum() == pytest.approx(0.1562, abs=5e-5)
    smeared = build_machine_network(spindle, refinement=2)
    assert network.cells.volume.sum() == pytest.approx(smeared.cells.volume.sum(), rel=1e-9)


def test_side_walls_are_helicoids(spindle):
    channel = spindle.channel
    lead = channel.pitch / (2.0 * np.pi)
    r = np.linspace(0.108, 0.118, 200_001)
    middle = 0.5 * (r[1:] + r[:-1])
    exact = 2.0 * 5.0 * 2.0 * np.pi * float(np.sum(np.hypot(middle, lead) * np.diff(r)))
    assert side_wall_area(channel, 0.108, 0.118, 5.0) == pytest.approx(exact, rel=1e-9)
    assert channel_zone(channel) == pytest.approx((0.048, 0.168))


@pytest.mark.parametrize("machine", MACHINES)
def test_energy_balance_closes_to_1e_10(machine):
    state = solve_machine_network(build_machine_network(load_machine(machine)))
    assert state.imbalance_relative < 1e-10
    assert sum(state.boundary_heat.values()) == pytest.approx(state.heat_in, rel=1e-10)


@pytest.mark.parametrize("machine", ["recorded_spindle", "small_two_start", "uncooled"])
def test_jacobian_is_the_derivative_of_the_balance(machine):
    network = build_machine_network(load_machine(machine))
    state = solve_machine_network(network)
    balance = SparseBalance(state.network)
    temperature = state.temperature + np.random.default_rng(0).normal(size=network.n_nodes)
    analytic = balance(temperature)[1]
    step = 1e-4
    moved = step * np.eye(network.n_nodes)
    numeric = np.array(
        [(balance(temperature + e)[0] - balance(temperature - e)[0]) / (2 * step) for e in moved]
    ).T
    assert np.abs(analytic - numeric).max() < 1e-6 * np.abs(analytic).max()


def test_coolant_nodes_are_the_enthalpy_march(network):
    """The march over the walls that the network found gives the network's coolant."""
    state = solve_machine_network(network)
    law, loop = state.network.coolant_law, network.coolant.loop
    h = law.coefficients(state.temperature)[0]
    link = [(a, b, q) for a, b, kind, q in state.links() if kind == "coolant"]
    heat = np.bincount([b - network.coolant_start for _, b, _ in link], [q for _, _, q in link])
    end = state.temperature[network.coolant_start :]
    start = np.concatenate([[law.inlet], end[:-1]])
    units = np.bincount(law.cell, law.conductances(h)[0]) / law.capacity_rate
    units = np.log1p(units)
    wall = end + (end - start) / np.expm1(units)
    march = loop.at(state.network.point, wall[None])
    # the march knows no resistance of metal: compare with its film times the same share
    assert (march.march.march.mixed_outlet_temperature - law.inlet) > 0.9 * (state.coolant_outlet - law.inlet)
    assert heat.sum() == pytest.approx(law.capacity_rate * (state.coolant_outlet - law.inlet), rel=1e-10)
    assert np.diff(np.concatenate([[law.inlet], end])) * law.capacity_rate == pytest.approx(heat, rel=1e-9)


@pytest.mark.parametrize(
    ("fluid", "model", "flow", "jump"),
    [
        ("iso_vg_10", "helical", 80.0, 0.0),
        ("iso_vg_32", "paper", 40.0, 44.04),
        ("water", "helical", 4.0, 0.0),
    ],
)
def test_film_of_the_network_is_the_model_beside_kinks_and_jumps(fluid, model, flow, jump):
    """Splines over the whole range were 10 % off at a kink, 93 % at the paper's jump."""
    path = CoolantPath.of(load_machine("wu_tan_2016", (f"coolant.fluid={fluid}",)))
    film = ChannelFilm(path.coolant, path.section, model, flow / 6.0e4, 1.0)
    low, high = film.range
    bulk, wall = np.random.default_rng(0).uniform(low + 0.1, high - 0.1, (2, 4000))
    bulk[np.abs(bulk - 273.15 - jump) < FILM_STEP] += 2.0 * FILM_STEP
    found, *slopes = film(bulk, wall)
    state = ChannelState(path.coolant, film.flow, bulk, wall)
    assert found == pytest.approx(select_film(model, path.section, state).value, rel=5e-3)
    step = 1e-6
    for slope, moved in zip(slopes, ((step, 0.0), (0.0, step)), strict=True):
        numeric = film(bulk + moved[0], wall + moved[1])[0] - film(bulk - moved[0], wall - moved[1])[0]
        assert np.mean(np.isclose(slope, numeric / (2.0 * step), rtol=1e-4, atol=1e-4)) > 0.999


def test_double_heat_doubles_the_rise(network):
    """Linear machine: table heat, fixed films."""
    point = OperatingPoint.of(network.spec)
    model = heat_model_of(network.spec)
    net = operate(network, point, model)
    temperature = newton(SparseBalance(net), np.full(72, 300.0))[0]
    matrix, load = SparseBalance(net).matrix, SparseBalance(net).load
    twice = np.linalg.solve(matrix, load + net.heat)
    none = np.linalg.solve(matrix, load - net.heat)
    assert twice - none == pytest.approx(2.0 * (temperature - none), rel=1e-9)


def test_bad_arguments_are_refused_by_name(spindle, network):
    for wrong in (0, 1.5, True):
        with pytest.raises(SpecError, match="refinement"):
            build_machine_network(spindle, refinement=wrong)
    with pytest.raises(SpecError, match="channelling"):
        build_machine_network(spindle, channelling="rings")
    with pytest.raises(SpecError, match='"spiral"'):
        build_cells(build_assembly(spindle), channelling="spiral")
    wide = spindle.model_copy(update={"channel": spindle.channel.model_copy(update={"width": 0.025})})
    with pytest.raises(FaultsError, match="neighbouring turns"):
        build_machine_network(wide)


def test_a_film_hotter_than_its_table_is_refused():
    spec = load_machine("small_two_start")
    network = build_machine_network(spec)
    point, model = OperatingPoint.of(spec), heat_model_of(spec)
    net = operate(network, point, model, friction=tabulate_friction(network.spec, point, model))
    (friction,) = [law for law in net.laws if isinstance(law, FrictionLaw)]
    with pytest.raises(OutOfValidityError, match="friction heat of B1"):
        friction.require_valid(np.full(network.n_nodes, 500.0))


def test_a_machine_that_loses_no_heat_has_no_steady_state(spindle):
    network = build_machine_network(spindle)
    net = operate(network, OperatingPoint.of(spindle), heat_model_of(spindle))
    from dataclasses import replace

    outward = net.second >= network.n_nodes
    sealed = replace(
        net, conductance=np.where(outward, 0.0, net.conductance), streams=(np.empty(0, int),) * 2
    )
    with pytest.raises(NoSteadyStateError):
        newton(SparseBalance(sealed), np.full(network.n_nodes, 300.0))
