"""The folder of a plan while it is worked out."""

from __future__ import annotations

import pytest

from spindle_fem.commands import plan_command
from spindle_fem.errors import SpecError


def test_a_plan_shows_its_folder_while_it_works(tmp_path, monkeypatch) -> None:
    folder = tmp_path / "out"

    def work(*arguments, **more):
        assert {"INCOMPLETE", "log.txt"} <= {path.name for path in folder.iterdir()}
        raise SpecError("test", "ends here.")

    monkeypatch.setattr(plan_command, "_planned", work)
    with pytest.raises(SpecError, match="ends here"):
        plan_command.plan("bench_motor", folder)
    assert (folder / "INCOMPLETE").exists()
