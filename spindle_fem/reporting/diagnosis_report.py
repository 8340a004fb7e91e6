"""Report of a diagnosis, from the files of its folder alone."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from matplotlib.figure import Figure

from spindle_fem.errors import BadInputError, SpindleFemError
from spindle_fem.reporting.diagnosis_charts import (
    before_after,
    finding_intervals,
    machine_parameters,
    missing_heat,
    residual_map,
    set_probabilities,
)
from spindle_fem.reporting.diagnosis_data import DATA_SCHEMA
from spindle_fem.reporting.diagnosis_drawing import located_on_machine, located_on_network
from spindle_fem.reporting.diagnosis_words import (
    VERDICTS,
    chance,
    checks,
    confidence_words,
    kelvin,
    level,
    moment,
    set_words,
    verdict_sentence,
)
from spindle_fem.reporting.document import (
    Bullets,
    Cards,
    Notice,
    Section,
    Table,
    Text,
    illustration_of,
    render_document,
)
from spindle_fem.reporting.figures import save_png
from spindle_fem.reporting.output import replace_text
from spindle_fem.reporting.tables import column, number, rows_of, significant
from spindle_fem.spec.load import load_machine
from spindle_fem.spec.model import MachineSpec

if TYPE_CHECKING:
    import xarray as xr

SCHEMA = "spindle-fem/diagnosis/1"
CAPTIONS = {
    "before_after": "Readings, model before and after, and what each leaves; shaded: not fitted.",
    "residual_map": "Root mean square residual by channel and condition, before and after.",
    "sets": "Probability of every set of effects that was fitted to the end.",
    "findings": "Parameters of what was found, with 90 % intervals.",
    "parameters": "The machine's own uncertain parameters, prior against posterior.",
    "where": "How well heat that is missing at one place only would explain the readings.",
    "missing_heat": "Heat over time that would explain the readings, at each credible place alone.",
}
_DEFECTS = ("spikes", "dropouts", "stuck", "implausible", "bridged", "empty_cells", "infinite")


def write_diagnosis_report(folder: str | Path) -> Path:
    """``report.html`` and ``figures`` of a folder that holds ``diagnosis.json`` and ``diagnosis.nc``.

    Parameters
    ----------
    folder : str or Path
        The drawing of the machine needs ``improved_machine.toml`` or ``machine.toml`` too.

    Returns
    -------
    Path
        Of the report.

    Raises
    ------
    BadInputError
        ``diagnosis.json`` is missing or of a version that this program does not know.
    """
    folder = Path(folder)
    content = read_diagnosis(folder)
    data = _read_data(folder / "diagnosis.nc")
    place = folder / "figures"
    place.mkdir(exist_ok=True)
    pictures: dict[str, list[Any]] = {}
    for name, figure in _figures(content, data, folder):
        path = save_png(figure, place / f"{name}.png")
        kind = name.rpartition("_recording_")[0] or name
        pictures.setdefault(kind, []).append(illustration_of(path, CAPTIONS[kind]))
    return replace_text(folder / "report.html", render(content, pictures))


def read_diagnosis(folder: Path) -> dict[str, Any]:
    """Content of ``diagnosis.json``.

    Raises
    ------
    BadInputError
    """
    path = folder / "diagnosis.json"
    if not path.is_file():
        raise BadInputError(str(path), "there is no such file.", "Run spindle-fem diagnose.")
    content = json.loads(path.read_text(encoding="utf-8"))
    if content.get("schema") != SCHEMA:
        raise BadInputError(
            str(path), f"schema {content.get('schema')!r} is not known.", f"Allowed: {SCHEMA}."
        )
    return content


def _read_data(path: Path) -> xr.Dataset | None:
    """Dataset of the folder; None where the recording said too little to make one."""
    if not path.is_file():
        return None
    import xarray as xr

    data = xr.load_dataset(path)
    if data.attrs.get("schema") != DATA_SCHEMA:
        raise BadInputError(
            str(path), f"schema {data.attrs.get('schema')!r} is not known.", f"Allowed: {DATA_SCHEMA}."
        )
    return data


def _figures(
    content: Mapping[str, Any], data: xr.Dataset | None, folder: Path
) -> Iterator[tuple[str, Figure]]:
    if data is None:
        return
    recordings = range(data.sizes["recording"])
    many = data.sizes["recording"] > 1

    def numbered(name: str, recording: int) -> str:
        return f"{name}_recording_{recording + 1}" if many else name

    for recording in recordings:
        yield numbered("before_after", recording), before_after(data, recording)
    yield "residual_map", residual_map(data)
    where = content["mismatch"]["where"]
    found: list[tuple[str, Figure | None]] = [
        ("sets", set_probabilities(data)),
        ("findings", finding_intervals(content["findings"])),
        ("parameters", machine_parameters(data)),
    ]
    if content["verdict"] != "consistent":
        spec = _machine(folder)
        drawn = (
            located_on_machine(data, spec, where["component"] or "")
            if spec is not None
            else located_on_network(data)
        )
        found.append(("where", drawn))
        found += [
            (numbered("missing_heat", recording), missing_heat(data, where["credible"], recording))
            for recording in recordings
        ]
    yield from ((name, figure) for name, figure in found if figure is not None)


def _machine(folder: Path) -> MachineSpec | None:
    """The machine with geometry of a folder; None where there is none."""
    for name in ("machine.toml", "improved_machine.toml"):
        if (folder / name).is_file():
            try:
                return load_machine(folder / name)
            except SpindleFemError:
                # A network, which is drawn as bars.
                continue
    return None


def render(content: Mapping[str, Any], pictures: Mapping[str, list[Any]]) -> str:
    """HTML of a diagnosis.

    Parameters
    ----------
    content : mapping
        Of ``diagnosis.json``.
    pictures : mapping of kind to list of illustrations
    """

    def of(*names: str) -> list[Any]:
        return [item for name in names for item in pictures.get(name, [])]

    tone = {"consistent": "good", "unexplained": "bad"}.get(content["verdict"], "")
    sections = [
        Section(
            "verdict",
            "Verdict",
            [
                Notice(verdict_sentence(content), tone),
                _cards(content),
                Text("What to check on the machine:"),
                Bullets(checks(content) or ["Nothing that the catalogue names; see the next measurement."]),
            ],
        ),
        Section(
            "fit",
            "Before and after",
            [_fit_table(content), *of("before_after"), *of("residual_map"), *_channel_table(content)],
        ),
        Section("what", "Which physics", [*of("sets", "findings"), *_set_tables(content)]),
    ]
    if content["verdict"] != "consistent":
        located = [*_where_text(content), *of("where", "missing_heat"), *_place_tables(content)]
        sections.append(Section("where", "Where and when", located))
    sections += [
        Section("next", "What to measure next", _next_blocks(content)),
        Section(
            "parameters", "The machine's own parameters", of("parameters") or [Text("Nothing was fitted.")]
        ),
        Section(
            "confidence",
            "How sure this is",
            [Bullets(confidence_words(content)), *_defect_blocks(content)],
        ),
    ]
    names = ", ".join(content.get("recordings", []))
    title = f"{content.get('machine', 'Machine')}: {VERDICTS[content['verdict']]}"
    return render_document("Diagnosis", title, sections, names)


def _cards(content: Mapping[str, Any]) -> Cards:
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


def _fit_table(content: Mapping[str, Any]) -> Table:
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


def _channel_table(content: Mapping[str, Any]) -> list[Table]:
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


def _set_tables(content: Mapping[str, Any]) -> list[Any]:
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


def _where_text(content: Mapping[str, Any]) -> list[Text]:
    where = content["mismatch"]["where"]
    if not where["component"]:
        return [Text("No place stands out.")]
    text = f"Place: {where['component'].replace('_', ' ')}"
    if where["r_mm"] is not None:
        text += f" (centroid at r = {where['r_mm']:.0f} mm, z = {where['z_mm']:.0f} mm)"
    others = [name.replace("_", " ") for name in where["credible"] if name != where["component"]]
    text += f". Heat at {', '.join(others)} would explain nearly as much or more." if others else "."
    return [Text(text)]


def _place_tables(content: Mapping[str, Any]) -> list[Table]:
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


def _next_blocks(content: Mapping[str, Any]) -> list[Any]:
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


def _defect_blocks(content: Mapping[str, Any]) -> list[Any]:
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
