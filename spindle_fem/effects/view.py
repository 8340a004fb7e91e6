"""A machine as effects see it: what can be heated, cooled, scaled and read, by component.

Components carry the names that a diagnosis reports: ``front_bearings`` (a
bearing set), one bearing, ``shaft``, ``housing``, ``channel``, ``flange``,
``drive_end``, ``nose``, ``ambient``, a probe, or a node or link of a network.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True, slots=True)
class MachineView:
    """Names of one machine.

    Attributes
    ----------
    kind : str
        "geometry" or "network".
    sets : mapping of component to tuple of str
        Bearings of each set (``front_bearings``); single bearings map to
        themselves. Sources of a network likewise.
    inner, outer : mapping of bearing to str
        Places of its rings; for a network source, the node that it heats and
        what that node is joined to.
    heat : mapping of component to tuple of str
        Places that take heat which belongs to a component.
    films : mapping of component to tuple of str
        Coefficients of the films to the surroundings there (a network: links
        to boundaries), rotating surfaces under ``shaft``, ``nose``, ``drive_end``.
    joints : mapping of component to tuple of str
        Parameters of the machine that scale the contacts there.
    joint_coefficients : mapping of component to tuple of str
        Coefficients of the same contacts.
    parameters : mapping of str to float
        1 σ of the logarithm of every uncertain parameter of the definition.
    channels : tuple of str
        Temperature channels of the recording.
    inputs : tuple of str
        Inputs of the recording.
    covariates : tuple of str
    has : frozenset of str
        Effects that the definition already switches on.
    reference_temperature : float, [K]
        Of the surroundings, nominal.
    highest_speed : float, [rad/s]
        In the recording.
    duration : float, [s]
        Of the recording.
    """

    kind: Literal["geometry", "network"]
    sets: Mapping[str, tuple[str, ...]]
    inner: Mapping[str, str]
    outer: Mapping[str, str]
    heat: Mapping[str, tuple[str, ...]]
    films: Mapping[str, tuple[str, ...]]
    joints: Mapping[str, tuple[str, ...]]
    joint_coefficients: Mapping[str, tuple[str, ...]]
    parameters: Mapping[str, float]
    channels: tuple[str, ...]
    inputs: tuple[str, ...]
    covariates: tuple[str, ...]
    has: frozenset[str]
    reference_temperature: float
    highest_speed: float
    duration: float
