"""The reference has every public name, texts lead to one another; needs the extra ``docs``."""

import json
import re
from pathlib import Path

import pytest

import spindle_fem

pytest.importorskip("pdoc")
pytest.importorskip("nbconvert")

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.mark.slow
def test_the_site_has_every_name_and_no_dead_link(tmp_path):
    from scripts.documentation_site import write_site

    write_site(tmp_path, gallery=False)
    reference = (tmp_path / "reference" / "spindle_fem.html").read_text(encoding="utf-8")
    assert not [name for name in spindle_fem.__all__ if f'id="{name}"' not in reference]
    for page in tmp_path.glob("*.html"):
        for target in re.findall(r'href="([\w/]+\.html)', page.read_text(encoding="utf-8")):
            if target.startswith("gallery/"):  # what examples answer takes minutes
                assert list(EXAMPLES.glob(f"{Path(target).stem}.*")), f"{page.name}: {target}"
            else:
                assert (tmp_path / target).is_file(), f"{page.name}: {target}"


@pytest.mark.slow
def test_the_gallery_has_what_examples_answer(tmp_path, monkeypatch):
    from scripts import documentation_site as site

    cell = {
        "cell_type": "code",
        "source": ["print(6 * 7)"],
        "metadata": {},
        "outputs": [],
        "execution_count": None,
    }
    title = {"cell_type": "markdown", "source": ["# Product"], "metadata": {}}
    notebook = {"cells": [title, cell], "metadata": {}, "nbformat": 4, "nbformat_minor": 4}
    examples = tmp_path / "mine"
    examples.mkdir()
    (examples / "product.ipynb").write_text(json.dumps(notebook), encoding="utf-8")
    (examples / "sum.py").write_text('"""Sum."""\n\nprint(40 + 2)\n', encoding="utf-8")
    monkeypatch.setattr(site, "EXAMPLES", examples)
    monkeypatch.chdir(tmp_path)
    site.write_site(Path("site"))  # a relative folder, as `make docs` gives
    for name in ("product", "sum"):
        assert "42" in (tmp_path / "site" / "gallery" / f"{name}.html").read_text(encoding="utf-8")
