"""The film of the cooling channel's helix, for grooves that are wound on a cylinder."""

from __future__ import annotations

from spindle_fem.errors import OutOfValidityError
from spindle_fem.physics.coolant.duct_films import DUCT_FILMS
from spindle_fem.physics.coolant.ducts import DuctFilm, DuctFlow
from spindle_fem.physics.coolant.regimes import ChannelState, select_film


@DUCT_FILMS.register
def helical(flow: DuctFlow) -> DuctFilm:
    """``coolant.film_model = "helical"`` with properties of the inlet, the wall as warm as the coolant.

    Raises
    ------
    OutOfValidityError
        A duct that is no helix.
    """
    helix = flow.section.helix
    if helix is None:
        raise OutOfValidityError("law", '"helical" needs a helix.', 'Allowed with duct = "helical_groove".')
    state = ChannelState(flow.coolant, flow.volume_flow, flow.inlet_temperature)
    film = select_film("helical", helix, state)
    conductivity = float(flow.properties.thermal_conductivity)
    nusselt = float(film.value) * flow.section.hydraulic_diameter / conductivity
    return DuctFilm(nusselt, "the channel's helix", tuple(item.text for item in film.warnings))
