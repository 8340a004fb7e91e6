"""Interface of the bearing heat models: inputs, options, results, and the models by name."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from spindle_fem.errors import OutOfValidityError, SpecError, did_you_mean
from spindle_fem.physics.bearings.ball_system import BallSystem
from spindle_fem.physics.bearings.bearing_geometry import BearingGeometry
from spindle_fem.physics.bearings.bearing_state import BearingHeat
from spindle_fem.physics.bearings.heat_models import HEAT_MODELS
from spindle_fem.physics.bearings.hertz import INNER, OUTER
from spindle_fem.physics.bearings.roller_bearing import RollerGeometry, RollerStates
from spindle_fem.physics.bearings.traction import ContactPatch, LubricantState, TractionIntegrals

FloatArray = NDArray[np.float64]
BallAttitude = Literal["equilibrium", "outer"]


@dataclass(frozen=True, slots=True)
class HeatOptions:
    """Choice of heat model, and parameters that only it needs.

    Attributes
    ----------
    level : str
        One of :func:`friction_model_names`.
    beside : tuple of str
        Further ones, whose heat in the same equilibrium ``BearingState.heat_beside`` gets.
    rolling_surfaces : {2, 1}
        The hydrodynamic rolling force acts on both surfaces of a contact: power
        2 F_R u. Some papers count one.
    hysteresis_loss : float, [-]
        Share of the elastic work lost in a load cycle of hard steel.
    palmgren_f0_rollers : float or None, [-]
        f_0 of a row of rollers; that of the bearing or its kind where None.
    skf_replenishment : float, [-]
        K_rs: 6e-8 for grease and oil-air, 3e-8 for oil baths and jets.
    flooded : bool
        Whether oil stands all around the contacts (baths, jets); else rolling of ``full`` is that of inlets
        that are starved a little.
    """

    level: str = "full"
    rolling_surfaces: int = 2
    hysteresis_loss: float = 0.01
    palmgren_f0: float = 2.0
    palmgren_f0_rollers: float | None = None
    skf_replenishment: float = 6.0e-8
    flooded: bool = False
    skf_friction_ehl: float = 0.04
    skf_friction_boundary: float = 0.15
    beside: tuple[str, ...] = ()

    def others(self) -> tuple[HeatOptions, ...]:
        """Options of the further models."""
        return tuple(replace(self, level=level, beside=()) for level in self.beside)

    def __post_init__(self) -> None:
        known = friction_model_names()
        if self.level not in known:
            raise SpecError("heat.model", f"{self.level!r} is unknown.", did_you_mean(str(self.level), known))
        if self.rolling_surfaces not in (1, 2):
            raise SpecError("heat.rolling_surfaces", f"it is {self.rolling_surfaces}.", "Allowed: 1, 2.")
        if not 0.0 <= self.hysteresis_loss <= 0.1:
            raise SpecError("heat.hysteresis_loss", f"it is {self.hysteresis_loss:g}.", "Allowed: 0 to 0.1.")


@dataclass(frozen=True, slots=True, eq=False)
class HeatInputs:
    """Results of a bearing's equilibrium that the heat models use.

    ``system``, ``patch``, ``traction`` and ``lubricant`` hold this bearing's
    balls only; ``orbital`` and ``drag`` are (n,).
    """

    geometry: BearingGeometry
    system: BallSystem
    patch: ContactPatch
    traction: TractionIntegrals
    lubricant: LubricantState
    orbital: FloatArray
    drag: FloatArray
    speed: float
    kinematic_viscosity: float
    axial_force: float
    radial_force: float


@dataclass(frozen=True, slots=True, eq=False)
class RollerHeatInputs:
    """Results of a roller bearing's equilibrium that the heat models use."""

    geometry: RollerGeometry
    states: RollerStates
    speed: float
    kinematic_viscosity: float


RollerModel = Callable[[RollerHeatInputs, HeatOptions], BearingHeat]


class FrictionModel:
    """A heat model that follows from a bearing's equilibrium.

    Attributes
    ----------
    ball_attitude : {"equilibrium", "outer"}
        What sets the axis about which a ball turns: its own friction, or outer race control.
    needs_boundary : bool
        Whether bore and outer diameter enter.
    counts_cage : bool
        Whether cage and seal enter.
    rollers : callable or None
        The same model for roller bearings; None where it knows balls only.
    """

    def __init__(
        self,
        heat: Callable[[HeatInputs, HeatOptions], BearingHeat],
        ball_attitude: BallAttitude,
        needs_boundary: bool,
        counts_cage: bool,
        rollers: RollerModel | None = None,
    ) -> None:
        functools.update_wrapper(self, heat)
        self._heat, self.ball_attitude = heat, ball_attitude
        self.needs_boundary, self.counts_cage = needs_boundary, counts_cage
        self.rollers = rollers

    def __call__(self, inputs: HeatInputs, options: HeatOptions) -> BearingHeat:
        """Heat of one bearing, term by term."""
        return self._heat(inputs, options)


def friction_model(
    *,
    ball_attitude: BallAttitude = "outer",
    needs_boundary: bool = False,
    counts_cage: bool = False,
    rollers: RollerModel | None = None,
) -> Callable[[Callable[[HeatInputs, HeatOptions], BearingHeat]], FrictionModel]:
    """Make a function of ``(inputs, options)`` a heat model, with the facts of :class:`FrictionModel`."""
    return lambda heat: FrictionModel(heat, ball_attitude, needs_boundary, counts_cage, rollers)


def friction_model_names(*, rollers: bool = False) -> tuple[str, ...]:
    """Heat models that follow from a bearing's equilibrium: all but ``table``.

    Parameters
    ----------
    rollers : bool
        Only those that know roller bearings too.

    >>> friction_model_names(rollers=True)
    ('palmgren', 'skf')
    """
    models = {name: model for name, model in HEAT_MODELS.items() if isinstance(model, FrictionModel)}
    return tuple(name for name, model in models.items() if model.rollers is not None or not rollers)


def bearing_heat(inputs: HeatInputs, options: HeatOptions) -> BearingHeat:
    """Heat of one bearing by the model that ``options`` names; all terms are 0 at rest."""
    return HEAT_MODELS[options.level](inputs, options)


def roller_heat(inputs: RollerHeatInputs, options: HeatOptions) -> BearingHeat:
    """Heat of one roller bearing by the model that ``options`` names.

    Raises
    ------
    OutOfValidityError
        The model knows balls only.
    """
    model = HEAT_MODELS[options.level].rollers
    if model is None:
        allowed = ", ".join(friction_model_names(rollers=True))
        what = f'"{options.level}" knows no rollers.'
        raise OutOfValidityError("heat.model", what, f"Allowed with roller bearings: {allowed}.")
    return model(inputs, options)


def ring_terms(inputs: HeatInputs, per_contact: Mapping[str, FloatArray]) -> dict[str, float]:
    """Heat of all balls at each ring, W, from that of one ball at each contact, (n, 2) W."""
    return {
        f"{ring}_{label}": float(power[:, side] @ inputs.system.weight)
        for label, power in per_contact.items()
        for side, ring in ((INNER, "inner"), (OUTER, "outer"))
    }
