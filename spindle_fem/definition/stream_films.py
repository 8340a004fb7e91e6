"""Common base of films of flowing fluids: a separate fluid that warms along its walls."""

from __future__ import annotations

from spindle_fem.definition.exchange_tables import Surface
from spindle_fem.definition.field_types import SpecModel

INLET_PREFIX = "inlet."


class StreamFilm(SpecModel):
    """A stream with a constant flow, whose coefficients are those at the definition's inlet temperature.

    A stream has ``name``, ``inlet_temperature``, ``flow`` and ``factor``.
    """

    @property
    def in_parallel(self) -> bool:
        """Whether every cell takes its own share of the flow from the inlet, or what the cell before left."""
        return False

    @property
    def temperature(self) -> float:
        """Temperature of the fluid at the inlet, K."""
        return self.inlet_temperature

    @property
    def inlet_input(self) -> str:
        """Input of a recording that is its inlet temperature, in the place of the definition's."""
        return f"{INLET_PREFIX}{self.name}"

    @property
    def cell_surfaces(self) -> tuple[tuple[str, ...], ...]:
        """Names of the walls of each cell, from the inlet."""
        raise NotImplementedError

    @property
    def ball_row(self) -> str | None:
        """The row of balls or rollers among its walls (``F1.balls``), a body of one temperature."""
        return None

    @property
    def n_cells(self) -> int:
        """Along the flow."""
        return len(self.cell_surfaces)

    @property
    def surface(self) -> tuple[str, ...]:
        """Names of all its walls, as other films have them."""
        return tuple(name for names in self.cell_surfaces for name in names)

    @property
    def walls(self) -> tuple[Surface, ...]:
        """Surfaces that it names itself."""
        return ()
