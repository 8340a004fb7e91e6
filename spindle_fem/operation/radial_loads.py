"""Loads at each bearing set from forces across the shaft."""

from __future__ import annotations

import math

import numpy as np

from spindle_fem.definition.machine_spec import BearingSet, MachineSpec


def radial_loads(spec: MachineSpec) -> dict[str, float]:
    """Radial load of every bearing set, N; constant over speed and time.

    The shaft is a rigid beam on one support a set, in the middle of its bearings
    and as stiff as they are many: two supports follow from the equilibrium alone,
    between three and more the beam shares by their stiffness.
    """
    found = dict.fromkeys((group.name for group in spec.bearing_set), 0.0)
    holding = [group for group in spec.bearing_set if group.carries_radial]
    if not spec.radial_load or not holding:
        return found
    places = np.array([_middle(group) for group in holding])
    stiffness = np.array([float(len(group.bearing)) for group in holding])
    # rows: force and moment that unit displacement and unit tilt of the beam call up
    motion = np.stack([np.ones_like(places), places])
    response = (motion * stiffness) @ motion.T
    forces = np.array(
        [[load.force * math.cos(load.angle), load.force * math.sin(load.angle)] for load in spec.radial_load]
    )
    levers = np.array([load.z for load in spec.radial_load])
    acting = np.stack([forces.sum(axis=0), levers @ forces])
    carried = stiffness[:, None] * (motion.T @ np.linalg.solve(response, acting))
    return found | {
        group.name: float(np.hypot(*force)) for group, force in zip(holding, carried, strict=True)
    }


def _middle(group: BearingSet) -> float:
    return float(np.mean([0.5 * (bearing.z[0] + bearing.z[1]) for bearing in group.bearing]))
