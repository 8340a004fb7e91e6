"""Ball rows that follow their contacts on a machine whose heat is given by table."""

from types import SimpleNamespace

import numpy as np

from spindle_fem.definition.load import load_machine
from spindle_fem.model.reduced.film_heat import FilmHeat
from spindle_fem.operation.operating_point import OperatingPoint


def test_contacts_follow_the_map_where_the_heat_is_a_table():
    machine = load_machine("small_two_start", ["heat.model=table"])
    constant = ("kind=constant", "conductance=2 W/K")
    table = load_machine(
        "small_two_start", ["heat.model=table", *(f"bearing_set.pair.ball_row.{item}" for item in constant)]
    )
    at_30 = np.array([[1.0, 2.0], [3.0, 4.0]])
    friction_map = SimpleNamespace(bearings=("B1", "B2"), nominal_conductance=lambda speed, thrust: at_30)
    term = FilmHeat(friction_map, machine, table)
    assert term.bearings == ()
    names = ("balls.B1.inner", "balls.B1.outer", "balls.B2.inner", "balls.B2.outer")
    assert term.operating_factor(OperatingPoint.of(machine), {}) == dict(
        zip(names, (0.5, 1.0, 1.5, 2.0), strict=True)
    )
