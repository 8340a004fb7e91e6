"""Time that a command still takes, as a rule: from how long its stages usually last."""

from __future__ import annotations

from rich.progress import ProgressColumn, Task
from rich.text import Text

# Share of a diagnosis that has usually passed when a stage begins: medians over 40 spindles and networks, of
# which those with one effect end earlier and those with three take twice as long.
DIAGNOSIS_SHARES = {
    "diagnosis: screening": 0.14,
    "diagnosis: changes and states that switch": 0.18,
    "diagnosis: 2 effects": 0.35,
    "diagnosis: 3 effects": 0.51,
    "diagnosis: final fits": 0.64,
    "diagnosis: where and when": 0.86,
}


def time_left(begun: float, share: float, now: float) -> float | None:
    """Usual remaining time of a command, s; None if unknown.

    Parameters
    ----------
    begun : float, [s]
        Since the start, when the stage began that runs now.
    share : float
        Of all its time that has usually passed by then; 0 where unknown.
    now : float, [s]
        Since the start.

    >>> time_left(20.0, 0.5, 25.0)
    15.0
    """
    return max(begun / share - now, 0.0) if share else None


class TimeLeft(ProgressColumn):
    """Time left of a task with ``begun`` and ``share``, as :func:`time_left` takes them."""

    def render(self, task: Task) -> Text:
        """Empty if the remaining time is unknown, and once it takes longer than usual."""
        left = time_left(task.fields["begun"], task.fields["share"], task.elapsed or 0.0)
        return Text(f"as a rule {left:.0f} s left" if left else "")
