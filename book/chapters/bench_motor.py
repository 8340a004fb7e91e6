"""Bench motor: a real recording, blind."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from book.diagnoses import (
    finished,
    found_blocks,
    next_step_blocks,
    own_pictures,
    place_blocks,
    verdict_blocks,
)
from book.page import Chapter, Pictures
from book.work import ROOT, Desk, read_json
from spindle_fem.report.block_page import Commands, Notice, Section, Table, Text
from spindle_fem.report.diagnosis_words import chance, set_words
from spindle_fem.report.table_rows import column, number, rows_of, significant

TITLE = "Bench motor: real recordings, blind"
FOLDER = "bench_motor"
MACHINE = ROOT / "geometry" / "bench_motor.toml"
CALIBRATION = tuple(f"calibration_{n}.toml" for n in (1, 2, 3))
TESTS = ("test_1", "test_2")
PICTURES = ("before_after", "residual_map", "sets", "findings", "where", "missing_heat", "parameters")


def make(desk: Desk, pictures: Pictures) -> Chapter:
    """Calibrate on the calibration runs, diagnose either test run by itself, predict the end of it."""
    place = desk.real(FOLDER)
    commands = [_command(test) for test in TESTS] + [_command(test, heldout=True) for test in TESTS]
    if place is None:
        return Chapter(
            outcome=f"Left out: the recordings “{FOLDER}” are not in {desk.recordings.name}.",
            commands=commands,
            left_out="The recordings are not part of the repository; give their folder with --recordings.",
        )
    step = desk.step("bench_motor", lambda folder: _run(place, folder), inputs={"heldout": "last:0.4"})
    found = {test: read_json(step.folder / test / "diagnosis.json") for test in TESTS}
    ahead = {
        test: read_json(step.folder / f"{test}_ahead" / "diagnosis.json")
        for test in TESTS
        if (step.folder / f"{test}_ahead" / "diagnosis.json").is_file()
    }
    sections = [
        Section(
            "set-up",
            "What is known, and what is done",
            [
                Text(
                    "Two temperatures, the room, the electrical power and the electrical speed; no "
                    "drawings and no masses. The network of winding, stator body and room is written from "
                    "the size of such motors, every value as a range. Three runs calibrate it. Either "
                    "test run is then diagnosed by itself: the tool knows neither whether its conditions "
                    "differ from those of the calibration nor how."
                ),
                _summary(found, ahead),
            ],
        )
    ]
    for test in TESTS:
        content, folder = found[test], step.folder / test
        blocks: list[Any] = [
            *verdict_blocks(content),
            *own_pictures(folder, PICTURES, pictures, f"{test}_"),
            *found_blocks(content),
            *place_blocks(content),
            *next_step_blocks(content),
        ]
        sections.append(Section(test, f"{content['recordings'][0]}: the whole run", blocks))
        if test in ahead:
            sections.append(
                Section(
                    f"{test}-ahead",
                    f"{content['recordings'][0]}: the first 60 % fitted, the rest predicted",
                    [
                        Commands([_command(test, heldout=True)]),
                        *verdict_blocks(ahead[test]),
                        *own_pictures(
                            step.folder / f"{test}_ahead",
                            ["before_after", "findings"],
                            pictures,
                            f"{test}_ahead_",
                        ),
                        *found_blocks(ahead[test]),
                    ],
                )
            )
        else:
            words = "The run is consistent with the calibrated machine: no physics to fit and extrapolate."
            sections.append(Section(f"{test}-ahead", "The rest of the run", [Notice(words, "good")]))
    return Chapter(
        outcome=" ".join(_outcome(test, found[test], ahead.get(test)) for test in TESTS),
        sections=sections,
        commands=commands,
        evidence=[
            "The test runs were never used to write the network; its ranges come from the size of such "
            "motors.",
            "Held-out readings of a test run, and in the second pass its last 40 %, never enter a fit.",
        ],
        not_evidence=[
            "Nobody has told the answer: what was changed on the bench is not documented, so that a "
            "verdict can be judged by its predictions only, not by the truth.",
            "With two sensors, effects that warm the same node in the same way cannot be told apart; the "
            "tool's names are those of its catalogue.",
            "The sensors' noise is declared by the recording's author, not measured here.",
        ],
    )


def _command(test: str, *, heldout: bool = False) -> str:
    where = f"../shared/recordings/{FOLDER}"
    given = " ".join(f"--calibrate {where}/{name}" for name in CALIBRATION)
    name = f"{test}_ahead" if heldout else test
    ahead = " --heldout last:0.4" if heldout else ""
    return (
        f"spindle-fem diagnose bench_motor {where}/{test}.toml {given}{ahead} -o runs/book/bench_motor/{name}"
    )


def _run(place: Path, folder: Path) -> None:
    from spindle_fem.commands.diagnose_command import diagnose

    calibrate = [place / name for name in CALIBRATION]
    for test in TESTS:
        if not finished(folder / test):
            diagnose(MACHINE, [place / f"{test}.toml"], folder / test, calibrate=calibrate)
        verdict = read_json(folder / test / "diagnosis.json")["verdict"]
        ahead = folder / f"{test}_ahead"
        if verdict != "consistent" and not finished(ahead):
            diagnose(MACHINE, [place / f"{test}.toml"], ahead, calibrate=calibrate, heldout="last:0.4")


def _outcome(test: str, content: dict[str, Any], ahead: dict[str, Any] | None) -> str:
    fit = content["fit"]
    words = (
        f"{content['recordings'][0].partition(', ')[2] or test}: {content['verdict'].replace('_', ' ')}"
        + (
            f" ({set_words(content['findings'])}, {chance(content['set_probability'])})"
            if content["findings"]
            else ""
        )
        + f"; held-out error {number(fit['before']['heldout_rmse_K'], 2)} → "
        f"{number(fit['after']['heldout_rmse_K'], 2)} K, noise {number(fit['noise_K'], 2)} K"
    )
    if ahead is not None:
        later = ahead["fit"]
        words += (
            f"; last 40 % predicted to {number(later['after']['heldout_rmse_K'], 2)} K instead of "
            f"{number(later['before']['heldout_rmse_K'], 2)} K"
        )
    return words[0].upper() + words[1:] + "."


def _summary(found: dict[str, Any], ahead: dict[str, Any]) -> Table:
    rows = []
    for test, content in found.items():
        for name, item in ((test, content), (f"{test}, last 40 % predicted", ahead.get(test))):
            if item is None:
                continue
            fit = item["fit"]
            rows.append(
                [
                    name.replace("_", " "),
                    item["verdict"].replace("_", " "),
                    set_words(item["findings"]) if item["findings"] else "",
                    chance(item["set_probability"]),
                    significant(item["mismatch"]["p_value"], 2),
                    *(number(fit[key]["heldout_rmse_K"], 2) for key in ("before", "after")),
                    number(fit["noise_K"], 2),
                ]
            )
    columns = (
        column("run"),
        column("verdict"),
        column("found"),
        column("probability", number=True),
        column("p", number=True),
        column("held out before / K", number=True),
        column("held out after / K", number=True),
        column("noise / K", number=True),
    )
    return Table(columns, rows_of(rows), "Held out: stretches through the run, or its last 40 %.")
