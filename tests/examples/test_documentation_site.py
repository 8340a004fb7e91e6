"""The reference has every public name, texts lead to one another; needs the extra ``docs``."""

import re
from pathlib import Path

import pytest

import spindle_fem

pytest.importorskip("pdoc")

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
