"""A formula with its source and the range in which that source holds."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spindle_fem.validity import range_fault, require_range

Array = NDArray[np.float64]
Range = tuple[float, float]


class Correlation:
    """A formula that refuses values outside the range of its source.

    Called with the quantities of the formula as array_like of one shape or
    shapes that broadcast, it returns an array. Outside its range it raises :class:`OutOfValidityError`,
    unless ``extrapolate=True`` is given; callers that give it must warn the user.

    Attributes
    ----------
    name : str
        Of the function.
    ranges : mapping of str to (float, float)
        Lowest and highest allowed value by quantity; quantities that follow from
        several others (a Dean number) are given by ``derived``.
    """

    def __init__(
        self,
        function: Callable[..., Array],
        ranges: Mapping[str, Range],
        how_to_fix: str = "",
        derived: Callable[..., Mapping[str, Array]] | None = None,
    ) -> None:
        functools.update_wrapper(self, function)
        self.name = function.__name__
        self.function, self.ranges, self.how_to_fix, self._derived = function, ranges, how_to_fix, derived
        parameters = inspect.signature(function).parameters
        self.quantities = tuple(parameters)
        self._defaults = {
            name: item.default for name, item in parameters.items() if item.default is not item.empty
        }

    def __call__(self, *values: ArrayLike, extrapolate: bool = False, **named: ArrayLike) -> Array:
        """Answer of the formula, broadcast over its quantities."""
        given = self._defaults | dict(zip(self.quantities, values, strict=False)) | named
        arrays = np.broadcast_arrays(*(np.asarray(given[name], dtype=np.float64) for name in self.quantities))
        if not extrapolate:
            limited = self._limited(dict(zip(self.quantities, arrays, strict=True)))
            require_range(
                self.name,
                how_to_fix=self.how_to_fix,
                **{name: (value, *self.ranges[name]) for name, value in limited.items()},
            )
        return self.function(*arrays)

    def faults(self, **quantities: ArrayLike) -> tuple[str, ...]:
        """Parts of a sentence on which of the given quantities leave their range."""
        limited = self._limited(quantities)
        texts = (range_fault(name, value, *self.ranges[name]) for name, value in limited.items())
        return tuple(text for text in texts if text)

    def covers(self, **quantities: ArrayLike) -> NDArray[np.bool_]:
        """Whether the quantities given lie inside their ranges, element by element."""
        inside = [
            (np.asarray(value) >= self.ranges[name][0]) & (np.asarray(value) <= self.ranges[name][1])
            for name, value in self._limited(quantities).items()
        ]
        return np.logical_and.reduce(np.broadcast_arrays(*inside))

    def _limited(self, quantities: Mapping[str, Any]) -> dict[str, Any]:
        known = dict(quantities)
        if self._derived is not None and all(name in known for name in self.quantities):
            known |= self._derived(**{name: known[name] for name in self.quantities})
        return {name: known[name] for name in self.ranges if name in known}


def correlation(
    *,
    how_to_fix: str = "",
    derived: Callable[..., Mapping[str, Array]] | None = None,
    **ranges: Range,
) -> Callable[[Callable[..., Array]], Correlation]:
    """Make a formula refuse values outside the ranges given by quantity.

    Parameters
    ----------
    how_to_fix : str
        What to do instead, for the message.
    derived : callable, optional
        Further quantities that have a range, from those of the formula.
    **ranges : (float, float)
        Lowest and highest allowed value.

    >>> @correlation(reynolds=(1.0e4, 1.2e5))
    ... def nusselt(reynolds):
    ...     return 0.02 * reynolds**0.8
    >>> nusselt.faults(reynolds=500.0)
    ('reynolds is 500, allowed 10000 to 120000',)
    """
    return lambda function: Correlation(function, ranges, how_to_fix, derived)
