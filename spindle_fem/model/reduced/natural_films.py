"""Natural convection and radiation of a machine's own films as terms of the fast model."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.machine_spec import MachineSpec, NaturalFilm
from spindle_fem.effects.framework.term import Term, TermContext
from spindle_fem.operation.coefficients import (
    fluid_temperature,
    natural_coefficient_and_slope,
    natural_reference,
)


class NaturalFilmTerm(Term):
    """A film that follows the temperature of its surface.

    The full model takes the coefficient of each facet, this one that of the
    surface's mean temperature.
    """

    def __init__(self, spec: MachineSpec, film: NaturalFilm, surface: str) -> None:
        self.film = film
        self.reference = natural_reference(spec, film)
        self.name = f"natural film of {surface}"
        self.coefficients = (f"film.{surface}",)
        self.reads = (surface,)

    def factor(self, context: TermContext) -> NDArray[np.complex128]:
        """Coefficient at the wall's temperature over that which the operators hold, (1, k)."""
        fluid = fluid_temperature(self.film, context.inputs["ambient"])
        value, slope = natural_coefficient_and_slope(self.film, context.temperatures.real, fluid)
        return (value + 1j * slope * context.temperatures.imag) / self.reference


def natural_film_terms(spec: MachineSpec) -> tuple[NaturalFilmTerm, ...]:
    """A term for each surface with a natural film."""
    return tuple(
        NaturalFilmTerm(spec, film, surface)
        for film in spec.film
        if isinstance(film, NaturalFilm)
        for surface in film.surface
    )
