"""``spindle-fem diagnose``, ``diagnose-folder``, ``plan`` and ``watch``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import typer

from spindle_fem.command_line.application import (
    AsJson,
    Calibrate,
    Folder,
    Machine,
    Overrides,
    app,
    print_json,
)


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
    from spindle_fem.commands.usual_time import DIAGNOSIS_SHARES

    with stages(not as_json, DIAGNOSIS_SHARES) as tell:
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
    print_json(content) if as_json else print_diagnosis(content, output)


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
    if own and int(jobs) < 0:
        raise typer.BadParameter("Input should be greater than or equal to 0", param_hint="--jobs")
    with stages(not as_json) as tell:
        content = diagnose_each(
            order,
            recordings,
            output,
            jobs=int(jobs) if own else 1,
            scheduler=None if own else jobs,
            progress=tell,
        )
    print_json(content) if as_json else print_diagnoses(content, output)


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
            help="Probes, nodes or displacement sensors that are read, with their noise: "
            "SP01,SP04=0.05K,S1=0.5um; all=0.2K. Default: every one of the definition (or of the recording), "
            "0.1 K and 0.3 um.",
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
    print_json(content) if as_json else print_plan(content, output)


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
