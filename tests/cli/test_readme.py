"""What the README shows runs, and names what exists."""

import re
from pathlib import Path

README = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")


def test_the_python_lines_run(capsys):
    code = re.search(r"```python\n(.*?)```", README, re.DOTALL).group(1)
    assert len([line for line in code.splitlines() if line.strip()]) <= 7
    exec(compile(code, "README.md", "exec"), {})
    assert "'SP01': 23.3" in capsys.readouterr().out


def test_every_command_that_it_names_exists(command):
    listed = command("--help").stdout
    for name in set(re.findall(r"`spindle-fem ([a-z]+)", README)):
        assert f" {name} " in listed


def test_every_file_that_it_links_to_is_there():
    root = Path(__file__).parents[2]
    for target in re.findall(r"\]\(([^)#]+)\)", README):
        assert (root / target).exists(), target
