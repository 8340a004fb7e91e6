"""One study at a time in a folder."""

import subprocess
import sys

import pytest

from spindle_fem.errors import BadInputError
from spindle_fem.studies.sweep.study_lock import folder_lock, lock_path

HOLD = """
import sys
from spindle_fem.studies.sweep.study_lock import folder_lock
with folder_lock(sys.argv[1]):
    print("held", flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def holder(tmp_path):
    """Another process that holds the lock until its input ends or it is killed."""
    process = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(tmp_path / "out")],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout.readline().strip() == "held"
    yield process
    process.kill()
    process.wait()
    process.stdin.close()
    process.stdout.close()


def test_a_second_study_is_refused_and_told_who_holds_the_folder(tmp_path, holder):
    with (
        pytest.raises(BadInputError, match=rf"is in use: process {holder.pid} on .* runs a study"),
        folder_lock(tmp_path / "out"),
    ):
        pass
    assert lock_path(tmp_path / "out").exists()  # still the other one's


def test_other_folders_are_free(tmp_path, holder):
    with folder_lock(tmp_path / "elsewhere"):
        pass


def test_a_killed_process_holds_nothing(tmp_path, holder):
    holder.kill()
    holder.wait()
    with folder_lock(tmp_path / "out"):
        pass


def test_nothing_is_left_behind(tmp_path):
    with folder_lock(tmp_path / "deep" / "out"):
        assert lock_path(tmp_path / "deep" / "out").read_text().startswith("process ")
    assert list((tmp_path / "deep").iterdir()) == []
