"""Every command and every block of Python in the README and in ``docs/`` runs, page by page, in its order."""

import contextlib
import importlib.util
import re
import subprocess
import sys
import tomllib

import pytest
import typer

from spindle_fem.cli import app
from tests.support.command_line import run_here
from tests.support.documented_commands import PAGES, ROOT, Reader, blocks_of, documented
from tests.support.stepped_model import needs_compiler

COMMANDS = typer.main.get_command(app).commands
OF_THIS_PROGRAM = {page: [c for c in documented(page) if c.words[0] == "spindle-fem"] for page in PAGES}
SHORT = [page for page in PAGES if any(not c.is_mention for c in OF_THIS_PROGRAM[page])]
# Their blocks have tests of their own, which look at the answers.
OWN_PYTHON_TESTS = {"README.md", "python.md"}
# Recipes for Slurm and Kubernetes.
NEEDS_A_CLUSTER = {"scale.md"}
WITHOUT_TEST_HERE = OWN_PYTHON_TESTS | NEEDS_A_CLUSTER
WITH_PYTHON = [page for page in PAGES if blocks_of(page, "python") and page.name not in WITHOUT_TEST_HERE]


def named(page):
    return page.name


def group_of(words):
    """Command of some words; of ``diagnose --plan`` the one that it stands for."""
    return COMMANDS["plan" if "--plan" in words else words[1]]


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """Where a reader of any page begins: machines, recordings, and a folder of an earlier command."""
    folder = tmp_path_factory.mktemp("reader")
    reader = Reader(folder)
    done = run_here("simulate", "pump.toml", "recording_of_pump", "-o", "finished", cwd=folder)
    assert done.returncode == 0, done.stderr
    return reader


@pytest.fixture
def reader(finished, tmp_path, monkeypatch):
    monkeypatch.setattr(typer, "launch", lambda address: None)  # no browser
    return finished.in_a_copy(tmp_path / "here")


def run_page(page, reader, *, long, known=()):
    ran = []
    for command in OF_THIS_PROGRAM[page]:
        if command.is_mention or command.words[1] == "COMMAND" or (reader.is_long(command) and not long):
            continue
        if said(command) in known:
            continue
        given = reader.arguments(command)
        if command.words[1].startswith("--"):
            continue  # has a test of its own
        run = in_a_process if reader.is_long(command) else run_here
        with scheduler_of(given) as typed:
            done = run(*typed, cwd=reader.folder)
        assert done.returncode == 0, f"{page.name}:{command.line}: {given}\n{done.stdout}\n{done.stderr}"
        ran.append(command)
    return ran


@contextlib.contextmanager
def scheduler_of(given):
    """What is typed, with the address of a Dask scheduler that has one worker where a page leaves it open."""
    if "ADDRESS" not in given:
        yield given
        return
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster:
        yield [cluster.scheduler_address if item == "ADDRESS" else item for item in given]


def said(command):
    """What a command asks for, whichever page says it and in how many processes."""
    return re.sub(r"\.\.\.| --jobs \d+", "", " ".join(command.words))


def in_a_process(*arguments, cwd):
    called = [sys.executable, "-m", "spindle_fem", *arguments]
    return subprocess.run(called, cwd=cwd, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def known():
    """Diagnoses, plans and watches, which take seconds, of the pages before."""
    return set()


@pytest.mark.parametrize("page", SHORT, ids=named)
def test_the_short_commands_of_a_page_run(page, reader, known):
    ran = run_page(page, reader, long=False, known=known)
    known |= {said(command) for command in ran if command.words[1] in ("diagnose", "watch")}


@pytest.mark.slow
@pytest.mark.parametrize("page", SHORT, ids=named)
def test_all_commands_of_a_page_run(page, reader):
    asked = [c for c in OF_THIS_PROGRAM[page] if not c.is_mention and not c.words[1].startswith(("-", "COM"))]
    assert run_page(page, reader, long=True) == asked


@pytest.mark.parametrize("page", PAGES, ids=named)
def test_commands_and_flags_that_a_page_names_exist(page):
    for command in OF_THIS_PROGRAM[page]:
        words = command.words
        if len(words) > 1 and not words[1].startswith("-") and words[1] != "COMMAND":
            known = {flag for item in group_of(words).params for flag in item.opts}
            assert set(command.optional) <= known, f"{page.name}:{command.line}"


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_help(name):
    done = run_here(name, "--help")
    assert done.returncode == 0
    assert COMMANDS[name].help.split("\n")[0].replace("\\", "").rstrip(".") in done.stdout


def test_completion_is_shown_and_installed(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION", "1")
    for flag in ("--show-completion", "--install-completion"):
        done = in_a_process(flag, "bash", cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        assert "completion" in done.stdout.lower()
    assert list(tmp_path.rglob("*spindle*fem*"))


def test_goals_modules_and_extras_that_pages_name_exist():
    goals = set(re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.M))
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    for page in PAGES:
        for words in (command.words for command in documented(page)):
            if words[0] == "make":
                asked = {word for word in words[1:] if "=" not in word}
                assert asked <= goals, f"{page.name}: {words}"
            elif words[:2] == ("python", "-m"):
                assert importlib.util.find_spec(words[2]), f"{page.name}: {words}"
            elif words[0] == "python":
                assert (ROOT / words[1]).is_file(), f"{page.name}: {words}"
            elif words[0] == "pip":
                asked = re.findall(r"\[(\w+)\]", words[2])
                assert set(asked) <= set(extras["optional-dependencies"]), f"{page.name}: {words}"


@pytest.mark.parametrize("page", [page for page in WITH_PYTHON if page.name != "transients.md"], ids=named)
def test_the_python_of_a_page_runs(page, reader):
    run_python(page, reader)


@pytest.mark.slow
def test_the_python_of_transients_runs(reader):
    run_python(ROOT / "docs" / "transients.md", reader)
    assert (reader.folder / "probes.png").is_file()


def run_python(page, reader):
    if page.name == "export.md":
        assert run_here("export", "pump.toml", "-o", "model.py", cwd=reader.folder).returncode == 0
    namespace = {}
    sys.path.insert(0, str(reader.folder))
    try:
        with contextlib.chdir(reader.folder):
            for block in blocks_of(page, "python"):
                exec(compile(block, page.name, "exec"), namespace)
    finally:
        sys.path.remove(str(reader.folder))
        sys.modules.pop("model", None)


@needs_compiler
def test_the_c_of_the_exports_page_runs(reader):
    (block,) = blocks_of(ROOT / "docs" / "export.md", "c")
    include, _, body = block.partition("\n")
    show = '#include <stdio.h>\nint main(void) {%s\nprintf("%%g", outputs[0]); return (int)outside; }'
    (reader.folder / "main.c").write_text(f"{include}\n{show % body}\n", encoding="utf-8")
    assert run_here("export", "pump.toml", "-o", "model.c", cwd=reader.folder).returncode == 0
    compiled = ["cc", "-std=c99", "main.c", "model.c", "-lm", "-o", "main"]
    subprocess.run(compiled, cwd=reader.folder, check=True)
    done = subprocess.run([reader.folder / "main"], capture_output=True, text=True, check=True)
    assert float(done.stdout) > 22.0
