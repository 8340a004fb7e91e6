"""Charts of a transient: probes, rings, heat, steps."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from spindle_fem.report.figure_style import (
    CYCLE,
    INK,
    INNER,
    MUTED,
    OUTER,
    TEMPERATURE_LABEL,
    new_figure,
    plain_decades,
    styled,
)
from spindle_fem.studies.transient_study import StudyResult
from spindle_fem.units import ZERO_CELSIUS_K

Array = NDArray[np.float64]
_RPM = 30.0 / np.pi
_MOTION_WORDS = {
    "nose_axial": "nose forward",
    "nose_radial_up": "nose up",
    "nose_radial_across": "nose across",
}
# Share of the preload by which it has to change to be drawn.
SAME_PRELOAD = 1.0e-3


def _hours(seconds: Array | float) -> Array:
    return np.asarray(seconds) / 3600.0


def _stacked(height_px: float, title: str, ratios: tuple[float, ...]) -> tuple[Figure, list]:
    figure = new_figure(height_px)
    figure.set_layout_engine("constrained")
    axes = list(figure.subplots(len(ratios), 1, sharex=True, height_ratios=ratios, squeeze=False)[:, 0])
    figure.suptitle(title, x=0.01, ha="left", fontsize=12.5, fontweight="bold")
    axes[-1].set_xlabel("time / h")
    return figure, axes


def _legend_above(axes, columns: int) -> None:
    """Legend between the chart and what is over it, where no curve runs."""
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), borderaxespad=0.2, ncols=columns)


def _speed_strip(axes, result: StudyResult) -> None:
    edges = [result.phases[0].start, *(phase.end for phase in result.phases)]
    axes.stairs(
        [phase.point.speed * _RPM for phase in result.phases], _hours(edges), color=INK, linewidth=1.6
    )
    axes.set_ylabel("speed / rpm")
    axes.set_ylim(bottom=0.0)


@styled
def probe_history(result: StudyResult, steady: Mapping[str, float] | None = None) -> Figure:
    """Every probe over time, the speed below.

    Parameters
    ----------
    steady : mapping of probe to float, optional, [°C]
        Where the last phase tends to: dotted over it.
    """
    figure, (upper, lower) = _stacked(900.0, f"{result.study.name}: probes", (4.0, 1.0))
    hours, readings = _hours(result.joined("times")), result.joined("readings") - ZERO_CELSIUS_K
    for column, name in enumerate(result.phases[0].transient.probes):
        colour = CYCLE[column % len(CYCLE)]
        upper.plot(hours, readings[:, column], label=name, color=colour)
        if steady is not None:
            last = _hours(np.array([result.phases[-1].start, result.phases[-1].end]))
            upper.plot(last, [steady[name]] * 2, color=colour, linestyle=":", linewidth=1.2)
    if steady is not None:
        upper.plot([], [], color=MUTED, linestyle=":", label="steady state of the last phase")
    _phase_ends(upper, result)
    upper.set_ylabel(TEMPERATURE_LABEL)
    _legend_above(upper, 3)
    _speed_strip(lower, result)
    return figure


def _phase_ends(axes, result: StudyResult) -> None:
    for phase in result.phases[:-1]:
        axes.axvline(_hours(phase.end), color=MUTED, linewidth=0.6, alpha=0.6, zorder=0.5)


@styled
def bearing_history(result: StudyResult) -> Figure | None:
    """Raceway temperatures of every bearing and the difference between the rings; None without bearings."""
    bearings = result.phases[0].transient.bearings
    if not bearings:
        return None
    figure, (upper, lower) = _stacked(1000.0, f"{result.study.name}: bearings", (2.0, 1.0))
    hours = _hours(result.joined("times"))
    inner, outer = result.joined("inner") - ZERO_CELSIUS_K, result.joined("outer") - ZERO_CELSIUS_K
    for column, name in enumerate(bearings):
        colour = CYCLE[column % len(CYCLE)]
        upper.plot(hours, inner[:, column], color=colour, label=name)
        upper.plot(hours, outer[:, column], color=colour, linestyle="--")
        lower.plot(hours, inner[:, column] - outer[:, column], color=colour)
    upper.plot([], [], color=MUTED, label="inner raceway")
    upper.plot([], [], color=MUTED, linestyle="--", label="outer raceway")
    for axes in (upper, lower):
        _phase_ends(axes, result)
    upper.set_ylabel(TEMPERATURE_LABEL)
    _legend_above(upper, 4)
    lower.set_ylabel("inner − outer / K")
    return figure


@styled
def heat_history(result: StudyResult) -> Figure:
    """Friction heat, what the coolant takes, and preload where it changes."""
    preload = result.step_record("preload")
    known = preload[np.isfinite(preload).all(axis=1)]
    follows = bool(known.size) and bool(np.any(np.ptp(known, axis=0) > SAME_PRELOAD * known.max()))
    figure, axes = _stacked(
        1000.0 if follows else 700.0, f"{result.study.name}: heat", (2.0, 1.0) if follows else (1.0,)
    )
    hours, heat = _hours(result.step_record("times")), result.step_record("bearing_heat")
    axes[0].plot(hours, heat.sum(axis=1), color=INNER, label="friction in all bearings")
    axes[0].plot(
        hours, result.step_record("coolant_heat"), color=OUTER, label="taken by the coolant (mean of a step)"
    )
    for axis in axes:
        _phase_ends(axis, result)
    axes[0].set_ylabel("heat / W")
    _legend_above(axes[0], 2)
    if follows:
        for column, name in enumerate(result.phases[0].transient.bearings):
            axes[1].plot(hours, preload[:, column], color=CYCLE[column % len(CYCLE)], label=name)
        axes[1].set_ylabel("preload / N")
        _legend_above(axes[1], 5)
    return figure


@styled
def growth_history(result: StudyResult) -> Figure | None:
    """Shift of the nose and readings of the displacement sensors since assembly; None without bodies."""
    names = result.phases[0].transient.motions
    shown = [column for column, name in enumerate(names) if "_tilt_" not in name]
    if not shown:
        return None
    figure, (upper, lower) = _stacked(900.0, f"{result.study.name}: growth", (4.0, 1.0))
    hours, motion = _hours(result.joined("times")), 1.0e6 * result.joined("motion")
    for number, column in enumerate(shown):
        label = _MOTION_WORDS.get(names[column], f"sensor {names[column]}")
        upper.plot(hours, motion[:, column], color=CYCLE[number % len(CYCLE)], label=label)
    _phase_ends(upper, result)
    upper.set_ylabel("since assembly / µm")
    _legend_above(upper, 3)
    _speed_strip(lower, result)
    return figure


@styled
def step_history(result: StudyResult) -> Figure:
    """Size and estimated error of every step."""
    figure, (upper, lower) = _stacked(800.0, f"{result.study.name}: time steps", (1.0, 1.0))
    hours = _hours(result.step_record("times"))
    upper.semilogy(hours, result.step_record("sizes"), ".-", color=CYCLE[0])
    plain_decades(upper.yaxis)
    upper.set_ylabel("step / s")
    errors = result.step_record("errors")
    lower.semilogy(hours[errors > 0.0], errors[errors > 0.0], ".-", color=CYCLE[1])
    plain_decades(lower.yaxis)
    lower.axhline(result.study.error, color=MUTED, linewidth=1.0, linestyle="--")
    lower.set_ylabel("estimated error / K")
    return figure
