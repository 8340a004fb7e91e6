"""Tuned constants of the diagnosis stand in one file, and every one of them is used."""

import re
from pathlib import Path

from spindle_fem.inference import tuned

FOLDER = Path(tuned.__file__).parent


def test_every_tuned_constant_is_used_and_every_use_is_known():
    known = {name for name in vars(tuned) if name.isupper()}
    used = set()
    for path in FOLDER.glob("*.py"):
        used |= set(re.findall(r"\btuned\.([A-Z][A-Z_]+)", path.read_text(encoding="utf-8")))
    assert used == known


def test_every_tuned_constant_says_what_it_is():
    text = Path(tuned.__file__).read_text(encoding="utf-8").splitlines()
    for number, line in enumerate(text):
        if re.match(r"[A-Z_, ]+ = ", line):
            before = text[number - 1]
            assert before.startswith("# ") or re.match(r"[A-Z_, ]+ = ", before), line
