"""Units that designers read, for the parameters and outputs of a study."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

# Unit of the table: (factor, unit shown).
_SHOWN = {
    "m": (1.0e3, "mm"),
    "rad/s": (30.0 / math.pi, "rpm"),
    "rad": (180.0 / math.pi, "deg"),
    "m**3/s": (6.0e4, "L/min"),
    "m³/s": (6.0e4, "L/min"),
    "Pa": (1.0e-5, "bar"),
    "m**2/s": (1.0e6, "mm²/s"),
    "W/m**2/K": (1.0, "W/(m²·K)"),
}


@dataclass(frozen=True, slots=True)
class Scale:
    """Scale and label of one drawn column of the table.

    Attributes
    ----------
    path : str
        Column.
    label : str
        Name with unit for an axis.
    words : tuple of str
        Of a column of words, which are drawn at 0, 1, 2; empty for numbers.
    """

    path: str
    label: str
    factor: float
    unit: str
    words: tuple[str, ...] = ()

    def of(self, rows: Sequence[Mapping[str, Any]], ending: str = "") -> NDArray[np.float64]:
        """Values of rows as drawn, nan where there is none."""
        values = [row.get(self.path + ending) for row in rows]
        if self.words:
            return np.array(
                [self.words.index(v) if v in self.words else math.nan for v in values], dtype=float
            )
        return np.array([math.nan if v is None else self.factor * v for v in values], dtype=float)

    def text(self, value: Any) -> str:
        """A value of the table for people, without its unit."""
        if value is None:
            return "–"
        if isinstance(value, str):
            return value
        number = self.factor * value
        return f"{number:.5g}".replace("-", "−")


def scale_of_column(path: str, unit: str, rows: Sequence[Mapping[str, Any]]) -> Scale:
    """Scale of a column with its unit in the table.

    >>> scale_of_column("channel.depth", "m", [{"channel.depth": 0.019}]).label
    'channel depth / mm'
    """
    words = sorted({row[path] for row in rows if isinstance(row.get(path), str)})
    factor, shown = _SHOWN.get(unit, (1.0, unit))
    name = name_of(path)
    return Scale(path, f"{name} / {shown}" if shown else name, factor, shown, tuple(words))


def name_of(path: str) -> str:
    """Name of a column for people, without its unit.

    >>> name_of("bearings.F2.ring_difference_K"), name_of("temperature.max_degC")
    ('F2 ring difference', 'temperature max')
    """
    text = path.removeprefix("bearings.").removeprefix("derived.").removesuffix(".value")
    text = text.replace("terms_W.", "heat, ")
    for ending in (
        "_W_m2K",
        "_K_per_m",
        "_m3_s",
        "_m_s",
        "_degC",
        "_deg",
        "_um",
        "_m2",
        "_Pa",
        "_W",
        "_N",
        "_K",
        "_m",
    ):
        if text.endswith(ending):
            text = text.removesuffix(ending)
            break
    return text.replace(".", " ").replace("_", " ")
