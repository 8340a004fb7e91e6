"""Two questions of design in one study: how much oil, and how cold? Each design, the best ones, a report."""

import csv
import sys
from pathlib import Path

import spindle_fem

STUDY = """
schema = "spindle-fem/study/1"
name = "Flow and temperature of the oil"

[[parameter]]
path = "coolant.inlet_temperature"
values = ["15 degC", "20 degC"]

[[parameter]]
path = "coolant.flow"
low = "4 L/min"
high = "10 L/min"
number = 2

[study]
outputs = ["temperature.max_degC", "coolant.pressure_drop_Pa"]

[[objective]]
output = "temperature.max_degC"

[[objective]]
output = "coolant.pressure_drop_Pa"
"""

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "runs/sweep_example")
folder.mkdir(parents=True, exist_ok=True)
study = folder / "oil.toml"
study.write_text(STUDY, encoding="utf-8")

# Linear elements on a coarse mesh and heat by table answer within seconds; leave them out for the real thing.
quick = ("mesh.preset=coarse", "mesh.order=1", "heat.model=table")
summary = spindle_fem.sweep("small_two_start", study, folder / "answers", quick)

with (folder / "answers" / "results.csv").open(encoding="utf-8") as table:
    rows = list(csv.DictReader(table))
front = summary["optimum"]["front"]
for row in rows:
    oil, litres = row["coolant.inlet_temperature"], float(row["coolant.flow"]) * 6e4
    warmest, drop = float(row["temperature.max_degC"]), float(row["coolant.pressure_drop_Pa"])
    mark = "nothing is better in both" if int(row["design"]) in front else ""
    print(f"{litres:4.1f} L/min of {oil} degC: {warmest:.2f} degC, {drop / 1e5:.2f} bar  {mark}")
print(f"report: {folder / 'answers' / 'report.html'}")
assert summary["ok"] == len(rows) == 4
