"""Keys of a recording's manifest in docs/recordings.md, written from the models.

``python -m scripts.manifest_page`` renews them; the text around them stays.
"""

from __future__ import annotations

from pathlib import Path

from scripts.definition_page import key_sections
from spindle_fem.definition.schema import Shape
from spindle_fem.recordings.manifest import DRIVES_UNITS, ROLE_KEYS, Manifest

PAGE = Path(__file__).parents[1] / "docs" / "recordings.md"
BEGIN, END = "<!-- keys: python -m scripts.manifest_page -->\n", "<!-- end of keys -->"
ROLES = {
    "temperature": "read by a probe, to be explained",
    "displacement": "read by a displacement sensor, from its first reading",
    "input": "drives the model",
    "covariate": "drives nothing, may explain a mismatch",
}
DRIVES = {
    "speed": ("rotational speed, either direction", "`rpm`, `rad/s`; not `Hz`"),
    "thrust": ("axial force on the nose", "`N`, `kN`"),
    "ambient": ("temperature of the air about the machine", "`degC`, `K`, `degF`"),
    "coolant_inlet": ("temperature of the coolant at the inlet", "`degC`, `K`, `degF`"),
    "coolant_flow": ("volume flow of the coolant", "`l/min`, `m**3/hour`"),
}


def renewed(page: str) -> str:
    """The page with the keys as the models have them.

    Raises
    ------
    ValueError
        The page has no place for them.
    KeyError
        A role or a driven quantity is described nowhere.
    """
    before, begin, rest = page.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not end:
        raise ValueError(f"{PAGE.name} has no place for the keys")
    return before + begin + "\n".join(_lines()) + "\n" + end + after


def _lines() -> list[str]:
    lines = list(key_sections("", Shape("table", (Manifest,)), in_list=False))
    lines += ["### Keys by role", "", "| role | what it is | needed | allowed |", "|---|---|---|---|"]
    lines += [
        f"| `{role}` | {ROLES[role]} | {_listed(needed)} | {_listed(optional)} |"
        for role, (needed, optional) in ROLE_KEYS.items()
    ]
    lines += ["", "### What inputs drive", "", "| `drives` | what it is | unit |", "|---|---|---|"]
    lines += [f"| `{name}` | {DRIVES[name][0]} | {DRIVES[name][1]} |" for name in DRIVES_UNITS]
    lines += [
        "| `inlet.NAME` | temperature at the inlet of a stream (`[[film]]` of kind circuit or wetted, "
        "`BEARING.lubrication`) | `degC`, `K`, `degF` |",
        "| `heat.NAME` | heat of the `[[source]]` of that name | `W`, `kW` |",
        "| of a `[[source]]` | what its `input` names | any that its gain is made for |",
        "| of a `[network]` | the name that a boundary's `temperature` or a source's `input` gives | "
        "a temperature; any that gain and exponent are made for |",
    ]
    return lines


def _listed(keys: tuple[str, ...]) -> str:
    return ", ".join(f"`{key}`" for key in keys) or "none"


if __name__ == "__main__":
    PAGE.write_text(renewed(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
