"""Air or coolant that flows along a narrow gap whose inner wall turns, as purge air through a labyrinth."""

from __future__ import annotations

import math

from spindle_fem.correlation import Array, correlation
from spindle_fem.errors import OutOfValidityError
from spindle_fem.physics.coolant.duct_films import DUCT_FILMS
from spindle_fem.physics.coolant.duct_films.straight import straight
from spindle_fem.physics.coolant.ducts import DuctFilm, DuctFlow


@correlation(how_to_fix="Give film.factor.", reynolds=(1.0e3, 1.0e5), prandtl=(0.6, 1.0))
def nusselt_gazley(reynolds: Array, prandtl: Array) -> Array:
    """Nusselt number of a gap with axial flow between a turning and a standing wall, on twice its width.

    Parameters
    ----------
    reynolds : (n,) array_like, [-]
        Of the axial velocity and half that of the turning wall, together.
    prandtl : (n,) array_like, [-]
        Measured with air; the range of both is assumed about what was measured.

    Source: Gazley (1958), Trans. ASME 80, 79–90, as Fénot et al. (2011), Int. J. Thermal Sciences 50,
    1138–1155, have it: 0.03 Re^0.8, taken as cited. It is 1.6 to 1.7 times that of a smooth, still duct
    at the same Reynolds number (Gnielinski), as the tests hold.

    >>> float(nusselt_gazley(1.0e4, 0.7).round(1))
    47.5
    """
    return 0.03 * reynolds**0.8 + 0.0 * prandtl


@DUCT_FILMS.register
def turning(flow: DuctFlow) -> DuctFilm:
    """Gazley's film at the effective velocity, or that of a still duct where it is the larger one.

    Raises
    ------
    OutOfValidityError
        A duct that is no annulus.
    """
    diameter = flow.section.turning_diameter
    if diameter is None:
        raise OutOfValidityError("law", '"turning" needs a gap.', 'Allowed with duct = "annulus".')
    still = straight(flow)
    around = 0.25 * abs(flow.speed) * diameter
    reynolds = flow.reynolds * math.hypot(flow.velocity, around) / flow.velocity
    stirred = float(nusselt_gazley(reynolds, flow.prandtl, extrapolate=True))
    if around == 0.0 or stirred < still.nusselt:
        return still
    return DuctFilm(stirred, "Gazley 1958", nusselt_gazley.faults(reynolds=reynolds, prandtl=flow.prandtl))


turning.ranges = nusselt_gazley.ranges
