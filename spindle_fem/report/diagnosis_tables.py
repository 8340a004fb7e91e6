"""Tables and paragraphs of the report of a diagnosis, from the content of ``diagnosis.json``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from spindle_fem.report.block_page import Cards, Notice, Table, Text
from spindle_fem.report.diagnosis_words import chance, kelvin, level, moment, set_words
from spindle_fem.report.run_tables import column, number, rows_of, significant

_DEFECTS = ("spikes", "dropouts", "stuck", "implausible", "bridged", "empty_cells", "infinite")


def cards(content: Mapping[str, Any]) -> Cards:
    """Headline numbers."""
    fit, mismatch = content["fit"], content["mismatch"]
    items = [
        {"value": content["verdict"].replace("_", " "), "name": "verdict"},
        {"value": level(mismatch["p_value"]).removeprefix("= "), "name": "p, if nothing were missing"},
    ]
    if content["findings"]:
        items.append(
            {"value": chance(content.get("set_probability")), "name": "probability of what is named"}
        )
    items += [
        {
            "value": f"{kelvin(fit['before']['heldout_rmse_K'])} → {kelvin(fit['after']['heldout_rmse_K'])}",
            "name": "held-out error, before → after",
        },
        {"value": kelvin(fit["noise_K"]), "name": "noise of a reading"},
    ]
    return Cards(items)


def fit_table(content: Mapping[str, Any]) -> Table:
    """Errors before and after, on fitted and held-out readings."""
    fit = content["fit"]
    rows = [
        [
            title,
            number(fit[key]["train_rmse_K"], 3),
            number(fit[key]["heldout_rmse_K"], 3),
            number(_ratio(fit[key]["heldout_rmse_K"], fit["noise_K"]), 2),
        ]
        for key, title in (("before", "before"), ("after", "after"))
    ]
    columns = (
        column("model"),
        column("fitted readings / K", number=True),
        column("held-out readings / K", number=True),
        column("held out / noise", number=True),
    )
    caption = f"Root mean square error over all channels; held out: {fit['heldout']}."
    return Table(columns, rows_of(rows), caption)


def _ratio(value: float | None, by: float | None) -> float | None:
    return None if value is None or not by else value / by


def channel_table(content: Mapping[str, Any]) -> list[Table]:
    """Errors of every channel."""
    before = content["mismatch"]["channels"]
    after = content["fit"].get("channels_after") or [{}] * len(before)
    several = any("recording" in row for row in before)
    rows = [
        [
            *([first.get("recording", "")] if several else []),
            first["channel"],
            number(first["rmse_K"], 3),
            number(second.get("rmse_K"), 3),
            number(first["noise_K"], 3),
            number(first["max_K"], 2),
            number(second.get("max_K"), 2),
        ]
        for first, second in zip(before, after, strict=True)
    ]
    columns = (
        *([column("recording")] if several else []),
        column("channel"),
        *(
            column(name, number=True)
            for name in ("before / K", "after / K", "noise / K", "largest before / K", "largest after / K")
        ),
    )
    return [Table(columns, rows_of(rows), "Root mean square and largest error of every channel.")]


def set_tables(content: Mapping[str, Any]) -> list[Any]:
    """Parameters, intervals and alternatives."""
    blocks: list[Any] = []
    rows = [
        [
            item["effect"].replace("_", " "),
            item["component"].replace("_", " "),
            name.replace("_", " "),
            significant(value["value"]),
            f"{significant(value['low'])} to {significant(value['high'])}",
            str(value["unit"]).replace("degC", "°C"),
        ]
        for item in content["findings"]
        for name, value in item["parameters"].items()
    ]
    if rows:
        columns = (
            column("effect"),
            column("place"),
            column("parameter"),
            column("value", number=True),
            column("90 % interval", number=True),
            column("unit"),
        )
        blocks.append(Table(columns, rows_of(rows), "What was found."))
    intervals = [
        [
            item["effect"].replace("_", " "),
            item["component"].replace("_", " "),
            moment(i["start"]),
            moment(i["end"]),
        ]
        for item in content["findings"]
        for i in item["intervals"]
    ]
    if intervals:
        columns = (column("effect"), column("place"), column("from"), column("to"))
        blocks.append(Table(columns, rows_of(intervals), "When it is on."))
    others = [[set_words(item["findings"]), chance(item["probability"])] for item in content["alternatives"]]
    if others:
        columns = (column("instead"), column("probability", number=True))
        blocks.append(Table(columns, rows_of(others), "What the data cannot rule out."))
    elif content["findings"]:
        blocks.append(Text("No other set of effects keeps a probability of 2 % or more."))
    return blocks


def where_text(content: Mapping[str, Any]) -> list[Text]:
    """The place in a sentence."""
    where = content["mismatch"]["where"]
    if not where["component"]:
        return [Text("No place stands out.")]
    text = f"Place: {where['component'].replace('_', ' ')}"
    if where["r_mm"] is not None:
        text += f" (centroid at r = {where['r_mm']:.0f} mm, z = {where['z_mm']:.0f} mm)"
    others = [name.replace("_", " ") for name in where["credible"] if name != where["component"]]
    text += f". Heat missing at {' or '.join(others)} alone would explain much of it too." if others else "."
    return [Text(text)]


def place_tables(content: Mapping[str, Any]) -> list[Table]:
    """Missing heat by place, and when the readings differ."""
    mismatch = content["mismatch"]
    blocks = []
    heat = [
        [name.replace("_", " "), number(item["mean"], 0), number(item["peak"], 0)]
        for name, item in mismatch["missing_heat_W"].items()
    ]
    if heat:
        columns = (column("place"), column("mean / W", number=True), column("peak / W", number=True))
        blocks.append(Table(columns, rows_of(heat), "Missing heat, if at this place only."))
    several = any("recording" in item for item in mismatch["when"])
    when = [
        [
            *([item.get("recording", "")] if several else []),
            moment(item["start"]),
            moment(item["end"]),
            item["condition"],
        ]
        for item in mismatch["when"]
    ]
    if when:
        columns = (
            *([column("recording")] if several else []),
            column("from"),
            column("to"),
            column("condition"),
        )
        blocks.append(Table(columns, rows_of(when), "When the readings differ significantly."))
    return blocks


def next_blocks(content: Mapping[str, Any]) -> list[Any]:
    """The proposed measurement, its reason and what else was weighed."""
    item = content["next_measurement"]
    blocks: list[Any] = [
        Notice(f"Measure {item['quantity']} at {item['where']}: {item['condition']}."),
        Text(item["why"]),
    ]
    rows = [
        [
            option["where"],
            option["condition"],
            number(option["expected_information"], 2),
            option["channel"] if option["where"] != option["channel"] else "the new sensor",
            number(option["difference_K"], 2),
            number(option["sigma_K"], 2),
            number(option["after_s"] / 60.0, 0),
        ]
        for option in item.get("options", [])
    ]
    if rows:
        columns = (
            column("sensors"),
            column("operation"),
            column("information / bit", number=True),
            column("clearest at"),
            column("difference / K", number=True),
            column("± 1 σ / K", number=True),
            column("after / min", number=True),
        )
        between = " and ".join(item.get("between", [])[:2])
        caption = f"The proposal first, then the most telling. Difference between {between}."
        blocks.append(Table(columns, rows_of(rows), caption))
    blocks += [
        Text(f"Not simulated: {failed['condition']} ({failed['reason']})")
        for failed in item.get("not_simulated", [])
    ]
    return blocks


def defect_blocks(content: Mapping[str, Any]) -> list[Any]:
    """Defects of the recordings and readings that were left out."""
    blocks: list[Any] = []
    rows = []
    for item in content.get("defects", []):
        facts = [
            f"{item[key]} {words}"
            for key, words in (
                ("unordered_rows", "rows out of order"),
                ("repeated_rows", "repeated rows"),
                ("conflicting_stamps", "stamps with two readings"),
                ("rows_without_time", "rows without a time"),
                ("blank_rows", "blank rows"),
                ("short_rows", "short rows"),
                ("non_uniform_steps", "steps of another length"),
            )
            if item.get(key)
        ]
        facts += [f"{len(item['gaps'])} gaps"] if item.get("gaps") else []
        blocks.append(
            Text(f"Recording {item.get('name', '')}: {', '.join(facts) or 'no defects in the table itself'}.")
        )
        for own in item.get("channels", []):
            faults = [f"{own[key]} {key.replace('_', ' ')}" for key in _DEFECTS if own.get(key)]
            if faults:
                rows.append([item.get("name", ""), own["channel"], ", ".join(faults)])
    if rows:
        columns = (column("recording"), column("channel"), column("left out"))
        blocks.append(Table(columns, rows_of(rows), "Readings that were not used."))
    return blocks
