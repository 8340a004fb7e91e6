"""A diagnosis in sentences: the verdict for a report, what to check, how sure it is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from spindle_fem.effects.framework.effect import capital, place_words
from spindle_fem.effects.registry import catalogue
from spindle_fem.inference import tuned
from spindle_fem.inference.coordinate_names import PROBE_PREFIX
from spindle_fem.report.table_rows import significant

# P-values below are too small for the models behind them to mean their digits.
LEAST_LEVEL = 0.001

VERDICTS = {
    "consistent": "nothing is missing",
    "parameter": "a parameter is off",
    "sensor": "a sensor does not tell the truth",
    "missing_physics": "physics is missing",
    "ambiguous": "the data cannot decide",
    "unexplained": "no explanation",
}


def verdict_sentence(content: Mapping[str, Any]) -> str:
    """The verdict with its numbers, to be put in a report as it is.

    Parameters
    ----------
    content : mapping
        Of ``diagnosis.json``.
    """
    verdict, fit = content["verdict"], content["fit"]
    off = "".join(f"{wrong_definition_words(row)} " for row in wrong_rows(content))
    if verdict == "unexplained" and not content["findings"]:
        reason = str(content.get("reason") or "the difference follows nothing that the catalogue holds")
        unexplained = f"The difference between recording and model is not explained: {reason.rstrip('.')}."
        return f"{unexplained} {off}".rstrip()
    if verdict == "unexplained":
        reason = str(content.get("reason") or "the best set leaves too much").rstrip(".")
        statements = " ".join(item["statement"] for item in content["findings"])
        return (
            f"The difference between recording and model is not explained: {reason}. What comes nearest, "
            f"and is not to be taken for the cause (probability {chance(content.get('set_probability'))}): "
            f"“{statements}” {off}{_improvement(fit)}"
        )
    if verdict == "consistent":
        others = [
            f"{set_words(item['findings'])} ({chance(item['probability'])})"
            for item in content["alternatives"]
            if item["probability"] >= tuned.LISTED
        ]
        return (
            f"The recording agrees with the machine: what differs, {kelvin(fit['after']['heldout_rmse_K'])} "
            f"on held-out readings, is noise ({kelvin(fit['noise_K'])}), the slow error allowed to sensors "
            f"and model ({kelvin(content['slow_error']['sigma_K'])}) and what the uncertain parameters "
            f"absorb within their priors (p {level(content['mismatch']['p_value'])})."
            + (f" Not ruled out: {_or(others)}." if others else "")
        )
    if verdict == "ambiguous":
        lead = off + _when(content)
        sets = [(content["findings"], content.get("set_probability"))]
        # One effect less is no other answer, unless it is likely.
        sets += [
            (item["findings"], item["probability"])
            for item in content["alternatives"]
            if item["probability"] >= tuned.LISTED or len(item["findings"]) >= len(content["findings"])
        ]
        options = [f"{set_words(items)} ({chance(value)})" for items, value in sets]
        reason = str(content.get("reason") or "several sets explain the data").rstrip(".")
        if len(options) == 1:
            return (
                f"{lead}the readings differ from the model by more than noise and uncertain "
                f"parameters. The likeliest set is {options[0]}, but {reason}. {_improvement(fit)}"
            )
        return (
            f"{lead}the readings differ from the model by more than noise and uncertain "
            f"parameters, but the data cannot tell apart {_or(options)}: {reason}. {_improvement(fit)}"
        )
    if off and not content["findings"]:
        return off + _improvement(fit)
    statements = " ".join(item["statement"] for item in content["findings"])
    lead = "" if verdict == "sensor" else _heat_words(content)
    doubt = str(content.get("reason") or "").rstrip(".")
    sure = f"Probability {chance(content.get('set_probability'))}.{f' {capital(doubt)}.' if doubt else ''}"
    return f"{lead}{statements} {sure} {off}{_improvement(fit)}"


def sensors_named(content: Mapping[str, Any]) -> list[str]:
    """Sensors that findings hold to be wrong: their places are no places of the physics.

    >>> sensors_named({"findings": [{"kind": "sensor", "component": "SP02"}]})
    ['SP02']
    """
    return [item["component"] for item in content["findings"] if item.get("kind") == "sensor"]


def place_named(content: Mapping[str, Any]) -> str:
    """Component where the mismatch is, if it is physical and not a sensor; else empty."""
    place = content["mismatch"]["where"]["component"] or ""
    return "" if place in sensors_named(content) else place


def found_words(content: Mapping[str, Any]) -> str:
    """Describe the findings: found, or only what comes nearest.

    >>> found_words({"verdict": "unexplained"}), found_words({"verdict": "sensor"})
    ('what comes nearest', 'what was found')
    """
    return "what comes nearest" if content["verdict"] == "unexplained" else "what was found"


def set_words(findings: Sequence[Mapping[str, Any]]) -> str:
    """Effects and places of a set.

    >>> set_words([{"effect": "heat_scale", "component": "front_bearings"}])
    'heat scale at the front bearings'
    """
    if not findings:
        return "nothing missing"
    return " with ".join(
        f"{item['effect'].replace('_', ' ')} at {place_words(item['component'])}{in_recording(item)}"
        for item in findings
    )


def in_recording(finding: Mapping[str, Any]) -> str:
    """The one of several recordings that a finding is of, behind a place; empty if it is of all.

    >>> in_recording({"effect": "windage", "component": "shaft", "recording": "monday"})
    ' in monday'
    """
    return f" in {finding['recording']}" if "recording" in finding else ""


def misdescription_words(row: Mapping[str, Any]) -> str:
    """A direction in which the machine differs from its definition, with its value and interval.

    >>> row = {"statement": "outer diameter", "value": 1.5, "low": 1.25, "high": 1.75, "unit": "mm"}
    >>> misdescription_words(row)
    'Outer diameter: 1.5 mm (1.25 to 1.75 mm).'
    """
    unit = f" {row['unit']}" if row["unit"] else ""
    middle, low, high = (significant(row[key]) for key in ("value", "low", "high"))
    return f"{capital(row['statement'])}: {middle}{unit} ({low} to {high}{unit})."


def wrong_rows(content: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Where the definition of ``diagnosis.json`` is wrong."""
    own = content.get("misdescription") or {}
    return [row for row in (own.get("wrong"), *own.get("also_wrong", ())) if row is not None]


