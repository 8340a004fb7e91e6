import numpy as np
import pytest

from spindle_fem.errors import OutOfValidityError
from spindle_fem.physics.coolant.channel_section import ChannelSection
from spindle_fem.physics.coolant.coolants.iso_vg_32 import OilIsoVg32
from spindle_fem.physics.coolant.coolants.water import Water
from spindle_fem.physics.coolant.regimes import FILM_MODELS, ChannelState, select_film
from spindle_fem.physics.coolant.user_coolant import UserCoolant
from spindle_fem.studies.sweep.film_map import film_map

CHANNEL = ChannelSection(0.108, 0.010, 0.012, 0.024, 5.0)
OIL = OilIsoVg32()
LITRE_PER_MINUTE = 1e-3 / 60.0


def film(model, litres=20.0, celsius=31.0, wall=None, coolant=OIL, channel=CHANNEL):
    walls = None if wall is None else np.asarray(wall) + 273.15
    state = ChannelState(coolant, litres * LITRE_PER_MINUTE, np.asarray(celsius) + 273.15, walls)
    return select_film(model, channel, state)


def codes(result):
    return [warning.code for warning in result.warnings]


@pytest.mark.parametrize("model", FILM_MODELS)
def test_scalar_state_gives_plain_numbers(model):
    found = film(model)
    assert type(found.value) is float
    assert type(found.regime) is str
    assert type(found.in_range) is bool
    assert found.low <= found.value <= found.high


@pytest.mark.parametrize("model", FILM_MODELS)
@pytest.mark.parametrize("litres", [2.0, 20.0, 90.0, 400.0, 1500.0])
def test_arrays_answer_as_scalars_do(model, litres):
    celsius = np.array([12.0, 20.0, 31.0, 44.0])
    together = film(model, litres, celsius, wall=celsius + 5.0)
    for index, one in enumerate(celsius):
        alone = film(model, litres, one, wall=one + 5.0)
        for name in ("value", "low", "high", "reynolds", "prandtl"):
            assert getattr(together, name)[index] == pytest.approx(getattr(alone, name), rel=1e-12)
        assert together.regime[index] == alone.regime
        assert together.in_range[index] == alone.in_range
    assert not together.value.flags.writeable


def test_helical_takes_oil_measurements_inside_their_range():
    # Re 652, Pr 562 by hand: Seban & McLaughlin f = 0.1695, Nu = 22.3; Janssen & Hoogendoorn
    # 0.7·16.22·2.872·0.8088 = 26.38; k/D_h = 12.60.
    found = film("helical")
    assert found.value == pytest.approx(np.sqrt(22.3 * 26.38) * 12.60, rel=3e-3)
    assert found.source.startswith("Seban & McLaughlin")
    assert found.in_range
    assert codes(found) == []


def test_cold_oil_leaves_the_prandtl_range_and_says_so():
    found = film("helical", celsius=15.0)
    assert not found.in_range
    assert codes(found) == ["coolant_film_extrapolated"]
    assert "prandtl is 1214" in found.warnings[0].text
    # Widened, and never below the straight duct that the coil can only improve.
    assert found.low == pytest.approx(found.value / 1.25, rel=1e-9)
    assert found.high == pytest.approx(found.candidates["schmidt"], rel=1e-9)


def test_water_takes_the_theory_of_manlapaz_and_churchill():
    found = film("helical", litres=2.0, celsius=20.0, coolant=Water())
    assert found.regime == "laminar"
    assert found.value == pytest.approx(found.candidates["manlapaz_churchill"], rel=1e-12)
    assert "Seban" not in found.source


