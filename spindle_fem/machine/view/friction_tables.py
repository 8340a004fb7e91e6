"""Friction heat of every bearing as the heat table of a definition gives it."""

from __future__ import annotations

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.effects.framework.machine_view import FrictionTable


def friction_tables(spec: MachineSpec) -> dict[str, FrictionTable]:
    """Table of every bearing, the definition's factors included; none where the definition has no table."""
    table = spec.heat.table
    if table is None:
        return {}
    return {
        bearing.name: FrictionTable(
            tuple(table.speed),
            tuple(value * group.heat_factor.value for value in table.heat[bearing.name]),
            table.thrust_coefficient.get(bearing.name, 0.0),
            table.reference_thrust,
        )
        for group, bearing in spec.bearings
    }
