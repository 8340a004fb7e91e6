"""A definition of a small machine in which nothing is wrong: cases break it one by one."""

from __future__ import annotations

VALID = """
schema = "spindle-fem/machine/1"
name = "bench"
remaining_surfaces = "adiabatic"

[operation]
speed = "3000 rpm"
thrust = "300 N"
ambient_temperature = "20 degC"

[materials.steel]
marks = "A"
thermal_conductivity = "45 W/m/K"
density = "7800 kg/m**3"
specific_heat_capacity = "470 J/kg/K"

[[part]]
name = "shaft"
material = "steel"
rotating = true
segment = [
    {name = "nose", z = ["0 mm", "24 mm"], inner_diameter = "16 mm", outer_diameter = "70 mm"},
    {name = "seat", z = ["24 mm", "92 mm"], inner_diameter = "16 mm", outer_diameter = "50 mm"},
    {name = "locknut", z = ["92 mm", "106 mm"], inner_diameter = "16 mm", outer_diameter = "70 mm"},
]

[[part]]
name = "inner_spacer"
material = "steel"
rotating = true
segment = [{name = "ring", z = ["40 mm", "76 mm"], inner_diameter = "50 mm", outer_diameter = "58 mm"}]

[[part]]
name = "outer_spacer"
material = "steel"
segment = [{name = "ring", z = ["40 mm", "76 mm"], inner_diameter = "72 mm", outer_diameter = "80 mm"}]

[[part]]
name = "housing"
material = "steel"
segment = [
    {name = "body", z = ["24 mm", "92 mm"], inner_diameter = "80 mm", outer_diameter = "150 mm"},
    {name = "shoulder", z = ["92 mm", "104 mm"], inner_diameter = "74 mm", outer_diameter = "150 mm"},
]

[bearing_types.7010_C]
bore_diameter = "50 mm"
outer_diameter = "80 mm"
width = "16 mm"
inner_ring_outer_diameter = "58 mm"
outer_ring_inner_diameter = "71 mm"
ball_diameter = "8.731 mm"
ball_count = 19
contact_angle = "15 deg"
groove_curvature_inner = 0.52
groove_curvature_outer = 0.52
ring_material = "steel"
ball_material = "steel"

[[bearing_set]]
name = "pair"
bearing_type = "7010_C"
preload = "250 N"
carries_thrust = true
ball_row = {kind = "constant", conductance = {value = "2 W/K", sigma_rel = 0.3}}
bearing = [
    {name = "B1", z = ["24 mm", "40 mm"], takes_thrust = "towards_rear"},
    {name = "B2", z = ["76 mm", "92 mm"], takes_thrust = "towards_nose"},
]

[grease]
name = "ester"
kinematic_viscosity_40 = "22 mm**2/s"
kinematic_viscosity_100 = "5 mm**2/s"

[heat]
model = "palmgren"
inner_share = {value = 0.5, sigma_rel = 0.1}

[heat.table]
speed = ["0 rpm", "4000 rpm", "8000 rpm"]
thrust_coefficient = {B1 = 0.1}
heat = {B1 = ["0 W", "24 W", "74 W"], B2 = ["0 W", "22 W", "69 W"]}

[channel]
part = "housing"
inner_radius = "50 mm"
depth = "6 mm"
width = "8 mm"
pitch = "24 mm"
turns = 2
starts = 2
hand = "left"
z_start = "34 mm"
ports = {diameter = "6 mm"}

[coolant]
inlet_temperature = "20 degC"
flow = "6 L/min"

[[joint]]
name = "seats"
conductance = {low = "4000 W/m**2/K", high = "20000 W/m**2/K"}
contacts = ["*_ring|shaft", "inner_spacer|shaft", "*_ring|housing", "housing|outer_spacer"]

[[joint]]
name = "faces"
conductance = "perfect"
contacts = ["*_ring|shaft:face", "*_ring|*_spacer:face", "*_ring|housing:face"]

[[surface]]
name = "housing.outside"
part = "housing"
where = [{facing = "outward"}]

[[surface]]
name = "housing.rear"
part = "housing"
where = [{facing = "rear", z = "104 mm"}]

[[surface]]
name = "shaft.nose"
part = "shaft"
where = [{facing = "front", z = "0 mm"}, {facing = "outward", r = "35 mm", z = ["0 mm", "24 mm"]}]

[[surface]]
name = "inner_spacer.gap"
part = "inner_spacer"
where = [{facing = "outward"}]

[[surface]]
name = "outer_spacer.gap"
part = "outer_spacer"
where = [{facing = "inward"}]

[[film]]
name = "outside"
kind = "natural_convection_radiation"
surface = ["housing.outside"]
characteristic_length = "150 mm"
emissivity = 0.6

[[film]]
name = "rear"
kind = "constant"
surface = ["housing.rear"]
coefficient = "200 W/m**2/K"
temperature = "22 degC"

[[film]]
name = "nose"
kind = "rotating"
surface = ["shaft.nose"]
diameter = "70 mm"
minimum = "10 W/m**2/K"

[[gap]]
name = "spacers"
rotating = "inner_spacer.gap"
standing = ["outer_spacer.gap"]
at_rest = "8 W/m**2/K"

[[factor]]
name = "air"
sigma_rel = 0.3
applies_to = ["film.outside", "gap.spacers"]

[[probe]]
name = "seat"
part = "housing"
r = "41 mm"
z = "32 mm"

[[probe]]
name = "outlet"
kind = "coolant_outlet"

[mesh]
preset = "coarse"
size = {housing = "12 mm"}
"""
