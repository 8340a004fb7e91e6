"""Interface of the film models of the cooling channel, and film models made from correlations."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from spindle_fem.correlation import Array, Correlation, Range
from spindle_fem.errors import SpecError, did_you_mean
from spindle_fem.validity import range_fault

Regime = Literal["laminar", "turbulent"]
HOW_TO_FIX = "Let coolant.regimes choose the correlation."


@dataclass(frozen=True, slots=True)
class FlowGroups:
    """Dimensionless groups of the flow through a helical channel, arrays of one shape.

    Attributes
    ----------
    reynolds, prandtl, graetz : ndarray, [-]
        On the hydraulic diameter, at bulk temperature; the Graetz number is Re Pr D_h/L.
    viscosity_ratio, prandtl_ratio : ndarray, [-]
        Dynamic viscosity and Prandtl number at bulk over those at wall temperature.
    curvature_ratio : float, [-]
        Hydraulic over coil diameter.
    aspect_ratio : float, [-]
        Short over long side of the section.
    depth_ratio : float, [-]
        Channel depth over hydraulic diameter.
    critical_reynolds : float, [-]
        Where laminar flow ends.
    """

    reynolds: Array
    prandtl: Array
    graetz: Array
    viscosity_ratio: Array
    prandtl_ratio: Array
    curvature_ratio: float
    aspect_ratio: float
    depth_ratio: float
    critical_reynolds: float

    @property
    def dean(self) -> Array:
        """Re √(D_h/D_c), [-]."""
        return self.reynolds * np.sqrt(self.curvature_ratio)

    def at_reynolds(self, reynolds: Array) -> FlowGroups:
        """The same channel and coolant at another Reynolds number."""
        return replace(self, reynolds=reynolds, graetz=self.graetz * reynolds / self.reynolds)

    def only(self, names: tuple[str, ...]) -> dict[str, Any]:
        """Some of the groups by name."""
        return {name: getattr(self, name) for name in names}


# What a correlation may ask for.
GROUPS = (*(item.name for item in fields(FlowGroups)), "dean")


@dataclass(frozen=True, slots=True)
class FilmBand:
    """Nusselt numbers on the hydraulic diameter that the correlations for coils give together.

    Attributes
    ----------
    value, low, high : ndarray, [-]
    faults : tuple of str
        What leaves the range of the value's source.
    in_range : ndarray of bool
    candidates : mapping of str to ndarray, [-]
        Every correlation that was looked at.
    """

    value: Array
    low: Array
    high: Array
    faults: tuple[str, ...]
    in_range: NDArray[np.bool_]
    candidates: Mapping[str, Array]


@dataclass(frozen=True, slots=True)
class FilmNumbers:
    """Result of a film model.

    Attributes
    ----------
    nusselt : ndarray, [-]
        On the hydraulic diameter.
    in_range : ndarray of bool
        Whether the source covers the state.
    faults : tuple of str
        What leaves the range of the source.
    source : str
        Author and year.
    regime : ndarray of str or None
        What the model takes the flow for; None for the regime of the coil.
    """

    nusselt: Array
    in_range: NDArray[np.bool_]
    faults: tuple[str, ...]
    source: str
    regime: NDArray[np.str_] | None = None


# A film model is called with the groups of the flow and what all correlations for coils say of it.
FilmModel = Callable[[FlowGroups, FilmBand], FilmNumbers]


class NusseltCorrelation(Correlation):
    """A Nusselt number of one flow regime; as a film model it is ``model``.

    Attributes
    ----------
    source : str
        Author and year.
    regime : {"laminar", "turbulent"}
    counts : bool
        Whether it counts in the band also where its source does not cover the state,
        since the source names no limit.
    """

    def __init__(self, function: Callable[..., Array], ranges: Mapping[str, Range], **facts: Any) -> None:
        super().__init__(function, ranges, HOW_TO_FIX, facts.get("derived"))
        for name in self.quantities:
            if name not in GROUPS:
                what = f'"{name}" is no group of the flow.'
                raise SpecError(f"film correlation {self.name}", what, did_you_mean(name, GROUPS))
        self.source: str = facts["source"]
        self.regime: Regime = facts["regime"]
        self.counts: bool = facts.get("counts", False)

    def at(self, flow: FlowGroups) -> Array:
        """Nusselt number of a flow, inside the range or not."""
        return self(extrapolate=True, **flow.only(self.quantities))

    def covers_flow(self, flow: FlowGroups) -> NDArray[np.bool_]:
        """Whether the source covers each state."""
        return self.covers(**flow.only(self.quantities))

    def model(self, flow: FlowGroups, band: FilmBand) -> FilmNumbers:
        """The correlation alone as film model, whatever the flow's regime."""
        critical = flow.critical_reynolds
        limits = (0.0, critical) if self.regime == "laminar" else (critical, np.inf)
        faults = self.faults(**flow.only(self.quantities))
        other_regime = range_fault(f"{self.regime} Reynolds number", flow.reynolds, *limits)
        in_regime = (flow.reynolds >= limits[0]) & (flow.reynolds <= limits[1])
        return FilmNumbers(
            self.at(flow),
            self.covers_flow(flow) & in_regime,
            faults + ((other_regime,) if other_regime else ()),
            self.source,
        )


def nusselt_correlation(
    *,
    source: str,
    regime: Regime,
    counts: bool = False,
    derived: Callable[..., Mapping[str, Array]] | None = None,
    **ranges: Range,
) -> Callable[[Callable[..., Array]], NusseltCorrelation]:
    """Make a function of groups of the flow, a Nusselt number, a correlation of a regime.

    The function names what it asks for of :class:`FlowGroups`: ``def nusselt(dean, prandtl)``.

    Parameters
    ----------
    source : str
        Author and year, for results.
    regime : {"laminar", "turbulent"}
    counts, derived
        As :class:`NusseltCorrelation` and :class:`spindle_fem.correlation.Correlation` have them.
    **ranges : (float, float)
        Range of the source by quantity.

    Raises
    ------
    SpecError
        The function asks for what is no group of the flow.
    """
    facts = {"source": source, "regime": regime, "counts": counts, "derived": derived}
    return lambda function: NusseltCorrelation(function, ranges, **facts)
