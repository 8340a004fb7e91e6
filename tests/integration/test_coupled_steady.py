"""The coupled solve: balances, limits, symmetry of rotating parts, and what it refuses."""

import dataclasses
import math
import re
import types

import numpy as np
import pytest

from spindle_fem.definition.exchange_tables import SeatSurface
from spindle_fem.definition.load import load_machine
from spindle_fem.errors import CheckFailedError, ConvergenceError, FaultsError, NoSteadyStateError
from spindle_fem.machine.geometry.joint_groups import group_of_contacts
from spindle_fem.model.mesh.steady_conduction import solve_steady
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.solvers import coupled_steady
from spindle_fem.solvers.coupled_steady import LINEAR_RESIDUAL_LIMIT, solve_coupled
from spindle_fem.solvers.preload_runaway import equilibria_above
from spindle_fem.solvers.prepared_machine import machine_on_mesh, prepare_machine, without_expansion
from spindle_fem.solvers.solution_branch import Branch
from spindle_fem.studies.run_checks import require_checks
from spindle_fem.studies.solve_machine import estimate_refinement, solve_prepared
from tests.support.near_rings import NEAR_RINGS

RPM = math.pi / 30.0


def test_energy_and_coolant_close(recorded_result):
    assert abs(recorded_result.energy.imbalance_relative) < 1e-10
    checks = {check.name: check for check in recorded_result.checks}
    assert checks["coolant enthalpy"].value < 1e-8
    assert all(check.passed for check in recorded_result.checks)
    assert recorded_result.energy.heat_in == pytest.approx(2 * 155 + 140 + 2 * 85)


def test_coolant_takes_what_its_temperature_rise_says(recorded_result):
    coolant = recorded_result.coolant
    oil = 873.3 * 1858.0  # density and heat capacity of equation 29 at 15 °C
    assert coolant.heat == pytest.approx(
        oil * coolant.flow * (coolant.outlet_temperature - coolant.inlet_temperature), rel=1e-3
    )
    assert coolant.mean_film_coefficient == pytest.approx(243.2, rel=1e-3)


def test_a_solution_is_not_taken_while_its_equations_are_not_solved(small, monkeypatch):
    """The last linear solve may end early where the loads had just moved the field."""
    point = OperatingPoint.of(small.spec)
    usual = solve_coupled(small, point)
    number = 0

    def loose(*arguments, **settings):
        nonlocal number
        number += 1
        found = solve_steady(*arguments, **settings)
        return dataclasses.replace(found, residual=2e-9) if number <= usual.iterations else found

    monkeypatch.setattr("spindle_fem.solvers.coupled_steady.solve_steady", loose)
    found = solve_coupled(small, point)
    assert found.iterations == usual.iterations + 1
    assert found.solution.residual <= LINEAR_RESIDUAL_LIMIT


def test_channel_wall_has_the_exact_helical_area(recorded_result):
    assert recorded_result.coolant.wetted_area == pytest.approx(0.1562, rel=1e-3)


def test_temperatures_rise_in_proportion_to_heat(small):
    """With films, flow and oil properties fixed, double heat is double rise over one ambient."""
    spec = small.spec
    table = spec.heat.table
    doubled = table.model_copy(
        update={"heat": {name: tuple(2.0 * value for value in row) for name, row in table.heat.items()}}
    )
    point = dataclasses.replace(
        OperatingPoint.of(spec), coolant_inlet_temperature=290.75, ambient_temperature=290.75
    )
    single = solve_prepared(small, point)
    heated = spec.model_copy(update={"heat": spec.heat.model_copy(update={"table": doubled})})
    twice = solve_prepared(machine_on_mesh(heated, small.mesh, small.operators), point)
    rise, doubled_rise = single.temperature - 290.75, twice.temperature - 290.75
    assert np.abs(doubled_rise - 2.0 * rise).max() < 1e-6 * rise.max()


def test_no_heat_leaves_the_machine_between_its_surroundings(small):
    point = dataclasses.replace(OperatingPoint.of(small.spec), speed=0.0)
    result = solve_prepared(small, point)
    assert result.energy.heat_in == 0.0
    assert result.temperature.min() > 288.15 - 1e-9
    assert result.temperature.max() < 290.75 + 1e-9


