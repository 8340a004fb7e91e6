"""What the README shows runs, and names what exists."""

import re
import subprocess
import sys
from pathlib import Path

README = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")


def test_the_python_lines_run():
    code = re.search(r"```python\n(.*?)```", README, re.DOTALL).group(1)
    assert len([line for line in code.splitlines() if line.strip()]) <= 7
    process = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert process.returncode == 0, process.stderr
    assert "'SP01': 23.3" in process.stdout


def test_every_command_that_it_names_exists(command):
    listed = command("--help").stdout
    for name in set(re.findall(r"`spindle-fem ([a-z]+)", README)):
        assert f" {name} " in listed


def test_every_file_that_it_links_to_is_there():
    root = Path(__file__).parents[2]
    for target in re.findall(r"\]\(([^)#]+)\)", README):
        assert (root / target).exists(), target
