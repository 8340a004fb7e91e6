"""A recording in, a diagnosis out: something that nobody recorded warmed a pump for forty minutes.

The recording is made here by integrating the equations of pump.toml with an extra 45 W in the casing.
"""

import shutil
import sys
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.integrate import solve_ivp

import spindle_fem


def power(time):
    """Losses of the motor, W: two loads with a rest between them."""
    return 80.0 if 600.0 <= time < 3000.0 or 7800.0 <= time < 9600.0 else 10.0


def slope(time, state):
    """Rates of both temperatures, K/s."""
    extra = 45.0 if 4200.0 <= time < 6600.0 else 0.0
    between, lost = 3.0 * (state[0] - state[1]), 2.0 * (state[1] - 22.0)
    return [(power(time) - between) / 500.0, (between - lost + extra) / 900.0]


folder = Path(sys.argv[1] if len(sys.argv) > 1 else "runs/diagnose_example")
folder.mkdir(parents=True, exist_ok=True)
times = np.arange(0.0, 12001.0, 30.0)
exact = solve_ivp(slope, (0.0, times[-1]), [22.0, 22.0], t_eval=times, max_step=10.0).y
read = exact + np.random.default_rng(2).normal(0.0, 0.1, exact.shape)
data = pd.DataFrame({"t": times, "T1": read[0], "T2": read[1], "room": 22.0, "P": [power(t) for t in times]})
data.to_csv(folder / "data.csv", index=False)
shutil.copy(Path(__file__).with_name("pump_recording.toml"), folder / "recording.toml")

machine = Path(__file__).with_name("pump.toml")
answer = spindle_fem.diagnose(machine, folder / "recording.toml", folder / "answer")
before, after = (answer["fit"][when]["heldout_rmse_K"] for when in ("before", "after"))
print(f"{answer['verdict']}: error on readings that the fit did not see {before:.2f} K, then {after:.2f} K")
for finding in answer["findings"]:
    print(f"{finding['probability']:.2f}  {finding['statement']}")
answer.plot_before_after().savefig(folder / "before_after.png")
assert answer["verdict"] == "missing_physics"
assert answer["findings"][0]["component"] == "casing"