def test_rotating_parts_are_uniform_around_the_axis(recorded_result):
    assert _first_harmonic(recorded_result, "F1.inner_raceway") < 0.01
    assert _first_harmonic(recorded_result, "F1.outer_raceway") > 0.1


def test_without_averaging_the_inner_ring_follows_the_outer_one(small, small_result):
    spec = small.spec
    kept = spec.model_copy(update={"mesh": spec.mesh.model_copy(update={"circumferential_averaging": False})})
    local = solve_prepared(machine_on_mesh(kept, small.mesh, small.operators))
    averaged = _first_harmonic(small_result, "F1.inner_raceway")
    assert _first_harmonic(local, "F1.inner_raceway") > 5.0 * averaged
    assert local.probes["SP01"] == pytest.approx(small_result.probes["SP01"], abs=0.2)


def _first_harmonic(result, surface):
    """Amplitude in K of the first harmonic around the axis on a cylindrical surface."""
    nodes = np.unique(result.mesh.surfaces[surface])
    x, y, z = result.mesh.points[nodes].T
    along = np.polynomial.chebyshev.chebvander(2.0 * (z - z.min()) / np.ptp(z) - 1.0, 4)
    radius = np.hypot(x, y)
    columns = np.column_stack([along, x / radius, y / radius])
    coefficients, *_ = np.linalg.lstsq(columns, result.temperature[nodes], rcond=None)
    return np.hypot(*coefficients[-2:])


def test_linear_and_quadratic_temperatures_agree(small_result, recorded_result):
    assert small_result.n_unknowns < recorded_result.n_unknowns / 3
    for name, value in recorded_result.probes.items():
        # Straight temperatures on elements of 10-20 mm; the rings alone span 15 K.
        assert small_result.probes[name] == pytest.approx(value, abs=0.5)


def test_ring_difference_is_what_the_ball_row_and_heat_make_of_it(recorded_result):
    bearing = recorded_result.bearings["F1"]
    assert bearing.temperature_outer < bearing.temperature_ball < bearing.temperature_inner
    assert bearing.ring_difference == pytest.approx(18.0, abs=1.5)


def test_reference_run_reports_every_friction_term(reference_result):
    terms = reference_result.bearings["F1"].terms
    assert sum(terms.values()) == pytest.approx(reference_result.bearings["F1"].heat)
    assert terms["inner_rolling"] > terms["ball_drag"] > terms["inner_sliding"]
    codes = {warning.code for warning in reference_result.warnings}
    assert "thermal_preload_omitted" not in codes
    assert "coolant_film_extrapolated" in codes


def test_the_reference_run_is_a_state_that_its_preload_allows(reference_result):
    """Rings some kelvins apart, preload of two to four times that of assembly, fits that hold."""
    equilibrium = reference_result.equilibrium
    assert equilibrium.followed
    assert 2.0 < equilibrium.preload_ratio["F3"] < 4.0
    assert not equilibrium.limits
    for name in ("F1", "F2", "F3"):
        assert 3.0 < reference_result.bearings[name].ring_difference < 8.0
        assert reference_result.growth.seats[name, "shaft"].pressure > 0.0


@pytest.fixture(scope="module")
def rigid_result(reference):
    return solve_prepared(without_expansion(reference))


def test_bearings_of_the_size_of_assembly_say_what_is_left_out(rigid_result, reference_result):
    (text,) = [item.text for item in rigid_result.warnings if item.code == "thermal_preload_omitted"]
    told = re.search(r"preload of F3 would be (\d+) N instead of (\d+) N.* (\d+) W instead of (\d+) W", text)
    hot, cold, more, less = (float(value) for value in told.groups())
    assert hot > 1.3 * cold
    assert less == pytest.approx(rigid_result.bearings["F3"].heat, abs=0.5)
    assert less < more < 1.5 * reference_result.bearings["F3"].heat


def test_heat_enters_balls_and_rings_by_the_share(reference_result):
    bearing = reference_result.bearings["F1"]
    assert bearing.heat_to["balls"] == pytest.approx(0.5 * bearing.heat)
    assert bearing.heat_to["inner"] == pytest.approx(bearing.heat_to["outer"])


