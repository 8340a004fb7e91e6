"""The paper's optimum, checked with both models: 19 mm deep channel and oil at 31 °C.

Wu & Tan (2016): against the first design the maximum temperature rises by less
than 3 °C and the difference between inner and outer ring falls by about 15 °C.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.machine.geometry.coolant_path import section_of
from spindle_fem.model.lumped.machine_network import build_machine_network
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.physics.coolant.properties import coolant_by_name
from spindle_fem.solvers.coupled_steady import CoupledState, solve_coupled
from spindle_fem.solvers.machine_network_steady import MachineNetworkState, solve_machine_network
from spindle_fem.solvers.prepared_machine import PreparedMachine, prepare_machine
from spindle_fem.units import ZERO_CELSIUS_K, Uncertain

OPTIMUM_DEPTH = 19.0e-3
OPTIMUM_INLET = 31.0 + ZERO_CELSIUS_K
CLAIMED_RISE, CLAIMED_FALL = 3.0, 15.0
# The claim says "about".
FALL_TOLERANCE = 3.0
PERFECT_FILM = 100.0
# Refinement of the network's cells.
REFINEMENT = 4


@dataclass(frozen=True, slots=True)
class ClaimCase:
    """Prediction of one model for one design, temperatures in K."""

    design: str
    model: str
    maximum: float
    ring_difference: dict[str, float]
    film_coefficient: float
    coolant_heat: float
    heat: float

    def as_json(self) -> dict[str, Any]:
        """Plain values with units in their names."""
        return {
            "design": self.design,
            "model": self.model,
            "max_degC": self.maximum - ZERO_CELSIUS_K,
            "ring_difference_K": {name: float(value) for name, value in self.ring_difference.items()},
            "film_coefficient_W_m2K": self.film_coefficient,
            "coolant_heat_W": self.coolant_heat,
            "friction_heat_W": self.heat,
        }


def with_design(spec: MachineSpec, depth: float | None, inlet: float | None) -> MachineSpec:
    """The machine with another channel depth (m) or oil temperature (K)."""
    update: dict[str, Any] = {}
    if depth is not None:
        update["channel"] = spec.channel.model_copy(update={"depth": depth})
    if inlet is not None:
        update["coolant"] = spec.coolant.model_copy(update={"inlet_temperature": inlet})
    return spec.model_copy(update=update)


def network_case(spec: MachineSpec, design: str) -> ClaimCase:
    """The refined network on a design."""
    state = solve_machine_network(build_machine_network(spec, refinement=REFINEMENT))
    return _network_result(design, state)


def _network_result(design: str, state: MachineNetworkState) -> ClaimCase:
    around = state.bearing_temperatures()
    network = state.network
    solid = state.temperature[: network.machine.air_start]
    raceways = [value for item in around.values() for value in (item.inner, item.outer)]
    law = network.coolant_law
    area = network.machine.coolant.area
    h = law.coefficients(state.temperature)[0]
    return ClaimCase(
        design,
        "network",
        max(float(solid.max()), *raceways),
        {name: item.inner - item.outer for name, item in around.items()},
        float(h @ area / area.sum()),
        state.boundary_heat["coolant"],
        state.heat_in,
    )


def element_case(spec: MachineSpec, design: str) -> ClaimCase:
    """The elements on a design."""
    prepared = prepare_machine(spec)
    coupled = solve_coupled(prepared, OperatingPoint.of(spec))
    return element_result(design, prepared, coupled)


def element_result(design: str, prepared: PreparedMachine, coupled: CoupledState) -> ClaimCase:
    """A solved design of the elements."""
    solution = coupled.solution
    lumped = dict(zip(solution.problem.lumped_names, solution.lumped_temperature.tolist(), strict=True))
    around = prepared.builder.bearing_temperatures(prepared.field_state(solution.temperature, lumped))
    cells, state = prepared.builder.cells, coupled.coolant
    return ClaimCase(
        design,
        "elements",
        float(solution.temperature.max()),
        {name: item.inner - item.outer for name, item in around.items()},
        float((state.film_coefficient * cells.cell_area).sum() / cells.cell_area.sum()),
        state.march.march.enthalpy_rise,
        coupled.loads.total_heat,
    )


def with_perfect_film(spec: MachineSpec) -> MachineSpec:
    """The machine with a film so good that the channel's wall has the oil's temperature."""
    perfect = spec.coolant.model_copy(update={"film_factor": Uncertain(PERFECT_FILM)})
    return spec.model_copy(update={"coolant": perfect})


def reynolds_number(spec: MachineSpec) -> float:
    """Reynolds number of the channel flow at inlet temperature, on the hydraulic diameter."""
    section = section_of(spec.channel)
    properties = coolant_by_name(spec.coolant.fluid).properties(spec.coolant.inlet_temperature)
    velocity = section.velocity(OperatingPoint.of(spec).coolant_flow)
    return velocity * section.hydraulic_diameter / float(properties.kinematic_viscosity)


def applies(spec: MachineSpec) -> bool:
    """Whether the claim is testable on a machine: the paper's, with bearings inside a cooling channel."""
    return (
        spec.is_the_papers
        and spec.channel is not None
        and spec.coolant is not None
        and bool(spec.bearing_set)
    )


