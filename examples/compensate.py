"""Thermal compensation with an exported model: a control shifts an axis by growth that nothing measures.

The model runs beside the machine in the control's cycle. It sees what the control knows, power and room
temperature, and no thermometer; from the casing's temperature follows how far the pump lifts its shaft.
"""

import runpy
import sys
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

from spindle_fem.commands.export_command import export_machine

CYCLE = 2.0  # s
GROWTH = 1.9  # µm/K: 160 mm of cast iron between foot and shaft
COLD = 22.0  # °C: where the axes were set

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "runs/compensate_example")
export_machine(Path(__file__).with_name("pump.toml"), folder / "pump_model.py")

# The control needs only the exported file and numpy, nothing of this package.
model = runpy.run_path(str(folder / "pump_model.py"))["model"]()
casing = model.outputs.index("casing")
model.start(COLD)


def compensation(power, room):
    """Shift of the axis in this cycle, µm."""
    inputs = {"power": power, "ambient": room}
    model.step(CYCLE, inputs)
    return -GROWTH * (model.read(inputs)[casing] - COLD)


def machine_rates(time, state):
    """The machine itself, which loses 4 % more than the model has it: rates of both temperatures, K/s."""
    between, lost = 3.0 * (state[0] - state[1]), 2.08 * (state[1] - 22.0)
    return [(power_at(time) - between) / 500.0, (between - lost) / 900.0]


def power_at(time):
    """Losses of the motor, W: an hour of work, a rest, work again."""
    return 80.0 if time < 3600.0 or time >= 5400.0 else 10.0


times = np.arange(0.0, 9000.0, CYCLE)
told = solve_ivp(machine_rates, (0.0, 9000.0), [COLD, COLD], t_eval=times + CYCLE, max_step=5.0, rtol=1e-8)
growth = GROWTH * (told.y[1] - COLD)
shifts = np.array([compensation(power_at(time), 22.0) for time in times])
left = np.abs(growth + shifts).max()
print(f"growth of the shaft up to {growth.max():.1f} µm, up to {left:.1f} µm of it left")
assert left < 0.1 * growth.max()
