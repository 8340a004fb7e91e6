"""The command line: parse, call one function, print."""

from __future__ import annotations

import atexit
import gc
import os
import sys
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from spindle_fem.command_line import diagnosis_commands, recording_commands
from spindle_fem.command_line.application import (
    AsJson,
    Folder,
    Machine,
    Overrides,
    State,
    app,
    print_json,
    say,
)

# Exit status of a command that the user ends.
INTERRUPTED = 130
# Modules whose commands are part of the application once they are imported.
FAMILIES = (diagnosis_commands, recording_commands)
# Objects made until garbage is looked for: a command makes many that last, and is over soon. A chart makes
# some 20,000.
COLLECT_AFTER = 50_000


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
    solid_growth: Annotated[
        bool, typer.Option("--solid-growth", help="Also work out growth in three dimensions, on the mesh.")
    ] = False,
) -> None:
    """Geometry, mesh, heat, films, solve, pictures, report."""
    from spindle_fem.commands.console import print_run
    from spindle_fem.commands.machine_commands import run_machine

    run_machine(
        machine,
        output,
        overrides=set_ or (),
        estimate_mesh_error=estimate_mesh_error,
        solid_growth=solid_growth,
        progress=not as_json,
        shown=print_json if as_json else partial(print_run, folder=output),
    )


@app.command()
def new(
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="FILE", help="Definition to write, .toml")
    ],
    front: Annotated[str, typer.Option(help="Ball bearings in front, as they are called.")] = "7014 C",
    rear: Annotated[str, typer.Option(help="Ball bearings behind, of a smaller bore.")] = "7012 C",
    drive: Annotated[str, typer.Option(help="belt, motor (built in) or coupling.")] = "belt",
    cooling: Annotated[str, typer.Option(help="helix (water in the housing) or none.")] = "helix",
    speed: Annotated[str, typer.Option(help="With its unit.")] = "4000 rpm",
) -> None:
    """Write a commented machine to start from."""
    from spindle_fem.commands.new_command import NewMachine, new_machine

    picture = output.with_suffix(".png")
    written = new_machine(output, NewMachine(front, rear, drive, cooling, speed))
    say(f"wrote {written}; next: spindle-fem check {output} --picture {picture}")


@app.command()
def check(
    machine: Machine,
    set_: Overrides = None,
    as_json: AsJson = False,
    picture: Annotated[
        Path | None, typer.Option("--picture", metavar="FILE", help="Draw it, faults marked, .png")
    ] = None,
) -> None:
    """Validate a machine without solving; every fault at once."""
    from spindle_fem.commands.console import print_check
    from spindle_fem.commands.machine_commands import check_machine
    from spindle_fem.errors import BadInputError

    try:
        content = check_machine(machine, overrides=set_ or (), picture=picture)
    except BadInputError as error:
        if as_json:
            print_json({"faults": [fault.as_plain() for fault in getattr(error, "faults", (error,))]})
        raise
    print_json(content) if as_json else print_check(content, picture)


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
    print_json(content) if as_json else print_pairs(f"wrote {output}", content)


@app.command()
def export(
    machine: Machine,
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="FILE", help=".npz, .json, .py, .c or .fmu")
    ],
    recording: Annotated[
        list[Path] | None,
        typer.Option("--recording", help="Recording whose speeds and thrusts the model holds; repeatable."),
    ] = None,
    set_: Overrides = None,
    as_json: AsJson = False,
) -> None:
    """Write the fast model for other programs, such as a control that compensates thermal growth."""
    from spindle_fem.commands.console import print_export, stages
    from spindle_fem.commands.export_command import export_machine

    with stages(not as_json) as tell:
        content = export_machine(machine, output, set_ or (), recording or (), progress=tell)
    print_json(content) if as_json else print_export(content)


