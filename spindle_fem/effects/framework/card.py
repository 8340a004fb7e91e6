"""Description of an effect, kept with the effect, for the documentation and the tests."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

# Headings of docs/effects.md under which effects stand, in their order.
GROUPS = (
    "Bearings",
    "Heat by speed",
    "Contacts and capacity",
    "Surroundings",
    "Coolant",
    "Sensors",
    "Way out",
)


@dataclass(frozen=True, slots=True)
class Makes:
    """Direction in which an effect of positive amplitude moves a probe of the reference spindle.

    Attributes
    ----------
    way : {"warmer", "colder"}
        On the mean of a run.
    at : str
        Component where the effect acts.
    """

    way: Literal["warmer", "colder"]
    probe: str
    at: str


@dataclass(frozen=True, slots=True)
class Card:
    """One row of docs/effects.md, and expectations that tests check.

    Attributes
    ----------
    group : str
        One of ``GROUPS``.
    law : str
        The formula.
    size : str
        Amplitude and shape parameters with their priors.
    acts_on : str
        Components where it may act.
    source : str
        Author and year; empty where the law needs none.
    states : mapping of str to str
        Names that a finding states whatever the form, with their units.
    makes : Makes or None
        None for an effect whose sign depends on the state.
    """

    group: str
    law: str
    size: str
    acts_on: str
    source: str = ""
    states: Mapping[str, str] = field(default_factory=dict)
    makes: Makes | None = None