def wrong_definition_words(row: Mapping[str, Any]) -> str:
    """A definition that is wrong, with what holds instead where a number of it is.

    >>> number = {"given": 3.0, "value": 5.1, "low": 4.7, "high": 5.5, "unit": "mm"}
    >>> wrong_definition_words({"key": "channel.depth", "defined": number})
    'The definition is off at channel.depth: 5.1 mm (4.7 to 5.5), where it says 3.'
    >>> other = {"key": "coolant.film_factor", "given": 1.0, "value": 0.6, "unit": ""}
    >>> wrong_definition_words({"key": "channel.depth", "defined": number, "rivals": [other]})[77:]
    ' Nearly as well explained by coolant.film_factor (0.6 for 1).'
    """
    if "defined" not in row:
        return f"{misdescription_words(row)} The definition is off there ({row['key']})."
    number = row["defined"]
    given, middle, low, high = (significant(number[key]) for key in ("given", "value", "low", "high"))
    instead = []
    for item in row.get("rivals", ()):
        value = f"{significant(item['value'])} {item['unit']}".strip()
        instead.append(f"{item['key']} ({value} for {significant(item['given'])})")
    return (
        f"The definition is off at {row['key']}: {middle} {number['unit']} ({low} to {high}), "
        f"where it says {given}." + (f" Nearly as well explained by {_or(instead)}." if instead else "")
    )


