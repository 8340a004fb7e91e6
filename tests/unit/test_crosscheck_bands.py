"""Narrow raceways: where balls touch, and what heat on a band instead of a whole face changes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from spindle_fem.definition.load import load_machine
from spindle_fem.model.lumped.links import SurfacePatch
from spindle_fem.model.lumped.machine_network import build_machine_network
from spindle_fem.operation.bearing_heat import heat_model_of
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.solvers.machine_network_steady import solve_machine_network
from spindle_fem.studies.crosscheck.causes import CHECKS, _narrow_raceways, band_lines, contact_bands


@pytest.fixture(scope="module")
def recorded():
    spec = load_machine("recorded_spindle")
    point, model = OperatingPoint.of(spec), heat_model_of(spec)
    coarse = build_machine_network(spec)
    fine = build_machine_network(spec, refinement=2, assembly=coarse.assembly)
    return coarse, solve_machine_network(fine, point, heat_model=model), point, model


def test_bands_lie_where_the_ellipses_are(recorded):
    coarse, state, point, _ = recorded
    bands = contact_bands(coarse.spec, point, state.bearing_temperatures())
    low, high = bands["F1.inner_raceway"]
    # 784 µm semi-major at 1137 N (reference_values); F1 carries a little more
    assert 1.45e-3 < high - low < 1.75e-3
    # F1 and F2 press the balls to the rear: their inner contact lies before the middle, F3's behind it
    assert 0.5 * (low + high) == pytest.approx(0.057 - 7.14e-3 * np.sin(np.radians(18.0)), abs=3e-4)
    assert bands["F1.outer_raceway"][0] > 0.057 > bands["F1.inner_raceway"][1]
    assert bands["F3.outer_raceway"][1] < 0.125 < bands["F3.inner_raceway"][0]


def test_narrow_raceways_hold_the_balls_heat_back(recorded):
    coarse, state, _, model = recorded
    change = _narrow_raceways(coarse, state, model)
    by_name = dict(zip(coarse.node_names, change, strict=True))
    assert "raceway_bands" in CHECKS
    for name in ("F1", "F3", "R1"):
        assert by_name[f"{name}.balls"] > by_name[f"{name}.inner_ring"] > 0.2
    assert abs(by_name["F1.outer_ring"]) < 0.5
    assert by_name["F1.balls"] == pytest.approx(3.0, abs=0.3)


def test_spread_in_a_ring_agrees_with_a_strip_on_a_slab(recorded):
    """Resistance from a narrow raceway into its ring, against Fourier's series of a strip on a slab."""
    coarse = recorded[0]
    spec = coarse.spec
    half, thickness, width, radius = 0.784e-3, 9.0e-3, 24.0e-3, 79.0e-3
    middle = 0.057
    along_z, depth = band_lines(middle - half, middle + half)
    lines = (tuple(along_z), tuple(radius - depth))
    bands = {"F1.inner_raceway": (middle - half, middle + half)}

    def built(narrow):
        return build_machine_network(spec, refinement=8, assembly=coarse.assembly, lines=lines, bands=narrow)

    networks = [built(narrow) for narrow in ({}, bands)]
    patches = [network.raceway("F1", "inner") for network in networks]
    assert patches[1].area.sum() == pytest.approx(2.0 * np.pi * radius * 2.0 * half, rel=1e-6)
    # the ring alone: heat in through the face, out through the bore held at 0
    resistance = []
    for network, patch in zip(networks, patches, strict=True):
        own = network.cells.part_names.index("F1.inner_ring")
        cells = np.flatnonzero(network.cells.part == own)
        nodes = network.partition.node_of_cell[cells]
        place = np.full(network.n_nodes, -1)
        place[nodes] = np.arange(len(nodes))
        inside = (place[network.links.first] >= 0) & (place[network.links.second] >= 0)
        first, second = place[network.links.first[inside]], place[network.links.second[inside]]
        g = network.links.conductance[inside]
        matrix = np.zeros((len(nodes), len(nodes)))
        for a, b, sign in ((first, first, 1), (second, second, 1), (first, second, -1), (second, first, -1)):
            np.add.at(matrix, (a, b), sign * g)
        log_bore = np.log(0.070)
        inner = network.cells.r[cells, 0] < 0.0701
        length = 2.0 * np.pi * np.diff(network.cells.z[cells], axis=1).ravel()
        sink = 46.0 * length / (network.centres.log_radius[nodes] - log_bore)
        matrix[inner.nonzero()[0], inner.nonzero()[0]] += sink[inner]
        share = patch.area / patch.area.sum()
        load = np.bincount(place[patch.node], share, len(nodes))
        temperature = np.linalg.solve(matrix, load)
        resistance.append(float(share @ (temperature[place[patch.node]] + patch.resistance * share)))
    # the slab's Fourier series: sum of tanh(m t) (sin(m a)/(m a))² / (w k m), m = n π/w, per length of strip
    wave = np.arange(1, 20_000) * np.pi / (0.5 * width)
    share_of_strip = (np.sin(wave * half) / (wave * half)) ** 2
    series = float(np.sum(np.tanh(wave * thickness) * share_of_strip / (0.5 * width * 46.0 * wave)))
    # most of it lies within a quarter of the ring's height under the raceway
    expected = series / (2.0 * np.pi * (radius - 0.25 * thickness))
    assert resistance[1] - resistance[0] == pytest.approx(expected, rel=0.03)


def test_a_patch_between_two_places() -> None:
    patch = SurfacePatch(np.arange(3), np.ones(3), np.array([1.0, 2.0, 3.0]), np.array([0.1, 0.2, 0.3]))
    part = patch.between(0.15, 0.35)
    assert part.node.tolist() == [1, 2]
    assert replace(part, z=part.z).area.sum() == 5.0
