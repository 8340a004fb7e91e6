"""Solve a spindle and look at the result: temperatures, heat of the bearings, where the heat goes."""

import spindle_fem

# Any value of the definition can be changed on the way in, with its unit.
machine = spindle_fem.load_machine(
    "small_two_start", ["mesh.preset=coarse", "operation.speed=6000rpm", "coolant.flow=8 L/min"]
)
result = spindle_fem.solve(machine)

for name, kelvin in result.probes.items():
    print(f"{name:14s} {kelvin - 273.15:6.2f} degC")
for name, bearing in result.bearings.items():
    difference = bearing.temperature_inner - bearing.temperature_outer
    print(f"{name:14s} {bearing.heat:6.1f} W, inner ring {difference:+.1f} K against outer ring")

# Heat through each film, and whether the sum equals the heat of the bearings.
for name, watts in sorted(result.energy.heat_out.items(), key=lambda item: -item[1]):
    print(f"{name:40s} {watts:7.2f} W")
print(f"heat in {result.energy.heat_in:.1f} W, imbalance {result.energy.imbalance_relative:.1e}")
assert all(check.passed for check in result.checks)
