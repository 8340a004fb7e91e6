"""Placing of labels, colour scales, tables and texts of reports."""

from __future__ import annotations

import itertools
import math
from functools import lru_cache

import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.patches import PathPatch
from matplotlib.text import Text

from spindle_fem.definition.load import load_machine
from spindle_fem.machine.meshing.simple_bodies import build_joined_tubes
from spindle_fem.report import run_tables as tables
from spindle_fem.report import table_rows
from spindle_fem.report.balance_charts import coolant_along_channel, heat_balance
from spindle_fem.report.clock_axis import clock_numbers
from spindle_fem.report.crosscheck_charts import convergence_chart, speed_chart
from spindle_fem.report.definition_tables import customary, input_groups
from spindle_fem.report.diagnosis_drawing import DOUBTED, located_on_machine
from spindle_fem.report.diagnosis_odds import finding_intervals, machine_parameters
from spindle_fem.report.figure_style import TEMPERATURE_MAP, new_figure, rasterise, scale_of, set_title
from spindle_fem.report.heat_charts import CHARTS
from spindle_fem.report.leader_labels import spread
from spindle_fem.report.machine_drawing import channel_sections, machine_drawing, part_colours
from spindle_fem.report.read_against_predicted import Course, courses_figure
from spindle_fem.report.run_outputs import draw_charts
from spindle_fem.studies.heat_study import heat_study
from tests.support.made_result import make_result


@given(st.lists(st.tuples(st.floats(-50, 150), st.floats(1, 9)), min_size=1, max_size=10))
def test_spread_labels_neither_overlap_nor_leave_the_line(items):
    wanted, widths = map(np.array, zip(*items, strict=True))
    places = spread(wanted, widths, 0.0, 100.0)
    order = np.argsort(places)
    gaps = np.diff(places[order]) - 0.5 * (widths[order][1:] + widths[order][:-1])
    assert (gaps > -1.0e-6).all()
    assert (places - 0.5 * widths > -1.0e-6).all()
    assert (places + 0.5 * widths < 100.0 + 1.0e-6).all()


def test_spread_leaves_labels_that_fit_where_they_are():
    assert spread([10.0, 50.0, 90.0], [5.0] * 3, 0.0, 100.0) == pytest.approx([10.0, 50.0, 90.0])


def test_spread_keeps_the_order_of_places():
    places = spread([30.0, 31.0, 29.0], [20.0] * 3, 0.0, 100.0)
    assert places[2] < places[0] < places[1]


def test_scale_of_a_constant_field_has_a_width():
    bar = scale_of([20.0, 20.0], TEMPERATURE_MAP, "temperature / °C")
    assert bar.low < 20.0 < bar.high


def test_temperature_map_grows_in_lightness():
    colours = TEMPERATURE_MAP(np.linspace(0.0, 1.0, 64))[:, :3]
    linear = np.where(colours <= 0.04045, colours / 12.92, ((colours + 0.055) / 1.055) ** 2.4)
    luminance = linear @ np.array([0.2126, 0.7152, 0.0722])
    assert (np.diff(luminance) > 0.0).all()


def test_figures_have_the_size_that_was_asked():
    assert rasterise(new_figure(300, 500)).shape == (300, 500, 3)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("0.019 m", "19 mm"),
        ("5e-08 m", "0.05 µm"),
        ("314.1592653589793 rad/s", "3000 rpm"),
        ("0.0003333333333333 m**3/s", "20 L/min"),
        ("0.2617993877991494 rad", "15°"),
        ("15 degC", "15 °C"),
        (["0.041 m", "0.4 m"], "41 to 400 mm"),
        ({"value": "10.0 W/m**2/K", "sigma_rel": 0.3}, "10 W/(m²·K) ± 30 %"),
        ("helical", "helical"),
        (True, "yes"),
        (0.5, "0.5"),
        (30, "30"),
    ],
)
def test_values_are_shown_in_customary_units(text, expected):
    assert customary(text) == expected


def test_inputs_carry_the_marks_of_the_file():
    import tomllib

    from spindle_fem.definition.load import write_machine

    definition = tomllib.loads(write_machine(load_machine("wu_tan_2016")))
    groups = {group["title"]: group for group in input_groups(definition)}
    cells = {row["cells"][0]: row["cells"] for row in groups["operation"]["rows"]}
    assert cells["speed"][1:] == ["3000 rpm", "P"]
    cells = {row["cells"][0]: row["cells"] for row in groups["coolant"]["rows"]}
    assert cells["flow"][1:] == ["20 L/min", "A"]
    assert cells["inlet temperature"][1:] == ["15 °C", "P"]
    parts = [row["cells"] for row in groups["part"]["rows"]]
    assert ["segment, nose: outer diameter", "180 mm", "A"] in parts
    assert ["segment, front_seat: outer diameter", "140 mm", "C"] in parts
    assert groups["operation"]["open"]
    assert not groups["part"]["open"]


