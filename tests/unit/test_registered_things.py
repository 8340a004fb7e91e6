"""Everything an option may name: found by its file, inside its range an answer, outside a refusal."""

from importlib import import_module
from pkgutil import walk_packages

import numpy as np
import pytest

import spindle_fem.physics
from scripts.definition_page import options
from spindle_fem.correlation import Correlation
from spindle_fem.definition.bearing_types import has_rollers
from spindle_fem.definition.exchange_tables import Coolant as CoolantTable
from spindle_fem.errors import OutOfValidityError, SpecError
from spindle_fem.physics.bearings.bearing_geometry import BearingGeometry
from spindle_fem.physics.bearings.bearing_kinds import BEARING_KINDS
from spindle_fem.physics.bearings.bearing_set import solve_bearing
from spindle_fem.physics.bearings.catalogue_friction import static_equivalent_load
from spindle_fem.physics.bearings.grease import Lubricant
from spindle_fem.physics.bearings.heat_model import HeatOptions, friction_model_names
from spindle_fem.physics.bearings.mounting import ExternalLoad, uniform_temperatures
from spindle_fem.physics.bearings.roller_bearing import RollerGeometry
from spindle_fem.physics.bearings.roller_set import RollerSet, solve_roller_set
from spindle_fem.physics.coolant.channel_section import ChannelSection
from spindle_fem.physics.coolant.coolants import COOLANTS
from spindle_fem.physics.coolant.film_correlation import nusselt_correlation
from spindle_fem.physics.coolant.film_models import FILM_MODELS
from spindle_fem.physics.coolant.regimes import ChannelState, select_film
from spindle_fem.physics.surroundings.air_gaps import AirGap
from spindle_fem.physics.surroundings.gap_laws import GAP_LAWS
from spindle_fem.physics.surroundings.rotating_films import ROTATING_FILMS
from spindle_fem.physics.surroundings.rotating_surfaces import rotating_film
from spindle_fem.registry import ADDED, Registry, registry

REGISTRIES = sorted({things.package for things in options().values()})
NAMED = [(package, name) for package in REGISTRIES for name in registry(package)]


def _correlations() -> dict[str, Correlation]:
    """Every correlation of the package by name."""
    found = {}
    for module in walk_packages(spindle_fem.physics.__path__, "spindle_fem.physics."):
        for item in vars(import_module(module.name)).values():
            if isinstance(item, Correlation):
                found[item.name] = item
    return found


CORRELATIONS = _correlations()


def middle(low: float, high: float) -> float:
    """A value inside a range: the geometric middle, a decade from an end that is open or 0."""
    if low <= 0.0 and high >= 1e6:
        return 1.0
    if high >= 1e12:
        return 10.0 * max(low, 1e-3)
    return float(np.sqrt(low * high)) if low > 0.0 else 0.5 * high


def inside(known: Correlation) -> dict[str, float]:
    """Values inside all ranges of a correlation; sizes of machines where a quantity has none."""
    usual = {"reynolds": 2.0e3, "prandtl": 50.0, "pressure": 1e7, "conductivity": 44.0, "roughness": 1e-6}
    usual |= {"microhardness": 3e9, "contact_modulus": 1e11, "slope": 0.1, "separation": 1e-6}
    found = {}
    for name in known.quantities:
        low, high = known.ranges.get(name, (0.0, np.inf))
        found[name] = usual[name] if low <= usual.get(name, np.nan) <= high else middle(low, high)
    return found


@pytest.mark.parametrize(("package", "name"), NAMED)
def test_a_name_has_a_thing_and_a_line_of_text(package, name):
    things = registry(package)
    assert things[name] is things[name]
    assert things.summary(name).endswith(".")


@pytest.mark.parametrize("name", sorted(CORRELATIONS))
def test_a_correlation_answers_inside_and_refuses_outside_its_range(name):
    known = CORRELATIONS[name]
    values = inside(known)
    answer = known(**values)
    assert np.isfinite(answer)
    assert answer > 0.0
    assert "Source" in known.__doc__
    refused = 0
    for quantity, limits in known.ranges.items():
        if quantity not in known.quantities:
            continue
        for end in limits:
            outside = end + (1.0 if end == limits[1] else -1.0) * (0.01 * abs(end) + 1e-9)
            if not np.isfinite(outside) or abs(end) > 1e300:
                continue
            with pytest.raises(OutOfValidityError, match=quantity):
                known(**(values | {quantity: outside}))
            refused += 1
    assert refused


@pytest.mark.parametrize("name", FILM_MODELS)
@pytest.mark.parametrize("coolant", COOLANTS)
def test_every_film_model_takes_every_coolant(name, coolant):
    section = ChannelSection(0.108, 0.010, 0.012, 0.024, 5.0)
    film = select_film(name, section, ChannelState(COOLANTS[coolant], 3.0e-4, 300.0, 305.0))
    assert film.low <= film.value <= film.high
    assert film.value > 0.0
    assert film.source
    assert film.in_range or film.warnings


