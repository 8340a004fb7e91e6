"""Turning centre: 200 days of a production machine, blind."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from book.diagnoses import (
    finished,
    found_blocks,
    next_step_blocks,
    own_pictures,
    place_blocks,
    verdict_blocks,
)
from book.page import Chapter, Pictures
from book.work import ROOT, Desk, read_json
from spindle_fem.report.block_page import Section, Table, Text
from spindle_fem.report.diagnosis_words import chance, set_words
from spindle_fem.report.figure_style import CYCLE, MUTED, new_figure, set_title, styled
from spindle_fem.report.table_rows import column, number, rows_of

TITLE = "Turning centre: 200 days of a production machine, blind"
FOLDER = "turning_centre"
MACHINE = ROOT / "geometry" / "turning_centre.toml"
PICTURES = ("before_after", "residual_map", "sets", "findings", "where", "missing_heat", "parameters")
DAY = 86_400.0


def make(desk: Desk, pictures: Pictures) -> Chapter:
    """Diagnose all days at once and show what the inputs do not explain."""
    where = f"../shared/recordings/{FOLDER}/recording.toml"
    commands = [f"spindle-fem diagnose turning_centre {where} -o runs/book/turning_centre/all_days"]
    place = desk.real(FOLDER)
    if place is None:
        return Chapter(
            outcome=f"Left out: the recording “{FOLDER}” is not in {desk.recordings.name}.",
            commands=commands,
            left_out="The recording is not part of the repository; give its folder with --recordings.",
        )

    def run(folder: Path) -> None:
        from spindle_fem.commands.diagnose_command import diagnose

        if not finished(folder / "all_days"):
            diagnose(MACHINE, [place / "recording.toml"], folder / "all_days")

    step = desk.step("turning_centre", run)
    folder = step.folder / "all_days"
    content = read_json(folder / "diagnosis.json")
    days = errors_by_day(folder / "diagnosis.nc")
    fit = content["fit"]
    unseen = {name: _unseen(table) for name, table in days.items()}
    sections = [
        Section(
            "set-up",
            "What is known, and what is done",
            [
                Text(
                    "A thermal network as a maintenance engineer would write it: a main spindle on its "
                    "headstock, a milling spindle, one room of constant, unknown temperature; friction "
                    "heat by speed, heat by load, every value a range from the size of such machines. No "
                    "drawings, no room temperature, no coolant temperature, sensor places unknown. All "
                    "200 days are diagnosed at once; every fourth of twenty stretches, some ten recorded "
                    "days each, is never fitted."
                )
            ],
        ),
        Section("said", "What the recorded inputs do not explain", verdict_blocks(content)),
        Section(
            "where",
            "Where, when, and by how much",
            [
                *place_blocks(content),
                *own_pictures(folder, ("where", "missing_heat"), pictures),
            ],
        ),
        Section(
            "what",
            "Which physics would explain it",
            [
                *own_pictures(folder, ("before_after", "residual_map", "sets", "findings"), pictures),
                *found_blocks(content),
            ],
        ),
        Section(
            "unseen",
            "Days that the model has not seen",
            [
                pictures.add(
                    "unseen_days",
                    day_chart(days),
                    "Root mean square error of every held-out day, before and after, sorted by the error "
                    "before.",
                ),
                _unseen_table(unseen, float(fit["noise_K"])),
            ],
        ),
        Section("next", "What to measure next", next_step_blocks(content)),
        Section(
            "parameters", "The network's own parameters", own_pictures(folder, ("parameters",), pictures)
        ),
    ]
    found = set_words(content["findings"]) if content["findings"] else content["verdict"]
    days_said = "; ".join(
        f"{name.removesuffix('_degC').replace('_', ' ')} better on {100 * item['better']:.0f} % of "
        f"{item['days']} unseen days, median {number(item['before'][0], 2)} → "
        f"{number(item['after'][0], 2)} K"
        for name, item in unseen.items()
    )
    left = fit["after"]["heldout_rmse_K"] / fit["noise_K"]
    return Chapter(
        outcome=(
            f"{content['verdict'].replace('_', ' ').capitalize()}: {found} (probability "
            f"{chance(content['set_probability'])}). Held-out error "
            f"{number(fit['before']['heldout_rmse_K'], 2)} → {number(fit['after']['heldout_rmse_K'], 2)} "
            f"K; {days_said}. What is left is {left:.0f} times a reading's noise."
        ),
        sections=sections,
        commands=[*commands, "python -m book --only turning_centre"],
        evidence=[
            "The recorded speeds and loads, through any network of this shape within its ranges, do not "
            "give the recorded temperatures: the p-value says so, and unseen days are predicted better "
            "with the terms found.",
            "Where the missing heat enters follows from which node's temperature it has to move, and when "
            "from the recording's own clock.",
        ],
        not_evidence=[
            "The names are the nearest terms of the catalogue, not causes seen on the machine: room, "
            "coolant, clamped brakes, hydraulics and parts in the chuck were not recorded.",
            "A probability near one says that no other set of the catalogue comes close, not that the set "
            "is the truth; what is left is many times the noise.",
            "A network with more nodes, or a room that follows the season, was not tried here.",
            "Sensor places are not documented, so that “main spindle” may be a motor, a bearing or the bore.",
        ],
    )


def errors_by_day(path: Path) -> dict[str, dict[str, NDArray[Any]]]:
    """Root mean square error of every day and channel before and after, from ``diagnosis.nc``.

    Returns
    -------
    dict
        By channel: ``day`` (n,), ``before``, ``after`` (n,) in K, ``held_out`` (n,) bool.
    """
    import xarray as xr

    data = xr.load_dataset(path)
    day = day_numbers(data["time"].values)
    held = data["held_out"].values.astype(bool)
    found = {}
    for at, name in enumerate(map(str, data["channel"].values)):
        usable = data["usable"].values[:, at].astype(bool)
        rows = []
        for value in np.unique(day[usable]):
            for flag in (False, True):
                here = usable & (day == value) & (held == flag)
                if here.sum() >= 3:
                    rows.append(
                        (
                            value,
                            *(
                                _rms(data[k].values[here, at] - data["measured"].values[here, at])
                                for k in ("before", "after")
                            ),
                            flag,
                        )
                    )
        table = np.array(rows)
        found[name] = {
            "day": table[:, 0].astype(int),
            "before": table[:, 1],
            "after": table[:, 2],
            "held_out": table[:, 3].astype(bool),
        }
    return found


def day_numbers(time: NDArray[np.float64]) -> NDArray[np.int64]:
    """Number of the working day of every stamp; days part at the hour in which least was recorded.

    >>> day_numbers(np.array([0.0, 3600.0, 80_000.0, 86_400.0])).tolist()
    [0, 0, 1, 1]
    """
    hour = (time % DAY) // 3600.0
    counts = np.bincount(hour.astype(int), minlength=24)
    around = np.roll(counts, 1) + counts + np.roll(counts, -1)
    part = (int(np.argmin(around)) + 0.5) * 3600.0
    number = np.floor((time - part) / DAY).astype(np.int64)
    return number - number.min()


def _rms(values: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(np.square(values, dtype=float))))


def _unseen(table: Mapping[str, NDArray[Any]]) -> dict[str, Any]:
    own = table["held_out"]
    before, after = table["before"][own], table["after"][own]
    return {
        "days": int(own.sum()),
        "before": np.quantile(before, [0.5, 0.9]).tolist(),
        "after": np.quantile(after, [0.5, 0.9]).tolist(),
        "better": float(np.mean(after < before)),
        "seen_after": float(np.median(table["after"][~own])),
    }


def _unseen_table(unseen: Mapping[str, Mapping[str, Any]], noise: float) -> Table:
    rows = [
        [
            name,
            str(item["days"]),
            *(number(item[key][at], 2) for at in (0, 1) for key in ("before", "after")),
            f"{100 * item['better']:.0f} %",
            number(item["seen_after"], 2),
        ]
        for name, item in unseen.items()
    ]
    columns = (
        column("channel"),
        column("unseen days", number=True),
        column("median day before / K", number=True),
        column("after / K", number=True),
        column("90 % of days before below / K", number=True),
        column("after / K", number=True),
        column("days that got better", number=True),
        column("median fitted day after / K", number=True),
    )
    caption = (
        f"Error of a day: root mean square over its readings, of a reading's noise {noise:.2f} K. Days "
        "with at least three readings after averaging."
    )
    return Table(columns, rows_of(rows), caption)


@styled
def day_chart(days: Mapping[str, Mapping[str, NDArray[Any]]]) -> Figure:
    """Held-out days of every channel, before and after."""
    figure = new_figure(620)
    set_title(
        figure, "Days that were never fitted", "root mean square error of a day; sorted by the error before"
    )
    axes = figure.subplots(1, len(days), squeeze=False)[0]
    figure.subplots_adjust(left=0.06, right=0.985, top=0.8, bottom=0.12, wspace=0.16)
    for own, (name, table) in zip(axes, days.items(), strict=True):
        held = table["held_out"]
        before, after = table["before"][held], table["after"][held]
        order = np.argsort(before)
        at = np.arange(order.size)
        own.vlines(
            at,
            np.minimum(before, after)[order],
            np.maximum(before, after)[order],
            color="#c9d1d9",
            linewidth=1.2,
        )
        own.plot(at, before[order], "o", color=MUTED, markersize=4.5, label="before")
        own.plot(at, after[order], "o", color=CYCLE[2], markersize=4.5, label="with the physics found")
        own.set_title(name.removesuffix("_degC").replace("_", " "))
        own.set_xlabel("held-out days")
        own.set_ylim(bottom=0.0)
        own.set_xlim(-1, order.size)
    axes[0].set_ylabel("error of the day / K")
    axes[0].legend(loc="upper left")
    return figure
