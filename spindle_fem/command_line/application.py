"""The application of the command line: its flags, the types of common arguments, what prints."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from spindle_fem import __version__

PLAN_FLAG, WORKER_FLAGS = "--plan", ("--jobs", "-j", "--cluster")
COMMON_FLAGS = ("--quiet", "-q", "--verbose", "-v", "--debug")
# As the help lists them: from a machine to its designs, its recordings and its files.
ORDER = (
    "new",
    "run",
    "check",
    "mesh",
    "heat",
    "bearing",
    "crosscheck",
    "sweep",
    "transient",
    "recording",
    "simulate",
    "diagnose",
    "diagnose-folder",
    "plan",
    "watch",
    "export",
    "view",
    "report",
    "examples",
)


def _without_values(options: list[Any]) -> list[Any]:
    """The same options; the help would list plain flags as if they took a value, ``<bool>``."""
    for option in options:
        if getattr(option, "is_flag", False) and option.metavar is None:
            option.metavar = ""
    return options


def _reflowed(text: str) -> str:
    r"""Paragraphs of a docstring for the terminal's own width, without the marks of code.

    >>> _reflowed("One\nline.\n\nSee ``run\n-o DIR``.")
    'One line.\n\nSee run -o DIR.'
    """
    paragraphs = (" ".join(part.split()) for part in text.replace("``", "").split("\n\n"))
    return "\n\n".join(paragraphs)


class _Commands(TyperGroup):
    """The commands; ``diagnose --plan`` and ``diagnose --jobs`` are commands of their own."""

    def list_commands(self, ctx: typer.Context) -> list[str]:
        """Names in the order of the help; those without a place in it last."""
        return sorted(
            super().list_commands(ctx), key=lambda name: ORDER.index(name) if name in ORDER else len(ORDER)
        )

    def get_params(self, ctx: typer.Context) -> list[Any]:
        """Options of the application; its flags take no value."""
        return _without_values(super().get_params(ctx))

    def get_command(self, ctx: typer.Context, cmd_name: str) -> Any:
        """Command of a name; its flags, and those of its own commands, take no value. Help is reflowed."""
        command = super().get_command(ctx, cmd_name)
        if command is not None:
            for each in (command, *getattr(command, "commands", {}).values()):
                _without_values(each.get_params(ctx))
                each.help = _reflowed(each.help or "")
        return command

    def parse_args(self, ctx: typer.Context, args: list[str]) -> list[str]:
        """Arguments with those that every command takes first, wherever they stand."""
        common = [item for item in args if item in COMMON_FLAGS]
        return super().parse_args(ctx, common + [item for item in args if item not in COMMON_FLAGS])

    def resolve_command(self, ctx: typer.Context, args: list[str]) -> tuple[str | None, Any, list[str]]:
        """Command that the arguments are for, and the remaining arguments."""
        if args[0] == "diagnose" and PLAN_FLAG in args:
            args = ["plan", *(item for item in args[1:] if item != PLAN_FLAG)]
        elif args[0] == "diagnose" and any(item.partition("=")[0] in WORKER_FLAGS for item in args):
            args = ["diagnose-folder", *args[1:]]
        return super().resolve_command(ctx, args)


app = typer.Typer(
    name="spindle-fem",
    cls=_Commands,
    help="Thermal finite elements for machine-tool spindles.",
    no_args_is_help=True,
    epilog="Exit status: 0 done, 2 bad input (the message names file, key, value and what is allowed), "
    "130 interrupted, 1 anything else.",
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
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Say nothing but errors.")] = False,
    verbose: Annotated[
        bool, typer.Option("--verbose", "-v", help="Every stage as a line with its time.")
    ] = False,
) -> None:
    from spindle_fem.commands.verbosity import choose_verbosity

    State.debug, State.quiet = debug, quiet
    choose_verbosity(quiet=quiet, verbose=verbose)


class State:
    """Options given before every command."""

    debug = False
    quiet = False


def print_json(content: Any) -> None:
    """Print what a command found."""
    typer.echo(json.dumps(content, indent=2, ensure_ascii=False))


def say(text: str) -> None:
    """Print a line, unless the command is to be quiet."""
    if not State.quiet:
        typer.echo(text)