def chance(value: float | None) -> str:
    """Probability as text.

    >>> chance(0.934), chance(0.9999), chance(0.004), chance(None)
    ('0.93', 'above 0.99', 'below 0.01', 'not known')
    """
    if value is None:
        return "not known"
    if value < 0.01:
        return "below 0.01"
    return "above 0.99" if value > 0.99 else f"{value:.2f}"


def level(p_value: float) -> str:
    """A p-value with its sign of relation.

    >>> level(0.0312), level(0.0)
    ('= 0.031', '< 0.001')
    """
    return f"= {significant(p_value, 2)}" if p_value >= LEAST_LEVEL else f"< {LEAST_LEVEL:g}"


def level_of(content: Mapping[str, Any]) -> str:
    """The p-value of a diagnosis as :func:`level` has it; empty where that says nothing.

    What is unexplained by what it leaves over the noise may be as likely as not under a slow error so large.
    """
    p_value = content["mismatch"]["p_value"]
    silent = content["verdict"] == "unexplained" and p_value > tuned.SIGNIFICANT
    return "" if silent else level(p_value)


def kelvin(value: float | None) -> str:
    """Temperature difference as text.

    >>> kelvin(0.1544), kelvin(None)
    ('0.15 K', 'not known')
    """
    return "not known" if value is None else f"{value:.2f} K"


def moment(value: float | str) -> str:
    """A time of the file: seconds from the start as hours or minutes, stamps as they are.

    >>> moment(5400.0), moment(90.0), moment("2024-01-01T10:00:00.123")
    ('1.50 h', '2 min', '2024-01-01 10:00:00')
    """
    if isinstance(value, str):
        return value[:19].replace("T", " ")
    return f"{value / 3600.0:.2f} h" if abs(value) >= 3600.0 else f"{value / 60.0:.0f} min"


def _when(content: Mapping[str, Any]) -> str:
    condition = content["mismatch"]["where"].get("condition")
    if not condition:
        return ""
    # "At 0-500 rpm", "During cooling".
    return (
        f"{'At' if condition[0].isdigit() or condition.startswith('standstill') else 'During'} {condition} "
    )


def _heat_words(content: Mapping[str, Any]) -> str:
    """When, where and how much heat would be missing; empty where the place is no place of heat."""
    mismatch = content["mismatch"]
    component = mismatch["where"]["component"]
    heat = mismatch["missing_heat_W"].get(component)
    unrecorded = any(item["effect"].startswith("unrecorded_") for item in content["findings"])
    if heat is None or unrecorded:
        # An unrecorded source says itself how much.
        return ""
    mean, peak = (
        f"{abs(heat[key]):.0f} W {'more' if heat[key] >= 0.0 else 'less'}" for key in ("mean", "peak")
    )
    when = _when(content).rstrip()
    above_all = f", above all {when[0].lower()}{when[1:]}" if when else ""
    return (
        "Beyond what the machine's uncertain values took up, the readings are as if "
        f"{place_words(component)} gave {mean} heat than modelled in the mean of all time, "
        f"and {peak} at the utmost{above_all}. "
    )


def heldout_errors(fit: Mapping[str, Any]) -> tuple[float | None, float | None, str]:
    """Held-out errors before and after, K, and what the second one is told besides; empty without.

    No fitted reading tells when a state switched or a level changed within a held-out stretch: all readings
    tell that, and the fit says how much.
    """
    after = fit["after"]
    told = after.get("heldout_states_told_rmse_K")
    if told is None:
        return fit["before"]["heldout_rmse_K"], after["heldout_rmse_K"], ""
    return fit["before"]["heldout_rmse_K"], told, "its moments told by all readings"


def is_one_fit(fit: Mapping[str, Any]) -> bool:
    """Whether nothing was found, so that before and after are the same."""
    return all(fit["before"][key] == fit["after"][key] for key in ("train_rmse_K", "heldout_rmse_K"))


