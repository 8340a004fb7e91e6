"""The reference has every public name, texts lead to one another; needs the extra ``docs``."""

import re

import pytest

import spindle_fem

pytest.importorskip("pdoc")


@pytest.mark.slow
def test_the_site_has_every_name_and_no_dead_link(tmp_path):
    from scripts.documentation_site import write_site

    write_site(tmp_path, gallery=False)
    reference = (tmp_path / "reference" / "spindle_fem.html").read_text(encoding="utf-8")
    assert not [name for name in spindle_fem.__all__ if f'id="{name}"' not in reference]
    for page in tmp_path.glob("*.html"):
        for target in re.findall(r'href="([\w/]+\.html)', page.read_text(encoding="utf-8")):
            assert (tmp_path / target).is_file(), f"{page.name}: {target}"
