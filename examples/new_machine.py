"""A new machine in Python: a shaft on two bearings in a sleeve, checked with all its faults, then solved."""

from spindle_fem import solve
from spindle_fem.definition.load import validate
from spindle_fem.errors import FaultsError


def segment(name, start, end, inner, outer):
    """A hollow cylinder, in millimetres."""
    sizes = {"inner_diameter": f"{inner} mm", "outer_diameter": f"{outer} mm", "marks": "A"}
    return {"name": name, "z": [f"{start} mm", f"{end} mm"], **sizes}


steel = {"thermal_conductivity": "45 W/m/K", "density": "7800 kg/m**3", "marks": "A"}
steel |= {"specific_heat_capacity": "470 J/kg/K"}
bearing = {"bore_diameter": "50 mm", "outer_diameter": "80 mm", "width": "16 mm"}
bearing |= {"inner_ring_outer_diameter": "58 mm", "outer_ring_inner_diameter": "71 mm"}
bearing |= {"ball_diameter": "8.731 mm", "ball_count": 19, "contact_angle": "15 deg"}
bearing |= {"groove_curvature_inner": 0.52, "groove_curvature_outer": 0.52}
bearing |= {"ring_material": "steel", "ball_material": "steel", "marks": "C"}
seats = [("B1", "24 mm", "40 mm", "towards_rear"), ("B2", "76 mm", "92 mm", "towards_nose")]
machine = {
    "schema": "spindle-fem/machine/1",
    "name": "sleeve",
    "remaining_surfaces": "adiabatic",
    "operation": {"speed": "4000 rpm", "thrust": "300 N", "ambient_temperature": "22 degC", "marks": "A"},
    "materials": {"steel": steel},
    "part": [
        {"name": "shaft", "material": "steel", "rotating": True, "segment": [segment("bar", 0, 120, 16, 50)]},
        {"name": "housing", "material": "steel", "segment": [segment("sleeve", 24, 92, 80, 150)]},
    ],
    "bearing_types": {"7010_C": bearing},
    "bearing_set": [{
        "name": "pair", "bearing_type": "7010_C", "preload": "250 N", "carries_thrust": True, "marks": "A",
        "ball_row": {"kind": "constant", "conductance": "3 W/K", "marks": "A"},
        "bearing": [{"name": n, "z": [a, b], "takes_thrust": to, "marks": "A"} for n, a, b, to in seats],
    }],
    "heat": {"model": "table", "ball_share": 0.5, "inner_share": 0.5, "marks": "A", "table": {
        "speed": ["0 rpm", "8000 rpm"], "reference_thrust": "300 N", "marks": "A",
        "heat": {"B1": ["0 W", "74 W"], "B2": ["0 W", "69 W"]},
    }},
    "joint": [{
        "name": "seats", "conductance": "6000 W/m**2/K", "marks": "A",
        "contacts": ["B*.inner_ring|shaft", "B*.outer_ring|housing"],
    }],
    "surface": [{"name": "housing.outside", "part": "housing", "where": [{"facing": "outward"}]}],
    "film": [
        {"name": "air", "kind": "constant", "surface": ["housing.outside"], "coefficient": "30 W/m**2/K"},
    ],
    "probe": [{"name": "SKIN", "part": "housing", "r": "75 mm", "z": "58 mm", "marks": "A"}],
    "mesh": {"preset": "coarse", "order": 1},
}  # fmt: skip

try:  # two faults at once: both are reported, each with its place and what is allowed
    validate({**machine, "mesh": {"preset": "corse"}, "initial": "cold"})
except FaultsError as faults:
    print(faults)

result = solve(validate(machine))
print(f"SKIN {result.probes['SKIN'] - 273.15:.2f} degC, heat {result.energy.heat_in:.1f} W")