@pytest.mark.parametrize("model", ["palmgren", "skf", "paper"])
def test_every_heat_model_finds_its_fixed_point(reference, model):
    """Palmgren with cold grease first asks for more heat than its viscosity fit reaches."""
    chosen = [f"heat.model={model}", "heat.thermal_preload=false"]
    whole = [f"bearing_set.{name}.heat_factor=1" for name in ("front", "rear")]
    spec = load_machine("wu_tan_2016", ["mesh.preset=coarse", "mesh.order=1", *chosen, *whole])
    result = solve_prepared(machine_on_mesh(spec, reference.mesh, reference.operators))
    assert all(check.passed for check in result.checks)
    expected = {"palmgren": 300.0, "skf": 500.0, "paper": 17.0}[model]
    assert result.bearings["F1"].heat == pytest.approx(expected, rel=0.2)


def test_grease_beyond_its_limit_fails_the_run(small):
    spec = small.spec
    cool_grease = spec.model_copy(
        update={"grease": spec.grease.model_copy(update={"temperature_limit": 310.0})}
    )
    result = solve_prepared(machine_on_mesh(cool_grease, small.mesh, small.operators))
    with pytest.raises(CheckFailedError, match=r"grease temperature 50\..* degC \(limit 36\.85\)"):
        require_checks(result.checks, "recorded")


@pytest.fixture(scope="module")
def following():
    return prepare_machine(
        load_machine(
            "wu_tan_2016",
            ["mesh.preset=coarse", "mesh.order=1", *NEAR_RINGS, "operation.speed=1000rpm"],
        )
    )


@pytest.fixture(scope="module")
def followed_result(following):
    return solve_prepared(following, find_fold=True)


def test_a_followed_preload_grows_and_its_fold_lies_above_the_running_speed(followed_result):
    equilibrium = followed_result.equilibrium
    assert equilibrium.followed
    assert equilibrium.preload_ratio["F3"] > 2.0
    assert 1000.0 * RPM < equilibrium.fold_speed < 1500.0 * RPM
    assert all(check.passed for check in followed_result.checks)


def test_fits_of_the_state_are_those_that_the_growth_shows(followed_result, following):
    """The heat model and the growth after the run solve the same contact problem."""
    point = OperatingPoint.of(following.spec)
    heats = solve_coupled(following, point).loads.bearing_heat
    for (bearing, side), state in followed_result.growth.seats.items():
        pressure = heats[bearing].seat_pressure[("shaft", "housing").index(side)]
        assert pressure == pytest.approx(state.pressure, rel=1e-3, abs=1e3)


def test_seats_that_follow_their_fits_conduct_better_where_the_rings_press(following, followed_result):
    spec = following.spec
    joints = tuple(
        joint.model_copy(update={"seat": SeatSurface()}) if "ring_seats" in joint.name else joint
        for joint in spec.joint
    )
    changed = machine_on_mesh(spec.model_copy(update={"joint": joints}), following.mesh, following.operators)
    state = solve_coupled(changed, OperatingPoint.of(spec))
    factors = state.loads.change.coefficients
    assert factors["joint.F3.outer_ring|housing"] > 1.5
    assert not any(name.endswith(":face") for name in factors)
    assert state.loads.bearing_heat["F3"].preload < followed_result.bearings["F3"].preload


@pytest.mark.parametrize(("end", "kind"), [("fold", NoSteadyStateError), ("end", ConvergenceError)])
def test_what_creeps_on_beyond_a_fold_is_a_runaway_and_below_it_is_not(monkeypatch, end, kind):
    """Stand-ins for the branch: it turns at 99 % of the speed asked for, or reaches it."""
    asked = OperatingPoint.of(load_machine("uncooled"))
    limit = asked.speed * (0.99 if end == "fold" else 1.0)
    branch = Branch(np.array([limit]), np.ones((1, 1)), end, limit, np.ones(1))

    def settle(machine, point, start, beyond):
        if point.speed > limit or end == "end":
            raise ConvergenceError(machine.spec.name, "temperatures still change by 0.6.")
        return types.SimpleNamespace(loads=None, solution=None)

    monkeypatch.setattr(coupled_steady, "_settle", settle)
    monkeypatch.setattr(coupled_steady, "equilibria_above", lambda *_: branch)
    response = types.SimpleNamespace(branch=lambda end: branch)
    monkeypatch.setattr(coupled_steady, "HeatResponse", lambda *_: response)
    machine = types.SimpleNamespace(spec=types.SimpleNamespace(name="crept", follows_preload=True))
    told = rf"fold at {limit / RPM:.0f} rpm" if end == "fold" else "still change by"
    with pytest.raises(kind, match=told):
        solve_coupled(machine, asked)


