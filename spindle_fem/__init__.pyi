"""What type checkers and editors see of the names that load on first use."""

from typing import Final

from spindle_fem.commands.diagnose_command import diagnose_without_report as diagnose_without_report
from spindle_fem.commands.heat_command import heat_table as heat_table
from spindle_fem.commands.machine_commands import check_machine as check_machine
from spindle_fem.commands.machine_commands import mesh_machine as mesh_machine
from spindle_fem.commands.machine_commands import run_machine as run_machine
from spindle_fem.definition.load import validate as validate
from spindle_fem.effects.registry import register_effect as register_effect
from spindle_fem.library.design_sweep import sweep as sweep
from spindle_fem.library.loaded_machine import load_machine as load_machine
from spindle_fem.library.machine_diagnosis import diagnose as diagnose
from spindle_fem.library.network_check import crosscheck as crosscheck
from spindle_fem.library.simulated_recording import read_recording as read_recording
from spindle_fem.library.simulated_recording import simulate as simulate
from spindle_fem.library.solved_bearing import bearing as bearing
from spindle_fem.library.solved_machine import solve as solve
from spindle_fem.library.transient_run import transient as transient
from spindle_fem.physics.bearings.bearing_kinds import BEARING_KINDS as BEARING_KINDS
from spindle_fem.physics.bearings.heat_model import friction_model as friction_model
from spindle_fem.physics.bearings.heat_models import HEAT_MODELS as HEAT_MODELS
from spindle_fem.physics.coolant.coolants import COOLANTS as COOLANTS
from spindle_fem.physics.coolant.film_correlation import nusselt_correlation as nusselt_correlation
from spindle_fem.physics.coolant.film_models import FILM_MODELS as FILM_MODELS
from spindle_fem.physics.coolant.user_coolant import UserCoolant as UserCoolant
from spindle_fem.physics.surroundings.gap_laws import GAP_LAWS as GAP_LAWS
from spindle_fem.physics.surroundings.joint_law import joint_law as joint_law
from spindle_fem.physics.surroundings.joint_laws import JOINT_LAWS as JOINT_LAWS
from spindle_fem.physics.surroundings.natural_films import NATURAL_FILMS as NATURAL_FILMS
from spindle_fem.physics.surroundings.rotating_films import ROTATING_FILMS as ROTATING_FILMS
from spindle_fem.studies.simulate import simulate_recordings as simulate_recordings

__version__: Final[str]
