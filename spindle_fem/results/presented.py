"""Display of results in a terminal and in a notebook: one line, or a small table."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape


class Presented:
    """Gives a result its ``repr`` and its table in notebooks, from its headline and rows."""

    __slots__ = ()

    def _headline(self) -> str:
        """Kind of result, in a few words."""
        raise NotImplementedError

    def _rows(self) -> Mapping[str, str]:
        """Most important values by name, as text with units."""
        return {}

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self._headline()}>"

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><th style='text-align:left'>{escape(name)}</th><td>{escape(text)}</td></tr>"
            for name, text in self._rows().items()
        )
        return f"<b>{escape(self._headline())}</b><table>{rows}</table>"
