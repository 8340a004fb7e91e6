"""Rules of the catalogue against rows of a maker's.

IBC Wälzlager GmbH, High Precision Bearings, TI-I-5050.0 / E, September 2010: sections 2.3 (load ratings),
2.4 (preloads of class H of single bearings), 3.3 (E, C0r of cylindrical roller bearings). Balls and rollers
are not printed there; their sizes show in the static load ratings (ISO 76). The tolerances are the spread
between the rows, whose sections do not follow one rule.

NTN-SNR, ULTAGE series 70 and 79 (DOC.IMTO.ULTAGEARG1RUa, 2015): boundary dimensions, static load ratings,
limiting speeds in grease and oil, preload and axial stiffness of a pair before mounting. Stiffness tells
number and size of balls at once.
"""

from __future__ import annotations

import math

import pytest

from spindle_fem.definition.bearing_catalogue import (
    boundary_dimensions,
    catalogue_bearing,
    preload_of_class,
)
from spindle_fem.definition.bearing_types import BallBearingType, RollerBearingType
from spindle_fem.physics.bearings.bearing_geometry import BearingGeometry
from spindle_fem.physics.bearings.bearing_kinds import BEARING_KINDS
from spindle_fem.physics.bearings.catalogue_friction import static_load_rating
from spindle_fem.physics.bearings.preload import axial_state

# Outer raceway, mm.
RACEWAYS = {
    "NN3005": 41.3, "NN3006": 48.5, "NN3009": 67.5, "NN3010": 72.5, "NN3012": 86.1, "NN3013": 91.0,
    "NN3016": 113.0, "NN3019": 132.0, "N1021": 145.5, "N1022": 155.0, "N1024": 165.0, "N1026": 182.0,
    "N1028": 192.0, "N1030": 205.5, "N1032": 220.0, "N1034": 237.0, "N1036": 255.0, "N1038": 265.0,
    "N1040": 281.0,
}  # fmt: skip
# N; without NN3006 and NN3007, whose rollers must be 5 mm thick.
ROLLER_RATINGS = {
    "NN3005": 30200, "NN3008": 59400, "NN3009": 72200, "NN3010": 80100, "NN3011": 100500, "NN3012": 110600,
    "NN3013": 116700, "NN3014": 150500, "NN3015": 156300, "NN3016": 186300, "NN3017": 200500,
    "NN3018": 224600, "NN3019": 236400, "NN3020": 245300, "NN3021": 310500, "NN3022": 360400,
    "NN3024": 390100, "NN3026": 501000, "NN3028": 522000, "NN3030": 586000, "NN3032": 672000,
    "NN3034": 802000, "NN3036": 1003000, "NN3038": 1042000, "NN3040": 1204000, "N1008": 30800,
    "N1010": 41700, "N1012": 55200, "N1014": 81700, "N1016": 98500, "N1018": 125900, "N1020": 135000,
    "N1024": 208000, "N1030": 311000, "N1040": 602000,
}  # fmt: skip
BALL_RATINGS = {
    "7010 C": 23000, "7012 C": 33700, "7013 C": 35800, "7014 C": 43500, "7015 C": 46500, "7016 C": 58000,
    "7017 C": 60000, "7014 E": 41500, "7015 E": 44000, "7016 E": 55000, "71914 C": 28000, "71915 C": 29500,
    "7212 C": 49000, "7213 C": 58800, "7214 C": 64800, "7215 C": 70000, "7216 C": 77600, "7215 E": 66500,
}  # fmt: skip
# N, class H.
PRELOADS = {
    "71921 C": 1710, "71924 C": 2250, "71928 C": 3090, "71934 C": 4600, "71940 C": 6410, "71920 E": 2190,
    "71928 E": 4380, "71940 E": 9160, "7015 C": 1410, "7018 C": 2030, "7020 C": 2510, "7024 C": 3640,
    "7030 C": 5730, "7040 C": 10310, "7015 E": 1970, "7020 E": 3450, "7030 E": 7670, "7040 E": 13580,
    "7214 C": 1990, "7220 C": 4020, "7228 C": 7850, "7214 E": 2680, "7220 E": 5480, "7228 E": 10820,
}  # fmt: skip

