"""Section of the report of a diagnosis on the full finite-element model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from spindle_fem.inference import tuned
from spindle_fem.report.block_page import Notice, Section, Table, Text
from spindle_fem.report.diagnosis_tables import recording_fields
from spindle_fem.report.diagnosis_words import fits_told, kelvin
from spindle_fem.report.table_rows import fixed, table_of, words

# Sources of errors where there is one fit: both models.
ONE_FIT = 2


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
    if found["reason"] is not None:
        return [Section("full_model", "The full model", [Notice(found["reason"])])]
    fits = list(fits_told(content["fit"]))
    title = f"The full model{', before and after' if len(fits) > 1 else ''}"
    return [Section("full_model", title, [Text(_words(found, fits)), *_tables(content, found, fits)])]


def _words(found: Mapping[str, Any], fits: Sequence[str]) -> str:
    order = "linear" if found["order"] == 1 else "quadratic"
    steps = (
        f"{found['before']['steps']} time steps before and {found['after']['steps']} after"
        if len(fits) > 1
        else f"{found['after']['steps']} time steps"
    )
    text = (
        f"The same physics and parameters on the {found['preset']} mesh, {order} temperatures, "
        f"{found['unknowns']} of them, iterated with the loads through {steps}, each within "
        f"{found['step_error_K']:.2g} K in the mean over the machine."
        " Its mesh is not that of the fast model: readings are up to "
        f"{_largest(found['differences'], 'after_K'):.2g} K apart."
    )
    if len(fits) > 1:
        text += (
            " On what the two fits differ by, both models agree within "
            f"{_largest(found['differences'], 'change_K'):.2g} K."
        )
        before, after = (found[when]["heldout_rmse_K"] for when in ("before", "after"))
        if before is not None and after is not None:
            verb = "lowers" if after < (1.0 - tuned.LEAST_IMPROVEMENT) * before else "does not lower"
            text += (
                f" What was found {verb} the full model's held-out error: {kelvin(before)} before, "
                f"{kelvin(after)} after."
            )
    if (left := found.get("left")) and len(fits) > 1:
        text += (
            f" With that change the set leaves {left['full']:.2g} times the errors expected of the readings, "
            f"{left['fast']:.2g} times on the fast model."
        )
    # Folders of before have none.
    if moved := found.get("displacement_differences"):
        text += f" Displacements are up to {_largest(moved, 'after_um'):.2g} µm apart"
        text += (
            f", on what the fits differ by {_largest(moved, 'change_um'):.2g} µm." if len(fits) > 1 else "."
        )
    return text + (f" Not of the mesh but added: {found['first_order']}." if found["first_order"] else "")


def _largest(differences: Sequence[Mapping[str, Any]], key: str) -> float:
    return max(row[key] for row in differences)


def _tables(content: Mapping[str, Any], found: Mapping[str, Any], fits: Sequence[str]) -> list[Table]:
    fit = content["fit"]

    def named(name: str, model: str) -> str:
        return f"{name}, {model}" if len(fits) > 1 else model

    errors = [
        {"model": named(name, model), "seconds": None, **values}
        for name in fits
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

    def by_channel(kind: str, differences: Sequence[Mapping[str, Any]], what: str, unit: str) -> list[Table]:
        fast = {"before": content["mismatch"][kind], "after": fit[f"{kind}_after"]}
        sources = {
            named(name, model): values
            for name in fits
            for model, values in (("fast model", fast[name]), ("full model", found[name][kind]))
        }
        return _by_channel(sources, differences, what, unit)

    tables = [by_model, *by_channel("channels", found["differences"], "channel", "K")]
    if moved := found.get("displacement_differences"):
        tables += by_channel("displacements", moved, "sensor", "um")
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
    *_, last = sources.values()
    rows = [
        {**row, **{name: source[index][f"rmse_{unit}"] for name, source in sources.items()}}
        for index, row in enumerate(last)
    ]
    before_and_after = (
        fixed(f"before / {shown}", f"before_{unit}", 3),
        fixed(f"after / {shown}", f"after_{unit}", 3),
        fixed(f"of what they differ by / {shown}", f"change_{unit}", 3),
    )
    one = (fixed(f"difference / {shown}", f"after_{unit}", 3),)
    apart = (*named, *(before_and_after if len(sources) > ONE_FIT else one))
    return [
        table_of(errors, rows, f"Root mean square error of each {what} over all its readings."),
        table_of(
            apart, differences, f"Largest difference of the full model from the fast one at each {what}."
        ),
    ]
