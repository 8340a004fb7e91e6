"""Catalogue constants of friction that distinguish kinds of roller bearing."""

from __future__ import annotations

from dataclasses import dataclass

from spindle_fem.physics.bearings.bearing_kind import AttainableSpeeds


@dataclass(frozen=True, slots=True)
class RollerKind:
    """Constants of the catalogue formulas for one row of rollers of a kind.

    Rollers, contacts and films of every kind follow from the geometry alone.

    Attributes
    ----------
    palmgren_lubrication_factor : float, [-]
        f_0 of a row with grease, where a bearing type gives none.
    palmgren_load_factor : float, [-]
        f_1 of the load moment f_1 P d_m.
    skf_rolling, skf_sliding : float
        R1 and S2 of the SKF friction model.
    skf_friction_ehl : float, [-]
        Its sliding friction coefficient in full film.
    skf_replenishment : float, [-]
        Its K_Z.
    attainable_speeds : AttainableSpeeds or None
        None: no catalogue says.
    """

    source: str
    palmgren_lubrication_factor: float
    palmgren_load_factor: float
    skf_rolling: float
    skf_sliding: float
    skf_friction_ehl: float
    skf_replenishment: float
    attainable_speeds: AttainableSpeeds | None = None
