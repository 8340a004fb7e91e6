"""The function behind ``spindle-fem heat``."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from spindle_fem.definition.load import load_machine
from spindle_fem.errors import NoEquilibriumError
from spindle_fem.operation.operating_limits import require_possible_speeds
from spindle_fem.results.output_folder import output_folder, replace_text
from spindle_fem.studies.heat_study import heat_study
from spindle_fem.units import to_si


def heat_table(
    machine: str | Path,
    *,
    speeds: Iterable[str] = (),
    temperature: str = "40 degC",
    coupled: bool = False,
    folder: Path | None = None,
    overrides: Iterable[str] = (),
) -> dict[str, Any]:
    """Bearing loads, angles, films and heat term by term over speed.

    Parameters
    ----------
    speeds : iterable of str
        With units; nine up to one and a half times the machine's speed when empty.
    temperature : str
        One for rings, balls and grease.
    coupled : bool
        Solve the machine at every speed and take its temperatures.
    folder : Path, optional
        For ``heat.json``, ``heat.csv``, charts and ``report.html``.

    Raises
    ------
    SpecError
        A speed that no rolling bearing of the machine reaches.
    NoEquilibriumError
        At no speed do the bearings have an equilibrium.
    """
    spec = load_machine(machine, overrides)
    chosen = [to_si(text, "rad/s", where="--speed") for text in speeds]
    require_possible_speeds(spec, chosen, "--speed")
    kelvin = to_si(temperature, "K", where="--temperature", kind="temperature")
    content = heat_study(spec, chosen, kelvin, coupled=coupled)
    if not content["models"]:
        reasons = (item["text"] for item in content["warnings"] if item["code"] == "no_equilibrium")
        raise NoEquilibriumError(spec.name, next(reasons), "Ask for lower speeds.")
    if folder is not None:
        with output_folder(folder) as place:
            _write(content, place)
    return content


def _write(content: dict[str, Any], place: Path) -> None:
    """Write ``heat.json``, ``heat.csv`` (a row for each bearing and speed), the charts and the report."""
    import pandas

    from spindle_fem.report.heat_charts import write_heat_charts
    from spindle_fem.report.heat_report import write_heat_report

    rows = []
    for name, entries in content["bearings"].items():
        for entry in entries:
            flat = {key: value for key, value in entry.items() if not isinstance(value, dict)}
            flat |= {f"{term}_W": value for term, value in entry["terms_W"].items()}
            for side, contact in entry["contacts"].items():
                flat |= {f"{side}_{key}": value for key, value in contact.items()}
            rows.append({"bearing": name, **flat})
    replace_text(place / "heat.json", json.dumps(content, indent=2, ensure_ascii=False))
    pandas.DataFrame(rows).to_csv(place / "heat.csv", index=False)
    write_heat_charts(content, place / "figures")
    write_heat_report(place)