# Bore, outside, width [mm]; C0 [N]; limiting speeds in grease and oil [rpm]; preload of a pair [N] and its
# axial stiffness [N/µm].
ULTAGE = {
    "7006 C": (30, 55, 13, 11000, 27200, 43600, 98, 48.0),
    "7008 C": (40, 68, 15, 16800, 21700, 34700, 127, 60.1),
    "7010 C": (50, 80, 16, 23100, 18000, 28800, 157, 70.5),
    "7012 C": (60, 95, 18, 32500, 15100, 24200, 216, 79.6),
    "7014 C": (70, 110, 20, 45000, 13000, 20800, 294, 95.4),
    "7016 C": (80, 125, 22, 58000, 11400, 18300, 365, 106.3),
    "7018 C": (90, 140, 24, 72500, 10200, 16300, 440, 117.4),
    "7020 C": (100, 150, 24, 81000, 9400, 15000, 460, 126.1),
    "7026 C": (130, 200, 33, 144000, 7100, 11400, 800, 163.2),
    "7006 E": (30, 55, 13, 10500, 23600, 38100, 147, 104.8),
    "7010 E": (50, 80, 16, 21900, 15600, 25200, 255, 162.0),
    "7014 E": (70, 110, 20, 43000, 11300, 18200, 460, 225.2),
    "7020 E": (100, 150, 24, 76500, 8100, 13100, 740, 300.0),
    "7026 E": (130, 200, 33, 136000, 6200, 9900, 1270, 390.0),
    "71910 C": (50, 72, 12, 16600, 19200, 30700, 118, 62.5),
    "71914 C": (70, 100, 16, 30000, 13800, 22100, 177, 83.9),
    "71918 C": (90, 125, 18, 46000, 10900, 17400, 255, 105.0),
    "71920 C": (100, 140, 20, 61000, 9800, 15600, 325, 118.5),
    "71926 C": (130, 180, 24, 102000, 7600, 12100, 510, 147.4),
    "71910 E": (50, 72, 12, 15800, 16600, 26900, 177, 138.4),
    "71914 E": (70, 100, 16, 28600, 11900, 19300, 284, 194.0),
    "71920 E": (100, 140, 20, 57500, 8500, 13700, 510, 273.7),
    "71926 E": (130, 180, 24, 95000, 6600, 10600, 800, 350.0),
}  # fmt: skip


def balls(designation):
    kind = BallBearingType.model_validate(catalogue_bearing(designation))
    return BearingGeometry(kind.ball_diameter, kind.ball_count, kind.pitch, kind.contact_angle, 0.52, 0.52)


@pytest.mark.parametrize("designation", ULTAGE)
def test_balls_of_another_maker(designation):
    *dimensions, rating, _, _, preload, stiffness = ULTAGE[designation]
    assert [1e3 * value for value in boundary_dimensions(designation)[:3]] == pytest.approx(dimensions)
    assert static_load_rating(balls(designation)) == pytest.approx(rating, rel=0.14)
    found = 2.0e-6 * axial_state(balls(designation), preload).stiffness
    assert found == pytest.approx(stiffness, rel=0.12)


@pytest.mark.parametrize("designation", ULTAGE)
def test_attainable_speeds_of_spindle_bearings(designation):
    bore, outside, _, _, grease, oil, _, _ = ULTAGE[designation]
    limits = BEARING_KINDS["angular_contact_ball"].attainable_speeds
    angle = balls(designation).contact_angle
    assert limits.at(angle, "grease") == pytest.approx(0.5 * (bore + outside) * grease, rel=0.02)
    assert limits.at(angle, "oil") == pytest.approx(0.5 * (bore + outside) * oil, rel=0.02)


def rollers(designation):
    return RollerBearingType.model_validate(catalogue_bearing(designation))


@pytest.mark.parametrize("designation", RACEWAYS)
def test_outer_raceways(designation):
    assert 1e3 * rollers(designation).outer_ring_inner_diameter == pytest.approx(
        RACEWAYS[designation], rel=0.007
    )


@pytest.mark.parametrize("designation", ROLLER_RATINGS)
def test_rollers_by_their_static_rating(designation):
    kind = rollers(designation)
    size, length = 1e3 * kind.roller_diameter, 1e3 * kind.roller_length
    # ISO 76: 44 (1 - D/d_m) i Z L D
    rating = 44.0 * (1.0 - kind.roller_diameter / kind.pitch) * kind.rows * kind.roller_count * length * size
    assert rating == pytest.approx(ROLLER_RATINGS[designation], rel=0.11)


@pytest.mark.parametrize("designation", BALL_RATINGS)
def test_balls_by_their_static_rating(designation):
    kind = BallBearingType.model_validate(catalogue_bearing(designation))
    geometry = BearingGeometry(
        kind.ball_diameter, kind.ball_count, kind.pitch, kind.contact_angle, 0.52, 0.52
    )
    assert static_load_rating(geometry) == pytest.approx(BALL_RATINGS[designation], rel=0.18)


@pytest.mark.parametrize("designation", PRELOADS)
def test_heavy_preload(designation):
    assert preload_of_class(designation, "heavy") == pytest.approx(PRELOADS[designation], rel=0.05)


def test_classes_stand_as_the_maker_s():
    # 7040 C: 1145 N (X), 2290 N (L), 5150 N (M), 10310 N (H)
    light, medium, heavy = (preload_of_class("7040 C", name) for name in ("light", "medium", "heavy"))
    assert light / heavy == pytest.approx(2290 / 10310, rel=0.01)
    assert medium / heavy == pytest.approx(5150 / 10310, rel=0.01)
    assert preload_of_class("NN3014 K", "light") is None


@pytest.mark.parametrize(
    ("designation", "millimetres"),
    # widths of sections 2.3 and 3.2, where their columns are sure
    [("NN3021", 41), ("NN3028", 53), ("NN3034", 67), ("NN3036", 74), ("NN3040", 82), ("N1040", 51)],
)
def test_widths(designation, millimetres):
    assert math.isclose(1e3 * boundary_dimensions(designation)[2], millimetres)
