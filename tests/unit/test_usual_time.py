"""Time left of a diagnosis: told on a terminal, from stages that its search knows."""

from pathlib import Path

from rich.progress import Progress

import spindle_fem.inference
from spindle_fem.commands.usual_time import DIAGNOSIS_SHARES, TimeLeft, time_left


def test_time_left_counts_down_and_ends():
    assert time_left(20.0, 0.5, 25.0) == 15.0
    assert time_left(20.0, 0.5, 45.0) == 0.0
    assert time_left(0.0, 0.0, 3.0) is None
    now = [0.0]
    shown = Progress(get_time=lambda: now[0])
    shown.add_task("stage", begun=20.0, share=0.5)
    now[0] = 30.0
    assert TimeLeft().render(shown.tasks[0]).plain == "as a rule 10 s left"


def test_stages_with_a_usual_time_are_those_of_the_search():
    folder = Path(spindle_fem.inference.__file__).parent
    source = "".join(file.read_text(encoding="utf-8") for file in folder.glob("*.py"))
    for stage in DIAGNOSIS_SHARES:
        assert f'"{stage}"' in source or stage == "diagnosis: 3 effects"
    assert 'f"diagnosis: {size + 1} effects"' in source