def test_every_input_of_every_shipped_machine_finds_its_row():
    import tomllib

    from spindle_fem.definition.load import write_machine

    def leaves(value):
        if isinstance(value, dict) and set(value) != {"value", "sigma_rel"}:
            return sum(leaves(item) for key, item in value.items() if key != "marks")
        if isinstance(value, list) and value and isinstance(value[0], dict):
            return sum(leaves(item) - ("name" in item) for item in value)  # names are headings
        return 1

    for name in ("wu_tan_2016", "recorded_spindle", "small_two_start", "uncooled"):
        definition = tomllib.loads(write_machine(load_machine(name)))
        titles = ("schema", "name", "title", "description")
        shown = {key: value for key, value in definition.items() if key not in titles}
        rows = [row for group in input_groups(definition) for row in group["rows"] if "kind" not in row]
        assert len(rows) == leaves(shown), name
        assert all(row["cells"][0] and row["cells"][1] for row in rows)


def test_marks_do_not_cover_values_that_the_file_left_out():
    definition = {"coolant": {"marks": {"default": "P"}, "flow": "0.001 m**3/s", "film_factor": 1.0}}
    (group,) = input_groups(definition, ["coolant.film_factor"])
    assert [row["cells"][2] for row in group["rows"]] == ["P", ""]


@pytest.mark.parametrize(
    ("value", "digits", "expected"),
    [(1.25, 1, "1.2"), (-0.02, 1, "0.0"), (-3.0, 0, "−3"), (None, 1, "–"), (math.nan, 2, "–")],
)
def test_numbers_of_tables(value, digits, expected):
    assert table_rows.number(value, digits) == expected


@pytest.mark.parametrize(
    ("value", "expected"),
    [(1234.5, "1230"), (0.0, "0"), (2.6e-13, "2.60e−13"), (None, "–"), (418.0, "418"), (-0.25, "−0.25")],
)
def test_significant_digits_of_tables(value, expected):
    assert table_rows.significant(value) == expected


def test_heat_sources_are_added_up_by_bearing():
    heat = {"F1.inner_raceway": 10.0, "F1.outer_raceway": 12.0, "F1.balls": 20.0, "drive": 5.0}
    assert tables.heat_by_source(heat, ["F1"]) == {"F1": 42.0, "drive": 5.0}


def test_channel_sections_of_a_left_handed_double_start():
    channel = load_machine("wu_tan_2016").channel.model_copy(
        update={"starts": 2, "hand": "left", "turns": 1.0}
    )
    at_top = [round(1.0e3 * z, 6) for z in channel_sections(channel, 0.0)]
    assert at_top == [48.0, 60.0, 72.0]
    quarter = [round(1.0e3 * z, 6) for z in channel_sections(channel, 0.5 * np.pi)]
    assert quarter == [54.0, 66.0]


def test_part_colours_do_not_depend_on_other_parts():
    assert part_colours(["x", "shaft"])[1] == part_colours(["shaft"])[0]


@pytest.mark.render
@pytest.mark.parametrize("name", ["wu_tan_2016", "small_two_start", "uncooled"])
def test_drawings_of_the_shipped_machines_fill_their_page(name):
    pixels = rasterise(machine_drawing(load_machine(name)))
    ink = (pixels < 250).any(axis=2)
    rows, columns = np.flatnonzero(ink.any(axis=1)), np.flatnonzero(ink.any(axis=0))
    height, width = ink.shape
    assert rows[0] < 0.05 * height
    assert rows[-1] > 0.94 * height
    assert columns[0] < 0.05 * width
    assert columns[-1] > 0.93 * width


