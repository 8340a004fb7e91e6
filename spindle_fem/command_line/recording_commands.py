"""``spindle-fem recording draft`` and ``recording show``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from spindle_fem.command_line.application import AsJson, Folder, app, print_json, say

recording_app = typer.Typer(help="Measurement files: a manifest drafted for them; a recording drawn.")
app.add_typer(recording_app, name="recording")


@recording_app.command("draft")
def recording_draft(
    files: Annotated[
        list[Path],
        typer.Argument(
            metavar="FILE...", help="CSV, TSV, Excel, Parquet, HDF5 or TDMS of a measuring device."
        ),
    ],
    output: Folder,
    machine: Annotated[
        str | None, typer.Option("--machine", help="Machine whose probes and inputs the columns stand for.")
    ] = None,
    zone: Annotated[
        str | None,
        typer.Option("--zone", metavar="NAME", help="Time zone of stamps without one: Europe/Berlin."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Guess what each column means; write a manifest to check, clean data and a picture."""
    from spindle_fem.commands.console import print_draft
    from spindle_fem.commands.recording_command import draft

    content = draft(files, output, machine=machine, zone=zone)
    print_json(content) if as_json else print_draft(content, output)


@recording_app.command("show")
def recording_show(
    recording: Annotated[Path, typer.Argument(help="Folder or .toml file of a recording.")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FILE", help="Picture, .png")],
) -> None:
    """Draw every channel of a recording, with gaps and what is not used marked."""
    from spindle_fem.commands.recording_command import show

    say("\n".join([*show(recording, output), f"wrote {output}"]))
