"""Requirements on a diagnosis, compared with the results of a study."""

from typing import Any

import numpy as np

# Requirements on a diagnosis: key of the summary, words, relation, bound; a share unless said otherwise.
ASKED = (
    ("false_alarms", "consistent recordings flagged as mismatch", "<=", 0.02),
    ("clear_single_first", "clear single effects named first", ">=", 0.95),
    ("clear_single_within_three", "clear single effects within the first three sets", ">=", 0.99),
    ("clear_pair_exact", "clear pairs named", ">=", 0.85),
    ("place_of_named", "place of a rightly named effect right", ">=", 0.95),
    ("interval_coverage", "stated 90 % intervals that hold the truth", "within", (0.85, 0.95)),
    ("heldout_after_over_noise.median", "held-out error after over noise, median", "<=", 1.05),
    ("heldout_after_over_noise.worst", "held-out error after over noise, worst", "<=", 1.5),
    ("ambiguous_called", "undecidable cases called ambiguous with the truth among the sets", ">=", 0.95),
    ("confident_wrong", "confident (above 0.9) and wrong", "<=", 0.01),
    ("wall_s.worst", "wall time of a case on one core of a shared machine, worst, s", "<=", 60.0),
)


def held_against_asked(summary: dict[str, Any]) -> list[dict[str, Any]]:
    """Every required figure: its value, the number of cases, and whether it is met.

    >>> one = held_against_asked({"false_alarms": {"share": 0.01, "of": 100}})[0]
    >>> one["value"], one["met"]
    (0.01, True)
    """
    rows = []
    for key, words, relation, bound in ASKED:
        name, _, part = key.partition(".")
        found = summary.get(name) or {}
        value = found.get(part or "share")
        met = None
        if value is not None:
            met = {
                "<=": lambda v, b: v <= b,
                ">=": lambda v, b: v >= b,
                "within": lambda v, b: b[0] <= v <= b[1],
            }[relation](value, bound)
        share = not part
        low, high = wilson(value, found["of"]) if share and value is not None else (None, None)
        rows.append(
            {
                "key": key,
                "words": words,
                "relation": relation,
                "bound": bound,
                "value": value,
                "of": found.get("of", 0),
                "low": low,
                "high": high,
                "share": share,
                "met": met,
            }
        )
    return rows


def wilson(share: float, number: int, z: float = 1.645) -> tuple[float, float]:
    """90 % interval of a share that was seen on a number of cases (Wilson 1927).

    >>> [round(x, 3) for x in wilson(1.0, 50)]
    [0.949, 1.0]
    """
    if number == 0:
        return 0.0, 1.0
    spread = z * np.sqrt(share * (1.0 - share) / number + z * z / (4.0 * number * number))
    middle, scale = share + z * z / (2.0 * number), 1.0 + z * z / number
    return max(0.0, float((middle - spread) / scale)), min(1.0, float((middle + spread) / scale))