@pytest.mark.render
def test_a_closed_shape_looks_the_same_without_what_faces_away():
    from spindle_fem.report.drawn_surfaces import exposed_triangles
    from spindle_fem.report.scenes import SceneRenderer, View

    mesh = build_joined_tubes((0.03, 0.07, 0.15), 0.1, ((2, 2), 12, 3), parts=("shaft", "housing"))
    shape = exposed_triangles(mesh, mesh.points[:, 2])
    bar = scale_of(mesh.points[:, 2], TEMPERATURE_MAP, "z")
    images = []
    for closed in (False, True):
        with SceneRenderer() as renderer:
            renderer.add_coloured(shape, bar, closed=closed)
            images.append(renderer.render(View((-1.0, 0.4, -0.6), (0.0, 1.0, 0.0), mesh.points), 400).image)
    assert (images[0] < 250).any(axis=2).mean() > 0.3
    # silhouettes alone may differ, by what of a far side is seen in a fraction of a pixel
    assert (images[0] != images[1]).any(axis=2).mean() < 1e-3


@lru_cache(maxsize=16)
def texts_of(figure):
    """Every text of a figure that is drawn, with its place in pixels; drawn once, as no test changes one."""
    figure.canvas.draw()
    shown = [item for item in figure.findobj(Text) if item.get_visible() and item.get_text().strip()]
    # numbers of an axis beyond its ends are objects, but not drawn
    outside = {
        label
        for axes in figure.axes
        for axis in (axes.xaxis, axes.yaxis)
        for tick in axis.get_major_ticks() + axis.get_minor_ticks()
        if tick not in axis._update_ticks()
        for label in (tick.label1, tick.label2)
    }
    # of the text alone, without the leader of an annotation
    return {item: Text.get_window_extent(item) for item in shown if item not in outside}


def clipped(figure):
    """Texts that reach beyond the edge of a figure."""
    width, height = figure.canvas.get_width_height()
    return [
        item.get_text()
        for item, box in texts_of(figure).items()
        if box.x0 < 0.0 or box.y0 < 0.0 or box.x1 > width or box.y1 > height
    ]


@pytest.mark.parametrize("name", ["wu_tan_2016", "small_two_start", "motor_spindle", "uncooled"])
def test_no_label_of_a_machine_is_clipped_or_lies_on_another(name):
    figure = machine_drawing(load_machine(name))
    assert not clipped(figure)
    boxes = list(texts_of(figure).items())
    for number, (item, box) in enumerate(boxes):
        for other, its in boxes[number + 1 :]:
            assert not box.overlaps(its), f"{item.get_text()} on {other.get_text()}"


def test_no_label_of_profiles_is_clipped():
    charts = draw_charts(make_result())
    for name in ("axial_profiles", "radial_profiles"):
        assert not clipped(charts[name]())


def test_no_label_of_heat_charts_is_clipped_and_lines_under_others_are_wider():
    content = heat_study(load_machine("wu_tan_2016"), [100.0, 300.0, 470.0])
    figures = {name: draw(content) for name, draw in CHARTS.items()}
    assert not {name: found for name, figure in figures.items() if (found := clipped(figure))}
    # formulas are not set, since names hold dollar signs
    shown = [item.get_text() for figure in figures.values() for item in texts_of(figure)]
    assert not [text for text in shown if "mathdefault" in text]
    for axes in figures["ball_speeds"].axes:
        widths = [line.get_linewidth() for line in axes.lines]
        assert widths == sorted(widths, reverse=True)
        assert len(set(widths)) == len(widths)
        # a line that coincides with the one beneath lets it be seen
        assert all(line.get_linestyle() == "--" for line in axes.lines[1::2])
    assert all(figure.texts and figure.texts[0].get_text() for figure in figures.values())


@pytest.mark.parametrize(
    ("start", "seconds", "shown"),
    [
        ("2026-03-09T07:30:12.250Z", 6 * 3600.0, ["08:00", "09:00", "10:00", "11:00", "12:00", "13:00"]),
        ("2026-03-09T20:00:00Z", 86400.0, ["21:00", "00:00\n03-10", "03:00", "06:00"]),
        ("2026-02-27T12:00:00Z", 5 * 86400.0, ["02-28", "03-01", "03-02", "03-03", "03-04"]),
        ("2026-03-09T07:30:00Z", 0.0, ["07:30"]),
        ("2016-05-02T08:00:00Z", 1157 * 86400.0, ["2017-01", "2018-01", "2019-01"]),
    ],
)
def test_time_goes_by_the_clock_where_it_is_known(start, seconds, shown):
    places, texts, label = clock_numbers(start, seconds)
    assert texts[: len(shown)] == shown
    begin = np.datetime64(start.removesuffix("Z"), "ms")
    told = [str(begin + np.timedelta64(round(1000 * place), "ms"))[11:16] for place in places]
    if ":" in texts[0]:
        assert told == [text[:5] for text in texts]
    if label.startswith("month"):
        begun = [str(begin + np.timedelta64(round(1000 * place), "ms"))[:16] for place in places]
        assert begun == [f"{text}-01T00:00" for text in texts]
        assert places[-1] < seconds
    assert label.endswith(f"from {start[:10]}")


