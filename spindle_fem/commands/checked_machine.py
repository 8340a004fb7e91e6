"""Load the input of commands: recordings, and machines with all faults of tables, geometry and effects."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from spindle_fem.definition.load import load_machine
from spindle_fem.errors import BadInputError, FaultsError, SpecError, SpindleFemError

if TYPE_CHECKING:
    from spindle_fem.definition.effect_entries import EffectEntry
    from spindle_fem.definition.load import Readable
    from spindle_fem.definition.machine_spec import MachineSpec
    from spindle_fem.definition.network_tables import NetworkMachineSpec
    from spindle_fem.recordings.align import Recording


def recording_of(
    recording: str | Path | Recording, machine: str | Path, overrides: Iterable[str] = ()
) -> Recording:
    """A recording as it is, or read from its folder or manifest for a machine."""
    if not isinstance(recording, (str, Path)):
        return recording
    from spindle_fem.recordings.align import read_recording
    from spindle_fem.recordings.recordable_names import recordable_names

    return read_recording(recording, names=partial(recordable_names, machine, overrides))


def load_buildable(machine: str | Path, overrides: Iterable[str]) -> MachineSpec:
    """Machine whose parts fit together; faults of its tables, geometry and effects at once."""
    from spindle_fem.definition.bearing_seats import seat_faults
    from spindle_fem.definition.load import examine_machine
    from spindle_fem.machine.geometry.assembly import build_assembly, require_readable_geometry
    from spindle_fem.machine.geometry.joint_groups import group_of_contacts
    from spindle_fem.operation.assembled_sets import assembled_set, require_known_friction
    from spindle_fem.operation.operating_limits import require_possible_operation, require_seated_balls

    overrides = tuple(overrides)

    def fits_together(spec: MachineSpec) -> None:
        group_of_contacts(spec, build_assembly(spec).joint_names)
        named = {part.material for part in spec.part}
        for kind in spec.bearing_types.values():
            named |= {kind.ring_material, kind.element_material}
        # No set is assembled of faulty materials, which are already reported.
        for group in spec.bearing_set if named <= spec.materials.keys() else ():
            if group.fit is None or not any(seat_faults(spec, group)):
                assembled_set(spec, group)

    def has_possible_effects(spec: MachineSpec) -> None:
        if not spec.effects:
            return
        # The catalogue and its imports take a second to load.
        from spindle_fem.model.reduced.defined_effects import check_effects, require_known_effects

        examination = examine_machine(machine, overrides)
        entries = _by_number(spec.effects, [fault.where for fault in examination.faults])
        others = [fault for fault in examination.faults if not _ENTRY.search(fault.where)]
        try:
            fits_together(spec)
        except BadInputError as error:
            others.append(error)
        # Where they act needs the rest of the machine; that they exist does not.
        if others:
            require_known_effects(entries)
        else:
            check_effects(entries, spec)

    def rubs_by_a_known_law(spec: MachineSpec) -> None:
        if spec.heat is not None:
            require_known_friction(spec)

    def can_run(spec: MachineSpec, _: Readable) -> None:
        require_possible_operation(spec)

    def has_sensors_on_mounts(spec: MachineSpec) -> None:
        if spec.displacement_sensor:
            # Only they need to know what of a machine is its flange.
            from spindle_fem.machine.view.part_roles import Layout, require_mounts

            require_mounts(Layout(spec, set()))

    checks = (
        fits_together,
        require_possible_operation,
        require_seated_balls,
        has_sensors_on_mounts,
        rubs_by_a_known_law,
        has_possible_effects,
    )
    return load_machine(machine, overrides, checks=checks, partly=(require_readable_geometry, can_run))


_ENTRY = re.compile(r"(?:^|: )effect\[(\d+)\]")


def _by_number(entries: Sequence[EffectEntry], faulty: Iterable[str]) -> list[EffectEntry | None]:
    """Sound entries at their places in the file, None at those of faulty ones."""
    refused = {int(match[1]) for where in faulty if (match := _ENTRY.search(where))}
    sound = iter(entries)
    return [
        None if number in refused else next(sound) for number in range(1, len(entries) + len(refused) + 1)
    ]


def load_network(machine: str | Path, overrides: Iterable[str]) -> NetworkMachineSpec:
    """A sound ``[network]`` machine; faults of its keys, its network and its effects at once."""
    from pydantic import ValidationError

    from spindle_fem.definition.effect_entries import EffectEntry
    from spindle_fem.definition.inherit import apply_overrides
    from spindle_fem.definition.load import find_machine, read_toml
    from spindle_fem.definition.network_faults import network_faults
    from spindle_fem.definition.network_load import validate_network_machine
    from spindle_fem.definition.network_tables import NetworkMachineSpec, NetworkSpec
    from spindle_fem.model.lumped.written_network import build_network

    path = find_machine(machine)
    content = read_toml(path)
    faults: list[SpindleFemError] = []
    for override in overrides:
        try:
            content = apply_overrides(content, [override], NetworkMachineSpec)
        except SpecError as error:
            faults.append(error)
    spec, network = None, None
    try:
        spec = validate_network_machine(content, path.name)
        network = spec.network
    except FaultsError as error:
        faults += error.faults
        with contextlib.suppress(ValidationError):
            network = NetworkSpec.model_validate(content["network"])
    known = {str(fault) for fault in faults}

    def add(found: Iterable[SpindleFemError]) -> None:
        located = [type(f)(f"{path.name}: {f.where}", f.what, f.how_to_fix) for f in found]
        faults.extend(fault for fault in located if str(fault) not in known)

    between = [] if network is None else network_faults(network)
    add(between)
    written = content.get("effect", ())
    entries: list[EffectEntry | None] = []
    for item in written if isinstance(written, (list, tuple)) else ():
        entries.append(None)
        with contextlib.suppress(ValidationError):
            entries[-1] = EffectEntry.model_validate(item)
    if entries:
        from spindle_fem.model.reduced.defined_effects import check_network_effects, require_known_effects

        try:
            if network is None or between:
                require_known_effects(entries)
            else:
                check_network_effects(entries, build_network(network))
        except FaultsError as error:
            add(error.faults)
    if faults or spec is None:
        raise FaultsError(path.name, faults)
    return spec


def resolved_text(machine: str | Path, overrides: Iterable[str]) -> str:
    """A definition of either kind with everything that was left to the program, as a folder keeps it."""
    from spindle_fem.definition.load import find_machine, read_definition, write_machine
    from spindle_fem.definition.network_load import (
        is_network_machine,
        load_network_machine,
        write_network_machine,
    )

    if is_network_machine(read_definition(find_machine(machine))):
        return write_network_machine(load_network_machine(machine, overrides))
    return write_machine(load_machine(machine, overrides))
