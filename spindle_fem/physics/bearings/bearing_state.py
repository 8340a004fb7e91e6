"""Result records of one bearing at one operating state; rollers are recorded as balls are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from spindle_fem.physics.bearings.bearing_geometry import BearingGeometry
from spindle_fem.physics.bearings.hertz import INNER, OUTER
from spindle_fem.physics.bearings.roller_bearing import RollerGeometry
from spindle_fem.validity import CodedWarning

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class BallStates:
    """State of the balls or rollers that were solved for; (n,) or (n, 2) with the inner contact first.

    The strip that a roller touches is an ellipse's: half its length is ``semi_major``, half its width
    ``semi_minor``.

    Attributes
    ----------
    azimuth : (n,) ndarray, [rad]
    weight : (n,) ndarray
        Number of balls that each row represents (all of them under axial load alone).
    contact_angle : (n, 2) ndarray, [rad]
    load : (n, 2) ndarray, [N]
    deformation, semi_major, semi_minor : (n, 2) ndarray, [m]
        Deformation is negative across a gap.
    pressure : (n, 2) ndarray, [Pa]
    centrifugal_force : (n,) ndarray, [N]
    gyroscopic_moment : (n,) ndarray, [N m]
    orbital_speed, spin_speed : (n,) ndarray, [rad/s]
    film_isothermal, film_central, film_minimum : (n, 2) ndarray, [m]
        Flooded isothermal central film; central and minimum film with thermal
        and starvation reduction; NaN without lubricant, load or speed.
    film_thickness_ratio, contact_ratio : (n, 2) ndarray, [-]
        Λ and Ac/A0.
    entrainment_speed : (n, 2) ndarray, [m/s]
    """

    azimuth: FloatArray
    weight: FloatArray
    contact_angle: FloatArray
    load: FloatArray
    deformation: FloatArray
    semi_major: FloatArray
    semi_minor: FloatArray
    pressure: FloatArray
    centrifugal_force: FloatArray
    gyroscopic_moment: FloatArray
    orbital_speed: FloatArray
    spin_speed: FloatArray
    film_isothermal: FloatArray
    film_central: FloatArray
    film_minimum: FloatArray
    film_thickness_ratio: FloatArray
    contact_ratio: FloatArray
    entrainment_speed: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class BearingHeat:
    """Friction heat of one bearing, term by term.

    Attributes
    ----------
    model : str
        ``"paper"``, ``"full"``, ``"palmgren"`` or ``"skf"``.
    terms : mapping of str to float, [W]
        They add up to ``total``.
    per_contact : mapping of str to (n, 2) ndarray, [W]
        Terms that belong to a contact, of one ball each; inner first.
    """

    model: str
    terms: Mapping[str, float]
    per_contact: Mapping[str, FloatArray]

    @property
    def total(self) -> float:
        """Heat of the bearing, W."""
        return float(sum(self.terms.values()))


@dataclass(frozen=True, slots=True, eq=False)
class BearingState:
    """One bearing in equilibrium.

    Attributes
    ----------
    speed : float, [rad/s]
    axial_displacement : float, [m]
        Axial approach of the rings from touching (thermal and mounting
        displacements included).
    radial_displacement : float, [m]
        Of the inner ring along azimuth 0.
    axial_force, radial_force : float, [N]
        That the inner ring carries; the axial one positive in the bearing's
        own load direction.
    preload : float, [N]
        Axial force with the external loads removed, at the same speed and
        temperatures; NaN for a bearing without counter bearing.
    axial_stiffness : float, [N/m]
        Of the shaft against the load: of the single bearing, or of its set.
    heat : BearingHeat or None
        None without lubricant.
    friction_moment : float, [N m]
        Heat over speed; 0 at rest.
    lubricant_temperature : float, [K]
    residual : float, [-]
    heat_beside : mapping of str to float, [W]
        Heat by the further models of ``HeatOptions.beside``.
    ball_forces : (inner, outer) or None, [N]
        Of all balls on each raceway, each along its own radius, friction included; None for rollers.
    """

    name: str
    geometry: BearingGeometry | RollerGeometry
    speed: float
    axial_displacement: float
    radial_displacement: float
    axial_force: float
    radial_force: float
    preload: float
    axial_stiffness: float
    balls: BallStates
    heat: BearingHeat | None
    friction_moment: float
    lubricant_temperature: float
    residual: float
    warnings: tuple[CodedWarning, ...]
    heat_beside: Mapping[str, float] = field(default_factory=dict)
    ball_forces: tuple[float, float] | None = None

    def mean(self, name: str, side: int | None = None) -> float:
        """Mean over the balls of a field of ``BallStates`` (one contact of it).

        NaN entries (balls without film) do not count.
        """
        values = getattr(self.balls, name)
        values = values if side is None else values[:, side]
        valid = np.isfinite(values)
        if not valid.any():
            return float("nan")
        return float(np.average(values[valid], weights=self.balls.weight[valid]))

    @property
    def contact_angle_inner(self) -> float:
        """Mean inner contact angle, rad."""
        return self.mean("contact_angle", INNER)

    @property
    def contact_angle_outer(self) -> float:
        """Mean outer contact angle, rad."""
        return self.mean("contact_angle", OUTER)

    @property
    def cage_slip(self) -> float:
        """Relative slip of the balls' orbit below pure rolling, mean over the loaded balls; NaN at rest.

        Rolling is that of outer race control at the running angles; friction
        alone leaves less than 0.02, gross sliding shows as 0.1 and more.
        """
        balls = self.balls
        loaded = balls.load[:, INNER] > 0.0
        if self.speed == 0.0 or not loaded.any():
            return float("nan")
        inner, outer = balls.contact_angle[loaded, INNER], balls.contact_angle[loaded, OUTER]
        share = (1.0 - self.geometry.diameter_ratio * np.cos(inner)) / (1.0 + np.cos(inner - outer))
        slip = 1.0 - balls.orbital_speed[loaded] / (share * self.speed)
        return float(np.average(slip, weights=balls.weight[loaded]))

    @property
    def thinnest_film(self) -> float:
        """Smallest central film of all contacts, m; NaN without film."""
        return _smallest(self.balls.film_central)

    @property
    def smallest_film_ratio(self) -> float:
        """Smallest Λ of all contacts; NaN without film."""
        return _smallest(self.balls.film_thickness_ratio)

    @property
    def film_central(self) -> float:
        """Smaller mean central film of both contacts, m; NaN without film."""
        return float(np.fmin(self.mean("film_central", INNER), self.mean("film_central", OUTER)))

    @property
    def film_thickness_ratio(self) -> float:
        """Smaller mean Λ of both contacts; NaN without film."""
        ratios = (self.mean("film_thickness_ratio", INNER), self.mean("film_thickness_ratio", OUTER))
        return float(np.fmin(*ratios))

    @property
    def heat_W(self) -> float:  # noqa: N802 (unit suffix of the report)
        """Friction heat, W; 0 without lubricant."""
        return 0.0 if self.heat is None else self.heat.total

    @property
    def terms_W(self) -> dict[str, float]:  # noqa: N802
        """Friction heat term by term, W."""
        return {} if self.heat is None else dict(self.heat.terms)


def _smallest(values: FloatArray) -> float:
    """Least of the entries that are numbers; NaN where none is."""
    known = values[np.isfinite(values)]
    return float(known.min()) if known.size else float("nan")