def check_claim(
    spec: MachineSpec,
    base: ClaimCase,
    *,
    progress: Callable[[str], None] = lambda stage: None,
) -> dict[str, Any]:
    """Compare both models on the base design and the paper's optimum, and split the change by cause.

    Parameters
    ----------
    spec : MachineSpec
        The base design; ``base`` is its finite-element result.
    """
    progress("the paper's optimum")
    designs = {
        "base": spec,
        "coolant 31 °C only": with_design(spec, None, OPTIMUM_INLET),
        "19 mm only": with_design(spec, OPTIMUM_DEPTH, None),
        "19 mm and 31 °C": with_design(spec, OPTIMUM_DEPTH, OPTIMUM_INLET),
    }
    designs["19 mm and 31 °C, film a hundredfold"] = with_perfect_film(designs["19 mm and 31 °C"])
    network = {name: network_case(item, name) for name, item in designs.items()}
    elements = {"base": base, "19 mm and 31 °C": element_case(designs["19 mm and 31 °C"], "19 mm and 31 °C")}
    verdicts = {}
    for model, cases in (("network", network), ("elements", elements)):
        before, after = cases["base"], cases["19 mm and 31 °C"]
        rise = after.maximum - before.maximum
        change = {name: after.ring_difference[name] - value for name, value in before.ring_difference.items()}
        fall = -min(change.values())
        verdicts[model] = {
            "max_rise_K": rise,
            "ring_difference_change_K": change,
            "rise_below_3_K": bool(rise < CLAIMED_RISE),
            "fall_about_15_K": bool(abs(fall - CLAIMED_FALL) < FALL_TOLERANCE),
        }
    return {
        "source": "Wu & Tan (2016), doi 10.1177/1687814016665296: h_gap 19 mm, oil 31 °C",
        "cases": [case.as_json() for case in (*network.values(), *elements.values())],
        "verdicts": verdicts,
        "explanation": _explanation(spec, network, verdicts["elements"]),
    }


def _explanation(spec: MachineSpec, network: dict[str, ClaimCase], verdict: dict[str, Any]) -> list[str]:
    """Why the claim comes out or does not, with the numbers of the refined network."""
    base, warm, deep, both, perfect = network.values()
    drops = verdict["ring_difference_change_K"]
    hottest = max(base.ring_difference, key=lambda name: base.ring_difference[name])
    sentences = [
        f"Claimed: maximum up by less than {CLAIMED_RISE:.0f} K, ring difference down by about "
        f"{CLAIMED_FALL:.0f} K. "
        f"Elements: maximum {verdict['max_rise_K']:+.1f} K, ring differences "
        + ", ".join(f"{name} {value:+.1f} K" for name, value in drops.items())
        + ".",
        f"Coolant 16 K warmer alone moves the maximum by {warm.maximum - base.maximum:+.1f} K and the ring "
        "difference of "
        f"{hottest} by {warm.ring_difference[hottest] - base.ring_difference[hottest]:+.1f} K: all "
        "that sits on the "
        "housing follows the coolant, the shaft side only through balls and air, so the outer ring warms "
        "more than the "
        "inner one.",
        f"The deeper channel alone moves the maximum by {deep.maximum - base.maximum:+.1f} K: the "
        "flow is slower, "
        f"the film coefficient goes from {base.film_coefficient:.0f} to {deep.film_coefficient:.0f} W/(m²·K) "
        "while the wetted area grows.",
        f"Together the coolant takes {both.coolant_heat:.0f} W instead of {base.coolant_heat:.0f} W, and "
        "friction makes "
        f"{both.heat:.0f} W instead of {base.heat:.0f} W.",
    ]
    needed = base.ring_difference[hottest] - CLAIMED_FALL
    sentences.append(
        f"The ring difference of {hottest} is {base.ring_difference[hottest]:.1f} K at first; a fall of "
        f"{CLAIMED_FALL:.0f} K would leave {needed:.1f} K."
    )
    if verdict["rise_below_3_K"] and verdict["fall_about_15_K"]:
        return sentences
    optimum = with_design(spec, OPTIMUM_DEPTH, OPTIMUM_INLET)
    change = perfect.ring_difference[hottest] - base.ring_difference[hottest]
    sentences.append(
        "The paper's map steps to its turbulent branch at 19 mm and 31 °C. At "
        f"{6.0e4 * OperatingPoint.of(spec).coolant_flow:.0f} L/min "
        f"the Reynolds number there is {reynolds_number(optimum):.0f}, and no step comes."
    )
    sentences.append(
        "Nor would a turbulent film do it: with a film coefficient a hundred times as large the "
        "maximum still changes "
        f"by {perfect.maximum - base.maximum:+.1f} K and the ring difference of {hottest} by "
        f"{change:+.1f} K. "
        "The wall cannot be colder than the coolant, and the ring difference is made by the heat that "
        "must cross from the "
        "inner ring to the outer, which the coolant hardly changes."
    )
    return sentences
