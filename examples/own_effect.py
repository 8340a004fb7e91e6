"""An own effect: a pump on a cold floor, as a class that definitions and diagnoses know from then on."""

import shutil
import sys
from pathlib import Path

import numpy as np
import pandas as pd

import spindle_fem
from spindle_fem.effects.framework.effect import Effect
from spindle_fem.effects.framework.laws import amplitude
from spindle_fem.effects.framework.term import Term


class FloorTerm(Term):
    """Heat that a node loses to the floor: conductance times temperature difference."""

    parameters = (amplitude("conductance", 2.0, "W/K"),)

    def __init__(self, name, places):
        self.name, self.heat_places, self.reads = name, places, places

    def heat(self, context):
        """Heat into the node, W, from a floor of 10 °C."""
        return context.parameters["conductance"] * (283.15 - context.temperatures)


@spindle_fem.register_effect
class ColdFloor(Effect):
    """Conduction into a floor of 10 °C."""

    name, kind, title = "cold_floor", "missing_physics", "the machine loses heat to the floor under it"
    check = "What the machine stands on: feet, pads, grouting; the temperature of the floor."

    def forms(self, machine):
        """Every place of a machine, or node of a network, may stand on the floor."""
        terms = ((key, FloorTerm(self.term_name(key), places)) for key, places in machine.spots.items())
        return tuple(self.candidate(key, t, amplitude="conductance", reference=2.0) for key, t in terms)

    def statement(self, candidate, reported):
        """State the conductance to the floor."""
        return f"{candidate.component} loses {reported['conductance'].value:.2f} W/K to the floor."


ENTRY = '\n[[effect]]\neffect = "cold_floor"\ncomponent = "casing"\nparameters = {conductance = "1 W/K"}\n'

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "runs/own_effect_example")
folder.mkdir(parents=True, exist_ok=True)
# At rest 60 W = 2 W/K (T - 22 °C) + 1 W/K (T - 10 °C): 38 °C, and 52 °C without the floor.
times = np.arange(0.0, 20001.0, 50.0)
data = pd.DataFrame({"t": times, "T1": 58.0, "T2": 38.0, "room": 22.0, "P": 60.0})
data.to_csv(folder / "data.csv", index=False)
shutil.copy(Path(__file__).with_name("pump_recording.toml"), folder / "recording.toml")
text = Path(__file__).with_name("pump.toml").read_text(encoding="utf-8") + ENTRY
(folder / "machine.toml").write_text(text, encoding="utf-8")
spindle_fem.simulate(folder / "machine.toml", folder / "recording.toml", folder / "answer")
end = pd.read_csv(folder / "answer" / "simulated.csv")["T2"].iloc[-1]
print(f"casing {end:.2f} degC at the end; by hand 38 degC")
assert abs(end - 38.0) < 0.05
