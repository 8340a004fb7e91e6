"""What drawings leave open, to first order, against machines that really differ in it."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse.linalg import splu

from spindle_fem.definition.load import load_machine
from spindle_fem.definition.tolerances import DIAMETER_SHARE, PLACE
from spindle_fem.model.reduced import structural_model
from spindle_fem.model.reduced.build_reduced import nominal_channel_film, physical_loads
from spindle_fem.model.reduced.reduced_transient import simulate_fast
from spindle_fem.model.reduced.snapshots import Sample
from spindle_fem.model.reduced.structural_directions import structural_directions
from spindle_fem.model.reduced.structural_model import (
    StructuralModel,
    build_structural_model,
    full_machine,
)
from spindle_fem.operation.coefficient_table import build_coefficient_table
from spindle_fem.operation.operating_point import OperatingPoint
from tests.support.lumped_spindle import drive_of

CHOSEN = (
    "housing.outer_diameter",
    "channel.depth",
    "channel.film_along.1",
    "joint.front.outer_seats.up",
    "mass.shaft.nose_end",
    "capacity.steel_42CrMo4",
    "air.outside",
)


@pytest.fixture(scope="module")
def full(small):
    return full_machine(small)


@pytest.fixture(scope="module")
def directions(small):
    found = {item.name: item for item in structural_directions(small.spec, small.mesh)}
    return [found[name] for name in CHOSEN]


@pytest.fixture(scope="module")
def made(small, directions):
    return build_structural_model(small, directions)


@pytest.fixture(scope="module")
def model(made, directions, small):
    return StructuralModel(*made, small.spec)


def radii(mesh, nodes):
    return np.linalg.norm(mesh.points[nodes][..., :2], axis=-1)


def test_an_outer_diameter_moves_its_cylinders_and_no_other(full, directions):
    """Circles stay circles to their middles, contacts stay closed, the volume grows by that of the shell."""
    faces = directions[0].cause.faces
    amount = 4e-3
    mesh = full.movable.moved(full.movable.displacement(faces, None), amount)
    was, surfaces = full.machine.mesh, full.machine.mesh.surfaces
    outside = surfaces["housing.outside"]
    cylinder = outside[np.ptp(radii(was, outside), axis=1) < 1e-7]
    grown = radii(mesh, cylinder) - radii(was, cylinder)
    assert grown == pytest.approx(0.5 * amount * radii(was, cylinder) / 0.19, rel=1e-6)
    for name in ("housing.gap", "housing.channel_wall", "shaft.gap"):
        assert mesh.points[surfaces[name]] == pytest.approx(was.points[surfaces[name]], abs=1e-12)
    for joint in mesh.joints.values():
        assert mesh.points[joint.facets_a] == pytest.approx(mesh.points[joint.facets_b], abs=1e-9)
    rings = ((0.19, 0.025), (0.15, 0.345), (0.13, 0.080))
    shell = sum(2.0 * np.pi * radius * length * 0.5 * amount * radius / 0.19 for radius, length in rings)
    moved = directions[0].cause.moved(full, amount)
    row = moved.storage_names.index("capacity.cast_iron")
    volume = [float(item.storage[row].sum()) for item in (full.model, moved)]
    assert volume[1] - volume[0] == pytest.approx(shell, rel=0.03)


def test_widths_are_those_of_the_definition(small):
    """A diameter with a tolerance goes its own way, one that was measured nowhere, the others together."""
    path = "part.housing.segment.%s.outer_diameter={value = '%s', sigma = '%s'}"
    changes = (path % ("front_body", "300 mm", "1 mm"), path % ("rear_body", "260 mm", "0 mm"))
    spec = load_machine("recorded_spindle", (*changes, "channel.depth={value = '10 mm', sigma_rel = 0.05}"))
    found = {item.name: item for item in structural_directions(spec, small.mesh)}
    assert found["housing.front_body.outer_diameter"].sigma == 1e-3
    assert "housing.rear_body.outer_diameter" not in found
    assert found["channel.depth"].sigma == pytest.approx(0.5e-3)
    assert found["channel.z_start"].sigma == PLACE
    together = found["housing.outer_diameter"]
    assert together.sigma == pytest.approx(DIAMETER_SHARE * 0.38)
    assert sorted(face.place for face in together.cause.faces) == [0.15, 0.19]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["housing.outer_diameter", "channel.depth"])
def test_columns_are_those_of_a_machine_that_really_differs(name, made, full, directions, small):
    """Readings of the full model with its nodes moved; what is left falls with the size of the move."""
    model, changes, _ = made
    direction = next(item for item in directions if item.name == name)
    spec, point = small.spec, OperatingPoint.of(small.spec)
    table = build_coefficient_table(spec, full.model.contacts, full.model.gap_radii)
    sample = Sample(table.base(point), nominal_channel_film(spec, full.model, point), table.capacities())

    def readings(of, solve):
        matrix = of.conduction(sample.coefficients, sample.channel_film)
        return of.probes @ solve(
            matrix + 3e-4 * of.capacity(sample.capacities), physical_loads(of, sample, spec)
        )

    def in_full(of):
        return readings(
            of,
            lambda matrix, loads: splu(
                matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}
            ).solve(loads),
        )

    step = 1e-3 * direction.sigma
    column = readings(changes[name].applied(model, step), np.linalg.solve) - readings(model, np.linalg.solve)
    column /= step
    nominal, left = in_full(full.model), []
    for amount in (direction.sigma, direction.sigma / 4.0):
        moved = direction.cause.moved(full, amount)
        change = in_full(moved) - nominal
        left.append(np.abs(change - amount * column).max() / np.abs(change).max())
    assert left[0] < 0.06
    assert left[1] < 0.02


@pytest.mark.slow
def test_derivatives_of_a_run_are_differences_of_runs(model, directions):
    times = np.arange(0.0, 5401.0, 60.0)
    drive = drive_of(times, np.where(times < 3000.0, 3000.0, 500.0), ambient=293.0, inlet=289.0)
    found = simulate_fast(model, drive, 293.0, derivatives=CHOSEN)
    for column, direction in enumerate(directions):
        amount = 0.05 * direction.sigma
        if direction.name.startswith("air"):
            # Warmth is a load of the run, not of the model: nothing to compare with but its sign.
            assert found.sensitivity[-1, 0, column] > 0.0
            continue
        runs = [
            simulate_fast(model.with_amount(direction.name, sign * amount), drive, 293.0).temperature
            for sign in (1.0, -1.0)
        ]
        wanted = (runs[0] - runs[1]) / (2.0 * amount)
        assert found.sensitivity[:, :, column] == pytest.approx(wanted, abs=5e-3 * np.abs(wanted).max())


@pytest.mark.slow
def test_operators_in_proportion_are_differences_of_operators(model, small):
    """Of directions that leave the coolant's way alone, with bridges from places to the ambient."""
    point = OperatingPoint.of(small.spec)
    bridges = {"housing.outside": 1.5, "F1.outer_raceway": 0.7}
    plain = [name for name, change in model.changes.items() if not change.moves_channel]
    assert len(plain) == 5
    found = model.operators(point, {}, plain, conductances=bridges)
    storage = model.storage_by({}, plain)
    for name in plain:
        amount = 1e-2 * next(item.sigma for item in model.structural if item.name == name)
        other = model.with_amount(name, amount)
        moved = other.operators(point, {}, conductances=bridges)
        for part in ("conduction", "loads", "outputs", "output_inputs"):
            wanted = (getattr(moved, part) - getattr(found, part)) / amount
            own = getattr(found, f"{part}_by").get(name, np.zeros_like(wanted))
            if part == "loads":
                # Warmer fluids are a load of the run.
                always = model.load_names.index("coolant_friction")
                wanted[:, always] = own[:, always]
            size = np.abs(getattr(found, part)).max() / amount
            assert own == pytest.approx(wanted, abs=1e-12 * size + 1e-6 * np.abs(wanted).max()), (name, part)
        wanted = (other.storage({}) - model.storage({})) / amount
        own = storage.get(name, np.zeros_like(wanted))
        assert own == pytest.approx(wanted, abs=1e-7 * np.abs(wanted).max() + 1e-12 / amount)


@pytest.mark.slow
def test_the_cache_gives_the_same_model(made, tmp_path, monkeypatch, small):
    monkeypatch.setattr(structural_model, "build_structural_model", lambda machine, progress: made)
    monkeypatch.setattr(structural_model, "prepare_machine", lambda spec, progress: small)
    path = tmp_path / "structural-1.npz"
    first = structural_model._read_or_made(path, small.spec, print)
    structural_model._known.clear()
    again = structural_model._read_or_made(path, small.spec, print)
    structural_model._known.clear()
    assert first is made
    assert again is not made
    assert [replace(item, cause=None) for item in made[2]] == list(again[2])
    for name, change in made[1].items():
        assert again[1][name].channel == dict(change.channel)
        for field, values in change.values.items():
            assert np.array_equal(again[1][name].values[field], values)
            assert np.array_equal(again[1][name].rows[field], change.rows[field])
