"""Report of a heat study, from its files alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from spindle_fem.report.block_page import (
    Cards,
    Section,
    Table,
    Text,
    Warnings,
    illustration_of,
    render_document,
)
from spindle_fem.report.heat_charts import merged_terms
from spindle_fem.report.run_figures import HEAT_CAPTIONS
from spindle_fem.report.table_rows import fixed, number, table_of
from spindle_fem.results.output_folder import read_content, replace_text
from spindle_fem.studies.heat_study import HEAT_SCHEMA

_TERMS = (
    "Loads, angles and films of the ball or roller under the largest load; film and Λ are the smaller of "
    "both raceways. Terms of both raceways are added up."
)
_MODELS = (
    "The same loads and temperatures by every heat model. How far they are apart is what is not known about "
    "the friction of such bearings."
)


def write_heat_report(folder: Path) -> Path:
    """``report.html`` of a folder that holds ``heat.json`` and ``figures``.

    Raises
    ------
    BadInputError
        The file is missing or of a version that this program does not know.
    """
    content = read_content(folder / "heat.json", HEAT_SCHEMA, "heat MACHINE -o DIR")
    return replace_text(folder / "report.html", _page(content, folder / "figures"))


def _page(content: Mapping[str, Any], figures: Path) -> str:
    def drawn(*names: str) -> list[Any]:
        places = ((figures / f"{name}.png", HEAT_CAPTIONS[name]) for name in names)
        return [illustration_of(path, caption) for path, caption in places if path.is_file()]

    bearings = content["bearings"]
    terms = [_bearing_table(name, rows) for name, rows in bearings.items()]
    models = [_model_table(name, content["models"]) for name in bearings]
    mechanics = [name for name in HEAT_CAPTIONS if name not in ("heat_terms", "heat_models")]
    sections = [
        Section("headline", "Headline numbers", [Cards(_cards(content)), Warnings(content["warnings"])]),
        Section("terms", "Heat term by term", [*drawn("heat_terms"), Text(_TERMS), *terms]),
        Section("models", "Heat by every model", [*drawn("heat_models"), Text(_MODELS), *models]),
        Section("mechanics", "Contacts, films and speeds", drawn(*mechanics)),
    ]
    return render_document(
        "Bearing heat",
        content["machine"],
        sections,
        f"Heat model “{content['model']}” at {heat_conditions(content)}.",
    )


def heat_conditions(content: Mapping[str, Any]) -> str:
    """At which temperature, and with bearings of which size, the heat is.

    >>> heat_conditions({"temperature_degC": 40.0})
    '40.0 °C of films, rings and balls, and the size of assembly'
    """
    warmed = content["temperature_degC"]
    if warmed is None:
        return "the solved temperatures of each speed"
    return f"{number(warmed)} °C of films, rings and balls, and the size of assembly"


def _cards(content: Mapping[str, Any]) -> list[dict[str, str]]:
    """Heat of all bearings at the highest speed, by the machine's model and by the models farthest apart."""
    fastest = content["models"][-1]
    last = {name: rows[-1] for name, rows in content["bearings"].items()}
    totals = {model: sum(heat.values()) for model, heat in fastest["heat_W"].items()}
    least, most = min(totals, key=totals.__getitem__), max(totals, key=totals.__getitem__)
    hottest = max(last, key=lambda name: last[name]["heat_W"])
    return [
        {
            "value": f"{number(sum(row['heat_W'] for row in last.values()), 0)} W",
            "name": f"all bearings at {number(fastest['speed_rpm'], 0)} rpm",
        },
        {"value": f"{number(last[hottest]['heat_W'], 0)} W", "name": f"{hottest}, the most"},
        {
            "value": f"{number(totals[least], 0)} to {number(totals[most], 0)} W",
            "name": f"all bearings by {least} and by {most}",
        },
        {"value": number(min(row["lambda"] for row in last.values())), "name": "least film thickness ratio"},
    ]


def _bearing_table(name: str, rows: Sequence[Mapping[str, Any]]) -> Table:
    """Heat and its terms, load, preload, angles and films over speed."""
    terms = [merged_terms(row["terms_W"]) for row in rows]
    named = dict.fromkeys(term for own in terms for term, value in own.items() if value)
    fields = (
        fixed("rpm", lambda item: item[0]["speed_rpm"], 0),
        fixed("heat W", lambda item: item[0]["heat_W"]),
        *(fixed(f"{term} W", lambda item, term=term: item[1].get(term)) for term in named),
        fixed("axial load N", lambda item: item[0]["axial_load_N"], 0),
        fixed("preload N", lambda item: item[0]["preload_N"], 0),
        fixed("α inner °", lambda item: item[0]["contact_angle_inner_deg"], 2),
        fixed("α outer °", lambda item: item[0]["contact_angle_outer_deg"], 2),
        fixed("film µm", lambda item: item[0]["film_um"], 3),
        fixed("Λ", lambda item: item[0]["lambda"]),
    )
    return table_of(fields, zip(rows, terms, strict=True), f"{name}.")


def _model_table(name: str, rows: Sequence[Mapping[str, Any]]) -> Table:
    """Heat of one bearing by every model over speed."""
    fields = (
        fixed("rpm", "speed_rpm", 0),
        *(
            fixed(f"{model} W", lambda row, model=model: row["heat_W"][model][name])
            for model in rows[0]["heat_W"]
        ),
    )
    return table_of(fields, rows, f"{name}.")
