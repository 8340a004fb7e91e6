"""Every exception that spindle_fem raises on purpose.

Each carries three texts: ``where`` (file, key or object), ``what`` (the fault
and the offending value) and ``how_to_fix`` (what is allowed).
"""

from __future__ import annotations

import difflib
import errno
from collections.abc import Iterable, Sequence


class SpindleFemError(Exception):
    """Base of all errors; the command line maps it to exit status 1.

    Parameters
    ----------
    where : str
        File and key, or the object that is at fault.
    what : str
        The fault, with the offending value.
    how_to_fix : str
        What is allowed, or what to do about it.
    """

    exit_status = 1

    def __init__(self, where: str, what: str, how_to_fix: str = "") -> None:
        self.where = where
        self.what = what
        self.how_to_fix = how_to_fix
        super().__init__(where, what, how_to_fix)

    def __str__(self) -> str:
        text = f"{self.where}: {self.what}" if self.where else self.what
        return f"{text} {self.how_to_fix}".rstrip()

    def as_plain(self) -> dict[str, str]:
        """Plain values for JSON."""
        return {"where": self.where, "what": self.what, "how_to_fix": self.how_to_fix}


class BadInputError(SpindleFemError):
    """The user's input cannot be used; exit status 2."""

    exit_status = 2


class SpecError(BadInputError):
    """A machine, study or bearing definition is wrong."""


class UnknownKeyError(SpecError):
    """A key that the schema does not have."""


class UnitError(SpecError):
    """A bare number, an unknown unit or the wrong dimension."""


class FaultsError(SpecError):
    """Several faults of one file at once.

    Parameters
    ----------
    where : str
        The file.
    faults : sequence of SpindleFemError
        Every fault that was found, in file order.
    """

    def __init__(self, where: str, faults: Iterable[SpindleFemError]) -> None:
        self.faults = tuple(faults)
        listing = "\n".join(f"  - {fault}" for fault in self.faults)
        number = len(self.faults)
        super().__init__(where, f"{number} fault{'s' if number != 1 else ''}\n{listing}")


def raise_all(where: str, faults: Sequence[SpindleFemError]) -> None:
    """Raise faults that were found, a single one as it is; nothing where there is none."""
    if len(faults) == 1:
        raise faults[0]
    if faults:
        raise FaultsError(where, faults)


class GeometryError(BadInputError):
    """Parts overlap or float, a channel breaks through, a design is impossible."""


class MeshTagError(SpindleFemError):
    """A facet without a name, with two names, or a name without facets."""


class UnknownSurfaceError(BadInputError):
    """A surface, part, joint or probe name that does not exist."""


class MeshQualityError(SpindleFemError):
    """Inverted elements, a mesh that does not conform, areas away from CAD."""


class OutOfValidityError(SpindleFemError):
    """A correlation was evaluated outside the range of its source."""


class NoEquilibriumError(SpindleFemError):
    """A bearing has no quasi-static equilibrium at the requested state."""


class NoSteadyStateError(SpindleFemError):
    """Heat and temperature run away: no thermal equilibrium exists."""


class ConvergenceError(SpindleFemError):
    """An iteration ended without reaching its tolerance."""


class WorkerDiedError(SpindleFemError):
    """A worker process ended before its time."""


class EnergyBalanceError(SpindleFemError):
    """Heat in and heat out differ by more than the tolerance."""


class CheckFailedError(SpindleFemError):
    """A solved machine did not pass one of its self-checks."""


class RecordingError(BadInputError):
    """A recording or its manifest cannot be used."""


class MissingColumnError(RecordingError):
    """A data file does not have a column that its manifest names."""


class PathError(BadInputError):
    """A path that was given cannot be read or written."""


class NoSpaceError(SpindleFemError):
    """A disk is full."""


_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


def of_system(error: OSError) -> SpindleFemError | OSError:
    """Convert an error of the operating system to one with where and how to fix; others stay unchanged.

    >>> str(of_system(OSError(errno.EROFS, "Read-only file system", "out/new.toml")))
    'out/new.toml: cannot be used (Read-only file system). Give another path.'
    """
    where = str(error.filename or "")
    if error.errno in _FULL:
        return NoSpaceError(
            where, f"there is no space left ({error.strerror}).", "Make room and run the command again."
        )
    if error.errno is not None and where:
        return PathError(where, f"cannot be used ({error.strerror}).", "Give another path.")
    return error


def did_you_mean(name: str, allowed: Iterable[str]) -> str:
    """Sentence that offers the closest allowed name and lists all of them.

    >>> did_you_mean("housing.chanel_wall", ["housing.channel_wall"])
    'Did you mean "housing.channel_wall"? Allowed: housing.channel_wall.'
    """
    choices = list(allowed)
    close = difflib.get_close_matches(name, choices, n=1, cutoff=0.6)
    offer = f'Did you mean "{close[0]}"? ' if close else ""
    listing = ", ".join(choices) if choices else "nothing"
    return f"{offer}Allowed: {listing}."
