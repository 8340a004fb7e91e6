"""Lubricants of a machine's bearing sets: grease or oil as the laws of films and friction take it."""

from __future__ import annotations

from dataclasses import replace

from spindle_fem.definition.lubrication_tables import Lubrication, LubricationFilm
from spindle_fem.definition.machine_spec import BearingSet, Grease, MachineSpec
from spindle_fem.physics.bearings.grease import Lubricant
from spindle_fem.physics.bearings.heat_model import HeatOptions
from spindle_fem.physics.coolant.lubrication_kind import BearingStream, LubricationKind
from spindle_fem.physics.coolant.lubrication_kinds import LUBRICATION_KINDS
from spindle_fem.physics.coolant.mineral_oil import mineral_oil
from spindle_fem.physics.coolant.properties import Coolant
from spindle_fem.validity import CodedWarning


class SetLubricant:
    """Lubricant of one bearing set, and its influence on friction.

    Attributes
    ----------
    word : str
        "grease" or "oil", for messages.
    wetted_share : float or None
        Share of the balls' surface in it.
    """

    def __init__(self, spec: MachineSpec, group: BearingSet) -> None:
        given = spec.lubricant_of(group)
        self.word = "oil" if isinstance(given, Lubrication) else "grease"
        self.group = group.name
        self._oil = given if isinstance(given, Lubrication) else None
        self.kind: LubricationKind | None = None
        if self._oil is None:
            self._base = _of_grease(given)
            self.wetted_share = given.free_volume_fill if given.wetted_share is None else given.wetted_share
        else:
            self.kind = LUBRICATION_KINDS[self._oil.kind]
            self._base = _of_oil(self._oil)
            self.wetted_share = self._oil.wetted_share
        names = [bearing.name for bearing in group.bearing]
        self._films = [
            film for film in spec.film if isinstance(film, LubricationFilm) and film.bearing in names
        ]

    def at(self, speed: float) -> Lubricant:
        """The lubricant at a speed [rad/s]: how much of the balls' path a stream fills follows it."""
        if self.kind is None or self._oil.path_fill is not None or not self._films:
            return self._base
        return replace(self._base, path_fill=self.kind.fill(bearing_stream(self._films[0], speed)))

    def options(self, options: HeatOptions) -> HeatOptions:
        """A heat model's options with the factors of the lubrication."""
        if self.kind is None:
            return options
        own = self._oil.palmgren_f0
        return replace(
            options,
            palmgren_f0=self.kind.ball_factor if own is None else own,
            palmgren_f0_rollers=self.kind.roller_factor if own is None else own,
            skf_replenishment=self.kind.replenishment,
            flooded=self.kind.churns,
        )

    def warnings(self, options: HeatOptions) -> tuple[CodedWarning, ...]:
        """Effects of this lubrication that a heat model leaves out."""
        if self.kind is None or not self.kind.churns or options.level != "skf":
            return ()
        text = (
            f'Bearing set {self.group}: heat.model = "skf" is without the drag of oil that flows through; '
            '"palmgren" and "full" count it.'
        )
        return (CodedWarning("oil_drag_omitted", text),)


def lubrication_oil(lubrication: Lubrication) -> Coolant:
    """The oil of a set as a fluid that carries heat."""
    return mineral_oil(
        lubrication.oil or "lubricating oil",
        lubrication.density,
        1.0e6 * lubrication.kinematic_viscosity_40,
        1.0e6 * lubrication.kinematic_viscosity_100,
    )


def bearing_stream(film: LubricationFilm, speed: float) -> BearingStream:
    """Streams of oil and air through a bearing at a speed [rad/s]."""
    own = film.lubrication
    return BearingStream(
        oil=lubrication_oil(own),
        oil_flow=own.oil_flow,
        air_flow=own.air_flow or 0.0,
        inlet_temperature=own.inlet_temperature,
        speed=speed,
        pitch_diameter=film.pitch_diameter,
        element_diameter=film.element_diameter,
        axial_cosine=film.axial_cosine,
        inner_diameter=film.inner_diameter,
        outer_diameter=film.outer_diameter,
        on_balls=film.rolls_on_balls,
    )


def _of_grease(grease: Grease) -> Lubricant:
    return Lubricant(
        kinematic_viscosity_40=grease.kinematic_viscosity_40,
        kinematic_viscosity_100=grease.kinematic_viscosity_100,
        density=grease.base_oil_density,
        pressure_viscosity=grease.pressure_viscosity,
        limiting_shear_ratio=grease.limiting_shear_ratio,
        limiting_shear_slope=grease.limiting_shear_slope,
        thermal_conductivity=grease.thermal_conductivity,
        film_starvation=grease.film_starvation,
        path_fill=grease.path_fill,
        temperature_limit=grease.temperature_limit,
    )


def _of_oil(oil: Lubrication) -> Lubricant:
    kind = {} if oil.path_fill is None else {"path_fill": oil.path_fill}
    return Lubricant(
        kinematic_viscosity_40=oil.kinematic_viscosity_40,
        kinematic_viscosity_100=oil.kinematic_viscosity_100,
        density=oil.density,
        pressure_viscosity=oil.pressure_viscosity,
        thermal_conductivity=oil.thermal_conductivity,
        film_starvation=oil.film_starvation,
        temperature_limit=oil.temperature_limit,
        word="oil",
        **kind,
    )
