"""``spindle_fem.load_machine``, and machines as functions take them: loaded, as a file, or by name."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from spindle_fem.definition import load
from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.definition.network_load import (
    is_network_machine,
    load_network_machine,
    write_network_machine,
)
from spindle_fem.definition.network_tables import NetworkMachineSpec

Machine = str | Path | MachineSpec | NetworkMachineSpec
Progress = Callable[[str], None]


def load_machine(machine: str | Path, overrides: Iterable[str] = ()) -> MachineSpec | NetworkMachineSpec:
    """Read a definition file, or one that ships by its name; with geometry or a ``[network]``.

    Parameters
    ----------
    overrides : iterable of str
        ``path=value`` texts applied before validation.

    Raises
    ------
    SpecError
        Anything wrong with the file, its base or the overrides.

    >>> round(load_machine("wu_tan_2016", ["channel.depth=19mm"]).channel.depth, 6)
    0.019
    """
    is_network = is_network_machine(load.read_definition(load.find_machine(machine)))
    return (load_network_machine if is_network else load.load_machine)(machine, overrides)


@contextmanager
def definition_file(machine: Machine) -> Iterator[str | Path]:
    """A machine as the commands take it: its name or file; one that was loaded is written for the while."""
    if isinstance(machine, (str, Path)):
        yield machine
        return
    write = write_network_machine if isinstance(machine, NetworkMachineSpec) else load.write_machine
    with tempfile.TemporaryDirectory(prefix="spindle-fem-") as folder:
        file = Path(folder) / "machine.toml"
        file.write_text(write(machine), encoding="utf-8")
        yield file
