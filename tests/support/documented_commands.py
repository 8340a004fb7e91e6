"""Commands of the README and of ``docs/`` as a reader copies them, and stand-ins for what they leave open."""

import copy
import re
import shlex
import shutil
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from spindle_fem.definition.load import find_machine, read_definition
from spindle_fem.definition.network_load import is_network_machine
from spindle_fem.recordings.recordable_names import recordable_names
from tests.support.written_texts import manifest_text

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
TOOLS = ("spindle-fem", "make", "pip", "python")
SPINDLE, NETWORK = "small_two_start", "pump.toml"
# Commands that only a machine with geometry has, and those of which only such a machine takes long.
OF_SPINDLES = {"run", "mesh", "heat", "crosscheck", "sweep", "transient"}
LONG = {"run", "crosscheck", "sweep", "transient", "--coupled"}
LONG_WITH_GEOMETRY = {"simulate", "diagnose", "diagnose-folder", "plan", "watch", "export"}
# Words for recordings; those of files are made when they are asked for.
RECORDED = re.compile(r"RECORDING|EARLIER|OTHER|(?:test|calibration)_\d\.toml")
COARSE = ["--set", "mesh.preset=coarse"]


@dataclass(frozen=True)
class Documented:
    """One command of a page.

    Attributes
    ----------
    words : tuple of str
        As typed, without what stands in brackets.
    optional : tuple of str
        Flags that stand in brackets.
    is_mention : bool
        Whether a sentence only names the command.
    """

    line: int
    words: tuple
    optional: tuple
    is_mention: bool


def documented(page):
    """Every command of a page, in its order."""
    text = page.read_text(encoding="utf-8")
    fenced = re.finditer(r"^```(\w*)\n(.*?)^```", text, re.M | re.S)
    lines = {}
    for block in fenced:
        if block[1] in ("", "sh"):
            lines |= _lines_of(text, block.start(2), block[2])
    plain = re.sub(r"^```\w*\n.*?^```", lambda m: re.sub(r"[^\n]", " ", m[0]), text, flags=re.M | re.S)
    for block in re.finditer(rf"^ {{4}}(?:{'|'.join(TOOLS)}) .*\n(?:(?<=\\\n) +\S.*\n)*", plain, re.M):
        lines |= _lines_of(text, block.start(), block[0])
    spans = {span.start(): " ".join(span[1].split()) for span in re.finditer(r"`([^`]+)`", plain)}
    found = [(start, line, False) for start, line in lines.items()]
    found += [(start, line, True) for start, line in spans.items()]
    commands = []
    for start, line, in_sentence in sorted(found):
        bare = OPTIONAL.sub(" ", re.sub(r"\s#.*", "", line)).strip()
        words = tuple(shlex.split(bare)) if bare.startswith(TOOLS) else ("",)
        if words[0] in TOOLS:
            optional = tuple(re.findall(r"\[(--[\w-]+)", line))
            mention = in_sentence and len(words) < 3 and not re.search(r" -|\b[A-Z]{3,}\b", bare)
            commands.append(Documented(text.count("\n", 0, start) + 1, words, optional, mention))
    return commands


# What may be left out, with the dots of what may be repeated.
OPTIONAL = re.compile(r"\s\[-.*?\](?:\.\.\.)?(?=\s|$)")


def _lines_of(text, start, block):
    """Lines of a block by their place in the page, those that go on joined to their first."""
    joined, last = {}, start
    for line in block.splitlines(keepends=True):
        goes_on = joined and (joined[last].endswith("\\") or re.match(r" {10,}[\[-]", line))
        if goes_on:
            joined[last] = f"{joined[last].rstrip(chr(92))} {line.strip()}"
        else:
            last = start
            joined[last] = line.strip()
        start += len(line)
    return joined


def blocks_of(page, language):
    """Fenced blocks of a page in a language."""
    text = page.read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.M | re.S)