def fits_told(fit: Mapping[str, Any]) -> dict[str, str]:
    """Words for ``before`` and ``after``; for one of both where nothing was found."""
    return {"after": "nothing missing"} if is_one_fit(fit) else {"before": "before", "after": "after"}


def fit_rows(fit: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Errors of every fit on fitted and held-out readings, K: ``model``, ``fitted``, ``heldout``."""
    names = fits_told(fit)
    rows = [
        {
            "model": name,
            "fitted": fit[when]["train_rmse_K"],
            "heldout": fit[when].get("heldout_states_untold_rmse_K", fit[when]["heldout_rmse_K"]),
        }
        for when, name in names.items()
    ]
    _, after, told = heldout_errors(fit)
    if told:
        rows.append({"model": f"{names['after']}, {told}", "fitted": None, "heldout": after})
    if errors := fit.get("improved_machine"):
        own = {"fitted": errors["train_rmse_K"], "heldout": errors["heldout_rmse_K"]}
        rows.append({"model": "improved_machine.toml", **own})
    return rows


def _improvement(fit: Mapping[str, Any]) -> str:
    before, after, told = heldout_errors(fit)
    if before is None or after is None:
        return ""
    verb = "falls" if after < before else "goes"
    return (
        f"With it{f', {told},' if told else ''} the held-out error {verb} from {kelvin(before)} to "
        f"{kelvin(after)}; noise {kelvin(fit['noise_K'])}."
    )


def _or(items: Sequence[str]) -> str:
    return " or ".join(filter(None, [", ".join(items[:-1]), items[-1] if items else ""]))


def checks(content: Mapping[str, Any]) -> list[str]:
    """Checks for a maintenance engineer, the most probable first."""
    if content["verdict"] == "consistent":
        return ["Nothing: the machine does what its definition says."]
    effects = catalogue()
    found: dict[str, None] = {}
    for row in wrong_rows(content):
        for item in (row, *row.get("rivals", ())):
            found[f"Drawing, data sheet or machine: is {item['key']} as the definition has it?"] = None
    sets = [content["findings"], *(item["findings"] for item in content["alternatives"])]
    for item in [finding for findings in sets for finding in findings]:
        text = item.get("check") or (effects[item["effect"]].check if item["effect"] in effects else "")
        if text:
            place = capital(place_words(item["component"]))
            found.setdefault(f"{place}: {text[0].lower() + text[1:]}")
    return list(found)


def confidence_words(content: Mapping[str, Any]) -> list[str]:
    """Sentences on how the answer was found and what it leaves open."""
    fit, p = content["fit"], level_of(content)
    found = [f"If nothing were missing, a difference as large would have the probability p {p}."] if p else []
    found += [
        f"Held out, never seen by the fit: {fit['heldout']}.",
    ]
    if content.get("candidates_tried"):
        names = [row["name"] for row in content.get("machine_parameters", [])]
        probes = " and the places of the probes" if any(n.startswith(PROBE_PREFIX) for n in names) else ""
        found.append(
            f"{content['candidates_tried']} candidates of the catalogue were tried, "
            f"{content.get('hypotheses_fitted', 0)} sets fitted to the end with the machine's uncertain "
            f"parameters{probes}."
        )
    other = content.get("something_else_probability")
    if other is not None:
        found.append(
            "Something that the catalogue does not hold, or holds with another law: probability "
            f"{significant(other, 2)}."
        )
    slow = content.get("slow_error")
    if slow:
        found.append(
            f"Beside white noise every channel is allowed a slow error of {kelvin(slow['sigma_K'])} that "
            f"changes within {slow['time_s'] / 60.0:.0f} min: drift of logger and sensor, and what any model "
            "leaves of its machine."
        )
    found.append(
        "Probabilities are tempered: the catalogue's laws never hold exactly, so a difference of evidence "
        "counts for a share of what it says, and no set is given more than sets of such evidence deserved "
        "on concealed recordings. Intervals are 90 %."
    )
    return found
