"""Results of the cases as a table and as the page of the documentation."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import jinja2

from .child import MOST_MB, MOST_SECONDS
from .judged import ACCEPTED, FAULT, REFUSED

SCHEMA = "spindle-fem/hardening/1"
WHAT = {
    "definitions": "definitions of machines: `check`, then solved",
    "recordings": "recordings and manifests: `simulate`, `recording`, `diagnose`, `watch`",
    "studies": "studies and bearing files: `sweep`, `transient`, `bearing`",
    "circuits": "definitions with ducts, streams, oil, unlike bearings, cages, seals: the same",
    "bearings": "bearing files with deep grooves, cages, seals, fits, types of the catalogue",
    "folders": "result folders and caches: `report`, `view`, `sweep` again, `--restart`, meshes and models",
    "texts": "markup, templates, shell, paths as names: `simulate`, `view`, `export`, `run`",
    "kills": "kills (signal 9) at a random moment, then the same command again",
    "surroundings": "full disk, nothing writable, no home, no network, two users, eight commands at once",
}


def summarise(cases: Iterable[Mapping[str, Any]], planned: Mapping[str, int], seed: int) -> dict[str, Any]:
    """Counts by family, the longest and the largest case, and every fault."""
    cases = list(cases)
    families = {}
    for family, number in planned.items():
        own = [case for case in cases if case["family"] == family]
        # the steps of kills and of full disks have no limits: whole runs stand beside their parts
        steps = [step for case in own for step in case["steps"]]
        counts = Counter(case["outcome"] for case in own)
        families[family] = {
            "planned": number,
            "done": len(own),
            **{outcome: counts[outcome] for outcome in (ACCEPTED, REFUSED, FAULT)},
            "ran": dict(Counter(f"{case['ran']}, {case['ran_outcome']}" for case in own if case["ran"])),
            "kinds": dict(Counter(case["done"][0] for case in own)) if family == "kills" else {},
            "most_seconds": max((step["seconds"] for step in steps), default=0.0),
            "most_MB": max((step["peak_MB"] for step in steps), default=0),
        }
    faults = [
        {key: case[key] for key in ("family", "number", "done", "reason")}
        for case in cases
        if case["outcome"] == FAULT
    ]
    return {"schema": SCHEMA, "seed": seed, "families": families, "faults": faults}


def page(found: Mapping[str, Any]) -> str:
    """Markdown of a summary."""
    template = jinja2.Template(
        Path(__file__).with_name("page.md.j2").read_text(encoding="utf-8"),
        undefined=jinja2.StrictUndefined,
        keep_trailing_newline=True,
    )
    limits = {"most_seconds": f"{MOST_SECONDS:.0f}", "most_MB": f"{MOST_MB:.0f}"}
    unfinished = any(item["done"] < item["planned"] for item in found["families"].values())
    return template.render(found=found, what=WHAT, unfinished=unfinished, **limits)
