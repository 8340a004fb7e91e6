"""Names of the free numbers of a fit that are no parameters of the machine."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from types import MappingProxyType

# Factor of a candidate on a parameter of the machine: ``effect:<parameter>``. The machine's own factor on the
# same parameter is another coordinate, and both multiply.
EFFECT_PREFIX = "effect:"
# Displacement of a probe from its nominal place, m: ``probe.<probe>.<direction>``.
PROBE_PREFIX = "probe."
DIRECTIONS = ("r", "z")
# Temperature of a node at the start of one recording: ``start.<recording>.initial.<node>``.
START_PREFIX = "start."
# How much earlier than it is drawn, amid a gap or at the row that shows it, an input had changed, s:
# ``jump.<recording>.<number>``.
JUMP_PREFIX = "jump."
# Events within a piece of a gap beyond what the inputs beside it indicate,
# ``within_gap.<recording>.<number>``: friction of a bearing set, as a share of the highest that it gives; an
# input temperature that is another after the gap, as a share of its change.
GAP_PREFIX = "within_gap."
# How far the machine is from its definition in one direction, ``misdescribed.<direction>``; of one recording,
# ``misdescribed_in.<recording>.<direction>``.
MISDESCRIBED_PREFIX, MISDESCRIBED_IN_PREFIX = "misdescribed.", "misdescribed_in."
# Coordinates that say nothing about other recordings.
OF_ONE_RECORDING = (START_PREFIX, JUMP_PREFIX, GAP_PREFIX, MISDESCRIBED_IN_PREFIX)
# Those that a prediction follows to first order, outside the march of the model.
FIRST_ORDER = (PROBE_PREFIX, JUMP_PREFIX, GAP_PREFIX, MISDESCRIBED_PREFIX, MISDESCRIBED_IN_PREFIX)

NO_VALUES: Mapping[str, float] = MappingProxyType({})


@lru_cache(maxsize=65536)
def run_name(number: int, name: str) -> str | None:
    """Name of a coordinate in the run of one recording; None if it does not enter."""
    if name.startswith(FIRST_ORDER):
        return None
    if name.startswith(START_PREFIX):
        owner, _, own = name.removeprefix(START_PREFIX).partition(".")
        return own if int(owner) == number else None
    return name.removeprefix(EFFECT_PREFIX)
