"""A line in a drafted manifest that shows whether anybody has changed what was drafted."""

from __future__ import annotations

import hashlib
import re
from pathlib import Path

from spindle_fem.errors import BadInputError

_SEAL = re.compile(rb"# As drafted, by SHA-256: lines above ([0-9a-f]{64}), data ([0-9a-f]{64})\n")


def sealed(manifest: str, data: str) -> str:
    r"""Append a comment to a drafted manifest with the checksums of itself and of its data.

    >>> sealed("schema = 1\n", "time,SP01\n").splitlines()[1][:37]
    '# As drafted, by SHA-256: lines above'
    """
    own, beside = _sum(manifest.encode("utf-8")), _sum(data.encode("utf-8"))
    return f"{manifest}# As drafted, by SHA-256: lines above {own}, data {beside}\n"


def require_as_drafted(manifest: Path, data: Path) -> None:
    """Refuse to draft over what somebody has changed, or written without a draft.

    Raises
    ------
    BadInputError
        Either file is not byte for byte what was drafted. That there is no manifest is no fault.
    """
    if not manifest.is_file():
        return
    lines, separator, last = manifest.read_bytes().removesuffix(b"\n").rpartition(b"\n")
    seal = _SEAL.fullmatch(last + b"\n")
    changed = manifest if seal is None or _sum(lines + separator) != seal[1].decode() else None
    if (
        changed is None
        and seal is not None
        and data.is_file()
        and _sum(data.read_bytes()) != seal[2].decode()
    ):
        changed = data
    if changed is not None:
        raise BadInputError(
            str(changed),
            "was changed since it was drafted, or was not drafted at all: it is left as it is.",
            f"Give another folder with -o, or remove {changed.name} to have it drafted anew.",
        )


def _sum(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
