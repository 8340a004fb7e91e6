"""Balls of another material than their rings: contacts, inertia and growth take each its own."""

from __future__ import annotations

from dataclasses import replace

import pytest

from spindle_fem.definition.load import load_machine, write_machine
from spindle_fem.errors import BadInputError
from spindle_fem.operation.assembled_sets import assembled_set
from spindle_fem.physics.bearings.bearing_geometry import BearingGeometry
from spindle_fem.physics.bearings.hertz import INNER, bearing_contact_constants
from spindle_fem.physics.bearings.mounting import rotation_growth

STEEL = {"young_modulus": "206 GPa", "poisson_ratio": "0.3", "thermal_expansion": "12.5e-6 1/K"}
CERAMIC = {"young_modulus": "310 GPa", "poisson_ratio": "0.26", "thermal_expansion": "3.2e-6 1/K"}
HYBRID = """schema = "spindle-fem/machine/1"
base = "small_two_start"
name = "hybrid"

[materials.balls]
thermal_conductivity = "30 W/m/K"
density = "3200 kg/m**3"
specific_heat_capacity = "700 J/kg/K"
{values}

[bearing_types.7010_C]
ball_material = "balls"
"""


def geometry_of(tmp_path, values: dict[str, str], leave_out: str = "") -> BearingGeometry:
    lines = [
        f"{key} = {value if key == 'poisson_ratio' else repr(value)}"
        for key, value in values.items()
        if key != leave_out
    ]
    path = tmp_path / "hybrid.toml"
    path.write_text(HYBRID.format(values="\n".join(lines)))
    spec = load_machine(path)
    (tmp_path / "again.toml").write_text(write_machine(spec))
    assert load_machine(tmp_path / "again.toml").materials == spec.materials
    return assembled_set(spec, spec.bearing_set[0]).bearings[0].geometry


def test_contacts_are_stiffer_and_pressed_harder_by_a_ceramic_ball(tmp_path) -> None:
    hybrid, steel = geometry_of(tmp_path, CERAMIC), geometry_of(tmp_path, STEEL)
    assert steel.reduced_modulus == pytest.approx(206e9 / 0.91)
    expected = 2.0 / (0.91 / 206e9 + (1.0 - 0.26**2) / 310e9)
    assert hybrid.reduced_modulus == pytest.approx(expected)
    # Hertz: at one load the pressure goes with the reduced modulus to 2/3, some 12 % for silicon nitride.
    assert (hybrid.reduced_modulus / steel.reduced_modulus) ** (2.0 / 3.0) == pytest.approx(1.12, abs=0.01)
    stiffer, softer = (bearing_contact_constants(item, 0.26, INNER).load_constant for item in (hybrid, steel))
    assert stiffer / softer == pytest.approx(hybrid.reduced_modulus / steel.reduced_modulus, rel=1e-9)


def test_inertia_is_the_balls_and_growth_by_rotation_the_rings(tmp_path) -> None:
    hybrid = geometry_of(tmp_path, CERAMIC)
    assert (hybrid.density, hybrid.ring_density) == (3200.0, 7810.0)
    heavier = rotation_growth(replace(hybrid, density=7810.0), 1000.0, 0.016)
    assert rotation_growth(hybrid, 1000.0, 0.016) == heavier


@pytest.mark.parametrize("key", list(CERAMIC))
def test_other_balls_must_say_what_steel_is_assumed_to_have(tmp_path, key: str) -> None:
    with pytest.raises(BadInputError, match=f"materials.balls.{key}: is missing.*silicon nitride"):
        geometry_of(tmp_path, CERAMIC, leave_out=key)
