"""Thermal design of machine-tool spindles by finite elements.

The functions named in ``__all__`` are loaded when they are first used, so that
``import spindle_fem`` stays light.
"""

from __future__ import annotations

import importlib
from typing import Any

__version__ = "0.2.0"

# Module of each public name, and its name there where that is another.
_PLACES = {
    "load_machine": "spindle_fem.library.loaded_machine",
    "validate": "spindle_fem.definition.load",
    "solve": "spindle_fem.library.solved_machine",
    "run_machine": "spindle_fem.commands.machine_commands",
    "check_machine": "spindle_fem.commands.machine_commands",
    "mesh_machine": "spindle_fem.commands.machine_commands",
    "heat_table": "spindle_fem.commands.heat_command",
    "crosscheck": "spindle_fem.library.network_check",
    "sweep": "spindle_fem.library.design_sweep",
    "transient": "spindle_fem.library.transient_run",
    "simulate": "spindle_fem.library.simulated_recording",
    "simulate_recordings": "spindle_fem.studies.simulate",
    "diagnose": "spindle_fem.library.machine_diagnosis",
    "diagnose_without_report": "spindle_fem.commands.diagnose_command",
    "bearing": "spindle_fem.library.solved_bearing",
    "read_recording": "spindle_fem.library.simulated_recording",
    # Registries, to add things of one's own with ``add`` or ``register``, and what makes such things.
    "BEARING_KINDS": "spindle_fem.physics.bearings.bearing_kinds",
    "COOLANTS": "spindle_fem.physics.coolant.coolants",
    "FILM_MODELS": "spindle_fem.physics.coolant.film_models",
    "GAP_LAWS": "spindle_fem.physics.surroundings.gap_laws",
    "HEAT_MODELS": "spindle_fem.physics.bearings.heat_models",
    "JOINT_LAWS": "spindle_fem.physics.surroundings.joint_laws",
    "NATURAL_FILMS": "spindle_fem.physics.surroundings.natural_films",
    "ROTATING_FILMS": "spindle_fem.physics.surroundings.rotating_films",
    "UserCoolant": "spindle_fem.physics.coolant.user_coolant",
    "friction_model": "spindle_fem.physics.bearings.heat_model",
    "joint_law": "spindle_fem.physics.surroundings.joint_law",
    "register_effect": "spindle_fem.effects.registry",
    "nusselt_correlation": "spindle_fem.physics.coolant.film_correlation",
}
__all__ = ["__version__", *_PLACES]


def __getattr__(name: str) -> Any:
    """Load a public function from its module on first use."""
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, _, attribute = _PLACES[name].partition(":")
    return getattr(importlib.import_module(module), attribute or name)


def __dir__() -> list[str]:
    """Public names, loaded or not."""
    return sorted(__all__)
