"""The documentation as pages: texts of ``docs/``, reference from docstrings, gallery of ``examples/``.

``python -m scripts.documentation_site FOLDER [--without-gallery]``; needs the extra ``docs``. Notebooks and
scripts of the gallery are run for it.
"""

from __future__ import annotations

import argparse
import ast
import html
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import markdown2
import pdoc

import spindle_fem

ROOT = Path(__file__).resolve().parents[1]
EXAMPLES = ROOT / "examples"
# The functions of the package, their results, and what own models are made of.
MODULES = (
    "spindle_fem",
    "spindle_fem.library",
    "spindle_fem.results.thermal_result",
    "spindle_fem.recordings.align",
    "spindle_fem.studies.simulate",
    "spindle_fem.studies.transient_study",
    "spindle_fem.operation.operating_point",
    "spindle_fem.physics.bearings.heat_model",
    "spindle_fem.physics.bearings.bearing_state",
    "spindle_fem.physics.coolant.properties",
    "spindle_fem.physics.coolant.user_coolant",
    "spindle_fem.physics.coolant.film_correlation",
    "spindle_fem.effects.framework",
    "spindle_fem.effects.registry",
    "spindle_fem.registry",
    "spindle_fem.errors",
)
STYLE = """
body { font: 16px/1.5 sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; color: #1d2733 }
pre, code { background: #f3f5f7; font-size: 14px }
pre { padding: .7rem; overflow-x: auto }
table { border-collapse: collapse }
td, th { border-bottom: 1px solid #dfe4e9; padding: .2rem .6rem; text-align: left }
img { max-width: 100% }
"""


def write_page(path: Path, title: str, body: str) -> None:
    """Write a page."""
    head = f'<meta charset="utf-8"><title>{html.escape(title)}</title><style>{STYLE}</style>'
    page = f'<!doctype html><html lang="en"><head>{head}</head><body>{body}</body></html>'
    path.write_text(page, encoding="utf-8")


def write_reference(folder: Path) -> None:
    """The reference, from docstrings."""
    for name in spindle_fem.__all__:  # names that load on first use are found only then
        vars(spindle_fem)[name] = getattr(spindle_fem, name)
    pdoc.render.configure(docformat="numpy", footer_text=f"spindle-fem {spindle_fem.__version__}")
    package, *others = MODULES
    # "!" leaves out what is beneath the package and is not named.
    pdoc.pdoc(package, rf"!{package}\..*", *others, output_directory=folder)


def write_texts(folder: Path) -> list[tuple[str, str]]:
    """Pages of ``docs/``; address and title of each."""
    found = []
    for source in sorted((ROOT / "docs").glob("*.md")):
        text = source.read_text(encoding="utf-8")
        body = markdown2.markdown(text, extras=["tables", "fenced-code-blocks", "header-ids"])
        title = text.partition("\n")[0].lstrip("# ")
        body = re.sub(r'href="(\w+)\.md', r'href="\1.html', body)
        body = re.sub(r'href="\.\./examples/(\w+)\.(?:py|ipynb)', r'href="gallery/\1.html', body)
        write_page(folder / f"{source.stem}.html", title, body)
        found.append((f"{source.stem}.html", title))
    return found


def write_gallery(folder: Path) -> list[tuple[str, str]]:
    """Notebooks and scripts with their results; address and title of each."""
    folder.mkdir()
    work = folder / "work"
    shutil.copytree(EXAMPLES, work)
    found = []
    for notebook in sorted(work.glob("*.ipynb")):
        options = ["--to", "html", "--execute", "--output-dir", folder]
        convert = [sys.executable, "-m", "nbconvert", *options, notebook]
        subprocess.run(convert, check=True, cwd=work)
        cell = json.loads(notebook.read_text(encoding="utf-8"))["cells"][0]
        found.append((f"{folder.name}/{notebook.stem}.html", cell["source"][0].strip("# \n")))
    for script in sorted(work.glob("*.py")):
        run = [sys.executable, script, work / "answers" / script.stem]
        printed = subprocess.run(run, check=True, cwd=work, capture_output=True, text=True).stdout
        code = script.read_text(encoding="utf-8")
        title = (ast.get_docstring(ast.parse(code)) or script.stem).partition("\n")[0]
        body = f"<h1>{html.escape(title)}</h1><pre>{html.escape(code)}</pre><pre>{html.escape(printed)}</pre>"
        page = folder / f"{script.stem}.html"
        write_page(page, title, body)
        found.append((f"{folder.name}/{page.name}", title))
    shutil.rmtree(work)
    return found


def write_site(folder: Path, *, gallery: bool = True) -> None:
    """Write everything to a folder, in place of what is there."""
    folder = folder.resolve()  # examples run in a folder of their own
    for name in ("reference", "gallery"):
        shutil.rmtree(folder / name, ignore_errors=True)
    folder.mkdir(parents=True, exist_ok=True)
    write_reference(folder / "reference")
    parts = {
        "Texts": write_texts(folder),
        "Reference": [("reference/spindle_fem.html", "Functions and classes")],
    }
    if gallery:
        parts["Gallery"] = write_gallery(folder / "gallery")
    body = f"<h1>spindle-fem {spindle_fem.__version__}</h1>" + "".join(
        f"<h2>{part}</h2><ul>"
        + "".join(f'<li><a href="{address}">{html.escape(title)}</a></li>' for address, title in pages)
        + "</ul>"
        for part, pages in parts.items()
    )
    write_page(folder / "index.html", "spindle-fem", body)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--without-gallery", action="store_true", help="run no examples")
    asked = parser.parse_args()
    write_site(asked.folder, gallery=not asked.without_gallery)
    print(f"wrote {asked.folder / 'index.html'}")
