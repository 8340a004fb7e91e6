"""The router spindle that ships with oil in its bearings: oil-air in front, jets at the rear."""

from pathlib import Path

OILED = """
schema = "spindle-fem/machine/1"
base = "router_spindle"
name = "oiled"
operation = {speed = "12000 rpm"}
[[bearing_set]]
name = "front"
[bearing_set.lubrication]
kind = "oil_air"
oil = "iso_vg_22"
oil_flow = "0.2 cm**3/h"
air_flow = "30 L/min"
inlet_temperature = "25 degC"
[[bearing_set]]
name = "rear"
[bearing_set.lubrication]
kind = "oil_jet"
oil = "iso_vg_10"
oil_flow = "0.5 L/min"
inlet_temperature = "25 degC"
film_factor = {value = 1.0, sigma_rel = 0.3}
[[probe]]
name = "OIL_OUT"
kind = "circuit_outlet"
circuit = "R1.lubrication"
"""


def oiled(folder: Path) -> Path:
    """Its definition, written into a folder."""
    path = folder / "oiled.toml"
    path.write_text(OILED, encoding="utf-8")
    return path
