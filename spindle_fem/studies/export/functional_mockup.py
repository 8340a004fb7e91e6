"""State spaces as functional mock-up units (FMI 3.0, co-simulation), by PythonFMU3."""

from __future__ import annotations

import hashlib
import tempfile
from pathlib import Path

from spindle_fem.errors import BadInputError
from spindle_fem.studies.export.state_space import StateSpace

# Base units, factor and offset of what inputs and outputs are measured in.
UNITS = {
    "degC": {"K": 1, "offset": 273.15},
    "um": {"m": 1, "factor": 1e-6},
    "rad/s": {"rad": 1, "s": -1},
    "W": {"kg": 1, "m": 2, "s": -3},
    "N": {"kg": 1, "m": 1, "s": -2},
    "N*m": {"kg": 1, "m": 2, "s": -2},
    "A": {"A": 1},
    "V": {"kg": 1, "m": 2, "s": -3, "A": -1},
    "m/s": {"m": 1, "s": -1},
    "m**3/s": {"m": 3, "s": -1},
    "Pa": {"kg": 1, "m": -1, "s": -2},
    "1": {},
}

# Appended to the exported module: the model with the interface that PythonFMU3 needs.
SLAVE = '''

from pythonfmu3 import Boolean, CoSimulation, Float64, Fmi3Causality  # noqa: E402
from pythonfmu3 import Fmi3Slave, Fmi3StepResult, Unit  # noqa: E402

UNITS = {units!r}


class {name}(Fmi3Slave, CoSimulation):
    """The model beside what drives it; inputs are held over each step."""

    def __init__(self, **arguments):
        super().__init__(**arguments)
        self.model, self.initial_temperature, self.is_outside = model(), {initial}, False
        self.description = "Fast thermal model, made by spindle-fem export"
        self.values = [item["default"] for item in self.model.header["inputs"]]
        self.register_units([Unit(unit, **parts) for unit, parts in UNITS.items()])
        self.time = 0.0
        clock = Float64("time", causality=Fmi3Causality.independent, getter=lambda: self.time)
        self.register_variable(clock, nested=False)
        for number, item in enumerate(self.model.header["inputs"]):
            self._register(item, Fmi3Causality.input, lambda n=number: self.values[n], self._setter(number))
        for number, item in enumerate(self.model.header["outputs"]):
            self._register(item, Fmi3Causality.output, lambda n=number: self.model.read(self.values)[n], None)
        start = {{"name": "initial_temperature", "unit": "degC"}}
        self._register(start, Fmi3Causality.parameter, lambda: self.initial_temperature, self._start)
        outside = Boolean("outside_range", causality=Fmi3Causality.output, getter=lambda: self.is_outside)
        self.register_variable(outside, nested=False)

    def _register(self, item, causality, getter, setter):
        unit = item["unit"] if item["unit"] in UNITS else None
        variable = Float64(item["name"], causality=causality, unit=unit, getter=getter, setter=setter)
        self.register_variable(variable, nested=False)

    def _setter(self, number):
        return lambda value: self.values.__setitem__(number, value)

    def _start(self, temperature):
        self.initial_temperature = temperature
        self.model.start(temperature)

    def do_step(self, current_time, step_size):
        self.time = current_time + step_size
        self.is_outside = bool(self.model.step(step_size, self.values))
        return Fmi3StepResult()
'''


def write_functional_mockup(space: StateSpace, path: Path, source: str, name: str) -> None:
    """Write a co-simulation unit that holds a module and steps its model.

    Parameters
    ----------
    source : str
        The exported module, with ``model()``.
    name : str
        Of the machine, as programs have names.

    Raises
    ------
    BadInputError
        PythonFMU3 is not installed.
    """
    try:
        from pythonfmu3 import FmuBuilder
    except ImportError:
        raise BadInputError(
            str(path),
            "needs PythonFMU3, which is not installed.",
            'Install it: pip install "spindle-fem[fmu]".',
        ) from None
    header = space.header
    used = {item["unit"] for item in (*header["inputs"], *header["outputs"])} | {"degC"}
    units = {unit: UNITS[unit] for unit in UNITS if unit in used}
    text = source + SLAVE.format(name=name, units=units, initial=header["initial_degC"])
    # Units in one process must not share modules.
    module = f"{name}_{hashlib.sha256(text.encode()).hexdigest()[:12]}.py"
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / module).write_text(text, encoding="utf-8")
        made = FmuBuilder.build_FMU(Path(folder) / module, dest=Path(folder) / "made")
        path.write_bytes(made.read_bytes())
