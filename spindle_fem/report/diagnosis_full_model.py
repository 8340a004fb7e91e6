"""Section of the report of a diagnosis on the full finite-element model."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from spindle_fem.report.block_page import Notice, Section, Table, Text
from spindle_fem.report.run_tables import column, number, rows_of


def full_model_sections(content: Mapping[str, Any]) -> list[Section]:
    """The section, or none where the full model was not asked for.

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
        [
            f"{name}, {model}",
            number(values["train_rmse_K"], 3),
            number(values["heldout_rmse_K"], 3),
            number(values.get("seconds"), 1),
        ]
        for name in ("before", "after")
        for model, values in (("fast model", fit[name]), ("full model", found[name]))
    ]
    errors.append(["noise", number(fit["noise_K"], 3), number(fit["noise_K"], 3), ""])
    several = any("recording" in row for row in found["differences"])
    both = {
        "before": (content["mismatch"]["channels"], found["before"]["channels"]),
        "after": (fit["channels_after"], found["after"]["channels"]),
    }
    channels = [
        [
            *([row.get("recording", "")] if several else []),
            row["channel"],
            *(number(model[index]["rmse_K"], 3) for models in both.values() for model in models),
            number(row["noise_K"], 3),
        ]
        for index, row in enumerate(found["after"]["channels"])
    ]
    differences = [
        [
            *([row.get("recording", "")] if several else []),
            row["channel"],
            number(row["before_K"], 3),
            number(row["after_K"], 3),
            number(row["change_K"], 3),
        ]
        for row in found["differences"]
    ]
    return [
        Table(
            (
                column("model"),
                column("fitted readings / K", number=True),
                column("held-out readings / K", number=True),
                column("time taken / s", number=True),
            ),
            rows_of(errors),
            "Root mean square error over all channels.",
        ),
        Table(
            (
                *([column("recording")] if several else []),
                column("channel"),
                *(
                    column(f"{name}, {model} / K", number=True)
                    for name in both
                    for model in ("fast model", "full model")
                ),
                column("noise / K", number=True),
            ),
            rows_of(channels),
            "Root mean square error of each channel over all its readings.",
        ),
        Table(
            (
                *([column("recording")] if several else []),
                column("channel"),
                column("before / K", number=True),
                column("after / K", number=True),
                column("of what they differ by / K", number=True),
            ),
            rows_of(differences),
            "Largest difference of the full model from the fast one at each channel.",
        ),
    ]