@pytest.mark.parametrize(
    ("prandtl", "oil"), [(30.0, 0.0), (np.sqrt(3000.0), 0.5), (100.0, 1.0), (102.0, 1.0)]
)
def test_theory_and_measurements_are_blended_on_the_logarithm_of_prandtl(prandtl, oil):
    viscosity = prandtl * 0.15 / (2000.0 * 900.0)
    thin = UserCoolant(
        "thin",
        300.0,
        900.0,
        2000.0,
        0.15,
        (290.0, 310.0),
        (viscosity,) * 2,
        280.0,
        330.0,
        viscosity_law="andrade",
    )
    found = film("helical", 5.0, 25.0, coolant=thin)
    assert found.prandtl == pytest.approx(prandtl)
    known = found.candidates
    measured = np.sqrt(known["seban_mclaughlin"] * known["janssen_hoogendoorn"])
    expected = known["manlapaz_churchill"] ** (1.0 - oil) * measured**oil
    assert found.value == pytest.approx(expected, rel=1e-12)


def test_slow_flow_in_a_short_channel_develops_as_in_a_straight_duct():
    short = ChannelSection(0.108, 0.010, 0.012, 0.024, 1.0)
    found = film("helical", litres=3.0, celsius=15.0, channel=short)
    assert found.value == pytest.approx(found.candidates["straight_developing"], rel=1e-12)
    assert found.in_range


@pytest.mark.parametrize(
    ("litres", "regime"), [(20.0, "laminar"), (300.0, "transition"), (1300.0, "turbulent")]
)
def test_regimes_of_the_coil(litres, regime):
    assert film("helical", litres).regime == regime
    # The laminar formula does not make the flow laminar.
    assert film("sieder_tate", litres).regime == regime


def test_turbulent_band_holds_the_straight_duct_and_the_scatter_of_the_data():
    tight = film("helical", 1300.0)
    straight, curved = tight.candidates["gnielinski_straight"], tight.candidates["gnielinski_helical"]
    assert tight.value == curved
    assert tight.low == pytest.approx(min(straight, curved / 1.15), rel=1e-12)
    assert tight.high == pytest.approx(1.15 * curved, rel=1e-12)
    # On a wide coil curvature adds little and the scatter alone sets the low end.
    wide = film("helical", 1300.0, channel=ChannelSection(2.0, 0.010, 0.012, 0.024, 5.0))
    assert wide.low == pytest.approx(wide.value / 1.15, rel=1e-12)


def test_paper_switches_on_the_channel_depth_with_a_jump():
    edge = 2300.0 * float(OIL.properties(304.15).kinematic_viscosity) / 0.010
    flow = CHANNEL.volume_flow(edge) / LITRE_PER_MINUTE
    below, above = film("paper", flow * 0.9999), film("paper", flow * 1.0001)
    assert (below.regime, above.regime) == ("laminar", "turbulent")
    assert above.value > 1.5 * below.value
    assert not above.in_range
    text = above.warnings[0].text
    assert "prandtl is 562" in text
    assert "a coil stays laminar up to Re 7357" in text


def test_paper_and_sieder_tate_differ_by_their_length_only():
    # Both 1.86 (…)^(1/3): h goes with length^(-1/3) at equal velocity.
    ratio = film("paper").value / film("sieder_tate").value
    assert ratio == pytest.approx((CHANNEL.hydraulic_diameter / CHANNEL.depth) ** (1.0 / 3.0), rel=1e-12)


def test_sieder_tate_says_when_the_flow_is_not_laminar():
    found = film("sieder_tate", 300.0)
    assert not found.in_range
    assert "laminar Reynolds number is 9780" in found.warnings[0].text


def test_sieder_tate_corrects_for_the_wall_only_when_given():
    plain, warm = film("sieder_tate"), film("sieder_tate", wall=41.0)
    assert warm.value / plain.value == pytest.approx(np.exp(0.051 * 10.0 * 0.14), rel=1e-12)
    assert film("paper", wall=41.0).value == film("paper").value


def test_too_little_flow_leaves_the_graetz_range():
    found = film("sieder_tate", 0.1, 15.0)
    assert not found.in_range
    assert "graetz is 5.44569" in found.warnings[0].text


