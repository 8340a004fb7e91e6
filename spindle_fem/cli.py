"""The command line: parse, call one function, print."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from spindle_fem import __version__

PLAN_FLAG, WORKER_FLAGS = "--plan", ("--jobs", "-j", "--cluster")


class _Commands(TyperGroup):
    """The commands; ``diagnose --plan`` and ``diagnose --jobs`` ask other things than a diagnosis alone."""

    def resolve_command(self, ctx: typer.Context, args: list[str]) -> tuple[str | None, Any, list[str]]:
        """Which command arguments are for, and those that are left."""
        if args[0] == "diagnose" and PLAN_FLAG in args:
            args = ["plan", *(item for item in args[1:] if item != PLAN_FLAG)]
        elif args[0] == "diagnose" and any(item.partition("=")[0] in WORKER_FLAGS for item in args):
            args = ["diagnose-folder", *args[1:]]
        return super().resolve_command(ctx, args)


app = typer.Typer(
    name="spindle-fem",
    cls=_Commands,
    help="Thermal finite elements for grease-lubricated machine-tool spindles.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

Machine = Annotated[str, typer.Argument(help="A TOML definition, or the name of a machine that ships.")]
Overrides = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="PATH=VALUE", help="Override a value, with its unit: channel.depth=19mm."),
]
Folder = Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="Folder for the results.")]
Calibrate = Annotated[
    list[Path] | None,
    typer.Option(
        "--calibrate", metavar="FILE", help="Recording of the same machine with nothing missing; repeatable."
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print the summary as JSON.")]


def _version(asked: bool) -> None:
    if asked:
        typer.echo(f"spindle-fem {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    _version_asked: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")] = False,
) -> None:
    _State.debug = debug


class _State:
    debug = False


def _print_json(content: Any) -> None:
    typer.echo(json.dumps(content, indent=2, ensure_ascii=False))


@app.command()
def run(
    output: Folder,
    machine: Machine = "wu_tan_2016",
    set_: Overrides = None,
    as_json: AsJson = False,
    estimate_mesh_error: Annotated[
        bool,
        typer.Option("--estimate-mesh-error", help="Solve on a second, coarser mesh and report the change."),
    ] = False,
) -> None:
    """Geometry, mesh, heat, films, solve, pictures, report."""
    from spindle_fem.commands.console import print_run
    from spindle_fem.commands.machine_commands import run_machine

    summary = run_machine(
        machine, output, overrides=set_ or (), estimate_mesh_error=estimate_mesh_error, progress=not as_json
    )
    _print_json(summary) if as_json else print_run(summary, output)


@app.command()
def check(machine: Machine, set_: Overrides = None, as_json: AsJson = False) -> None:
    """Validate a machine without solving; every fault at once."""
    from spindle_fem.commands.console import print_check
    from spindle_fem.commands.machine_commands import check_machine

    content = check_machine(machine, overrides=set_ or ())
    _print_json(content) if as_json else print_check(content)


@app.command()
def mesh(
    machine: Machine,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FILE", help=".msh, .vtu or .step")],
    set_: Overrides = None,
    as_json: AsJson = False,
) -> None:
    """Write the mesh (.msh, .vtu with named parts and surfaces) or the solid model (.step)."""
    from spindle_fem.commands.console import print_pairs
    from spindle_fem.commands.machine_commands import mesh_machine

    content = mesh_machine(machine, output, overrides=set_ or ())
    _print_json(content) if as_json else print_pairs(f"wrote {output}", content)


@app.command()
def heat(
    machine: Machine,
    speed: Annotated[
        list[str] | None,
        typer.Option("--speed", help='Speeds, repeatable: "3000 rpm"; default 500 to 4500 rpm.'),
    ] = None,
    temperature: Annotated[str, typer.Option(help="Of rings, balls and grease.")] = "40 degC",
    coupled: Annotated[
        bool, typer.Option("--coupled", help="Solve the machine at every speed and take its temperatures.")
    ] = False,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="DIR", help="Folder for tables and pictures.")
    ] = None,
    set_: Overrides = None,
    as_json: AsJson = False,
) -> None:
    """Bearing loads, angles, films and heat term by term over speed."""
    from spindle_fem.commands.console import print_heat
    from spindle_fem.commands.heat_command import heat_table

    content = heat_table(
        machine,
        speeds=speed or (),
        temperature=temperature,
        coupled=coupled,
        folder=output,
        overrides=set_ or (),
    )
    _print_json(content) if as_json else print_heat(content)


@app.command()
def bearing(
    file: Annotated[Path, typer.Argument(help="TOML with [bearing], [operation] and perhaps [lubricant].")],
    as_json: AsJson = False,
) -> None:
    """One bearing or one preloaded set, without a machine."""
    from spindle_fem.commands.console import print_bearing
    from spindle_fem.physics.bearings.bearing_file import bearing_report

    content = bearing_report(file)
    _print_json(content) if as_json else print_bearing(content)


@app.command()
def crosscheck(machine: Machine, output: Folder, set_: Overrides = None, as_json: AsJson = False) -> None:
    """Lumped network beside the FEM, node by node, and why they differ."""
    from spindle_fem.commands.console import print_crosscheck, stages
    from spindle_fem.commands.crosscheck_command import crosscheck_machine

    with stages(not as_json) as tell:
        content = crosscheck_machine(machine, output, overrides=set_ or (), progress=tell)
    _print_json(content) if as_json else print_crosscheck(content, output)


@app.command()
def sweep(
    machine: Machine,
    study: Annotated[Path, typer.Argument(help="TOML with parameters, design and outputs.")],
    output: Folder,
    jobs: Annotated[int, typer.Option("--jobs", "-j", help="Worker processes; 0 for one a core.")] = 1,
    scheduler: Annotated[
        str | None, typer.Option("--scheduler", metavar="ADDRESS", help="A Dask scheduler instead.")
    ] = None,
    set_: Overrides = None,
    as_json: AsJson = False,
) -> None:
    """Channel design iterations: every design a solved machine; stopped studies go on."""
    from spindle_fem.commands.console import print_sweep
    from spindle_fem.commands.sweep_command import sweep_machine

    content = sweep_machine(
        machine,
        study,
        output,
        overrides=set_ or (),
        jobs=jobs,
        scheduler=scheduler,
        progress=not as_json,
    )
    _print_json(content) if as_json else print_sweep(content, output)


@app.command()
def transient(
    study: Annotated[Path, typer.Argument(help="TOML with phases, such as studies/heat_up_3000rpm.toml.")],
    output: Folder,
    machine: Annotated[str | None, typer.Option("--machine", help="In place of the study's own.")] = None,
    restart: Annotated[Path | None, typer.Option("--restart", help="state.npz of an earlier run.")] = None,
    set_: Overrides = None,
    as_json: AsJson = False,
) -> None:
    """Heat-up, step test or cool-down by the full finite-element model."""
    from spindle_fem.commands.console import print_transient, stages
    from spindle_fem.commands.transient_command import run_transient_study

    with stages(not as_json) as tell:
        content = run_transient_study(
            study, output, machine=machine, overrides=set_ or (), restart=restart, progress=tell
        )
    _print_json(content) if as_json else print_transient(content, output)


@app.command()
def simulate(
    machine: Machine,
    recording: Annotated[Path, typer.Argument(help="Folder or .toml file of a recording.")],
    output: Folder,
    calibrate: Annotated[
        list[Path] | None,
        typer.Option(
            "--calibrate",
            metavar="FILE",
            help="Recording that may move the uncertain parameters; repeatable.",
        ),
    ] = None,
    set_: Overrides = None,
    as_json: AsJson = False,
) -> None:
    """What every channel of a recording should have read, beside what it read."""
    from spindle_fem.commands.console import print_simulation, stages
    from spindle_fem.commands.simulate_command import simulate_machine

    with stages(not as_json) as tell:
        content = simulate_machine(
            machine, recording, output, calibrate=calibrate or (), overrides=set_ or (), progress=tell
        )
    _print_json(content) if as_json else print_simulation(content, output)


@app.command()
def diagnose(
    machine: Machine,
    recordings: Annotated[
        list[Path], typer.Argument(help="Folders or .toml files of the recordings to be explained.")
    ],
    output: Folder,
    calibrate: Calibrate = None,
    heldout: Annotated[
        str,
        typer.Option(
            "--heldout",
            metavar="CHOICE",
            help='Readings that the fit does not see: "blocks" or "last:0.4" (the last 40 % of the time).',
        ),
    ] = "blocks",
    full_model: Annotated[
        str,
        typer.Option(
            "--full-model",
            metavar="auto|off|coarse|own",
            help="Run both fits again by the full finite-element model: on the coarse mesh with linear "
            "temperatures (auto: unless it takes very many time steps) or on the machine's own mesh "
            "(much longer).",
        ),
    ] = "auto",
    set_: Overrides = None,
    as_json: AsJson = False,
) -> None:
    """Where a recording and the model differ, which physics was left out, and how the fit improves.

    ``diagnose --plan MACHINE -o DIR``, before anything is measured: which effects the sensors and a test
    could tell apart; the same as ``spindle-fem plan``. A folder with several recordings in it is diagnosed
    one by one; ``diagnose --jobs N`` or ``--cluster ADDRESS`` does so abreast (``spindle-fem
    diagnose-folder``).
    """
    from spindle_fem.recordings.recording_folder import recordings_in

    if len(recordings) == 1 and recordings_in(recordings[0], calibrate or ()):
        _diagnose_folder(
            _folder_order(machine, calibrate, set_, heldout, full_model), recordings[0], output, "1", as_json
        )
        return
    from spindle_fem.commands.console import print_diagnosis, stages
    from spindle_fem.commands.diagnose_command import diagnose as diagnose_machine

    with stages(not as_json) as tell:
        content = diagnose_machine(
            machine,
            recordings,
            output,
            calibrate=calibrate or (),
            overrides=set_ or (),
            heldout=heldout,
            full_model=full_model,
            progress=tell,
        )
    _print_json(content) if as_json else print_diagnosis(content, output)


@app.command()
def diagnose_folder(
    machine: Machine,
    recordings: Annotated[Path, typer.Argument(help="Folder with several recordings.")],
    output: Folder,
    calibrate: Calibrate = None,
    full_model: Annotated[
        str, typer.Option("--full-model", metavar="auto|off|coarse|own", help="As of diagnose.")
    ] = "auto",
    jobs: Annotated[
        str,
        typer.Option(
            "--jobs",
            "-j",
            "--cluster",
            metavar="N|ADDRESS",
            help="Worker processes, 0 for one a core; or the address of a Dask scheduler.",
        ),
    ] = "1",
    set_: Overrides = None,
    as_json: AsJson = False,
) -> None:
    """Every recording of a folder diagnosed by itself, with a table (also diagnose --jobs)."""
    order = _folder_order(machine, calibrate, set_, "blocks", full_model)
    _diagnose_folder(order, recordings, output, jobs, as_json)


def _folder_order(
    machine: str, calibrate: list[Path] | None, set_: list[str] | None, heldout: str, full_model: str
) -> Any:
    from spindle_fem.commands.diagnose_folder_command import FolderOrder

    return FolderOrder(machine, tuple(calibrate or ()), tuple(set_ or ()), heldout, full_model)


def _diagnose_folder(order: Any, recordings: Path, output: Path, jobs: str, as_json: bool) -> None:
    from spindle_fem.commands.console import print_diagnoses, stages
    from spindle_fem.commands.diagnose_folder_command import diagnose_folder as diagnose_each

    own = jobs.lstrip("-").isdigit()
    with stages(not as_json) as tell:
        content = diagnose_each(
            order,
            recordings,
            output,
            jobs=int(jobs) if own else 1,
            scheduler=None if own else jobs,
            progress=tell,
        )
    _print_json(content) if as_json else print_diagnoses(content, output)


@app.command()
def plan(
    machine: Machine,
    output: Folder,
    test: Annotated[
        str,
        typer.Option(
            "--test",
            metavar="RECORDING|NAME",
            help="A recording whose inputs are used; or heat_up, steps, cool_down, with a length: steps:4h.",
        ),
    ] = "steps",
    sensors: Annotated[
        list[str] | None,
        typer.Option(
            "--sensors",
            metavar="NAME[=NOISE],...",
            help="Probes or nodes that are read, with their noise: SP01,SP04=0.05K; all=0.2K. Default: every "
            "one of the definition (or of the recording), 0.1 K.",
        ),
    ] = None,
    inputs: Annotated[
        list[str] | None,
        typer.Option(
            "--input",
            metavar="NAME=VALUE",
            help='Input at full load in a standard test, with its unit, repeatable: speed="3000 rpm".',
        ),
    ] = None,
    calibrate: Calibrate = None,
    set_: Overrides = None,
    as_json: AsJson = False,
) -> None:
    """Before measuring: which effects the sensors and a test could tell apart (also diagnose --plan)."""
    from spindle_fem.commands.console import print_plan, stages
    from spindle_fem.commands.plan_command import plan as plan_measurement

    with stages(not as_json) as tell:
        content = plan_measurement(
            machine,
            output,
            test=test,
            sensors=sensors or (),
            inputs=inputs or (),
            calibrate=calibrate or (),
            overrides=set_ or (),
            progress=tell,
        )
    _print_json(content) if as_json else print_plan(content, output)


@app.command()
def watch(
    machine: Machine,
    recording: Annotated[
        Path,
        typer.Argument(help='Folder or .toml file of a recording that grows; data = "-": standard input.'),
    ],
    calibrate: Calibrate = None,
    warm_up: Annotated[
        str | None,
        typer.Option("--warm-up", metavar="TIME", help="Beginning of the recording that is taken as sound."),
    ] = None,
    false_alarms: Annotated[
        str, typer.Option("--false-alarms", metavar="RATE", help='Stated rate: "1/month", "1/week".')
    ] = "1/month",
    heartbeat: Annotated[
        str | None,
        typer.Option(
            "--heartbeat", metavar="TIME", help="A line at least so often, by the recording's clock."
        ),
    ] = None,
    until_end: Annotated[
        bool, typer.Option("--until-end", help="Stop at the end of what is there, instead of waiting.")
    ] = False,
    set_: Overrides = None,
) -> None:
    """Follow a recording that grows; one JSON object a line when its readings leave the model."""
    from spindle_fem.commands.watch_command import watch as watch_machine

    for line in watch_machine(
        machine,
        recording,
        calibrate=calibrate or (),
        overrides=set_ or (),
        warm_up=warm_up,
        false_alarms=false_alarms,
        heartbeat=heartbeat,
        until_end=until_end,
    ):
        typer.echo(json.dumps(line, ensure_ascii=False))


@app.command()
def report(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of an earlier command.")],
) -> None:
    """Rebuild the report of an output folder."""
    from spindle_fem.commands.report_command import rebuild

    typer.echo(f"wrote {rebuild(folder)}")


def main() -> None:
    """Entry point: exit status 0 done, 2 bad input, 1 anything else."""
    from spindle_fem.errors import SpindleFemError

    # The solver is bound by memory: more threads only wait for one another, spinning.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
    try:
        app(standalone_mode=True)
    except SpindleFemError as error:
        if _State.debug:
            raise
        typer.echo(f"{type(error).__name__}: {error}", err=True)
        sys.exit(error.exit_status)
    except OSError as error:
        if _State.debug:
            raise
        typer.echo(f"{type(error).__name__}: {error}", err=True)
        sys.exit(1)
