"""Chapters, their data folders, the claims of the README, causes of wrong cases."""

import json
import re

import pytest

from book import build as building
from book import causes
from book.chapters import ENTRIES, bench_motor, concealed, turning_centre
from book.page import Chapter, Entry, Pictures, render_chapter
from book.work import Desk
from spindle_fem.errors import BadInputError
from spindle_fem.report.block_page import Section, Text
from validation.causes import read_note


@pytest.fixture
def desk(tmp_path):
    return Desk(
        tmp_path / "work",
        tmp_path / "study",
        tmp_path / "study" / "results",
        tmp_path / "recordings",
        tell=lambda text: None,
    )


def test_a_step_is_made_once(desk):
    made = []
    for _ in range(2):
        step = desk.step("data", lambda folder: made.append(folder), sources=("generator",))
    assert made == [desk.work / "data"]
    assert not step.outdated


def test_a_step_with_other_inputs_is_made_again(desk):
    made = []
    for seed in (1, 2):
        desk.step(
            "data", lambda folder, s=seed: made.append(s), sources=("generator",), inputs={"seed": seed}
        )
    assert made == [1, 2]


def test_an_interrupted_step_gets_its_folder_again(desk):
    def interrupted(folder):
        (folder / "half.txt").write_text("half", encoding="utf-8")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        desk.step("data", interrupted, sources=("generator",))
    found = []
    desk.step("data", lambda folder: found.append((folder / "half.txt").read_text()), sources=("generator",))
    assert found == ["half"]


def test_data_of_an_earlier_source_are_made_again_or_kept_and_named(desk):
    made = []
    desk.step("data", made.append, sources=("generator",))
    stamp = desk.work / "data" / "step.json"
    content = json.loads(stamp.read_text())
    content["sources"]["generator"] = "an earlier one"
    stamp.write_text(json.dumps(content))
    desk.keep = True
    assert desk.step("data", made.append, sources=("generator",)).outdated
    assert desk.outdated == ["data"]
    assert len(made) == 1
    desk.keep = False
    desk.step("data", made.append, sources=("generator",))
    assert len(made) == 2


def test_every_claim_has_chapters_and_a_chapter_that_is_none_is_refused(tmp_path, monkeypatch):
    claims = building.read_claims(ENTRIES)
    assert len(claims) >= 8
    assert all(claim["entries"] for claim in claims)
    path = tmp_path / "claims.toml"
    path.write_text('[[claim]]\ntext = "x"\nchapters = ["exakt"]\n', encoding="utf-8")
    monkeypatch.setattr(building, "CLAIMS", path)
    with pytest.raises(BadInputError, match="names chapter 'exakt', which is not in the book"):
        building.read_claims(ENTRIES)


def test_only_a_chapter_that_exists(desk, tmp_path):
    with pytest.raises(BadInputError, match="nonsense is no chapter"):
        building.build(tmp_path / "book", desk, ["nonsense"])


def test_book_is_written_with_links_between_its_pages(desk, tmp_path, monkeypatch):
    def chapter(words):
        blocks = [Text("Said & done.")]
        return lambda desk, pictures: Chapter(words, [Section("a", "A", blocks)], commands=["make x"])

    entries = (Entry("one", "First", chapter("one came out")), Entry("two", "Second", chapter("<two>")))
    monkeypatch.setattr(building, "ENTRIES", entries)
    path = tmp_path / "claims.toml"
    path.write_text('[[claim]]\ntext = "It works."\nchapters = ["two"]\n', encoding="utf-8")
    monkeypatch.setattr(building, "CLAIMS", path)
    output = tmp_path / "book"
    building.build(output, desk)
    index = (output / "index.html").read_text(encoding="utf-8")
    assert "one came out" in index
    assert "&lt;two&gt;" in index
    assert "It works." in index
    for page in output.glob("*.html"):
        text = page.read_text(encoding="utf-8")
        for target in re.findall(r'href="([a-z_]+\.html)"', text):
            assert (output / target).is_file(), (page, target)
    second = (output / "two.html").read_text(encoding="utf-8")
    assert 'href="one.html"' in second
    assert "make x" in second
    assert "Said &amp; done." in second


@pytest.mark.parametrize("module", [bench_motor, turning_centre])
def test_chapter_without_its_recordings_is_left_out_by_name(module, desk, tmp_path):
    chapter = module.make(desk, Pictures(tmp_path, "x"))
    assert chapter.outcome.startswith("Left out: the recording")
    assert module.FOLDER in chapter.outcome
    assert not chapter.sections
    entry = Entry("x", module.TITLE, module.make)
    assert "not part of the repository" in render_chapter(entry, chapter, (entry,))


def test_concealed_chapter_without_a_study_says_how_to_make_it(desk, tmp_path):
    chapter = concealed.make(desk, Pictures(tmp_path, "x"))
    assert "make study" in chapter.outcome


def test_causes_of_one_seed(tmp_path):
    path = tmp_path / "causes.toml"
    entry = '[[case]]\nseed = {seed}\ncase = "case_0001"\nkind = "twin"\ncause = "because {seed}"\n'
    path.write_text(entry.format(seed=7) + entry.format(seed=8), encoding="utf-8")
    assert causes.read_causes(path, 7)["case_0001"]["cause"] == "because 7"
    path.write_text(entry.format(seed=7) * 2, encoding="utf-8")
    with pytest.raises(BadInputError, match="case_0001 of seed 7: stands there twice"):
        causes.read_causes(path, 7)
    path.write_text('[[case]]\nseed = 7\ncase = "case_0002"\n', encoding="utf-8")
    with pytest.raises(BadInputError, match="case_0002 of seed 7: is incomplete"):
        causes.read_causes(path, 7)


def test_the_note_of_one_study(tmp_path):
    path = tmp_path / "causes.toml"
    entry = '[[study]]\ngenerator = "rough"\nseed = {seed}\nnote = "seen before {seed}"\n'
    path.write_text(entry.format(seed=7) + entry.format(seed=8), encoding="utf-8")
    assert read_note(path, 8, "rough") == "seen before 8"
    assert read_note(path, 8, "networks") == read_note(path, 9, "rough") == ""


def test_the_causes_that_ship_can_be_read():
    assert isinstance(causes.read_causes(causes.CAUSES, 7), dict)
