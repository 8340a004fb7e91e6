"""The elastic bodies of a machine: shaft, housing, every ring of a bearing, in the meridian plane.

Parts that are joined for good move as one body: the shaft with what is fused to it, the housing with
its covers and sleeves. Rings sit on them with fits and are bodies of their own. Spacers carry no
radial load.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.definition.solid_tables import Material
from spindle_fem.machine.geometry.part_shapes import AnnularSegment
from spindle_fem.machine.view.part_roles import Layout
from spindle_fem.model.elastic.elastic_body import ElasticBody, Face
from spindle_fem.model.elastic.meridian_mesh import MeridianMesh
from spindle_fem.physics.elasticity.elastic_material import ElasticMaterial, Stiffness

# Longest side of an element, m: mean shifts of seats change by less than 0.1 % on half of it.
ELEMENT_SIZE = 4.0e-3


@dataclass(frozen=True, slots=True)
class Seat:
    """Contact of a ring with shaft or housing.

    Attributes
    ----------
    ring : str
        ``F1.inner_ring``, ``F1.outer_ring``.
    face : Face
        The cylinder between them.
    raceway : Face
        The ring's other cylinder, on which the balls press.
    """

    bearing: str
    ring: str
    carrier: str
    face: Face
    raceway: Face

    @property
    def is_inner(self) -> bool:
        """Whether it is the seat of an inner ring, on the shaft."""
        return self.raceway.r[0] > self.face.r[0]


@dataclass(frozen=True, slots=True)
class MachineBodies:
    """Bodies of a machine and the parts of each.

    Attributes
    ----------
    parts : mapping of str to tuple of str
        Parts of the mesh that each body consists of.
    shaft, housing : str
        Bodies that carry the rings; empty where there is none.
    """

    bodies: dict[str, ElasticBody]
    parts: dict[str, tuple[str, ...]]
    seats: tuple[Seat, ...]
    shaft: str
    housing: str


def elastic_material(material: Material) -> ElasticMaterial:
    """Elastic constants of a material of the definition."""
    return ElasticMaterial(
        material.young_modulus, material.poisson_ratio, material.thermal_expansion, material.density
    )


def carries_rings(spec: MachineSpec) -> bool:
    """Whether a machine has bearings, a turning part and a standing one."""
    layout = Layout(spec, set())
    return bool(spec.bearings) and layout.shaft is not None and layout.housing is not None


def machine_bodies(spec: MachineSpec, *, size: float = ELEMENT_SIZE) -> MachineBodies:
    """Bodies of a machine definition, evenly stretched round the axis.

    Parameters
    ----------
    size : float, [m]
        Longest side of an element.
    """
    layout = Layout(spec, set())
    bodies, parts, carriers = {}, {}, {}
    seats = _seats(spec)
    for main, rotating in ((layout.shaft, True), (layout.housing, False)):
        if main is None:
            continue
        own = [p for p in spec.part if p.rotating is rotating and (p is main or not layout.is_spacer(p))]
        regions = [
            [AnnularSegment(*s.z, 0.5 * s.inner_diameter, 0.5 * s.outer_diameter) for s in part.segment]
            for part in own
        ]
        stiffnesses = [elastic_material(spec.part_material(part.name)).stiffness for part in own]
        cut = _grooved(spec, [part.name for part in own])
        if cut is not None:
            regions.append(cut[0])
            stiffnesses.append(cut[1])
        ends = [z for seat in seats if seat.is_inner is rotating for z in seat.face.z]
        section = MeridianMesh.of(regions, size, z_lines=ends)
        carriers[rotating] = main.name
        parts[main.name] = tuple(part.name for part in own)
        bodies[main.name] = ElasticBody(main.name, section, stiffnesses)
    known: dict[tuple, ElasticBody] = {}
    for seat in seats:
        z, radii = seat.face.z, tuple(sorted((seat.face.r[0], seat.raceway.r[0])))
        material = elastic_material(spec.part_material(seat.ring))
        shape = round(z[1] - z[0], 9), radii, material
        if shape in known:
            first = known[shape]
            bodies[seat.ring] = first.moved(seat.ring, z[0] - float(first.section.z[0]))
        else:
            section = MeridianMesh.of([[AnnularSegment(*z, *radii)]], 0.5 * size)
            bodies[seat.ring] = known[shape] = ElasticBody(seat.ring, section, [material.stiffness])
        parts[seat.ring] = (seat.ring,)
    return MachineBodies(bodies, parts, seats, carriers.get(True, ""), carriers.get(False, ""))


def _seats(spec: MachineSpec) -> tuple[Seat, ...]:
    """Inner and outer seat of every bearing in turn; none where shaft or housing is missing."""
    layout = Layout(spec, set())
    found = []
    for group, bearing in spec.bearings if carries_rings(spec) else ():
        kind = spec.bearing_types[group.type_name(bearing)]
        z = tuple(bearing.z)
        for ring, carrier, seat, raceway in (
            ("inner", layout.shaft, kind.bore_diameter, kind.inner_ring_outer_diameter),
            ("outer", layout.housing, kind.outer_diameter, kind.outer_ring_inner_diameter),
        ):
            faces = (Face(z, (0.5 * seat, 0.5 * seat)), Face(z, (0.5 * raceway, 0.5 * raceway)))
            found.append(Seat(bearing.name, f"{bearing.name}.{ring}_ring", carrier.name, *faces))
    return tuple(found)


def _grooved(spec: MachineSpec, parts: Sequence[str]) -> tuple[list[AnnularSegment], Stiffness] | None:
    """The layer of a body that the channel has cut into lands, and its stiffness."""
    channel = spec.channel
    if channel is None or channel.part not in parts:
        return None
    layer = AnnularSegment(
        channel.z_start,
        channel.z_start + channel.pitch * channel.turns,
        channel.inner_radius,
        channel.inner_radius + channel.depth,
    )
    pitch = channel.pitch / channel.starts
    material = elastic_material(spec.part_material(channel.part))
    return [layer], material.lands(channel.depth, pitch - channel.width, pitch)
