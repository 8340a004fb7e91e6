"""The paper's choice of depth and oil temperature, by its equations and by those of a helical duct."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.machine.geometry.coolant_path import section_of
from spindle_fem.physics.coolant.channel_section import ChannelSection
from spindle_fem.physics.coolant.duct_friction import channel_pressure_drop
from spindle_fem.physics.coolant.properties import coolant_by_name
from spindle_fem.physics.coolant.transition import critical_reynolds_schmidt
from spindle_fem.studies.sweep.film_map import FilmMap, film_map
from spindle_fem.units import ZERO_CELSIUS_K

PAPER_DEPTH, PAPER_TEMPERATURE = 19.0e-3, 31.0 + ZERO_CELSIUS_K
# The paper takes Re on the depth and calls it turbulent from here.
PAPER_CRITICAL_REYNOLDS = 2300.0
DEPTHS = np.linspace(5.0e-3, 30.0e-3, 51)
TEMPERATURES = np.linspace(10.0, 40.0, 61) + ZERO_CELSIUS_K
MODELS = {"paper": "the paper's equations 30 and 31", "helical": "helical duct"}


@dataclass(frozen=True, slots=True)
class FilmChart:
    """One film map with the demand on the pump.

    Attributes
    ----------
    model : str
        A key of ``MODELS``.
    held : str
        "velocity" or "flow".
    amount : float
        What is held, m/s or m³/s.
    laminar_share : (n_depths, n_temperatures) ndarray, [-]
        Reynolds number over that at which the model leaves laminar flow: 1 is
        the laminar-turbulent line.
    pressure_drop : (n_depths, n_temperatures) ndarray, [Pa]
        From port to port without the ports.
    pumping_power : (n_depths, n_temperatures) ndarray, [W]
    best : (float, float), [m], [K]
        Depth and temperature of the largest coefficient.
    best_value : float, [W/(m²·K)]
    paper_value : float, [W/(m²·K)]
        At the paper's optimum, 19 mm and 31 °C.
    """

    model: str
    held: str
    amount: float
    chart: FilmMap
    laminar_share: NDArray[np.float64]
    pressure_drop: NDArray[np.float64]
    pumping_power: NDArray[np.float64]
    best: tuple[float, float]
    best_value: float
    paper_value: float


@dataclass(frozen=True, slots=True)
class PumpLimits:
    """Pump limits of a study, infinite if not given.

    Attributes
    ----------
    pressure_drop : float, [Pa]
    pumping_power : float, [W]
    """

    pressure_drop: float = np.inf
    pumping_power: float = np.inf

    @property
    def given(self) -> bool:
        """Whether there is any."""
        return bool(np.isfinite(min(self.pressure_drop, self.pumping_power)))

    def demand(self, chart: FilmChart) -> NDArray[np.float64]:
        """Pump demand over its limit, pressure or power, the larger; 1 is the limit.

        Same shape as the chart, (n_depths, n_temperatures).
        """
        return np.maximum(chart.pressure_drop / self.pressure_drop, chart.pumping_power / self.pumping_power)

    def best(self, chart: FilmChart) -> tuple[float, float, float] | None:
        """Depth, oil temperature and value of the largest coefficient that the pump allows; None if none."""
        allowed = np.where(self.demand(chart) <= 1.0, chart.chart.value, -np.inf)
        row, column = np.unravel_index(int(np.argmax(allowed)), allowed.shape)
        if not np.isfinite(allowed[row, column]):
            return None
        return float(DEPTHS[row]), float(TEMPERATURES[column]), float(allowed[row, column])


def pump_limits(constraints: Iterable[Mapping[str, Any]]) -> PumpLimits:
    """Limits of the pump among those of a study.

    Parameters
    ----------
    constraints : iterable of mapping
        As in ``sweep.json``: ``output``, ``min``, ``max``.

    >>> pump_limits([{"output": "coolant.pressure_drop_Pa", "min": None, "max": 5e5}])
    PumpLimits(pressure_drop=500000.0, pumping_power=inf)
    """
    found = {"coolant.pressure_drop_Pa": np.inf, "coolant.pumping_power_W": np.inf}
    for item in constraints:
        if item["output"] in found and item["max"] is not None:
            found[item["output"]] = min(found[item["output"]], float(item["max"]))
    return PumpLimits(*found.values())


def film_study(spec: MachineSpec) -> tuple[FilmChart, ...]:
    """Film maps over depth and oil temperature, by two sets of equations, at constant velocity and flow.

    Depth 5–30 mm, temperature 10–40 °C. The paper gives neither velocity nor
    flow. Held here is the velocity that puts the paper's optimum on the paper's
    own laminar–turbulent line, where its choice comes from, and the flow that
    the machine has.

    Parameters
    ----------
    spec : MachineSpec
        With a channel.

    Returns
    -------
    tuple of FilmChart
        Empty for a machine that is not the paper's or has no channel.

    Source: Wu & Tan (2016), Adv. Mech. Eng. 8(8), Figure 22 and its optimum.
    """
    if spec.channel is None or not spec.is_the_papers:
        return ()
    channel, coolant = spec.channel, coolant_by_name(spec.coolant.fluid)
    section = section_of(channel)
    viscosity = float(coolant.properties(PAPER_TEMPERATURE).kinematic_viscosity)
    held = {"velocity": PAPER_CRITICAL_REYNOLDS * viscosity / PAPER_DEPTH, "flow": spec.coolant.flow}
    charts = []
    for hold, amount in held.items():
        how = {"velocity": amount} if hold == "velocity" else {"volume_flow": amount}
        for model in MODELS:
            chart = film_map(model, section, coolant, DEPTHS, TEMPERATURES, **how)
            at_paper = film_map(model, section, coolant, [PAPER_DEPTH], [PAPER_TEMPERATURE], **how)
            row, column = np.unravel_index(int(np.argmax(chart.value)), chart.value.shape)
            drop = _pressure_drops(section, coolant, chart)
            charts.append(
                FilmChart(
                    model=model,
                    held=hold,
                    amount=float(amount),
                    chart=chart,
                    laminar_share=_laminar_share(model, section, chart),
                    pressure_drop=drop,
                    pumping_power=drop * chart.volume_flow[:, None],
                    best=(float(DEPTHS[row]), float(TEMPERATURES[column])),
                    best_value=float(chart.value[row, column]),
                    paper_value=float(at_paper.value[0, 0]),
                )
            )
    return tuple(charts)


def _laminar_share(model: str, section: ChannelSection, chart: FilmMap) -> NDArray[np.float64]:
    """The paper takes 2300 on the depth, the helical duct Schmidt's limit on its hydraulic diameter."""
    sections = [replace(section, depth=float(depth)) for depth in chart.depth]
    if model == "paper":
        factor = [one.depth / one.hydraulic_diameter / PAPER_CRITICAL_REYNOLDS for one in sections]
    else:
        factor = [1.0 / float(critical_reynolds_schmidt(one.curvature_ratio)) for one in sections]
    return chart.reynolds * np.array(factor)[:, None]


def _pressure_drops(section: ChannelSection, coolant: object, chart: FilmMap) -> NDArray[np.float64]:
    properties = [coolant.properties(float(temperature)) for temperature in chart.temperature]
    found = np.empty(chart.value.shape)
    for row, (depth, flow) in enumerate(zip(chart.depth, chart.volume_flow, strict=True)):
        one = replace(section, depth=float(depth))
        critical = float(critical_reynolds_schmidt(one.curvature_ratio))
        found[row] = [channel_pressure_drop(one, float(flow), oil, critical).channel for oil in properties]
    return found
