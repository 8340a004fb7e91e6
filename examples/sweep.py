"""Two questions of design in one study: how deep a channel, how much oil? The best designs and what they cost."""

import csv
import sys
from pathlib import Path

import spindle_fem

STUDY = """
schema = "spindle-fem/study/1"
name = "Depth and flow"

[[parameter]]
path = "channel.depth"
values = ["4 mm", "6 mm"]

[[parameter]]
path = "coolant.flow"
low = "4 L/min"
high = "12 L/min"
number = 3

[study]
outputs = ["temperature.max_degC", "coolant.pressure_drop_Pa"]

[[objective]]
output = "temperature.max_degC"

[[objective]]
output = "coolant.pressure_drop_Pa"
"""

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "runs/sweep_example")
folder.mkdir(parents=True, exist_ok=True)
study = folder / "depth_and_flow.toml"
study.write_text(STUDY, encoding="utf-8")

# A coarse mesh of linear elements answers within seconds; leave the overrides out for the real thing.
quick = ("mesh.preset=coarse", "mesh.order=1")
summary = spindle_fem.sweep_machine("small_two_start", study, folder / "answers", quick)

with (folder / "answers" / "results.csv").open(encoding="utf-8") as table:
    rows = list(csv.DictReader(table))
front = summary["optimum"]["front"]
for row in rows:
    depth, flow = row["channel.depth"], row["coolant.flow"]
    warmest, drop = float(row["temperature.max_degC"]), float(row["coolant.pressure_drop_Pa"])
    mark = "nothing is better in both" if int(row["design"]) in front else ""
    print(f"depth {depth}, flow {flow}: {warmest:6.2f} degC, {drop / 1e5:.3f} bar  {mark}")
print(f"report: {folder / 'answers' / 'report.html'}")
assert summary["ok"] == len(rows) == 6
