"""Pictures of the proof page: right by family, and one case as it was read and refitted."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from spindle_fem.report.figure_style import CYCLE, INK, MUTED, new_figure, save_png, set_title, styled

COLOURS = 64


def draw_all(data: dict[str, Any], studies: dict[str, tuple[Path, Path]], output: Path) -> None:
    """Write every picture that the page shows."""
    for study in data["studies"]:
        figure = by_family(study["summary"], study["title"])
        save_png(figure, output / f"by_family_{study['name']}.png", colours=COLOURS)
    if data["worked"] and data["worked"]["study"] in studies:
        study, results = studies[data["worked"]["study"]]
        save_png(worked(data["worked"], study, results), output / "worked_case.png", colours=COLOURS)


@styled
def by_family(figures: dict[str, Any], title: str) -> Figure:
    """Share of right cases of every family with its interval."""
    families = {k: v for k, v in figures["by_family"].items() if v["right"]["of"]}
    rows = {"all": figures["all"], **families}
    height = 110 + 46 * len(rows) + 90
    figure = new_figure(height)
    set_title(
        figure, title, "share of cases answered rightly, with Wilson's 90 % interval and the number of cases"
    )
    axes = figure.add_axes((0.24, 90 / height, 0.7, 46 * len(rows) / height))
    for at, part in enumerate(rows.values()):
        right = part["right"]
        colour = INK if at == 0 else CYCLE[0]
        axes.hlines(-at, right["low"], right["high"], color=colour, linewidth=2.2)
        axes.plot(right["share"], -at, "o", color=colour, markersize=7, clip_on=False)
        axes.text(1.02, -at, str(right["of"]), va="center", color=MUTED, fontsize=9)
    axes.set_yticks(
        [-k for k in range(len(rows))], [name.replace("_", " ").replace("+", " + ") for name in rows]
    )
    axes.set(xlim=(0.0, 1.0), ylim=(0.6 - len(rows), 0.6))
    axes.set_xlabel("right")
    return figure


def _readings(folder: Path) -> pd.DataFrame:
    return pd.read_csv(folder / "recording.csv.gz").drop_duplicates("time_s").sort_values("time_s")


@styled
def worked(case: dict[str, Any], study: Path, results: Path) -> Figure:
    """Readings of the channel that was worst before, what the machine reads before and after, and states."""
    worst = max(case["channels"], key=lambda c: c["rmse_K"] / max(c["noise_K"], 1e-6))["channel"]
    folder = results / case["case"]
    read = _readings(study / "inputs" / case["case"])
    before, after = (pd.read_csv(folder / f"{name}.csv") for name in ("before", "after"))
    figure = new_figure(900)
    set_title(
        figure,
        worst.replace("_", " "),
        f"{case['case']} of {case['study']}; grey: state truly on, blue: state found",
    )
    upper = figure.add_axes((0.07, 0.42, 0.9, 0.44))
    lower = figure.add_axes((0.07, 0.09, 0.9, 0.27), sharex=upper)
    every = max(1, len(read) // 4000)
    hours = read["time_s"].to_numpy()[::every] / 3600.0
    upper.plot(hours, read[worst].to_numpy()[::every], color=MUTED, linewidth=0.6, label="read")
    for table, colour, label in ((before, CYCLE[1], "before"), (after, CYCLE[0], "after")):
        step = max(1, len(table) // 4000)
        time = table["time_s"].to_numpy()[::step]
        upper.plot(time / 3600.0, table[worst].to_numpy()[::step], color=colour, linewidth=1.2, label=label)
        at = np.interp(time, read["time_s"], read[worst].interpolate())
        lower.plot(time / 3600.0, at - table[worst].to_numpy()[::step], color=colour, linewidth=0.7)
    for start, end in case["true_states"]:
        upper.axvspan(start / 3600.0, end / 3600.0, color=INK, alpha=0.12, linewidth=0)
    for start, end in case["found_states"]:
        lower.axvspan(start / 3600.0, end / 3600.0, color=CYCLE[0], alpha=0.15, linewidth=0)
    upper.set_ylabel("°C")
    lower.set_ylabel("read minus model / K")
    lower.set_xlabel("hours")
    upper.legend(loc="best")
    return figure
