"""The recorded spindle with one unknown per part: quick, and checked by hand.

Parts conduct without limit; contacts, films and gaps have round areas.
"""

from dataclasses import replace

import numpy as np

from spindle_fem.definition.machine_spec import NaturalFilm
from spindle_fem.machine.geometry.assembly import build_assembly
from spindle_fem.model.reduced.drive import STANDARD, make_drive
from spindle_fem.model.reduced.spindle_inputs import fast_spindle
from spindle_fem.model.thermal_model import ThermalModel

CELLS = 12
RPM = np.pi / 30.0


def lumped_model(spec):
    """Each part and ball row is one unknown; contacts, films and gaps have round areas."""
    assembly = build_assembly(spec)
    parts = [part.name for part in assembly.parts]
    nodes = [*parts, *(f"{bearing.name}.balls" for _, bearing in spec.bearings)]
    size = len(nodes)

    def edge(first, second, area):
        vector = np.zeros(size)
        vector[nodes.index(first)], vector[nodes.index(second)] = 1.0, -1.0
        return area * np.outer(vector, vector)

    def diagonal(name, value):
        matrix = np.zeros((size, size))
        matrix[nodes.index(name), nodes.index(name)] = value
        return matrix

    def unit(name):
        return np.eye(size)[nodes.index(name)]

    operators = {f"conductivity.{name}": np.zeros((size, size)) for name in spec.materials}
    for contact in assembly.joint_names:
        operators[f"joint.{contact}"] = edge(*contact.removesuffix(":face").split("|"), 0.01)
    films = {}
    for film in spec.film:
        for surface in film.surface:
            operators[f"film.{surface}"] = diagonal(surface.split(".")[0], 0.1)
            films[f"film.{surface}"] = operators[f"film.{surface}"] @ np.ones(size)
    for gap in spec.gap:
        operators[f"gap.{gap.name}"] = edge(gap.rotating.split(".")[0], gap.standing[0].split(".")[0], 0.1)
    for _, bearing in spec.bearings:
        for side in ("inner", "outer"):
            ring = f"{bearing.name}.{side}_ring"
            operators[f"balls.{bearing.name}.{side}"] = edge(ring, f"{bearing.name}.balls", 1.0)
    storage = {f"capacity.{name}": np.zeros((size, size)) for name in spec.materials}
    keys = {id(value): key for key, value in spec.materials.items()}
    for part in parts:
        volume = 0.01 if part in ("shaft", "housing") else 2e-4
        storage[f"capacity.{keys[id(spec.part_material(part))]}"] += diagonal(part, volume)
    for _, bearing in spec.bearings:
        storage[f"capacity.{bearing.name}.balls"] = diagonal(f"{bearing.name}.balls", 1.0)
    places = {name: unit(name) for name in nodes}
    for _, bearing in spec.bearings:
        for side in ("inner", "outer"):
            places[f"{bearing.name}.{side}_raceway"] = unit(f"{bearing.name}.{side}_ring")
    points = [probe for probe in spec.probe if probe.kind == "point"]
    rings = ("F1.outer_ring", "F2.outer_ring", "F3.outer_ring", "housing", "R1.outer_ring")
    area = 0.156 / CELLS
    return ThermalModel(
        coefficient_names=tuple(operators),
        operators=np.array(list(operators.values())),
        fluid_names=tuple(films),
        fluid_load=np.array(list(films.values())),
        cell_film=np.array([diagonal("housing", area)] * CELLS),
        cell_load=np.array([area * unit("housing")] * CELLS),
        cell_area=np.full((1, CELLS), area),
        cell_angle=np.linspace(0.0, 31.0, CELLS),
        cell_position=np.linspace(0.0, 3.5, CELLS),
        cell_is_port=np.zeros(CELLS, dtype=bool),
        storage_names=tuple(storage),
        storage=np.array(list(storage.values())),
        place_names=tuple(places),
        places=np.array(list(places.values())),
        probe_names=tuple(probe.name for probe in points),
        probes=np.array([unit(name) for name in rings]),
        one=np.ones(size),
        contacts=tuple(assembly.joint_names),
        gap_radii={gap.name: (0.065, 0.09) for gap in spec.gap},
        ranges={"film.housing.outside": (5.0, 20.0)},
        errors={"probes": 0.0},
        n_full=size,
        digest="lumped",
    )


def with_natural_film(fast):
    """The same with natural convection and radiation outside."""
    spec = fast.spec
    film = NaturalFilm(
        name="outside",
        kind="natural_convection_radiation",
        surface=("housing.outside",),
        orientation="horizontal_cylinder",
        characteristic_length="0.3 m",
        emissivity=0.9,
    )
    others = tuple(item for item in spec.film if item.name != "outside")
    changed = spec.model_copy(update={"film": (film, *others), "factor": spec.factor[1:]})
    keep = [i for i, name in enumerate(fast.model.coefficient_names) if name != "film.cover.outside"]
    fluids = [i for i, name in enumerate(fast.model.fluid_names) if name != "film.cover.outside"]
    natural = fast_spindle(
        replace(
            fast.model,
            coefficient_names=tuple(fast.model.coefficient_names[i] for i in keep),
            operators=fast.model.operators[keep],
            fluid_names=tuple(fast.model.fluid_names[i] for i in fluids),
            fluid_load=fast.model.fluid_load[fluids],
        ),
        changed,
    )
    # The lumped model has no surfaces of its own: the housing stands for its outside.
    places = (*natural.model.place_names, "housing.outside")
    rows = np.vstack((natural.model.places, natural.model.place("housing")))
    return fast_spindle(replace(natural.model, place_names=places, places=rows), changed)


def drive_of(times, speed_rpm, *, ambient=293.15, inlet=290.15, thrust=1750.0, flow=20e-3 / 60):
    columns = [np.asarray(speed_rpm) * RPM, thrust, ambient, inlet, flow]
    values = np.column_stack([np.broadcast_to(np.asarray(c, dtype=float), times.shape) for c in columns])
    return make_drive(times, STANDARD, values, np.array([True, True, False, False, True]))
