"""Tables and paragraphs of the report of a diagnosis, from the content of ``diagnosis.json``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from operator import itemgetter
from typing import Any

from spindle_fem.effects.framework.effect import capital
from spindle_fem.inference.findings import size_unit
from spindle_fem.report.block_page import Cards, Notice, Table, Text
from spindle_fem.report.diagnosis_words import (
    chance,
    fit_rows,
    found_words,
    heldout_errors,
    in_recording,
    is_one_fit,
    kelvin,
    level_of,
    moment,
    sensors_named,
    set_words,
)
from spindle_fem.report.parameter_words import parameter_words
from spindle_fem.report.table_rows import (
    Field,
    fixed,
    number,
    plain,
    rounded,
    significant,
    table_of,
    whole,
    with_interval,
    words,
)

_DEFECTS = ("spikes", "dropouts", "stuck", "implausible", "bridged", "empty_cells", "infinite")
_FROM_TO = (
    words("from", lambda item: moment(item["start"])),
    words("to", lambda item: moment(item["end"])),
)


def cards(content: Mapping[str, Any]) -> Cards:
    """Headline numbers."""
    fit, p = content["fit"], level_of(content)
    before, after, told = heldout_errors(fit)
    error = kelvin(after) if is_one_fit(fit) else f"{kelvin(before)} → {kelvin(after)}"
    change = "" if is_one_fit(fit) else ", before → after"
    items = [{"value": content["verdict"].replace("_", " "), "name": "verdict"}]
    if p:
        items.append({"value": p.removeprefix("= "), "name": "p, if nothing were missing"})
    if content["findings"]:
        items.append(
            {
                "value": chance(content.get("set_probability")),
                "name": f"probability of {found_words(content)}",
            }
        )
    items += [
        {
            "value": error,
            "name": f"held-out error{change}{f', {told}' if told else ''}",
        },
        {"value": kelvin(fit["noise_K"]), "name": "noise of a reading"},
    ]
    return Cards(items)


def fit_table(content: Mapping[str, Any]) -> Table:
    """Errors before and after, on fitted and held-out readings."""
    fit = content["fit"]
    fields = (
        words("model", "model"),
        fixed("fitted readings / K", "fitted", 3),
        fixed("held-out readings / K", "heldout", 3),
    )
    caption = (
        f"Root mean square error over all temperature channels; held out: {fit['heldout']}. "
        f"Noise of a reading: {kelvin(fit['noise_K'])}."
    )
    return table_of(fields, fit_rows(fit), caption)


def misdescription_blocks(content: Mapping[str, Any]) -> list[Table | Text]:
    """Possible deviations of the machine from its definition: the largest, and what to measure."""
    deviations = content.get("misdescription") or {}
    if not deviations.get("directions"):
        return []
    blocks: list[Table | Text] = []
    captions = {
        "instead": f"Would explain the recording instead of {found_words(content)}, all of it together:",
        "left_open": f"As fitted with {found_words(content)}:" if content["findings"] else "As fitted:",
    }
    for key, caption in captions.items():
        if deviations.get(key):
            fields = (
                *recording_fields(deviations[key]),
                words("key of the definition", "key"),
                words("what", "statement"),
                rounded("value", "value"),
                rounded("low", "low"),
                rounded("high", "high"),
                words("unit", "unit"),
                fixed("in widths of its prior", "sigmas", 1),
                whole("moves a channel by up to", _largest),
                words("channel", "channel"),
            )
            blocks.append(table_of(fields, deviations[key], caption))
    if measure := deviations.get("measure"):
        amount = f"{significant(measure['expected'])} {measure['unit']}".strip()
        blocks.append(
            Text(
                f"Worth measuring on the machine: {measure['key']} (expected to be off by {amount}); "
                f"{measure['why']}."
            )
        )
    if not blocks:
        blocks = [Text("The recording moves none of them beyond 0.7 of the width of its prior.")]
    return blocks


def recording_fields(items: Sequence[Mapping[str, Any]]) -> tuple[Field, ...]:
    """Column that names the recording of a row, where there are several."""
    several = any("recording" in item for item in items)
    return (words("recording", lambda item: item.get("recording", "")),) if several else ()


def channel_table(content: Mapping[str, Any]) -> list[Table]:
    """Errors of every channel."""
    fit, mismatch = content["fit"], content["mismatch"]

    def table(what: str, unit: str, before: list, after: list | None, caption: str) -> Table:
        rms, most, shown = f"rmse_{unit}", f"max_{unit}", unit.replace("um", "µm")
        items = [
            {**first, "rmse_after": second.get(rms), "max_after": second.get(most)}
            for first, second in zip(before, after or [{}] * len(before), strict=True)
        ]
        noise = fixed(f"noise / {shown}", f"noise_{unit}", 3)
        both = (
            fixed(f"before / {shown}", rms, 3),
            fixed(f"after / {shown}", "rmse_after", 3),
            noise,
            fixed(f"largest before / {shown}", most, 2),
            fixed(f"largest after / {shown}", "max_after", 2),
        )
        one = (fixed(f"error / {shown}", rms, 3), noise, fixed(f"largest / {shown}", most, 2))
        fields = (*recording_fields(before), words(what, "channel"), *(one if is_one_fit(fit) else both))
        return table_of(fields, items, caption)

    caption = "Root mean square and largest error of every channel."
    tables = [table("channel", "K", mismatch["channels"], fit.get("channels_after"), caption)]
    if grown := mismatch.get("displacements"):
        caption = "Error of every displacement, but for where its sensor was set."
        tables.append(table("sensor", "um", grown, fit["displacements_after"], caption))
    return tables


def set_tables(content: Mapping[str, Any]) -> list[Any]:
    """Parameters, intervals and alternatives."""
    effect = (
        words("effect", lambda item: plain(item["effect"])),
        words("place", lambda item: plain(item["component"]) + in_recording(item)),
    )
    parameters = [
        {**item, **value, "parameter": plain(name)}
        for item in content["findings"]
        for name, value in item["parameters"].items()
    ]
    intervals = [{**item, **interval} for item in content["findings"] for interval in item["intervals"]]
    blocks: list[Any] = []
    if parameters:
        fields = (
            *effect,
            words("parameter", "parameter"),
            *_value_and_interval("value"),
            words("unit", lambda item: str(item["unit"]).replace("degC", "°C")),
        )
        blocks.append(table_of(fields, parameters, f"{capital(found_words(content))}."))
    if intervals:
        size = words("size", _size_words)
        blocks.append(table_of((*effect, *_FROM_TO, size), intervals, "When it is on, and how much."))
    if content["alternatives"]:
        fields = (
            words("instead", lambda item: set_words(item["findings"])),
            whole("probability", lambda item: chance(item["probability"])),
        )
        blocks.append(table_of(fields, content["alternatives"], "What the data cannot rule out."))
    elif content["findings"]:
        blocks.append(Text("No other set of effects keeps a probability of 2 % or more."))
    return blocks


def parameter_tables(content: Mapping[str, Any]) -> list[Table]:
    """All parameters of the machine before and after; directions of its definition have their own section."""
    rows = content.get("machine_parameters")
    if not rows:
        return []
    recordings = content.get("recordings", ())
    rows = [
        item | {key: 1.0e3 * item[key] for key in ("prior", "value", "low", "high")} | {"unit": "mm"}
        if item["unit"] == "m"
        else item
        for item in rows
    ]
    fields = (
        words("parameter", lambda item: parameter_words(item["name"], recordings)),
        rounded("before", "prior"),
        *_value_and_interval("after"),
        words("unit", "unit"),
    )
    return [table_of(fields, rows, "All of them; diagnosis.nc has the directions of the definition too.")]


def where_text(content: Mapping[str, Any]) -> list[Text]:
    """The place in a sentence."""
    where, sensors = content["mismatch"]["where"], sensors_named(content)
    place = where["component"]
    centre = ""
    if where["r_mm"] is not None:
        centre = f" (centroid at r = {where['r_mm']:.0f} mm, z = {where['z_mm']:.0f} mm)"
    texts = []
    if not place:
        texts.append("No place stands out.")
    elif place not in sensors:
        texts.append(f"Place: {place.replace('_', ' ')}{centre}.")
    for name in sensors:
        own = centre if name == place else ""
        texts.append(
            f"Sensor {name.replace('_', ' ')}{own}: the finding is of its reading, not of heat there."
        )
    others = [name.replace("_", " ") for name in where["credible"] if name not in (place, *sensors)]
    if others:
        too = " too" if place and place not in sensors else ""
        texts.append(f"Heat missing at {' or '.join(others)} alone would explain much of it{too}.")
    return [Text(" ".join(texts))]


def place_tables(content: Mapping[str, Any]) -> list[Table]:
    """Missing heat by place, and when the readings differ."""
    mismatch = content["mismatch"]
    blocks = []
    if mismatch["missing_heat_W"]:
        fields = (
            words("place", lambda item: plain(item[0])),
            fixed("mean / W", lambda item: item[1]["mean"], 0),
            fixed("peak / W", lambda item: item[1]["peak"], 0),
        )
        heat = mismatch["missing_heat_W"].items()
        blocks.append(table_of(fields, heat, "Missing heat, if at this place only."))
    if mismatch["when"]:
        fields = (*recording_fields(mismatch["when"]), *_FROM_TO, words("condition", "condition"))
        blocks.append(table_of(fields, mismatch["when"], "When the readings differ significantly."))
    return blocks


def next_blocks(content: Mapping[str, Any]) -> list[Any]:
    """The proposed measurement, its reason and what else was weighed."""
    item = content["next_measurement"]
    blocks: list[Any] = [
        Notice(f"Measure {item['quantity']} at {item['where']}: {item['condition']}."),
        Text(item["why"]),
    ]
    if item.get("options"):
        fields = (
            words("sensors", "where"),
            words("operation", "condition"),
            fixed("information / bit", "expected_information", 2),
            words("clearest at", _clearest_channel),
            whole("difference", lambda option: _in_its_unit(option, "difference")),
            whole("± 1 σ", lambda option: _in_its_unit(option, "sigma")),
            fixed("after / min", lambda option: option["after_s"] / 60.0, 0),
        )
        caption = "The proposal first, then the most telling."
        if len(between := item.get("between", [])) > 1:
            caption += f" Difference: what is read if it is {between[1]}, less what if it is {between[0]}."
        blocks.append(table_of(fields, item["options"], caption))
    blocks += [
        Text(f"Not simulated: {failed['condition']} ({failed['reason']})")
        for failed in item.get("not_simulated", [])
    ]
    return blocks


def _largest(row: Mapping[str, Any]) -> str:
    """What a direction does to temperatures, or, where it leaves them alone, to displacements."""
    if row["largest_K"] or "largest_um" not in row:
        return f"{row['largest_K']:.2f} K"
    return f"{row['largest_um']:.2f} µm"


def _value_and_interval(title: str) -> tuple[Field, Field]:
    """Columns of a value and of its interval."""

    def told(item: Mapping[str, Any]) -> tuple[str, str, str]:
        return with_interval(item["value"], item["low"], item["high"])

    return whole(title, lambda item: told(item)[0]), whole(
        "90 % interval", lambda item: " to ".join(told(item)[1:])
    )


def _size_words(item: Mapping[str, Any]) -> str:
    """Size in one interval of a finding; folders of before have none."""
    return f"{significant(item['value'])} {size_unit(item['parameters'])}" if "value" in item else ""


def _in_its_unit(option: Mapping[str, Any], key: str) -> str:
    """A difference of temperatures, or of displacements."""
    if f"{key}_um" in option:
        return f"{number(option[f'{key}_um'], 2)} µm"
    return f"{number(option[f'{key}_K'], 2)} K"


def _clearest_channel(option: Mapping[str, Any]) -> str:
    return option["channel"] if option["where"] != option["channel"] else "the new sensor"


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
                rows.append((item.get("name", ""), own["channel"], ", ".join(faults)))
    if rows:
        fields = [words(title, itemgetter(n)) for n, title in enumerate(("recording", "channel", "left out"))]
        blocks.append(table_of(fields, rows, "Readings that were not used."))
    return blocks
