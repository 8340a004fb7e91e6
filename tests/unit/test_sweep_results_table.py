"""The table of a study: safe to append to, to stop and to open again."""

import math

import pandas
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spindle_fem.errors import BadInputError
from spindle_fem.report.sweep_report import answered_by
from spindle_fem.studies.sweep.results_table import (
    EARLIER,
    PARQUET,
    RESULTS,
    ResultTable,
    format_cell,
    parse_cell,
    read_results,
)

COLUMNS = ("design", "channel.depth", "temperature.max_degC", "status", "reason", "key")


def row(number, temperature=31.25, status="ok", reason=""):
    values = (number, 0.001 * number, temperature, status, reason, f"key{number}")
    return dict(zip(COLUMNS, values, strict=True))


def test_rows_are_in_the_file_at_once_and_read_back(tmp_path):
    table = ResultTable(tmp_path, COLUMNS)
    table.append(row(1, 0.1 + 0.2))
    table.append(row(2, None, "failed", 'runs away, "hot"\nat 9000 rpm'))
    again = ResultTable(tmp_path, COLUMNS)
    assert again.rows == table.rows
    assert again.rows["key1"]["temperature.max_degC"] == 0.1 + 0.2
    assert again.rows["key2"]["reason"] == 'runs away, "hot" at 9000 rpm'


@pytest.mark.parametrize("kept", [1, 5, 20])
def test_a_line_that_was_cut_is_dropped(tmp_path, kept):
    table = ResultTable(tmp_path, COLUMNS)
    table.append(row(1))
    whole = (tmp_path / RESULTS).read_bytes()
    table.append(row(2))
    longer = (tmp_path / RESULTS).read_bytes()
    (tmp_path / RESULTS).write_bytes(longer[: len(whole) + kept])
    again = ResultTable(tmp_path, COLUMNS)
    assert set(again.rows) == {"key1"}
    again.append(row(2))
    assert (tmp_path / RESULTS).read_bytes() == longer


def test_a_key_is_taken_once(tmp_path):
    table = ResultTable(tmp_path, COLUMNS)
    table.append(row(1))
    with pytest.raises(BadInputError, match="key1"):
        table.append(row(1))


def test_table_of_another_study_and_damaged_lines_are_refused(tmp_path):
    ResultTable(tmp_path, COLUMNS).append(row(1))
    with pytest.raises(BadInputError, match="another study"):
        ResultTable(tmp_path, (*COLUMNS, "coolant.flow"))
    with (tmp_path / RESULTS).open("a") as stream:
        stream.write("rubbish\n")
    with pytest.raises(BadInputError, match="line 3 is damaged"):
        ResultTable(tmp_path, COLUMNS)


def test_finished_table_is_in_order_and_keeps_rows_of_an_earlier_study(tmp_path):
    table = ResultTable(tmp_path, COLUMNS)
    for number in (3, 1, 2):
        table.append(row(number))
    final = table.finish([{"design": 1, "key": "key2"}, {"design": 2, "key": "key3"}])
    assert [item["key"] for item in final] == ["key2", "key3"]
    assert read_results(tmp_path) == final
    assert "key1" in (tmp_path / EARLIER).read_text()
    frame = pandas.read_parquet(tmp_path / PARQUET)
    assert frame["temperature.max_degC"].dtype == float
    assert frame["key"].tolist() == ["key2", "key3"]


@given(st.one_of(st.integers(), st.floats(allow_nan=False, allow_infinity=False), st.none()))
def test_numbers_survive_the_file_to_the_last_digit(value):
    assert parse_cell(format_cell(value)) == value


def test_no_number_is_no_cell():
    assert format_cell(math.nan) == ""
    assert parse_cell("1_000") == "1_000"
    assert parse_cell("inf") == "inf"


def test_the_report_tells_what_answered_and_whose_mesh_it_had():
    row = {"backend": "full", "error_estimate_K": None, "mesh": "new"}
    assert answered_by(row) == "full"
    assert answered_by(row | {"mesh": "moved"}) == "full, moved mesh"
    reduced = row | {"backend": "reduced", "error_estimate_K": 0.004, "mesh": "moved"}
    assert answered_by(reduced) == "reduced, within 4 mK, moved mesh"
    assert answered_by(dict.fromkeys(row)) == "–"