@app.command()
def heat(
    machine: Machine,
    speed: Annotated[
        list[str] | None,
        typer.Option("--speed", help='Speeds, repeatable: "3000 rpm"; default: up to 1.5 times its own.'),
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
    print_json(content) if as_json else print_heat(content, output)


@app.command()
def bearing(
    file: Annotated[
        Path, typer.Argument(help=r"TOML with \[bearing], \[operation] and perhaps \[lubricant].")
    ],
    picture: Annotated[
        Path | None, typer.Option("--picture", metavar="FILE", help="Draw the loads around each row, .png")
    ] = None,
    every: Annotated[
        bool, typer.Option("--every", help="Show balls and rollers that are alike too.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """One bearing or one preloaded set, without a machine."""
    from spindle_fem.commands.bearing_console import print_bearing
    from spindle_fem.physics.bearings.bearing_file import bearing_report

    content = bearing_report(file)
    if picture is not None:
        from spindle_fem.report.bearing_chart import write_bearing_chart

        write_bearing_chart(content, picture)
    print_json(content) if as_json else print_bearing(content, every=every)


@app.command()
def crosscheck(machine: Machine, output: Folder, set_: Overrides = None, as_json: AsJson = False) -> None:
    """Lumped network beside the FEM, node by node, and why they differ."""
    from spindle_fem.commands.console import print_crosscheck, stages
    from spindle_fem.commands.crosscheck_command import crosscheck_machine

    with stages(not as_json) as tell:
        content = crosscheck_machine(machine, output, overrides=set_ or (), progress=tell)
    print_json(content) if as_json else print_crosscheck(content, output)


@app.command()
def sweep(
    machine: Machine,
    study: Annotated[
        Path, typer.Argument(help="TOML with parameters, design and outputs, or one that ships.")
    ],
    output: Folder,
    jobs: Annotated[int, typer.Option("--jobs", "-j", min=0, help="Worker processes; 0 for one a core.")] = 1,
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
    print_json(content) if as_json else print_sweep(content, output)


@app.command()
def transient(
    study: Annotated[
        Path, typer.Argument(help="TOML with phases, or the name of one that ships: heat_up_3000rpm.")
    ],
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
    print_json(content) if as_json else print_transient(content, output)


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
    print_json(content) if as_json else print_simulation(content, output)


@app.command()
def view(
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="Folder of run, transient, sweep, simulate or diagnose.")
    ],
    open_page: Annotated[bool, typer.Option("--open", help="Open the page in the browser.")] = False,
    design: Annotated[
        int | None, typer.Option("--design", metavar="N", help="Design of a sweep; default its optimum.")
    ] = None,
) -> None:
    """Write DIR/view.html: field in 3-D with a movable cut, times, growth, histories."""
    from spindle_fem.commands.console import stages
    from spindle_fem.commands.view_command import view_folder

    with stages(True) as tell:
        page = view_folder(folder, design=design, progress=tell)
    say(f"wrote {page}")
    if open_page:
        typer.launch(page.resolve().as_uri())


@app.command()
def report(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of an earlier command.")],
) -> None:
    """Rebuild the report of an output folder."""
    from spindle_fem.commands.report_command import rebuild

    say(f"wrote {rebuild(folder)}")


@app.command()
def examples(
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="DIR", help="Gets examples/ and studies/.")
    ],
) -> None:
    """Copy the example scripts and the studies that ship; files that are there already stay."""
    from spindle_fem.studies.shipped_files import copy_shipped

    say(f"wrote {len(copy_shipped(output))} files to {output}")


def main() -> None:
    """Entry point: exit status 0 done, 2 bad input, 130 interrupted, 1 anything else."""
    from spindle_fem.errors import SpindleFemError, of_system

    gc.set_threshold(COLLECT_AFTER)
    # Else the interpreter looks for garbage once more as it ends, for half a second after a diagnosis.
    atexit.register(gc.freeze)
    # The solver is bound by memory: more threads only wait for one another, spinning.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
    try:
        app(standalone_mode=True)
    except SystemExit as ended:
        if ended.code == INTERRUPTED:
            typer.echo("Interrupted; the same command goes on or begins again.", err=True)
        raise
    except SpindleFemError as error:
        if State.debug:
            raise
        typer.echo(f"{type(error).__name__}: {error}", err=True)
        sys.exit(error.exit_status)
    except OSError as error:
        if State.debug:
            raise
        own = of_system(error)
        typer.echo(f"{type(own).__name__}: {own}", err=True)
        sys.exit(getattr(own, "exit_status", 1))
