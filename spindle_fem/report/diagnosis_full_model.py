"""Section of the report of a diagnosis on the full finite-element model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from spindle_fem.report.block_page import Notice, Section, Table, Text
from spindle_fem.report.diagnosis_tables import recording_fields
from spindle_fem.report.table_rows import fixed, table_of, words


def full_model_sections(content: Mapping[str, Any]) -> list[Section]:
    """Section on the full model; none unless the full model was requested.

    Parameters
    ----------
    content : mapping
        Of ``diagnosis.json``.

    >>> full_model_sections({"fit": {"full_model": {"mesh": "off", "reason": "It was not asked for."}}})
    []
    """
    found = content["fit"].get("full_model") or {"mesh": "off"}
    if found["mesh"] == "off":
        return []
    title = "The full model, before and after"
    if found["reason"] is not None:
        return [Section("full_model", title, [Notice(found["reason"])])]
    return [Section("full_model", title, [Text(_words(found)), *_tables(content, found)])]


def _words(found: Mapping[str, Any]) -> str:
    order = "linear" if found["order"] == 1 else "quadratic"
    text = (
        f"The same physics and parameters on the {found['preset']} mesh, {order} temperatures, "
        f"{found['unknowns']} of them, iterated with the loads through {found['before']['steps']} time steps "
        f"before and {found['after']['steps']} after, each within "
        f"{found['step_error_K']:.2g} K in the mean over the machine."
    )
    text += (
        " Its mesh is not that of the fast model: readings are up to "
        f"{_largest(found['differences'], 'after_K'):.2g} K apart. On what the two fits differ by, both "
        f"models agree within {_largest(found['differences'], 'change_K'):.2g} K."
    )
    if left := found.get("left"):
        text += (
            f" With that change the set leaves {left['full']:.2g} times the errors expected of the readings, "
            f"{left['fast']:.2g} times on the fast model."
        )
    # Folders of before have none.
    if moved := found.get("displacement_differences"):
        text += (
            f" Displacements are up to {_largest(moved, 'after_um'):.2g} µm apart, on what the fits differ "
            f"by {_largest(moved, 'change_um'):.2g} µm."
        )
    return text + (f" Not of the mesh but added: {found['first_order']}." if found["first_order"] else "")


def _largest(differences: Sequence[Mapping[str, Any]], key: str) -> float:
    return max(row[key] for row in differences)


def _tables(content: Mapping[str, Any], found: Mapping[str, Any]) -> list[Table]:
    fit = content["fit"]
    errors = [
        {"model": f"{name}, {model}", "seconds": None, **values}
        for name in ("before", "after")
        for model, values in (("fast model", fit[name]), ("full model", found[name]))
    ]
    models = (
        words("model", "model"),
        fixed("fitted readings / K", "train_rmse_K", 3),
        fixed("held-out readings / K", "heldout_rmse_K", 3),
        fixed("time taken / s", "seconds", 1),
    )
    by_model = table_of(models, errors, "Root mean square error over all channels.")
    noise = fixed("noise / K", "noise_K", 3)
    level = noise.cell(fit)
    by_model.rows.append({"cells": ["noise", level, level, ""]})
    temperatures = {
        "before, fast model": content["mismatch"]["channels"],
        "before, full model": found["before"]["channels"],
        "after, fast model": fit["channels_after"],
        "after, full model": found["after"]["channels"],
    }
    tables = [by_model, *_by_channel(temperatures, found["differences"], "channel", "K")]
    if moved := found.get("displacement_differences"):
        displacements = {
            "before, fast model": content["mismatch"]["displacements"],
            "before, full model": found["before"]["displacements"],
            "after, fast model": fit["displacements_after"],
            "after, full model": found["after"]["displacements"],
        }
        tables += _by_channel(displacements, moved, "sensor", "um")
    return tables


def _by_channel(
    sources: Mapping[str, Sequence[Mapping[str, Any]]],
    differences: Sequence[Mapping[str, Any]],
    what: str,
    unit: str,
) -> list[Table]:
    """Errors of both models at each channel, and by how much the models differ there, in ``K`` or ``um``."""
    shown = unit.replace("um", "µm")
    named = (*recording_fields(differences), words(what, "channel"))
    errors = (
        *named,
        *(fixed(f"{name} / {shown}", name, 3) for name in sources),
        fixed(f"noise / {shown}", f"noise_{unit}", 3),
    )
    rows = [
        {**row, **{name: source[index][f"rmse_{unit}"] for name, source in sources.items()}}
        for index, row in enumerate(sources["after, full model"])
    ]
    apart = (
        *named,
        fixed(f"before / {shown}", f"before_{unit}", 3),
        fixed(f"after / {shown}", f"after_{unit}", 3),
        fixed(f"of what they differ by / {shown}", f"change_{unit}", 3),
    )
    return [
        table_of(errors, rows, f"Root mean square error of each {what} over all its readings."),
        table_of(
            apart, differences, f"Largest difference of the full model from the fast one at each {what}."
        ),
    ]
