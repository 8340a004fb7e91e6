"""What the report and the console of a run say of coolants, fits, contacts and thrust."""

from __future__ import annotations

import html
import re
from types import SimpleNamespace

import pytest
from matplotlib.patches import PathPatch

from spindle_fem.commands.machine_commands import check_machine
from spindle_fem.definition.load import load_machine
from spindle_fem.model.elastic.deformed_shape import still_place
from spindle_fem.report import run_tables
from spindle_fem.report.balance_charts import heat_balance
from spindle_fem.report.block_page import Section, render_document
from spindle_fem.report.heat_charts import loads_over_thrust
from spindle_fem.report.machine_drawing import part_colours
from spindle_fem.report.run_report import _fitted
from spindle_fem.report.table_rows import MISSING
from spindle_fem.studies.heat_study import THRUST_STEPS, heat_study
from spindle_fem.studies.machine_equilibrium import contact_warnings

CIRCUITS = {"jacket": {"heat_W": 71.0}, "R1.lubrication": {"heat_W": 4.0}}
HEAT_OUT = {"jacket.1": 41.0, "jacket.cover.1": 30.0, "R1.inner_raceway": 5.0, "R1.outer_raceway": -1.0}
SUMMARY = {
    "temperature": {"max_degC": 50.0, "max_at_mm": [1.0, 0.0, 2.0]},
    "energy": {"heat_in_W": 100.0, "heat_in_by_W": {"motor": 100.0}, "heat_out_W": {"cap": 25.0, **HEAT_OUT}},
    "bearings": {},
    "circuits": CIRCUITS,
}


def test_every_coolant_is_counted_as_coolant():
    cards = {item["name"]: item["value"] for item in run_tables.headline(SUMMARY)}
    taken = "taken by the coolant, 75 % of the heat put in: jacket 71 W, R1.lubrication 4 W"
    assert cards[taken] == "75 W"


def test_cells_of_a_circuit_are_one_line_and_one_band():
    energy = SUMMARY["energy"]
    rows = [row["cells"][:2] for row in run_tables.balance_table(SUMMARY).rows]
    assert rows[-4:-1] == [["jacket", "71.00"], ["cap", "25.00"], ["R1.lubrication", "4.00"]]
    figure = heat_balance(
        SimpleNamespace(
            heat_in_by=energy["heat_in_by_W"],
            heat_out=energy["heat_out_W"],
            heat_in=100.0,
            imbalance_relative=0.0,
        ),
        (),
        CIRCUITS,
    )
    bands = [item for axes in figure.axes for item in axes.patches if isinstance(item, PathPatch)]
    assert len(bands) == 1 + 3


def test_a_bearing_without_preload_shows_what_it_carries():
    states = {"F1": {"heat_W": 20.0, "preload_N": None, "axial_load_N": 183.4}}
    table = run_tables.bearing_table({"bearings": states})
    shown = dict(zip([item["title"] for item in table.columns], table.rows[0]["cells"], strict=True))
    assert (shown["preload / N"], shown["axial load / N"]) == (MISSING, "183")


def test_the_table_of_bearings_fits_beside_the_contents_of_a_screen_of_1280_pixels():
    """Letters of the page's bold type are 8.3 pixels wide in the mean; contents and margins take 312."""
    states = {name: {"heat_W": 109.7, "preload_N": 13075.0, "film_um": 0.98} for name in ("F1", "R1")}
    page = render_document(
        "Run", "Machine", [Section("bearings", "Bearings", [run_tables.bearing_table({"bearings": states})])]
    )
    heads = re.findall(r"<th scope=\"col\"[^>]*>(.*?)</th>", page)
    assert len(heads) == 12
    # What stands between two places where a line may break.
    narrowest = sum(max(map(len, html.unescape(head).split(" "))) for head in heads)
    padding = 16 * 2 * 0.5
    assert 8.3 * narrowest + len(heads) * padding < 1280 - 312
    assert html.unescape(heads[4]) == "outer race /\u00a0°C"


def test_a_ring_without_a_fit_has_no_pressure_and_no_gap():
    names = ("F1", "R1")
    summary = {
        "fits": {name: {"shaft": {"pressure_MPa": 0.0, "gap_um": 4.4}} for name in names},
        "growth": {
            "seats": {name: {"shaft_um": 1.0} for name in names},
            "raceways": {name: {"inner_um": 2.0} for name in names},
        },
    }
    definition = {"bearing_set": [{"bearing": [{"name": "F1"}]}, {"fit": {}, "bearing": [{"name": "R1"}]}]}
    rows = run_tables.growth_table(summary, _fitted(definition)).rows
    assert [row["cells"][2:4] for row in rows] == [[MISSING, MISSING], ["0.00", "4.4"]]


def test_contacts_that_tire_and_rings_that_are_loose_are_warned_of():
    heat = {
        "R1": SimpleNamespace(contact_pressure=1.54e9, seat_pressure=None),
        "R2": SimpleNamespace(contact_pressure=1.0e9, seat_pressure=(0.0, 1.0)),
    }
    found = contact_warnings(SimpleNamespace(loads=SimpleNamespace(bearing_heat=heat)))
    assert [(item.code, item.text[:3]) for item in found] == [
        ("contact_pressure", "R1:"),
        ("seat_loose", "R2:"),
    ]
    assert "1.54 GPa, above the 1.5 GPa" in found[0].text


def test_without_thrust_loads_are_drawn_up_to_twice_the_preload():
    spec = load_machine("wu_tan_2016", ["operation.thrust=0 N"])
    rows = heat_study(spec, speeds=[300.0])["thrust"]
    largest = max(group.preload for group in spec.bearing_set)
    assert len(rows) == THRUST_STEPS
    assert rows[-1]["thrust_N"] == pytest.approx(2.0 * largest)
    assert loads_over_thrust({"thrust": []}) is None


def test_pictures_of_growth_name_what_stays():
    assert still_place(load_machine("wu_tan_2016")) == "the back of the flange"
    without = load_machine("router_spindle")
    assert still_place(without) == "the seat of F2"
    assert still_place(without, solid=True) == "the outside of the housing"


def test_check_lists_sets_with_the_force_of_a_class_of_preload():
    changes = ["bearing_set.front.preload=light"]
    found = {
        row["name"]: row["detail"]
        for row in check_machine("router_spindle", overrides=changes)["bearing_sets"]
    }
    force = next(g.preload for g in load_machine("router_spindle", changes).bearing_set if g.name == "front")
    assert f"preload {force:.4g} N" in found["front"]


def test_ten_parts_of_no_usual_kind_have_ten_colours():
    assert len(set(part_colours([f"part_{number}" for number in range(10)]))) == 10
