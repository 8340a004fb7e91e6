"""Columns of a view's payload, as the page's program unpacks them."""

from __future__ import annotations

import base64
import zlib
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray


def unpacked(payload: Mapping[str, Any]) -> dict[str, NDArray[Any]]:
    """Every column by name."""
    block = zlib.decompress(base64.b64decode(payload["block"]))
    found, first = {}, 0
    for name, kind, size in payload["columns"]:
        dtype = np.dtype("<" + kind)
        found[name] = np.frombuffer(block, dtype, size, first)
        first += size * dtype.itemsize
    assert first == len(block)
    return found