def test_what_is_fixed_is_not_drawn_as_found():
    fixed = {"value": 20.0, "low": 20.0, "high": 20.0, "unit": "s"}
    found = {"value": 520.0, "low": 400.0, "high": 700.0, "unit": "W"}
    item = {"effect": "unrecorded_heat_source", "component": "body"}
    assert finding_intervals([item | {"parameters": {"lag": fixed}}]) is None
    figure = finding_intervals([item | {"parameters": {"heat": found, "lag": fixed}}])
    assert len(figure.axes) == 1


def test_a_dollar_sign_in_a_name_begins_no_formula():
    from spindle_fem.report.figure_style import new_figure, plain_decades, rasterise, styled

    @styled
    def drawn():
        figure = new_figure(700.0, 800.0)
        axes = figure.add_axes((0.3, 0.3, 0.6, 0.5))
        axes.semilogy([1.0, 2.0], [0.1, 30.0])
        plain_decades(axes.yaxis)
        axes.set_title("$(x)`y`$")
        axes.set_xticks([1.0, 2.0], ["$a_$", "b"])
        return figure

    figure = drawn()
    assert rasterise(figure).min() < 128
    shown = {label.get_text() for label in figure.axes[0].get_yticklabels()}
    assert "0.1" in shown
    assert not any("mathdefault" in text for text in shown)


def test_no_label_of_crosscheck_charts_is_clipped_or_lies_on_a_curve():
    rows = [
        {"speed_rpm": speed, "unmatched_max_K": value, "fixed_max_K": 5.0 - value, "matched_max_K": 0.1}
        for speed, value in ((500.0, 0.2), (3000.0, 4.0), (8000.0, 2.0))
    ]
    speeds = speed_chart(rows)
    converging = convergence_chart(
        [{"nodes": 72, "max_difference_K": 3.0}, {"nodes": 2000, "max_difference_K": 0.1}]
    )
    assert not clipped(speeds) + clipped(converging)
    (axes,) = speeds.axes
    assert axes.get_legend().get_window_extent().y0 >= axes.get_window_extent().y1 - 1.0


@pytest.mark.parametrize(
    "small", [[23.4, 23.1, 11.3, 3.2, 2.4, 1.9, 0.2, 0.1, 0.1], [0.1] * 30, [65.0, 62.0]]
)
def test_bands_of_heat_keep_their_widths_and_their_places(small):
    from types import SimpleNamespace

    sinks = {"coolant": 252.6, **{f"film {n}": value for n, value in enumerate(small)}}
    heat = sum(sinks.values())
    figure = heat_balance(
        SimpleNamespace(heat_in_by={"F1": heat}, heat_out=sinks, heat_in=heat, imbalance_relative=0.0)
    )
    assert not clipped(figure)
    (axes,) = figure.axes
    bands = [item.get_path().vertices for item in axes.patches if isinstance(item, PathPatch)]
    ends = sorted((at[at[:, 0] == 1072.0, 1].min(), at[at[:, 0] == 1072.0, 1].max()) for at in bands[1:])
    widths = np.array([high - low for low, high in ends])
    assert widths / widths.sum() == pytest.approx(np.array(list(sinks.values())) / heat, rel=1e-6)
    assert ends[0][0] >= 0.0
    assert ends[-1][1] <= max(axes.get_ylim())
    assert all(low >= high for (_, high), (low, _) in itertools.pairwise(ends))


def test_labels_of_the_coolant_are_whole():
    from types import SimpleNamespace

    along = np.linspace(0.0, 2.2, 40)
    coolant = SimpleNamespace(
        position=along,
        angle=4.0 * along,
        wall_temperature=294.0 + 0.01 * along,
        bulk_temperature=293.2 + 0.01 * along,
        film_coefficient=np.full(40, 8200.0),
        film_low=np.full(40, 6000.0),
        film_high=np.full(40, 10100.0),
        mean_film_coefficient=8200.0,
    )
    assert not clipped(coolant_along_channel(coolant))