@pytest.mark.slow
def test_rigid_preload_runs_away_and_says_where_equilibria_end(following):
    point = OperatingPoint.of(following.spec)
    with pytest.raises(
        NoSteadyStateError, match=r"no thermal equilibrium at 3000 rpm.*fold at \d+ rpm"
    ) as told:
        solve_coupled(following, dataclasses.replace(point, speed=3000.0 * RPM))
    fold = float(re.search(r"fold at (\d+) rpm", str(told.value))[1]) * RPM
    slower = dataclasses.replace(point, speed=0.98 * fold)
    state = solve_coupled(following, slower)
    assert state.loads.bearing_heat["F2"].preload > 2000.0
    # films, oil and joints of the fold: from a third below it comes out where it does from just below
    found = []
    for share in (0.67, 0.98):
        below = dataclasses.replace(point, speed=share * fold)
        state = solve_coupled(following, below)
        found.append(equilibria_above(following, below, 1.5 * fold, state.loads, state.solution).limit)
    assert found[0] == pytest.approx(found[1], rel=4e-3)
    assert found[1] == pytest.approx(fold, rel=1e-2)


def test_spring_preload_keeps_its_force_when_the_rings_grow():
    spec = load_machine(
        "wu_tan_2016",
        [
            "mesh.preset=coarse",
            "mesh.order=1",
            *NEAR_RINGS,
            # Warm rings lose their fit: the equilibrium of the sprung sets ends near 3000 rpm.
            "operation.speed=1500rpm",
            "bearing_set.front.preload_kind=spring",
            "bearing_set.rear.preload_kind=spring",
        ],
    )
    result = solve_prepared(prepare_machine(spec))
    assert result.bearings["F3"].preload == pytest.approx(1137.2, rel=1e-3)
    assert result.bearings["F3"].contact_angle_inner < math.radians(15.0)


def test_second_mesh_estimates_the_error(recorded, recorded_result):
    refined = estimate_refinement(recorded_result, recorded.spec)
    estimate = refined.extra["mesh_refinement"]
    assert estimate["second_nodes"] > 1.5 * estimate["nodes"]
    assert set(estimate["estimate_K"]) == {*recorded_result.probes, "hottest"}
    assert max(estimate["estimate_K"].values()) < 0.2


def test_contacts_need_one_group_each(recorded):
    spec = recorded.spec
    first, *others = spec.joint
    faulty = spec.model_copy(
        update={
            "joint": (
                first.model_copy(update={"contacts": ("F1.inner_ring|shaft", "X*|shaft")}),
                others[0].model_copy(update={"contacts": (*others[0].contacts, "F1.inner_ring|shaft")}),
                *others[1:],
            )
        }
    )
    with pytest.raises(FaultsError) as error:
        group_of_contacts(faulty, recorded.mesh.joints)
    text = str(error.value)
    assert '"X*|shaft" is no contact of this machine.' in text
    assert 'the contact "F2.inner_ring|shaft" has no conductance.' in text
    assert (
        'the contact "F1.inner_ring|shaft" is claimed by inner_ring_seats and front_outer_ring_seats' in text
    )


def test_effects_act_where_balls_follow_their_contacts(reference, rigid_result, tmp_path):
    text = 'schema = "spindle-fem/machine/1"\nname = "more"\nbase = "wu_tan_2016"\n[[effect]]\n'
    text += 'effect = "heat_scale"\ncomponent = "front_bearings"\nparameters = {"heat.front" = 1.5}\n'
    (tmp_path / "more.toml").write_text(text, encoding="utf-8")
    chosen = ["mesh.preset=coarse", "mesh.order=1", "heat.thermal_preload=false"]
    spec = load_machine(tmp_path / "more.toml", chosen)
    assert spec.bearing_set[0].ball_row.kind == "contact"
    more = solve_prepared(dataclasses.replace(without_expansion(reference), spec=spec))
    heat, usual = (
        sum(bearing.heat for name, bearing in found.bearings.items() if name.startswith("F"))
        for found in (more, rigid_result)
    )
    # warmer grease takes some of it back
    assert 1.1 * usual < heat < 1.5 * usual