@pytest.mark.parametrize("name", COOLANTS)
def test_a_coolant_has_properties_in_its_range_alone(name):
    coolant = COOLANTS[name]
    temperatures = np.linspace(coolant.lowest_temperature, coolant.highest_temperature, 7)
    found = coolant.properties(temperatures)
    for values in (found.density, found.dynamic_viscosity, found.specific_heat_capacity, found.prandtl):
        assert np.isfinite(values).all()
        assert (values > 0.0).all()
    is_gas = found.density[0] < 10.0  # kg/m³; gases grow more viscous as they warm
    assert (np.sign(np.diff(found.dynamic_viscosity)) == (1.0 if is_gas else -1.0)).all()
    slope = np.gradient(coolant.specific_enthalpy(temperatures), temperatures)[1:-1]
    np.testing.assert_allclose(slope, found.specific_heat_capacity[1:-1], rtol=2e-3)
    for outside in (coolant.lowest_temperature - 1.0, coolant.highest_temperature + 1.0):
        with pytest.raises(OutOfValidityError, match="temperature"):
            coolant.properties(outside)


@pytest.mark.parametrize("name", GAP_LAWS)
def test_a_gap_law_grows_with_speed(name):
    slow, fast = (
        GAP_LAWS[name](AirGap(speed, 0.090, 0.092, 8.0, 12.0, 314.0, 0.75)).value for speed in (0.0, 400.0)
    )
    assert 0.0 < slow < fast


@pytest.mark.parametrize("name", ROTATING_FILMS)
def test_a_rotating_film_grows_with_speed(name):
    films = rotating_film(name, np.array([10.0, 100.0, 300.0]), 0.18)
    assert (np.diff(films.value) > 0.0).all()


@pytest.mark.parametrize("kind", [name for name in BEARING_KINDS if not has_rollers(name)])
@pytest.mark.parametrize("level", friction_model_names())
def test_every_heat_model_takes_every_kind_of_ball_bearing(kind, level):
    bearing = BearingGeometry(
        14.2875e-3,
        30,
        165e-3,
        np.radians(15.0),
        0.52,
        0.52,
        bore_diameter=0.140,
        outer_diameter=0.190,
        kind=kind,
    )
    grease = Lubricant(21e-6, 4.7e-6, pressure_viscosity=1.8e-8)
    heat = solve_bearing(bearing, 300.0, 1000.0, lubricant=grease, heat=HeatOptions(level)).heat
    assert heat.model == level
    assert np.isfinite(heat.total)
    assert heat.total > 0.0
    assert static_equivalent_load(bearing, 1000.0, 100.0) > 0.0


@pytest.mark.parametrize("kind", [name for name in BEARING_KINDS if has_rollers(name)])
@pytest.mark.parametrize("level", friction_model_names(rollers=True))
def test_every_heat_model_that_knows_rollers_takes_every_kind_of_them(kind, level):
    rollers = RollerSet(("N",), RollerGeometry(9e-3, 8e-3, 27, 91e-3, kind=kind))
    grease, warm = Lubricant(21e-6, 4.7e-6), [uniform_temperatures(1, 313.15)]
    ((found,),) = solve_roller_set(
        rollers, 300.0, ExternalLoad(0.0, 500.0), warm, lubricant=grease, heat=HeatOptions(level)
    )
    assert found.heat.model == level
    assert 0.0 < found.heat.total < 1000.0


def test_a_program_adds_its_own(monkeypatch):
    monkeypatch.setitem(ADDED, "coolants", {})
    oil = COOLANTS.add("own_oil", COOLANTS["iso_vg_32"])
    assert COOLANTS["own_oil"] is oil
    table = {"fluid": "own_oil", "inlet_temperature": "20 degC", "flow": "20 L/min"}
    assert CoolantTable.model_validate(table).fluid == "own_oil"
    with pytest.raises(ValueError, match='there is a coolant "own_oil" already'):
        COOLANTS.add("own_oil", object())


def test_a_function_of_a_program_takes_its_own_name(monkeypatch):
    monkeypatch.setitem(ADDED, "gap_laws", {})
    things = Registry("spindle_fem.physics.surroundings.gap_laws")

    @things.register
    def wide(gap):
        """Wide gap."""

    assert things["wide"] is wide
    assert things.summary("wide") == "Wide gap."
    with pytest.raises(OutOfValidityError, match='Did you mean "wide"'):
        things["wode"]


def test_a_film_correlation_that_asks_for_what_is_no_group_is_refused_at_once():
    def nusselt(dean, prandl):
        return dean * prandl

    with pytest.raises(SpecError, match=r'nusselt: "prandl" is no group of the flow. Did you mean "prandtl"'):
        nusselt_correlation(source="nobody", regime="laminar")(nusselt)
