"""Names of places and coefficients in the model of a machine, known before there is a mesh."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.effects.framework.term import CHANNEL_FILM
from spindle_fem.machine.geometry.assembly import build_assembly
from spindle_fem.machine.geometry.joint_groups import group_of_contacts
from spindle_fem.machine.view.place_names import (
    ACROSS,
    AROUND,
    NEAR,
    UP,
    growth_names,
    ringed_probes,
    sided_names,
)


@dataclass(frozen=True, slots=True)
class MachineNames:
    """Names of the places and coefficients of one machine's model.

    Attributes
    ----------
    place_names : tuple of str
        Where heat may enter and temperatures are read.
    fluid_names : tuple of str
        Coefficients that are films.
    groups : mapping of coefficient to tuple of str
        As :func:`coefficient_groups` gives them.
    """

    spec: MachineSpec
    place_names: tuple[str, ...]
    fluid_names: tuple[str, ...]
    groups: Mapping[str, tuple[str, ...]]

    @classmethod
    def of(cls, spec: MachineSpec) -> MachineNames:
        """Names of a machine whose parts fit together.

        Includes slices of parts that a coarse mesh may be unable to distinguish.
        """
        assembly = build_assembly(spec)
        contacts = assembly.joint_names
        places = [
            *assembly.part_names,
            *(f"{part.name}.{segment.name}" for part in spec.part for segment in part.segment),
            *(name for name in assembly.surface_names if not name.endswith(".adiabatic")),
            *(f"{name}@{side}" for name in contacts if not name.endswith(":face") for side in (0, 1)),
            *(f"{bearing.name}.balls" for _, bearing in spec.bearings),
            *(NEAR + probe.name for probe in spec.probe if probe.kind == "point"),
            *(AROUND + probe.name for probe in ringed_probes(spec)),
            *(prefix + name for name in sided_names(spec) for prefix in (UP, ACROSS)),
            *(name for pair in growth_names(spec).values() for name in pair),
        ]
        films = tuple(f"film.{surface}" for film in spec.film for surface in film.surface)
        return cls(spec, tuple(places), films, coefficient_groups(spec, contacts))

    @property
    def bearings(self) -> tuple[str, ...]:
        """Bearings, set by set."""
        return tuple(bearing.name for _, bearing in self.spec.bearings)

    @property
    def channels(self) -> tuple[str, ...]:
        """Probes of the machine."""
        return tuple(probe.name for probe in self.spec.probe)

    @property
    def conducting_contacts(self) -> tuple[str, ...]:
        """Contacts whose joint conducts at all."""
        conductance = {f"joint.{group.name}": group.conductance.value for group in self.spec.joint}
        return tuple(
            name.removeprefix("joint.")
            for name, groups in self.groups.items()
            if name.startswith("joint.") and conductance[groups[1]] > 0.0
        )

    def shared_parameter(self, coefficients: tuple[str, ...]) -> str:
        """Parameter that scales exactly these joint coefficients; empty where there is none."""
        if len(coefficients) == 1:
            return coefficients[0]
        for name in sorted(set.intersection(*(set(self.groups[item]) for item in coefficients))):
            scaled = {k for k, own in self.groups.items() if name in own and k.startswith("joint.")}
            if scaled == set(coefficients):
                return name
        return ""


def coefficient_groups(spec: MachineSpec, contacts: Iterable[str]) -> dict[str, tuple[str, ...]]:
    """Names whose factors multiply each coefficient: its own first, then that of its group.

    Raises
    ------
    FaultsError
        As :func:`spindle_fem.machine.geometry.joint_groups.group_of_contacts`.
    """
    found: dict[str, tuple[str, ...]] = {
        f"conductivity.{name}": (f"conductivity.{name}",) for name in spec.materials
    }
    joints = group_of_contacts(spec, contacts)
    found |= {f"joint.{name}": (f"joint.{name}", f"joint.{group.name}") for name, group in joints.items()}
    for number, film in enumerate(spec.film, 1):
        owner = f"film.{film.name}" if film.name else f"film[{number}]"
        found |= {f"film.{surface}": (f"film.{surface}", owner) for surface in film.surface}
    found |= {f"gap.{gap.name}": (f"gap.{gap.name}",) for gap in spec.gap}
    for group, bearing in spec.bearings:
        for side in ("inner", "outer"):
            name = f"balls.{bearing.name}.{side}"
            found[name] = (name, f"ball_row.{bearing.name}", f"ball_row.{group.name}")
    found[CHANNEL_FILM] = (CHANNEL_FILM, "coolant.film_factor")
    found |= {f"capacity.{name}": (f"capacity.{name}", "heat_capacity_factor") for name in spec.materials}
    for _, bearing in spec.bearings:
        name = f"capacity.{bearing.name}.balls"
        found[name] = (name, "heat_capacity_factor")
    return found