def test_of_many_parameters_those_are_drawn_that_moved_and_in_words():
    names = [f"jump.0.{n}" for n in range(40)] + [f"within_gap.0.{n}" for n in range(30)]
    names += [
        "misdescribed_in.0.standing_coolant.Kuehlwasser Ruecklauf nach dem Gehaeuse.100s",
        "probe.FRONT.r",
    ]
    names += [f"misdescribed.mass.side_{n}" for n in range(30)]
    shifts = np.array([0.0] * 69 + [3.0] * 33)
    data = xr.Dataset(
        {
            "parameter_nominal": ("parameter", np.zeros(len(names))),
            "parameter_prior_sigma": ("parameter", np.ones(len(names))),
            "parameter_logarithmic": ("parameter", np.zeros(len(names), dtype=int)),
            "parameter_unit": ("parameter", ["s"] * len(names)),
            "parameter_known": ("parameter", np.zeros(len(names))),
            "parameter_known_sigma": ("parameter", np.ones(len(names))),
            "parameter_fitted": ("parameter", shifts),
            "parameter_fitted_sigma": ("parameter", np.full(len(names), 0.9)),
        },
        coords={"parameter": names, "recording": ["measured"]},
    )
    figure = machine_parameters(data)
    shown = [item.get_text().replace("\n", " ") for item in texts_of(figure)]
    assert not clipped(figure)
    assert figure.get_size_inches()[1] * figure.dpi < 2200.0
    assert "heat or inlet in stretch 30 between rows" in shown
    assert "place of probe FRONT along the radius" in shown
    assert not [text for text in shown if "jump" in text or "misdescribed" in text]
    assert any("77 more" in text for text in shown)


@pytest.mark.parametrize("number", [1, 2, 3, 5])
def test_every_channel_over_time_goes_by_the_clock_and_fills_its_row(number):
    times = np.arange(0.0, 10800.0, 60.0)
    read = 20.0 + times / 5000.0
    nothing = np.zeros(times.size, dtype=bool)
    courses = [Course(f"T{n}", times, read, {"predicted": read}, 0.1, nothing) for n in range(number)]
    figure = courses_figure(courses, "title", "notes", "band", "2026-03-12T07:58:00Z")
    assert not clipped(figure)
    lowers = figure.axes[1::2]
    assert all(any(":" in label.get_text() for label in axes.get_xticklabels()) for axes in lowers)
    boxes = [axes.get_position() for axes in lowers]
    lowest = min(box.y0 for box in boxes)
    assert max(box.x1 for box in boxes if box.y0 == lowest) > 0.95


def test_a_machine_names_its_coolant_outlet_and_no_two_films_alike():
    spec = load_machine("motor_spindle")
    assert [probe.kind for probe in spec.probe if probe.name == "COOLANT_OUT"] == ["coolant_outlet"]
    figure = machine_drawing(spec)
    assert any(item.get_text().startswith("COOLANT_OUT") for item in texts_of(figure))
    head = figure.axes[-1]
    legend = [line for line in head.lines if line.get_linewidth() == 3.6]
    assert len({line.get_color() for line in legend}) == len(legend) > 8
    # leaders end above the numbers of the scale
    numbers = [item for item in head.texts if item.get_text().lstrip("-").isdigit()]
    leaders = [item for item in head.texts if getattr(item, "arrow_patch", None) is not None]
    lowest = max(item.xyann[1] for item in leaders)
    assert numbers
    assert all(item.get_position()[1] > lowest for item in numbers)


def test_the_place_is_framed_and_doubted_sensors_are_red():
    spec = load_machine("motor_spindle")
    probe = next(item.name for item in spec.probe if item.kind == "point")
    data = xr.Dataset({"spot_log_evidence": ("spot", [5.0, 1.0])}, coords={"spot": ["housing", "shaft"]})
    figure = located_on_machine(data, spec, "housing", [probe])
    assert not clipped(figure)
    red = [item.get_text() for item in texts_of(figure) if item.get_color() == DOUBTED]
    assert red == [probe]
    shown = " ".join(item.get_text() for item in texts_of(figure))
    assert "where the diagnosis puts it (housing). Red names: sensors that it doubts." in shown


@pytest.mark.parametrize("notes", ["Short.", "Notes of 150 characters " * 6, "Notes of 600 characters " * 24])
def test_title_and_notes_stay_within_the_figure(notes):
    figure = new_figure(400.0)
    set_title(figure, "A long name of a machine " * 6, notes)
    for line in figure.texts:
        assert line.get_window_extent().x1 <= 1600.0 - 20.0
        assert line.get_fontsize() >= 6.0
    title, below = figure.texts
    assert below.get_text().endswith(" …") == (len(notes) > 500)
    assert title.get_window_extent().y0 >= below.get_window_extent().y1
