"""Section of the report of a diagnosis on the full finite-element model."""

from __future__ import annotations

from collections.abc import Mapping
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
        f"before and {found['after']['steps']} after, each within {found['step_error_K']:.2g} K at any node."
    )
    text += (
        " Its mesh is not that of the fast model: readings are up to "
        f"{_largest(found, 'after_K'):.2g} K apart. On what the two fits differ by, both models agree within "
        f"{_largest(found, 'change_K'):.2g} K."
    )
    return text + (f" Not of the mesh but added: {found['first_order']}." if found["first_order"] else "")


def _largest(found: Mapping[str, Any], key: str) -> float:
    return max(row[key] for row in found["differences"])


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
    sources = {
        "before, fast model": content["mismatch"]["channels"],
        "before, full model": found["before"]["channels"],
        "after, fast model": fit["channels_after"],
        "after, full model": found["after"]["channels"],
    }
    named = (*recording_fields(found["differences"]), words("channel", "channel"))
    channels = (
        *named,
        *(fixed(f"{name} / K", name, 3) for name in sources),
        noise,
    )
    rows = [
        {**row, **{name: source[index]["rmse_K"] for name, source in sources.items()}}
        for index, row in enumerate(found["after"]["channels"])
    ]
    differences = (
        *named,
        fixed("before / K", "before_K", 3),
        fixed("after / K", "after_K", 3),
        fixed("of what they differ by / K", "change_K", 3),
    )
    return [
        by_model,
        table_of(channels, rows, "Root mean square error of each channel over all its readings."),
        table_of(
            differences,
            found["differences"],
            "Largest difference of the full model from the fast one at each channel.",
        ),
    ]
