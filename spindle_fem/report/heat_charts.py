"""Charts of a heat study, in the order of the paper's figures 12 to 17."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from spindle_fem.report.figure_style import CYCLE, new_figure, plain_decades, save_png, set_title, styled

SPEED_LABEL = "speed / rpm"
HEIGHT = 690.0
# Lines that may hide one another, points: the first and the last.
WIDEST, NARROWEST = 4.0, 1.2
# Style of charts in which dashes have no meaning of their own.
GAPS = "gaps"


def write_heat_charts(content: Mapping[str, Any], folder: Path) -> list[Path]:
    """Draw every chart of a heat study into a folder.

    Parameters
    ----------
    content : mapping
        As ``heat_study`` returns it.
    folder : Path
        Made when missing.
    """
    folder.mkdir(parents=True, exist_ok=True)
    figures = {name: draw(content) for name, draw in CHARTS.items()}
    return [
        save_png(figure, folder / f"{name}.png") for name, figure in figures.items() if figure is not None
    ]


def _panels(number: int, title: str) -> tuple[Figure, Sequence[Axes]]:
    figure = new_figure(HEIGHT)
    set_title(figure, title)
    axes = np.atleast_1d(figure.subplots(1, number))
    figure.subplots_adjust(
        left=0.075, right=0.985, top=1.0 - 186.0 / HEIGHT, bottom=90.0 / HEIGHT, wspace=0.3
    )
    return figure, axes


def _groups(content: Mapping[str, Any]) -> dict[str, Sequence[Mapping[str, Any]]]:
    """Rows of each bearing; bearings indistinguishable in a chart share a line, "F1, F2"."""
    groups: list[tuple[list[str], Sequence[Mapping[str, Any]]]] = []
    for name, rows in content["bearings"].items():
        for names, others in groups:
            alike = [
                np.isclose(row[key], other[key], rtol=2e-3)
                for row, other in zip(rows, others, strict=True)
                for key in ("heat_W", "axial_load_N", "orbital_speed_rad_s")
            ]
            if all(alike):
                names.append(name)
                break
        else:
            groups.append(([name], rows))
    return {", ".join(names): rows for names, rows in groups}


def _legend(figure: Figure, axes: Axes) -> None:
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(
        handles,
        labels,
        loc="upper left",
        bbox_to_anchor=(0.005, 1.0 - 52.0 / HEIGHT),
        ncols=6,
        columnspacing=1.4,
        handlelength=3.2,
    )


def _lines(
    axes: Axes,
    content: Mapping[str, Any],
    pick: Callable[[Mapping[str, Any]], float],
    style: str = "-",
    note: str = "",
) -> None:
    groups = _groups(content)
    widths = np.linspace(WIDEST, NARROWEST, len(groups)) if len(groups) > 1 else [1.8]
    for index, (name, rows) in enumerate(groups.items()):
        # every other one has gaps, through which a line that coincides with it is seen
        line = (0, (5, 2)) if style == GAPS and index % 2 else style
        speeds = [row["speed_rpm"] for row in rows]
        axes.plot(
            speeds,
            [pick(row) for row in rows],
            linestyle="-" if line == GAPS else line,
            color=CYCLE[index % len(CYCLE)],
            # a line under another remains visible on both sides of it
            linewidth=widths[index],
            label=f"{name}{note}",
        )


def _finish(axes: Axes, title: str, label: str) -> None:
    axes.set(title=title, xlabel=SPEED_LABEL, ylabel=label)
    axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))


@styled
def film_thickness(content: Mapping[str, Any]) -> Figure:
    """Central film, flooded and isothermal against with thermal and starvation reduction."""
    figure, axes = _panels(2, "Lubricant film of the contacts")
    for panel, side in zip(axes, ("inner", "outer"), strict=True):
        _lines(
            panel,
            content,
            lambda row, side=side: row["contacts"][side]["film_isothermal_um"],
            "--",
            " isothermal",
        )
        _lines(panel, content, lambda row, side=side: row["contacts"][side]["film_um"])
        _finish(panel, f"Central film, {side} raceway", "film thickness / µm")
    _legend(figure, axes[0])
    return figure


@styled
def loads_over_thrust(content: Mapping[str, Any]) -> Figure | None:
    """Axial load and displacement of the preloaded set over the thrust; None where none was varied."""
    rows = content["thrust"]
    if not rows:
        return None
    figure, axes = _panels(2, "Loads of the bearings over the thrust")
    thrust = [row["thrust_N"] for row in rows]
    for index, name in enumerate(rows[0]["bearings"]):
        for panel, key in zip(axes, ("axial_load_N", "axial_displacement_um"), strict=True):
            panel.plot(
                thrust,
                [row["bearings"][name][key] for row in rows],
                color=CYCLE[index % len(CYCLE)],
                linestyle=("-", "--", ":", "-.")[index % 4],
                label=name,
            )
    for panel, title, label in zip(
        axes,
        ("Axial load of each bearing", "Axial approach from touching"),
        ("axial load / N", "displacement / µm"),
        strict=True,
    ):
        panel.set(title=title, xlabel="thrust / N", ylabel=label)
        panel.set_ylim(bottom=min(0.0, panel.get_ylim()[0]))
    _legend(figure, axes[0])
    return figure


@styled
def contacts_over_speed(content: Mapping[str, Any]) -> Figure:
    """Deformations, contact angles and ellipses: inner solid, outer dashed."""
    figure, axes = _panels(3, "Contacts of the rolling elements with the rings")
    for panel, key, title, label in zip(
        axes,
        ("deformation_um", "contact_angle_deg", "semi_major_mm"),
        ("Contact deformation", "Contact angle", "Semi-major axis"),
        ("deformation / µm", "angle / °", "semi-major axis / mm"),
        strict=True,
    ):
        for side, style in (("inner", "-"), ("outer", "--")):
            _lines(
                panel, content, lambda row, side=side, key=key: row["contacts"][side][key], style, f" {side}"
            )
        panel.set(title=title, xlabel=SPEED_LABEL, ylabel=label)
        panel.margins(y=0.25)
    _legend(figure, axes[0])
    return figure


@styled
def ball_speeds(content: Mapping[str, Any]) -> Figure:
    """Orbital and spin speed of the balls, and the forces that they cause."""
    figure, axes = _panels(4, "Motion of the rolling elements")
    for panel, key, title, label in zip(
        axes,
        ("orbital_speed_rad_s", "spin_speed_rad_s", "centrifugal_force_N", "gyroscopic_moment_Nmm"),
        ("Orbit", "Spin", "Centrifugal force", "Gyroscopic moment"),
        ("speed / (rad/s)", "speed / (rad/s)", "force / N", "moment / N mm"),
        strict=True,
    ):
        _lines(panel, content, lambda row, key=key: row[key], GAPS)
        _finish(panel, title, label)
    _legend(figure, axes[0])
    return figure


@styled
def film_ratio(content: Mapping[str, Any]) -> Figure:
    """Film thickness ratio; from 3 on the film carries alone."""
    figure, axes = _panels(2, "How well the film separates the surfaces")
    for panel, side in zip(axes, ("inner", "outer"), strict=True):
        _lines(panel, content, lambda row, side=side: row["contacts"][side]["lambda"], GAPS)
        panel.axhline(3.0, color="black", linewidth=0.9, linestyle=":")
        panel.annotate(
            "full film from 3", (0.99, 3.0), xycoords=("axes fraction", "data"), ha="right", va="bottom"
        )
        _finish(panel, f"Film thickness ratio, {side} raceway", "Λ")
    _legend(figure, axes[0])
    return figure


def merged_terms(terms: Mapping[str, float]) -> dict[str, float]:
    """Terms with those of both raceways added up."""
    merged: dict[str, float] = {}
    for key, value in terms.items():
        name = key.removeprefix("inner_").removeprefix("outer_").replace("_", " ")
        merged[name] = merged.get(name, 0.0) + value
    return merged


@styled
def heat_terms(content: Mapping[str, Any]) -> Figure:
    """Friction heat of each bearing, stacked by term."""
    groups = _groups(content)
    figure, axes = _panels(len(groups), "Friction heat term by term")
    terms = {name: [merged_terms(row["terms_W"]) for row in rows] for name, rows in groups.items()}
    keys = list(dict.fromkeys(key for rows in terms.values() for row in rows for key in row))
    keys = [key for key in keys if any(row.get(key) for rows in terms.values() for row in rows)]
    top = max(row["heat_W"] for rows in groups.values() for row in rows)
    for panel, (name, rows) in zip(axes, groups.items(), strict=True):
        speeds = [row["speed_rpm"] for row in rows]
        values = [[row.get(key, 0.0) for row in terms[name]] for key in keys]
        panel.stackplot(speeds, *values, labels=keys, colors=CYCLE)
        panel.set(
            title=name,
            xlabel=SPEED_LABEL,
            ylim=(0.0, 1.05 * top),
            xlim=(speeds[0], max(speeds[-1], speeds[0] + 1)),
        )
    axes[0].set_ylabel(f"friction heat, model {content['model']} / W")
    _legend(figure, axes[0])
    return figure


@styled
def heat_models(content: Mapping[str, Any]) -> Figure:
    """Friction heat of the same bearings by every heat model."""
    groups = _groups(content)
    figure, axes = _panels(len(groups), "Friction heat by every heat model")
    speeds = [row["speed_rpm"] for row in content["models"]]
    for panel, group in zip(axes, groups, strict=True):
        name = group.partition(",")[0]
        for index, level in enumerate(content["models"][0]["heat_W"] if content["models"] else ()):
            heat = [row["heat_W"][level][name] for row in content["models"]]
            style = ("-", "--", "-.", ":")[index % 4]
            panel.plot(speeds, heat, style, color=CYCLE[index % len(CYCLE)], label=f"model {level}")
        panel.set(title=group, xlabel=SPEED_LABEL, yscale="log")
        plain_decades(panel.yaxis)
    axes[0].set_ylabel("friction heat / W")
    _legend(figure, axes[0])
    return figure


CHARTS: Mapping[str, Callable[[Mapping[str, Any]], Figure | None]] = {
    "film_thickness": film_thickness,
    "thrust": loads_over_thrust,
    "contacts": contacts_over_speed,
    "ball_speeds": ball_speeds,
    "film_ratio": film_ratio,
    "heat_terms": heat_terms,
    "heat_models": heat_models,
}
"""Every chart by its file name."""
