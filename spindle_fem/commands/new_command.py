"""A machine to start from, written with a comment on everything that a user has to decide."""

from __future__ import annotations

import re
from importlib import resources
from pathlib import Path
from string import Template

from spindle_fem.errors import SpecError
from spindle_fem.results.output_folder import replace_text

TEMPLATE = "new_machine.toml"


def new_machine(file: Path) -> Path:
    """Write a commented machine that is called as its file is, valid as it stands.

    Raises
    ------
    SpecError
        The file is there already, or does not end in .toml.
    """
    if file.suffix != ".toml":
        raise SpecError(str(file), "is no definition's name.", "Allowed: a name that ends in .toml.")
    if file.exists():
        raise SpecError(str(file), "is there already.", "Give another name, or remove it.")
    text = resources.files("spindle_fem.commands").joinpath("templates", TEMPLATE).read_text("utf-8")
    name = re.sub(r"\W+", "_", file.stem, flags=re.ASCII).strip("_") or "machine"
    replace_text(file, Template(text).substitute(name=name, file=file.name))
    return file
