"""Choice of the steps of a transient on a mesh, and accuracy of each solve."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from spindle_fem.errors import SpecError
from spindle_fem.model.mesh.linear_solvers import Method

ERROR_TOLERANCE_K = 0.05
# However well a stage's iteration contracts, its last change is at most 1/share times what may be left:
# heat that follows the temperatures is that of the last input.
LEAST_SHARE = 0.2
ErrorNorm = Literal["largest", "mean"]


@dataclass(frozen=True, slots=True)
class StepControl:
    """Settings for the choice of steps.

    Attributes
    ----------
    tolerance : float or None, [K]
        Estimated error of a step; None keeps ``first_step``.
    first_step : float or None, [s]
        A ten-thousandth of the span when None.
    largest_step : float, [s]
    linear_tolerance : float or None, [K]
        Error allowed to the linear solver; a thousandth of the tolerance when
        None.
    temperature_dependent : bool
        Whether the inputs look at the temperatures: each stage is then
        iterated. Film laws switch it on.
    nonlinear_tolerance : float or None, [K]
        Change at which that iteration ends; a hundredth of the tolerance when
        None.
    trust_contraction : bool
        Whether it may end before, where the change times what the iteration
        lately left of a change is as small: one solve a stage fewer. Heat of
        temperature-dependent inputs is then that of fields so much further apart.
    method : {"direct", "multigrid"} or None
    error_norm : {"largest", "mean"}
        Of the tolerance: the largest error over all nodes, or the root mean square over the heat capacity.
        After a jump a surface is far off the course of a step and little heat is behind it: where the mean
        counts, temperatures within a machine are as near the truth with fewer steps.
    """

    tolerance: float | None = ERROR_TOLERANCE_K
    first_step: float | None = None
    largest_step: float = np.inf
    linear_tolerance: float | None = None
    temperature_dependent: bool = False
    nonlinear_tolerance: float | None = None
    trust_contraction: bool = False
    method: Method | None = None
    error_norm: ErrorNorm = "largest"

    def __post_init__(self) -> None:
        if self.tolerance is None and self.first_step is None:
            raise SpecError("step control", "neither a tolerance nor a step.", "Give one of both.")
        if self.error_norm not in get_args(ErrorNorm):
            raise SpecError(
                "step control: error_norm",
                f"{self.error_norm!r}.",
                f"Allowed: {', '.join(get_args(ErrorNorm))}.",
            )
        for name in ("tolerance", "first_step", "largest_step", "linear_tolerance", "nonlinear_tolerance"):
            value = getattr(self, name)
            if value is not None and not value > 0.0:
                raise SpecError(f"step control: {name}", f"{value!r}.", "Allowed: above 0.")

    @property
    def linear(self) -> float:
        """Error allowed to the linear solver, [K]."""
        return self.linear_tolerance or 1e-3 * (self.tolerance or 1e-3)

    @property
    def nonlinear(self) -> float:
        """Change at which a stage's iteration ends, [K]."""
        return self.nonlinear_tolerance or 1e-2 * (self.tolerance or 1e-3)


DEFAULT_CONTROL = StepControl()
