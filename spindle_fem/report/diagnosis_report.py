"""Report of a diagnosis, from the files of its folder alone."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from matplotlib.figure import Figure

from spindle_fem.definition.load import load_machine
from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.errors import BadInputError, SpindleFemError
from spindle_fem.inference.diagnosis_content import SCHEMA
from spindle_fem.report.block_page import (
    Bullets,
    Illustration,
    Notice,
    Section,
    Text,
    illustration_of,
    render_document,
)
from spindle_fem.report.diagnosis_charts import missing_heat, residual_map
from spindle_fem.report.diagnosis_data import DATA_SCHEMA
from spindle_fem.report.diagnosis_drawing import located_on_machine, located_on_network
from spindle_fem.report.diagnosis_full_model import full_model_sections
from spindle_fem.report.diagnosis_odds import finding_intervals, machine_parameters, set_probabilities
from spindle_fem.report.diagnosis_tables import (
    cards,
    channel_table,
    defect_blocks,
    fit_table,
    misdescription_blocks,
    next_blocks,
    parameter_tables,
    place_tables,
    set_tables,
    where_text,
)
from spindle_fem.report.diagnosis_words import (
    VERDICTS,
    checks,
    confidence_words,
    found_words,
    is_one_fit,
    place_named,
    sensors_named,
    verdict_sentence,
)
from spindle_fem.report.figure_style import save_png
from spindle_fem.report.read_against_predicted import before_after, displaced_before_after
from spindle_fem.results.dataset import load_netcdf
from spindle_fem.results.output_folder import read_content, replace_text

if TYPE_CHECKING:
    import xarray as xr

CAPTIONS = {
    "before_after": "Readings, the model, and what it leaves; shaded: not fitted.",
    "displacements": "Displacements as read, the model, and what it leaves, but for where the sensor was "
    "set; shaded: not fitted.",
    "residual_map": "Root mean square residual by channel and condition.",
    "sets": "Sets of effects that were fitted to the end, the told one first, with their probability; none "
    "where it is ruled out or too small to be stated. Misfit: root mean square of what it leaves of the "
    "readings, in widths of their noise and slow error.",
    "findings": "Parameters of the findings, with 90 % intervals.",
    "parameters": "The machine's own uncertain parameters, prior against posterior.",
    "where": "How well heat that is missing at one place only would explain the readings.",
    "missing_heat": "Heat over time that would explain the readings, at each credible place alone.",
}


def draw_ahead(folder: str | Path, content: Mapping[str, Any]) -> dict[str, list[Illustration]]:
    """``figures`` of a folder that holds ``diagnosis.nc``, but for what the full model's check may change.

    Parameters
    ----------
    folder : str or Path
        The drawing of the machine needs ``improved_machine.toml`` or ``machine.toml`` too.
    content : mapping
        Of ``diagnosis.json``; neither the full model nor what to measure next is drawn.

    Returns
    -------
    dict of kind to list of Illustration

    Raises
    ------
    BadInputError
    """
    folder = Path(folder)
    data = _read_data(folder / "diagnosis.nc")
    return {} if data is None else _drawn(_figures(content, data, folder), folder)


def _drawn(figures: Iterable[tuple[str, Figure]], folder: Path) -> dict[str, list[Illustration]]:
    """Figures saved in a folder, by kind."""
    place = folder / "figures"
    place.mkdir(exist_ok=True)
    pictures: dict[str, list[Illustration]] = {}
    for name, figure in figures:
        path = save_png(figure, place / f"{name}.png")
        kind = name.rpartition("_recording_")[0] or name
        pictures.setdefault(kind, []).append(illustration_of(path, CAPTIONS[kind]))
    return pictures


def write_diagnosis_report(
    folder: str | Path, pictures: Mapping[str, list[Illustration]] | None = None
) -> Path:
    """``report.html`` and ``figures`` of a folder that holds ``diagnosis.json`` and ``diagnosis.nc``.

    Parameters
    ----------
    pictures : mapping of kind to list of Illustration, optional
        What :func:`draw_ahead` has drawn already.

    Returns
    -------
    Path
        Of the report.

    Raises
    ------
    BadInputError
        ``diagnosis.json`` is missing or of a version that this program does not know.
    """
    folder = Path(folder)
    content = read_content(folder / "diagnosis.json", SCHEMA, "diagnose")
    pictures = draw_ahead(folder, content) if pictures is None else pictures
    if (data := _read_data(folder / "diagnosis.nc")) is not None:
        pictures = {**pictures, **_drawn([("sets", set_probabilities(data, content))], folder)}
    return replace_text(folder / "report.html", render(content, pictures))


def _read_data(path: Path) -> xr.Dataset | None:
    """Dataset of the folder; None if the recording was too short on information to make one."""
    if not path.is_file():
        return None
    data = load_netcdf(path)
    if data.attrs.get("schema") != DATA_SCHEMA:
        raise BadInputError(
            str(path), f"schema {data.attrs.get('schema')!r} is not known.", f"Allowed: {DATA_SCHEMA}."
        )
    return data


def _figures(content: Mapping[str, Any], data: xr.Dataset, folder: Path) -> Iterator[tuple[str, Figure]]:
    recordings = range(data.sizes["recording"])
    many = data.sizes["recording"] > 1

    def numbered(name: str, recording: int) -> str:
        return f"{name}_recording_{recording + 1}" if many else name

    for recording in recordings:
        yield numbered("before_after", recording), before_after(data, recording)
        displaced = displaced_before_after(data, recording)
        if displaced is not None:
            yield numbered("displacements", recording), displaced
    yield "residual_map", residual_map(data)
    sensors = sensors_named(content)
    places = [name for name in content["mismatch"]["where"]["credible"] if name not in sensors]
    found: list[tuple[str, Figure | None]] = [
        ("findings", finding_intervals(content["findings"], found_words(content))),
        ("parameters", machine_parameters(data)),
    ]
    if content["verdict"] != "consistent":
        spec = _machine(folder)
        drawn = (
            located_on_machine(data, spec, place_named(content), sensors_named(content))
            if spec is not None
            else located_on_network(data)
        )
        found.append(("where", drawn))
        found += [
            (numbered("missing_heat", recording), missing_heat(data, places, recording))
            for recording in recordings
        ]
    yield from ((name, figure) for name, figure in found if figure is not None)


def _machine(folder: Path) -> MachineSpec | None:
    """The machine with geometry of a folder; None where there is none."""
    for name in ("machine.toml", "improved_machine.toml"):
        if (folder / name).is_file():
            try:
                return load_machine(folder / name)
            except SpindleFemError:
                # A network, which is drawn as bars.
                continue
    return None


def render(content: Mapping[str, Any], pictures: Mapping[str, list[Any]]) -> str:
    """HTML of a diagnosis.

    Parameters
    ----------
    content : mapping
        Of ``diagnosis.json``.
    pictures : mapping of kind to list of illustrations
    """

    def of(*names: str) -> list[Any]:
        return [item for name in names for item in pictures.get(name, [])]

    tone = {"consistent": "good", "unexplained": "bad"}.get(content["verdict"], "")
    sections = [
        Section(
            "verdict",
            "Verdict",
            [
                Notice(verdict_sentence(content), tone),
                cards(content),
                Text("What to check on the machine:"),
                Bullets(checks(content) or ["Nothing that the catalogue names; see the next measurement."]),
            ],
        ),
        Section(
            "fit",
            "Readings and model" if is_one_fit(content["fit"]) else "Before and after",
            [
                fit_table(content),
                *of("before_after", "displacements", "residual_map"),
                *channel_table(content),
            ],
        ),
        *full_model_sections(content),
        Section("what", "Which physics", [*of("sets", "findings"), *set_tables(content)]),
    ]
    if content["verdict"] != "consistent":
        located = [*where_text(content), *of("where", "missing_heat"), *place_tables(content)]
        sections.append(Section("where", "Where and when", located))
    if open_directions := misdescription_blocks(content):
        sections.append(
            Section("definition", "How the machine may differ from its definition", open_directions)
        )
    sections += [
        Section("next", "What to measure next", next_blocks(content)),
        Section(
            "parameters",
            "The machine's own parameters",
            [*of("parameters"), *parameter_tables(content)] or [Text("Nothing was fitted.")],
        ),
        Section(
            "confidence",
            "How sure this is",
            [Bullets(confidence_words(content)), *defect_blocks(content)],
        ),
    ]
    names = ", ".join(content.get("recordings", []))
    title = f"{content.get('machine', 'Machine')}: {VERDICTS[content['verdict']]}"
    return render_document("Diagnosis", title, sections, names)
