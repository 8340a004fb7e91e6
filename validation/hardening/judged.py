"""Outcome of a case: accepted, refused with a reason, or a fault of the program."""

from __future__ import annotations

import re
from dataclasses import asdict, dataclass, field
from typing import Any

from .child import MOST_MB, MOST_SECONDS, Ended

ACCEPTED, REFUSED, FAULT = "accepted", "refused", "fault"
# Reason of a refusal: the error's name with where, what and how to fix, or a usage error of the parser.
_REASON = re.compile(r"^(\w+Error: \S.*|.*\bError\b.*)$", re.MULTILINE)
REASON_LENGTH = 400
BAD_INPUT, OTHER_REFUSAL = 2, 1


@dataclass(slots=True)
class Record:
    """One case, a line of the results.

    Attributes
    ----------
    done : list of str
        What was done to the input.
    steps : list of dict
        Every process: command, status, seconds of processor, memory.
    outcome : str
        Of the input; a fault in whatever step is one of the case.
    ran, ran_outcome : str
        How an accepted input was then run, and how that ended.
    """

    family: str
    number: int
    done: list[str] = field(default_factory=list)
    steps: list[dict[str, Any]] = field(default_factory=list)
    outcome: str = ACCEPTED
    ran: str = ""
    ran_outcome: str = ""
    reason: str = ""

    def step(self, name: str, ended: Ended, refusals: tuple[int, ...] = (BAD_INPUT,)) -> str:
        """Note how a process ended; returns what that is. A fault stays whatever follows."""
        outcome, reason = judge(ended, refusals)
        self.steps.append(
            {
                "step": name,
                "status": ended.status,
                "seconds": round(ended.seconds, 2),
                "wall_seconds": round(ended.wall_seconds, 2),
                "peak_MB": round(ended.peak_MB),
                "outcome": outcome,
            }
        )
        if self.ran:
            self.ran_outcome = outcome
        if outcome == FAULT:
            self.fault(f"{name}: {reason}")
        elif self.outcome == ACCEPTED and outcome == REFUSED:
            self.reason = reason
            self.outcome = ACCEPTED if self.ran else REFUSED
        return outcome

    def fault(self, reason: str) -> None:
        """Note something that must not be."""
        if self.outcome != FAULT:
            self.outcome, self.reason = FAULT, reason

    def refused_rightly(self) -> None:
        """A refusal that was looked for."""
        if self.outcome == REFUSED:
            self.outcome, self.reason = ACCEPTED, ""

    def long_work(self) -> None:
        """Accept work longer than the limit of a case, if it was under way."""
        self.outcome, self.ran, self.ran_outcome, self.reason = ACCEPTED, "long", ACCEPTED, ""

    def as_dict(self) -> dict[str, Any]:
        """Content of the JSON line."""
        return asdict(self)


def judge(ended: Ended, refusals: tuple[int, ...]) -> tuple[str, str]:
    """Outcome and reason of a process that may end well or with one of the statuses of a refusal."""
    if ended.stopped:
        return FAULT, f"stopped: {ended.stopped}, {ended.seconds:.0f} s, {ended.peak_MB:.0f} MB"
    if "Traceback (most recent call last)" in ended.err + ended.out:
        return FAULT, f"traceback: {_last_line(ended.err)}"
    if ended.status < 0:
        return FAULT, f"ended by signal {-ended.status}"
    too_long = ended.seconds > MOST_SECONDS and not ended.patient
    if too_long or ended.peak_MB > MOST_MB:
        return FAULT, f"took {ended.seconds:.0f} s, {ended.peak_MB:.0f} MB"
    if ended.status == 0:
        return ACCEPTED, ""
    found = _REASON.search(ended.err)
    reason = found.group(1)[:REASON_LENGTH] if found else ""
    if ended.status not in refusals:
        return FAULT, f"exit {ended.status}: {reason or _last_line(ended.err)}"
    if not reason:
        return FAULT, f"exit {ended.status} without a reason: {_last_line(ended.err)}"
    return REFUSED, reason


def _last_line(text: str) -> str:
    lines = [line for line in text.splitlines() if line.strip()]
    return lines[-1][:REASON_LENGTH] if lines else ""
