"""Catalogue constants of friction and ratings that distinguish kinds of ball bearing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True)
class AttainableSpeeds:
    """Speed times pitch diameter that a catalogue allows single bearings of a kind with steel elements.

    Attributes
    ----------
    source : str
        Catalogue of the rows that it stands on.
    grease, oil : (contact angles [rad], n d_m [rpm mm])
        Linear between the angles.
    """

    source: str
    grease: tuple[tuple[float, ...], tuple[float, ...]]
    oil: tuple[tuple[float, ...], tuple[float, ...]]

    def at(self, contact_angle: float, lubricant: str) -> float:
        """Speed times pitch diameter, rpm mm, at a contact angle [rad] in "grease" or "oil"."""
        return float(np.interp(contact_angle, *(self.grease if lubricant == "grease" else self.oil)))


@dataclass(frozen=True, slots=True)
class BearingKind:
    """Constants of the catalogue formulas for one kind of ball bearing.

    Balls, contacts and films of every kind follow from the geometry alone.

    Attributes
    ----------
    largest_free_angle : float, [rad]
        Free contact angle that no bearing of the kind exceeds, where no shoulder angle is given.
    static_radial_factor : float, [-]
        X0 of the static equivalent load of a single bearing.
    static_axial_factors : (contact angles [rad], Y0)
        Linear between them.
    palmgren_load_factors : (contact angles [rad], factors)
        z of the factor z (P0/C0)^y of Palmgren's load moment.
    palmgren_load_exponent : float, [-]
        y of the same.
    skf_rolling, skf_sliding : (float, float, float)
        R1, R2, R3 and S1, S2, S3 of the SKF friction model, single row; empty with ``skf_groove``.
    skf_groove : (R1, R2, S1, S2) or None
        Of the SKF friction model's formulas for deep grooves.
    skf_replenishment : float, [-]
        K_Z of the SKF friction model's replenishment factor.
    attainable_speeds : AttainableSpeeds or None
        None: no catalogue says.
    palmgren_axial_factor : float or None
        Of the axial load in Palmgren's load moment; None: 0.9 over the tangent of the contact angle.
    rated_contact_angle : float or None, [rad]
        With which load ratings count; None: that of the bearing without load.
    """

    source: str
    largest_free_angle: float
    static_radial_factor: float
    static_axial_factors: tuple[tuple[float, ...], tuple[float, ...]]
    palmgren_load_factors: tuple[tuple[float, ...], tuple[float, ...]]
    palmgren_load_exponent: float
    skf_rolling: tuple[float, ...]
    skf_sliding: tuple[float, ...]
    skf_groove: tuple[float, float, float, float] | None = None
    skf_replenishment: float = 4.4
    attainable_speeds: AttainableSpeeds | None = None
    palmgren_axial_factor: float | None = None
    rated_contact_angle: float | None = None

    def static_axial_factor(self, contact_angle: float) -> float:
        """Y0 at a contact angle [rad]."""
        return float(np.interp(contact_angle, *self.static_axial_factors))

    def palmgren_load_factor(self, contact_angle: float) -> float:
        """Z at a contact angle [rad]."""
        return float(np.interp(contact_angle, *self.palmgren_load_factors))
