"""Joint group of each contact of the mesh."""

from __future__ import annotations

import fnmatch
from collections.abc import Iterable

from spindle_fem.definition.machine_spec import JointGroup, MachineSpec
from spindle_fem.errors import FaultsError, SpecError, SpindleFemError, UnknownSurfaceError, did_you_mean


def group_of_contacts(spec: MachineSpec, contacts: Iterable[str]) -> dict[str, JointGroup]:
    """Joint group of every contact name.

    Raises
    ------
    FaultsError
        A contact that no group or more than one group covers, or a pattern
        that covers none; all at once.
    """
    names = list(contacts)
    faults: list[SpindleFemError] = []
    groups: dict[str, list[JointGroup]] = {name: [] for name in names}
    for group in spec.joint:
        for pattern in group.contacts:
            matched = [name for name in names if _matches(name, pattern)]
            if not matched:
                faults.append(
                    UnknownSurfaceError(
                        f"joint.{group.name}.contacts",
                        f'"{pattern}" is no contact of this machine.',
                        did_you_mean(pattern, names),
                    )
                )
            for name in matched:
                if group not in groups[name]:
                    groups[name].append(group)
    turns = {part.name: part.rotating for part in spec.part}
    turns |= {f"{bearing.name}.inner_ring": True for _, bearing in spec.bearings}
    for name, owners in groups.items():
        if not owners:
            how = "Add it to a [[joint]]."
            if len({turns.get(part, False) for part in name.removesuffix(":face").split("|")}) == 2:
                how = "One turns and the other stands: leave a gap between them. Or add it to a [[joint]]."
            faults.append(SpecError("joint", f'the contact "{name}" has no conductance.', how))
        elif len(owners) > 1:
            listing = " and ".join(owner.name for owner in owners)
            faults.append(SpecError("joint", f'the contact "{name}" is claimed by {listing}.'))
    if faults:
        raise FaultsError(spec.name, faults)
    return {name: owners[0] for name, owners in groups.items()}


def _matches(name: str, pattern: str) -> bool:
    # A pattern without ":face" means cylindrical contacts only.
    return name.endswith(":face") == pattern.endswith(":face") and fnmatch.fnmatchcase(name, pattern)
