"""How results look in a terminal and in a notebook: one line, or a small table."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape


class Presented:
    """Gives a result its ``repr`` and its table in notebooks; a result says what stands in them."""

    __slots__ = ()

    def _headline(self) -> str:
        """What it is, in a few words."""
        raise NotImplementedError

    def _rows(self) -> Mapping[str, str]:
        """What matters most, by name, as text with units."""
        return {}

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self._headline()}>"

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><th style='text-align:left'>{escape(name)}</th><td>{escape(text)}</td></tr>"
            for name, text in self._rows().items()
        )
        return f"<b>{escape(self._headline())}</b><table>{rows}</table>"
