"""Charts of a heat study, in the order of the paper's figures 12 to 17."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from spindle_fem.reporting.figures import CYCLE, new_figure, save_png, styled

SPEED_LABEL = "speed / rpm"


def write_heat_charts(content: Mapping[str, Any], folder: Path) -> list[Path]:
    """Draw every chart of a heat study into a folder.

    Parameters
    ----------
    content : mapping
        As ``heat_study`` returns it.
    folder : Path
        Made when missing.

    Returns
    -------
    list of Path
    """
    folder.mkdir(parents=True, exist_ok=True)
    charts = {
        "film_thickness": film_thickness,
        "thrust": loads_over_thrust,
        "contacts": contacts_over_speed,
        "ball_speeds": ball_speeds,
        "film_ratio": film_ratio,
        "heat_terms": heat_terms,
        "heat_models": heat_models,
    }
    return [save_png(draw(content), folder / f"{name}.png") for name, draw in charts.items()]


def _panels(number: int, height: float = 620.0) -> tuple[Figure, Sequence[Axes]]:
    figure = new_figure(height)
    axes = np.atleast_1d(figure.subplots(1, number))
    figure.subplots_adjust(left=0.07, right=0.985, top=0.86, bottom=0.14, wspace=0.26)
    return figure, axes


def _lines(
    axes: Axes,
    content: Mapping[str, Any],
    pick: Callable[[Mapping[str, Any]], float],
    style: str = "-",
    note: str = "",
) -> None:
    for index, (name, rows) in enumerate(content["bearings"].items()):
        speeds = [row["speed_rpm"] for row in rows]
        axes.plot(
            speeds,
            [pick(row) for row in rows],
            style,
            color=CYCLE[index % len(CYCLE)],
            marker="o",
            markersize=3.0,
            label=f"{name}{note}",
        )


def _finish(axes: Axes, title: str, label: str) -> None:
    axes.set(title=title, xlabel=SPEED_LABEL, ylabel=label)
    axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))


@styled
def film_thickness(content: Mapping[str, Any]) -> Figure:
    """Central film, flooded and isothermal against with thermal and starvation reduction."""
    figure, axes = _panels(2)
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
        panel.legend(ncols=2)
    return figure


@styled
def loads_over_thrust(content: Mapping[str, Any]) -> Figure:
    """Axial load and displacement of the preloaded set over the thrust."""
    figure, axes = _panels(2)
    rows = content["thrust"]
    thrust = [row["thrust_N"] for row in rows]
    for index, name in enumerate(rows[0]["bearings"] if rows else ()):
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
        panel.set(title=title, xlabel="thrust / N", ylabel=label, ylim=(0.0, None))
        panel.legend()
    return figure


@styled
def contacts_over_speed(content: Mapping[str, Any]) -> Figure:
    """Deformations, contact angles and ellipses: inner solid, outer dashed."""
    figure, axes = _panels(3)
    for panel, key, title, label in zip(
        axes,
        ("deformation_um", "contact_angle_deg", "semi_major_mm"),
        ("Contact deformation", "Contact angle", "Contact ellipse, semi-major axis"),
        ("deformation / µm", "angle / °", "semi-major axis / mm"),
        strict=True,
    ):
        for side, style in (("inner", "-"), ("outer", "--")):
            _lines(
                panel, content, lambda row, side=side, key=key: row["contacts"][side][key], style, f" {side}"
            )
        panel.set(title=title, xlabel=SPEED_LABEL, ylabel=label)
        panel.margins(y=0.25)
    axes[0].legend(ncols=2, fontsize=7.5)
    return figure


@styled
def ball_speeds(content: Mapping[str, Any]) -> Figure:
    """Orbital and spin speed of the balls, and the forces that they cause."""
    figure, axes = _panels(4)
    for panel, key, title, label in zip(
        axes,
        ("orbital_speed_rad_s", "spin_speed_rad_s", "centrifugal_force_N", "gyroscopic_moment_Nmm"),
        ("Orbit", "Spin", "Centrifugal force", "Gyroscopic moment"),
        ("speed / (rad/s)", "speed / (rad/s)", "force / N", "moment / N mm"),
        strict=True,
    ):
        _lines(panel, content, lambda row, key=key: row[key])
        _finish(panel, title, label)
    axes[0].legend()
    return figure


@styled
def film_ratio(content: Mapping[str, Any]) -> Figure:
    """Film thickness ratio; from 3 on the film carries alone."""
    figure, axes = _panels(2)
    for panel, side in zip(axes, ("inner", "outer"), strict=True):
        _lines(panel, content, lambda row, side=side: row["contacts"][side]["lambda"])
        panel.axhline(3.0, color="black", linewidth=0.9, linestyle=":")
        panel.annotate(
            "full film from 3", (0.99, 3.0), xycoords=("axes fraction", "data"), ha="right", va="bottom"
        )
        _finish(panel, f"Film thickness ratio, {side} raceway", "Λ")
        panel.legend()
    return figure


@styled
def heat_terms(content: Mapping[str, Any]) -> Figure:
    """Friction heat of each bearing, stacked by term."""
    names = list(content["bearings"])
    figure, axes = _panels(len(names))
    top = max(row["heat_W"] for rows in content["bearings"].values() for row in rows)
    for panel, name in zip(axes, names, strict=True):
        rows = content["bearings"][name]
        speeds = [row["speed_rpm"] for row in rows]
        keys = list(dict.fromkeys(key for row in rows for key in row["terms_W"]))
        shown = [key for key in keys if max(row["terms_W"].get(key, 0.0) for row in rows) > 0.005 * top]
        rest = [sum(value for key, value in row["terms_W"].items() if key not in shown) for row in rows]
        values = [[row["terms_W"].get(key, 0.0) for row in rows] for key in shown]
        panel.stackplot(
            speeds,
            *values,
            rest,
            labels=[*(key.replace("_", " ") for key in shown), "all other terms"],
            colors=CYCLE,
        )
        panel.set(title=name, xlabel=SPEED_LABEL, ylim=(0.0, 1.05 * top), xlim=(speeds[0], speeds[-1]))
    axes[0].set_ylabel("friction heat / W")
    axes[0].legend(loc="upper left", fontsize=7.5)
    figure.suptitle(f"Friction heat by term, model {content['model']}", x=0.07, ha="left", fontweight="bold")
    return figure


@styled
def heat_models(content: Mapping[str, Any]) -> Figure:
    """The same bearings by every heat model: how far they are apart."""
    names = list(content["bearings"])
    figure, axes = _panels(len(names))
    speeds = [row["speed_rpm"] for row in content["models"]]
    for panel, name in zip(axes, names, strict=True):
        for index, level in enumerate(content["models"][0]["heat_W"] if content["models"] else ()):
            heat = [row["heat_W"][level][name] for row in content["models"]]
            panel.plot(speeds, heat, color=CYCLE[index], marker="o", markersize=3.0, label=level)
        panel.set(title=name, xlabel=SPEED_LABEL, yscale="log")
    axes[0].set_ylabel("friction heat / W")
    axes[0].legend()
    figure.suptitle("Friction heat by model", x=0.07, ha="left", fontweight="bold")
    return figure