def test_wall_outside_the_coolants_range_is_said():
    found = film("sieder_tate", wall=70.0)
    assert codes(found) == ["coolant_wall_temperature_out_of_range"]
    assert found.value == pytest.approx(film("sieder_tate", wall=50.0).value, rel=1e-12)


def test_less_accurate_oil_properties_are_said():
    assert codes(film("sieder_tate", celsius=12.0)) == ["coolant_property_accuracy"]


def test_starts_share_the_flow():
    double = ChannelSection(0.108, 0.010, 0.012, 0.024, 5.0, starts=2)
    assert film("helical", 40.0, channel=double).value == pytest.approx(
        film("helical", 20.0).value, rel=1e-12
    )


def test_refusals():
    with pytest.raises(OutOfValidityError, match='Did you mean "helical"'):
        film("helix")
    with pytest.raises(OutOfValidityError, match=r"volume_flow is 0.*Set coolant\.flow above 0"):
        film("helical", 0.0)
    with pytest.raises(OutOfValidityError, match="allowed 10 to 50"):
        film("helical", celsius=55.0)


class TestFilmMap:
    DEPTHS = np.array([0.005, 0.010, 0.019, 0.030])
    TEMPERATURES = np.linspace(10.0, 40.0, 7) + 273.15

    def test_at_constant_velocity_the_paper_breaks_at_its_reynolds_number(self):
        chart = film_map("paper", CHANNEL, OIL, self.DEPTHS, self.TEMPERATURES, velocity=5.7)
        viscosity = OIL.properties(self.TEMPERATURES).kinematic_viscosity
        expected = 5.7 * self.DEPTHS[:, None] / viscosity > 2300.0
        assert ((chart.regime == "turbulent") == expected).all()
        # Below 10 mm it is laminar at every temperature, as the paper says.
        assert (chart.regime[:2] == "laminar").all()
        assert chart.regime[2, -1] == "turbulent"
        assert np.allclose(chart.velocity, 5.7)
        assert np.allclose(chart.volume_flow, 5.7 * 0.012 * self.DEPTHS)
        codes = [warning.code for warning in chart.warnings]
        assert "coolant_film_extrapolated" in codes
        assert len(set(chart.warnings)) == len(chart.warnings)

    def test_at_constant_flow_a_deeper_channel_is_slower_and_worse(self):
        chart = film_map(
            "helical", CHANNEL, OIL, self.DEPTHS, self.TEMPERATURES, volume_flow=20 * LITRE_PER_MINUTE
        )
        assert (np.diff(chart.velocity) < 0.0).all()
        assert (np.diff(chart.value, axis=0) < 0.0).all()
        assert chart.value[1, 1] == pytest.approx(film("helical", celsius=15.0).value, rel=1e-12)
        assert ((chart.low <= chart.value) & (chart.value <= chart.high)).all()

    @pytest.mark.parametrize("given", [{}, {"velocity": 1.0, "volume_flow": 1e-4}])
    def test_exactly_one_of_velocity_and_flow(self, given):
        with pytest.raises(OutOfValidityError, match="Give exactly one of them"):
            film_map("paper", CHANNEL, OIL, self.DEPTHS, self.TEMPERATURES, **given)


@pytest.mark.parametrize("model", FILM_MODELS)
@pytest.mark.parametrize("litres", [20.0, 400.0, 1500.0])
def test_the_value_alone_is_that_of_the_band(model, litres):
    state = ChannelState(OIL, litres * LITRE_PER_MINUTE, np.array([285.0, 304.0]), np.array([290.0, 300.0]))
    whole, alone = (select_film(model, CHANNEL, state, bounds=bounds) for bounds in (True, False))
    for name in ("value", "regime", "in_range", "warnings", "source"):
        assert np.array_equal(getattr(whole, name), getattr(alone, name))
    assert np.array_equal(alone.low, alone.value)
    assert np.array_equal(alone.high, alone.value)
