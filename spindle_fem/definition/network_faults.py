"""Faults that make a well-formed written network unusable, each by name."""

from __future__ import annotations

from collections.abc import Mapping

from spindle_fem.definition.network_tables import NetworkSpec, SourceSpec
from spindle_fem.errors import SpecError, SpindleFemError, UnitError, UnknownSurfaceError, did_you_mean
from spindle_fem.units import Uncertain, registry


def network_faults(spec: NetworkSpec) -> list[SpindleFemError]:
    """Everything that makes a well-formed network unusable, by name.

    Floating nodes, capacities and conductances that are not positive, unknown
    or repeated names, links to themselves, gains without a power.
    """
    faults: list[SpindleFemError] = []
    seen: dict[str, str] = {}
    for kind, items in (("node", spec.node), ("boundary", spec.boundary)):
        for number, item in enumerate(items, 1):
            where = f"network.{kind}[{number}].name"
            if item.name in seen:
                earlier = seen[item.name]
                faults.append(
                    SpecError(
                        where, f'"{item.name}" is defined twice, first as {earlier}.', "Use one definition."
                    )
                )
            seen.setdefault(item.name, f"network.{kind}[{number}]")
    for number, node in enumerate(spec.node, 1):
        if not node.capacity.value > 0.0:
            faults.append(
                SpecError(
                    f"network.node[{number}].capacity",
                    f'"{node.name}" has {node.capacity.value:g} J/K.',
                    "Allowed: above 0 J/K.",
                )
            )
    for number, boundary in enumerate(spec.boundary, 1):
        value = boundary.temperature
        if isinstance(value, Uncertain) and not value.value > 0.0:
            faults.append(
                SpecError(
                    f"network.boundary[{number}].temperature",
                    f"{value.value:g} K is below absolute zero.",
                    'Allowed: such as "20 degC".',
                )
            )
    faults += _link_faults(spec, seen)
    faults += _source_faults(spec)
    if not faults:
        faults += _floating_faults(spec)
    return faults


def _link_faults(spec: NetworkSpec, known: Mapping[str, str]) -> list[SpindleFemError]:
    faults: list[SpindleFemError] = []
    labels: dict[frozenset[str] | str, int] = {}
    boundaries = {boundary.name for boundary in spec.boundary}
    for number, link in enumerate(spec.link, 1):
        where = f"network.link[{number}]"
        unknown = [end for end in dict.fromkeys(link.between) if end not in known]
        faults += [
            UnknownSurfaceError(
                f"{where}.between", f'"{end}" is neither a node nor a boundary.', did_you_mean(end, known)
            )
            for end in unknown
        ]
        if link.between[0] == link.between[1]:
            faults.append(
                SpecError(
                    f"{where}.between", f'joins "{link.between[0]}" to itself.', "Name two different ends."
                )
            )
        elif set(link.between) <= boundaries:
            faults.append(
                SpecError(
                    f"{where}.between",
                    f'joins the boundaries "{link.between[0]}" and "{link.between[1]}".',
                    "At least one end must be a node.",
                )
            )
        if not link.conductance.value > 0.0:
            faults.append(
                SpecError(
                    f"{where}.conductance",
                    f'"{link.label}" has {link.conductance.value:g} W/K.',
                    "Allowed: above 0 W/K.",
                )
            )
        label = link.name or frozenset(link.between)
        if label in labels:
            faults.append(
                SpecError(
                    where,
                    f'"{link.label}" is the same link as network.link[{labels[label]}].',
                    "Give the second one a name of its own, or add the conductances.",
                )
            )
        labels.setdefault(label, number)
    return faults


def _source_faults(spec: NetworkSpec) -> list[SpindleFemError]:
    faults: list[SpindleFemError] = []
    names = [node.name for node in spec.node]
    labels: dict[str, int] = {}
    for number, source in enumerate(spec.source, 1):
        where = f"network.source[{number}]"
        if source.node not in names:
            faults.append(
                UnknownSurfaceError(
                    f"{where}.node", f'"{source.node}" is not a node.', did_you_mean(source.node, names)
                )
            )
        if source.label in labels:
            faults.append(
                SpecError(
                    where,
                    f'node "{source.node}" already takes heat from {source.input or "a constant"} in '
                    f"network.source[{labels[source.label]}].",
                    "Use one source for each node and input.",
                )
            )
        labels.setdefault(source.label, number)
        faults += _gain_faults(source, where)
    return faults


def _gain_faults(source: SourceSpec, where: str) -> list[SpindleFemError]:
    units = registry()
    power = units.Unit("W").dimensionality
    is_power = units.Unit(source.gain.unit).dimensionality == power
    example = 'For example gain = "5 W".'
    if source.input is None:
        if source.exponent != 1.0 or source.reference is not None:
            return [
                SpecError(where, "exponent and reference need an input.", "Name the input, or drop them.")
            ]
        if not is_power:
            return [UnitError(f"{where}.gain", "a source without input needs a power.", example)]
    elif source.reference is not None:
        if not source.reference.amount.value > 0.0:
            return [SpecError(f"{where}.reference", "must be above 0.", 'For example "1000 rpm".')]
        if not is_power:
            return [
                UnitError(f"{where}.gain", "with a reference the gain is the heat there, a power.", example)
            ]
    return []


def _floating_faults(spec: NetworkSpec) -> list[SpindleFemError]:
    neighbours: dict[str, set[str]] = {}
    for link in spec.link:
        first, second = link.between
        neighbours.setdefault(first, set()).add(second)
        neighbours.setdefault(second, set()).add(first)
    reached = {boundary.name for boundary in spec.boundary}
    frontier = list(reached)
    while frontier:
        new = neighbours.get(frontier.pop(), set()) - reached
        reached |= new
        frontier += new
    return [
        SpecError(
            f"network.node[{number}]",
            f'"{node.name}" floats: no chain of links joins it to a boundary.',
            "Link it, directly or through other nodes, to a boundary.",
        )
        for number, node in enumerate(spec.node, 1)
        if node.name not in reached
    ]
