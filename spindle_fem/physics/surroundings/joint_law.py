"""Law of a joint's conductance: a formula, the units of its quantities, and its range."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from spindle_fem.correlation import Array, Correlation, Range
from spindle_fem.validity import POSITIVE

TOUCHING_EVERYWHERE = (
    "Beyond this the asperities touch nearly everywhere: treat the joint as perfect. "
    "Give SI values: Pa, W/(m·K), m, and the slope as a tangent."
)


class JointLaw(Correlation):
    """A conductance, W/(m²·K), of quantities that a definition gives.

    Attributes
    ----------
    units : mapping of str to str
        SI unit by quantity; a quantity without a value has none in the formula either.
    """

    def __init__(
        self,
        function: Callable[..., Array],
        units: Mapping[str, str],
        ranges: Mapping[str, Range],
        how_to_fix: str,
        derived: Callable[..., Mapping[str, Array]] | None,
    ) -> None:
        super().__init__(function, ranges, how_to_fix, derived)
        self.units = units

    @property
    def required(self) -> tuple[str, ...]:
        """Quantities that have no usual value."""
        return tuple(name for name in self.quantities if name not in self._defaults)


def joint_law(
    *,
    units: Mapping[str, str],
    how_to_fix: str = TOUCHING_EVERYWHERE,
    derived: Callable[..., Mapping[str, Array]] | None = None,
    **ranges: Range,
) -> Callable[[Callable[..., Array]], JointLaw]:
    """Make a formula the law of a joint; quantities without a range of their own are positive."""
    limits = dict.fromkeys(units, POSITIVE) | ranges
    return lambda function: JointLaw(function, units, limits, how_to_fix, derived)
