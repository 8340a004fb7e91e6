"""A liquid that runs down a wall in a film, as cutting fluid over the nose of a spindle."""

from __future__ import annotations

import numpy as np

from spindle_fem.correlation import Array, correlation
from spindle_fem.physics.coolant.properties import Coolant
from spindle_fem.physics.coolant.streams import StreamAnswer

GRAVITY = 9.81


@correlation(how_to_fix="Give film.factor.", reynolds=(1.0, 4000.0), prandtl=(1.0, 400.0))
def nusselt_schnabel(reynolds: Array, prandtl: Array, entry: Array) -> Array:
    """Mean Nusselt number of a falling film that is heated, on the length (ν²/g)^(1/3).

    Parameters
    ----------
    reynolds : (n,) array_like, [-]
        Mass flow per width over dynamic viscosity.
    prandtl : (n,) array_like, [-]
    entry : (n,) array_like, [-]
        The length (ν²/g)^(1/3) over that of the wall.

    Source: Schnabel & Schlünder (1980), as VDI Heat Atlas, falling films, has it: the largest of entry,
    laminar, transitional and turbulent film. Smooth vertical wall; its range is assumed here. The first two
    are those of theory within 0.6 % (Lévêque's entry, Nu = 1.88 on the thickness of Nusselt's film), which
    the tests hold; the constants of the transitional and turbulent film are taken as cited.

    >>> float(nusselt_schnabel(400.0, 7.0, 1.0e-3).round(3))
    0.339
    """
    laminar = 1.3 * np.cbrt(1.0 / reynolds)
    entering = 0.912 * np.cbrt(np.cbrt(reynolds) * prandtl * entry)
    between = 0.0425 * reynolds**0.2 * prandtl**0.344
    turbulent = 0.0136 * reynolds**0.4 * prandtl**0.344
    return np.max([laminar, entering, between, turbulent], axis=0)


def falling_film(
    coolant: Coolant, flow: float, inlet_temperature: float, width: float, length: float
) -> StreamAnswer:
    """Film of a liquid that runs down a wall.

    Parameters
    ----------
    flow : float, [m³/s]
    inlet_temperature : float, [K]
    width, length : float, [m]
        Across and down.
    """
    liquid = coolant.properties(inlet_temperature)
    viscosity, density = float(liquid.kinematic_viscosity), float(liquid.density)
    scale = (viscosity**2 / GRAVITY) ** (1.0 / 3.0)
    reynolds, prandtl = flow / width / viscosity, float(liquid.prandtl)
    nusselt = float(nusselt_schnabel(reynolds, prandtl, scale / length, extrapolate=True))
    # Nusselt's smooth laminar film: its mean velocity.
    thickness = scale * (3.0 * reynolds) ** (1.0 / 3.0)
    return StreamAnswer(
        coefficient=nusselt * float(liquid.thermal_conductivity) / scale,
        capacity_rate=density * float(liquid.specific_heat_capacity) * flow,
        volume_flow=flow,
        reynolds=reynolds,
        prandtl=prandtl,
        velocity=flow / width / thickness,
        regime="laminar" if reynolds < 400.0 else "turbulent",
        pressure_drop=0.0,
        source="Schnabel & Schlünder 1980",
        faults=nusselt_schnabel.faults(reynolds=reynolds, prandtl=prandtl),
    )
