"""Flow that a pump delivers into a circuit: the requested flow, or less if its pressure does not suffice."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from spindle_fem.bracketed_root import bracketed_root
from spindle_fem.errors import OutOfValidityError
from spindle_fem.validity import NOT_NEGATIVE, POSITIVE, require_range

# Pressure of circulation pumps in spindle coolers, which give 3 to 6 bar.
PUMP_PRESSURE = 6.0e5
# Relative tolerance of the flow delivered, and smallest flow considered, relative to the requested flow.
_TOLERANCE = 1.0e-12
_TRICKLE = 1.0e-9


@dataclass(frozen=True, slots=True)
class Pump:
    """A pump that delivers the requested flow as far as its pressure allows.

    Attributes
    ----------
    flow : float, [m³/s]
        Asked for.
    pressure_limit : float, [Pa]
        Of a relief valve; infinite without one.
    curve_flow, curve_pressure : tuple of float, [m³/s], [Pa]
        The pump's curve, pressure falling as the flow grows: level before its first entry, beyond its last
        one on along its last stretch down to no pressure. Empty for a pump that keeps its flow.

    Raises
    ------
    OutOfValidityError
        No flow, no pressure, a curve that does not fall.

    >>> pump = Pump(20e-3 / 60, pressure_limit=1.0e5)
    >>> resistance = 2.0e5 / pump.flow
    >>> round(pump.delivered(lambda flow: resistance * flow) / pump.flow, 12)
    0.5
    """

    flow: float
    pressure_limit: float = np.inf
    curve_flow: tuple[float, ...] = ()
    curve_pressure: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        require_range(
            "pump",
            flow=(self.flow, *POSITIVE),
            pressure_limit=(self.pressure_limit, POSITIVE[0], np.inf),
            curve_flow=(self.curve_flow or 0.0, *NOT_NEGATIVE),
            curve_pressure=(self.curve_pressure or 0.0, *NOT_NEGATIVE),
            how_to_fix="Give SI values.",
        )
        grows, falls = np.diff(self.curve_flow) > 0.0, np.diff(self.curve_pressure) < 0.0
        same = len(self.curve_flow) == len(self.curve_pressure)
        if len(self.curve_flow) == 1 or not (same and grows.all() and falls.all()):
            raise OutOfValidityError(
                "pump",
                f"{len(self.curve_flow)} flows and {len(self.curve_pressure)} pressures make no curve.",
                "Give as many of both, at least two: flows that grow, pressures that fall.",
            )

    @property
    def is_limited(self) -> bool:
        """Whether pressure can keep the flow below the requested flow."""
        return np.isfinite(self.pressure_limit) or bool(self.curve_flow)

    def pressure(self, flow: float) -> float:
        """Highest pressure that the pump gives at a flow [m³/s], Pa."""
        if not self.curve_flow:
            return self.pressure_limit
        given = float(np.interp(flow, self.curve_flow, self.curve_pressure))
        beyond = flow - self.curve_flow[-1]
        if beyond > 0.0:
            fall = self.curve_pressure[-2] - self.curve_pressure[-1]
            given -= beyond * fall / (self.curve_flow[-1] - self.curve_flow[-2])
        return min(given, self.pressure_limit)

    def delivered(self, pressure_drop: Callable[[float], float]) -> float:
        """Flow at which the circuit's pressure drop equals the pump's; at most the requested flow, m³/s.

        Parameters
        ----------
        pressure_drop : callable
            Of the circuit [Pa] at a flow [m³/s] above zero; grows with it.
        """

        def lacking(share: float) -> float:
            return pressure_drop(share * self.flow) - self.pressure(share * self.flow)

        if not self.is_limited or lacking(1.0) <= 0.0:
            return self.flow
        share = bracketed_root(lacking, _TRICKLE, 1.0, absolute=_TOLERANCE, relative=_TOLERANCE)
        return self.flow * share
