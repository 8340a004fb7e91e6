"""The reference spindle on its coarsest mesh with two displacement sensors, and a manifest for it."""

OVERRIDES = ("mesh.preset=coarse", "mesh.order=1")
SENSORS = """
[[displacement_sensor]]
name = "S1"
at = {z = "0 mm", radius = "55 mm", angle = "0 deg"}
direction = "axial"
mount = "flange"
[[displacement_sensor]]
name = "S2"
at = {z = "10 mm", radius = "90 mm", angle = "0 deg"}
direction = "radial"
mount = "flange"
"""
MANIFEST = """schema = "spindle-fem/recording/1"
name = "made"
data = "made.csv"
time = {column = "time", unit = "s"}
channel = [
    {column = "n", role = "input", drives = "speed", unit = "rpm", hold = "previous"},
    {column = "SP01", role = "temperature", probe = "SP01", unit = "degC", sigma = 0.1},
    {column = "SP05", role = "temperature", probe = "SP05", unit = "degC", sigma = 0.1},
    {column = "S1", role = "displacement", probe = "S1", unit = "um", sigma = 0.2},
    {column = "S2", role = "displacement", probe = "S2", unit = "um", sigma = 0.2},
]
"""