class Reader:
    """Somebody who copies the commands of a page one after another in one folder.

    Parameters
    ----------
    folder : Path
        Empty; gets what commands stand on: machines, recordings, studies.
    """

    def __init__(self, folder):
        self.folder = folder
        self.place = None  # the last folder that a command wrote
        self.number = 0
        for name in ("studies", "geometry"):
            shutil.copytree(ROOT / name, folder / name)
        shutil.copy(ROOT / "examples" / NETWORK, folder)
        bearing = next(b for b in blocks_of(ROOT / "docs" / "command_line.md", "toml") if "[bearing]" in b)
        (folder / "bearing.toml").write_text(bearing, encoding="utf-8")
        (folder / "study.toml").write_text(STUDY, encoding="utf-8")
        german_csv(folder / "measured.csv")
        for name in ("recording_of_pump", "several/one", "several/two"):
            made_recording(folder / name, folder / NETWORK)

    def in_a_copy(self, folder):
        """Another one, in a new folder, who has the same."""
        shutil.copytree(self.folder, folder)
        other = copy.copy(self)
        other.folder = folder
        return other

    def is_long(self, command):
        """Whether a command takes more than seconds."""
        words = command.words
        if words[1] in LONG or LONG & set(words):
            return True
        return words[1] in LONG_WITH_GEOMETRY and not self._is_network(self._machine(command))

    def arguments(self, command):
        """What is typed for a command of spindle-fem, its placeholders filled in."""
        name, machine = command.words[1], self._machine(command)
        given = [name]
        for number, word in enumerate(command.words[2:], 2):
            stem = word.removesuffix("...")
            if stem == "DIR" and command.words[number - 1] == "-o":
                self.number += 1
                self.place = self.folder / f"out_{self.number}"
                given.append(self.place)
            elif stem == "DIR":
                given.append(self.place or self.folder / "finished")
            elif RECORDED.fullmatch(stem):
                given.append(self._recording(stem, machine))
            else:
                given.append(self._stand_in(stem, name, machine))
        if name == "watch":
            given.append("--until-end")
            # a network's noise is not known before
            given += ["--warm-up", "20 min"] if self._is_network(machine) else []
        if name in ("--install-completion", "--show-completion"):
            given.append("bash")
        geometry = self.is_long(command) or name == "mesh"
        if geometry and name not in ("report", "view", "diagnose-folder") and COARSE[1] not in given:
            given += COARSE
        return [str(item) for item in given]

    def _machine(self, command):
        words = command.words
        if "--machine" in words:
            return words[words.index("--machine") + 1]
        named = [word for word in words[2:] if word.endswith("machine.toml") or word in SHIPPED]
        if named or "MACHINE" not in words:
            return named[0] if named else NETWORK
        return SPINDLE if words[1] in OF_SPINDLES or "--picture" in words else NETWORK

    def _is_network(self, machine):
        path = self.folder / machine
        return path.name == NETWORK or (
            path.name in SHIPPED and is_network_machine(read_definition(find_machine(machine)))
        )

    def _recording(self, stem, machine):
        if machine == NETWORK:
            return self.folder / "recording_of_pump"
        place = self.folder / (stem if stem.endswith(".toml") else f"{stem}_of_{machine}")
        if not place.exists():
            made_recording(place, machine)
        return place

    def _stand_in(self, word, name, machine):
        files = {
            "bearing": "bearing.toml",
            "check": NETWORK,
            "export": "model.npz",
            "new": "another.toml",
            "recording": "measured.csv",
            "diagnose": "several",
        }
        known = {"MACHINE": machine, "FILE": files.get(name), "FOLDER": "several", "STUDY": "study.toml"}
        if name == "view" and not word.startswith("-") and not (self.folder / word).exists():
            return "finished"
        return known.get(word, word)


SHIPPED = {path.stem for path in (ROOT / "geometry").glob("*.toml")}
STUDY = """
schema = "spindle-fem/study/1"
[[parameter]]
path = "coolant.flow"
values = ["5 L/min", "8 L/min"]
[study]
design = "grid"
outputs = ["temperature.max_degC"]
"""
# Of recordings: s, an hour by the minute.
TIMES = np.arange(0.0, 3601.0, 60.0)
SWITCHED_ON = 600.0
USUAL = {
    "speed": 1500.0,
    "thrust": 800.0,
    "power": 80.0,
    "electrical_power": 80.0,
    "ambient": 21.0,
    "coolant_inlet": 17.0,
}
STEADY = ("ambient", "coolant_inlet")


def german_csv(path):
    """What a German measuring device writes: preamble, semicolons, decimal commas, dates by day, Latin-1."""
    names = ["Datum", "Uhrzeit", "Drehzahl", "Temperatur Lager vorne", "Temperatur Lager hinten"]
    names += ["Hallentemperatur", "Kühlmittel Vorlauf", "Kühlmittel Rücklauf"]
    lines = ["Messprotokoll Frässpindel;;", "", ";".join(names), "TT.MM.JJJJ;hh:mm:ss;1/min;°C;°C;°C;°C;°C"]
    noise = np.random.default_rng(1).normal(0.0, 0.05, (TIMES.size, 5))
    for time, own in zip(TIMES, noise, strict=True):
        stamp = pd.Timestamp("2026-03-09 07:30:00") + pd.Timedelta(seconds=time)
        warmed = 12.0 * (1.0 - np.exp(-time / 2000.0))
        values = np.array([22.0 + warmed, 22.0 + 0.8 * warmed, 22.0, 20.0, 20.0 + 0.05 * warmed]) + own
        cells = [f"{stamp:%d.%m.%Y}", f"{stamp:%H:%M:%S}", "4000", *(f"{v:.2f}" for v in values)]
        lines.append(";".join([cells[0], *(cell.replace(".", ",") for cell in cells[1:])]))
    path.write_bytes("\r\n".join([*lines, ""]).encode("latin-1"))


def made_recording(place, machine):
    """A recording of a machine that is switched on: everything warms by some kelvin, with noise.

    Parameters
    ----------
    place : Path
        Folder to make, or the manifest to write beside data of its own.
    """
    names = recordable_names(str(machine))
    manifest = place if place.suffix == ".toml" else place / "recording.toml"
    manifest.parent.mkdir(parents=True, exist_ok=True)
    noise = np.random.default_rng(sum(place.name.encode())).normal(0.0, 0.1, (TIMES.size, len(names.probes)))
    since = TIMES - SWITCHED_ON
    warmed = 21.0 + np.where(since > 0.0, 8.0 * (1.0 - np.exp(-since / 1500.0)), 0.0)
    data = {"t": TIMES} | {f"T{i}": warmed + own for i, own in enumerate(noise.T)}
    drives = [name for name in names.inputs if name in USUAL]
    switched = np.where(since >= 0.0, 1.0, 0.0)
    data |= {name: USUAL[name] * (np.ones(TIMES.size) if name in STEADY else switched) for name in drives}
    own = f"{manifest.stem}.csv"
    pd.DataFrame(data).to_csv(manifest.parent / own, index=False)
    probes = {f"T{i}": probe for i, probe in enumerate(names.probes)}
    text = manifest_text("made", probes, {name: name for name in drives}, data=own, time="t")
    manifest.write_text(text, encoding="utf-8")
