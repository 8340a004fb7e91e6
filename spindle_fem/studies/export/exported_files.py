"""State spaces as files: .npz and .json to be read by programs; .py, .c and .fmu that run by themselves."""

from __future__ import annotations

import base64
import inspect
import json
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, FileSystemLoader
from numpy.typing import NDArray

from spindle_fem.errors import BadInputError
from spindle_fem.studies.export import portable_model
from spindle_fem.studies.export.functional_mockup import write_functional_mockup
from spindle_fem.studies.export.portable_model import (
    CLOSE,
    GAMMA,
    HELD_WITHIN,
    MOST_ROUNDS,
    SLOPE_STEP,
    STAGE_WEIGHT,
    START_WEIGHT,
)
from spindle_fem.studies.export.state_space import EXACT, StateSpace

Array = NDArray[np.float64]

TEMPLATES = Path(__file__).parent / "templates"
SCHEME_TEXTS = {
    EXACT: "K is diagonal; steps are exact for loads that are linear in time.",
    "TR-BDF2": "K, B, C and D follow the inputs by tables; steps are of second order and L-stable.",
}


def file_writer(path: Path) -> Callable[[StateSpace, Path], list[Path]]:
    """Writer for the suffix of a file.

    Raises
    ------
    BadInputError
        A suffix that no program is known for.
    """
    if path.suffix not in WRITERS:
        raise BadInputError(str(path), f'has the suffix "{path.suffix}".', f"Allowed: {', '.join(WRITERS)}.")
    return WRITERS[path.suffix]


def _write_npz(space: StateSpace, path: Path) -> list[Path]:
    with path.open("wb") as stream:
        np.savez_compressed(stream, header=json.dumps(dict(space.header)), **space.arrays)
    return [path]


def _write_json(space: StateSpace, path: Path) -> list[Path]:
    arrays = {name: values.tolist() for name, values in space.arrays.items()}
    path.write_text(
        json.dumps({**space.header, "arrays": arrays}, ensure_ascii=False) + "\n", encoding="utf-8"
    )
    return [path]


def _write_python(space: StateSpace, path: Path) -> list[Path]:
    path.write_text(python_source(space), encoding="utf-8")
    return [path]


def python_source(space: StateSpace) -> str:
    """A module that needs numpy alone: the portable model, its numbers and ``model()``."""
    lines = [
        inspect.getsource(portable_model).rstrip(),
        "",
        "",
        f"HEADER = {json.dumps(dict(space.header))!r}",
        "ARRAYS = {",
    ]
    for name, values in space.arrays.items():
        packed = base64.b64encode(np.ascontiguousarray(values, dtype="<f8").tobytes()).decode()
        lines.append(f"    {name!r}: ({list(values.shape)}, {packed!r}),")
    lines += [
        "}",
        "",
        "",
        "def model():",
        f'    """The model of {_plain(space.header["machine"])} at its start."""',
    ]
    return "\n".join([*lines, "    return PortableModel.from_text(HEADER, ARRAYS)", ""])


def _write_c(space: StateSpace, path: Path) -> list[Path]:
    header_file = path.with_suffix(".h")
    names = {"source_file": path.name, "header_file": header_file.name}
    environment = Environment(
        loader=FileSystemLoader(TEMPLATES), keep_trailing_newline=True, autoescape=False
    )
    environment.filters |= {"numbers": _numbers, "quoted": lambda text: json.dumps(_plain(text))}
    content = _c_content(space) | names
    for file in (path, header_file):
        template = environment.get_template(f"portable_model{file.suffix}.jinja")
        file.write_text(template.render(content), encoding="utf-8")
    return [path, header_file]


def _write_fmu(space: StateSpace, path: Path) -> list[Path]:
    write_functional_mockup(space, path, python_source(space), c_name(space.header["machine"]))
    return [path]


def c_name(machine: str) -> str:
    """A machine's name as C has names.

    >>> c_name("bench motor 2")
    'bench_motor_2'
    """
    found = re.sub(r"\W+", "_", machine.lower(), flags=re.ASCII).strip("_") or "machine"
    return f"machine_{found}" if found[0].isdigit() else found


def _c_content(space: StateSpace) -> dict[str, Any]:
    header, kept = space.header, dict(space.arrays)
    exact = header["scheme"] == EXACT
    kept["rate"] = np.diag(kept["conduction"])
    del kept["conduction" if exact else "rate"]
    ends = {"low": -np.inf, "high": np.inf, "default": 0.0}
    for end, none in ends.items():
        kept[f"input_{end}"] = np.array([none if i[end] is None else i[end] for i in header["inputs"]])
    load_input = kept.pop("load_input").astype(int)
    tables, responses = _c_tables(header, kept), _c_responses(space)
    feedback = {"feedbacks": 0, "followed": len(header["feedback_tables"]), "held": header["held_tables"]}
    if feedback["followed"]:
        held = np.isin(header["feedback_tables"], header["held_tables"]).astype(int)
        own = _table_of(tables, space.arrays["feedback.column"])
        feedback |= {
            "table_is_held": held,
            "heat_is_held": held[own],
            "held_within": HELD_WITHIN,
            "feedbacks": len(kept["feedback.column"]),
            "feedback_column": kept.pop("feedback.column").astype(int),
            "feedback_table": own,
            "feedback_less": _or_behind(kept.pop("feedback.less"), _columns(tables, "feedback")),
            "feedback_response": _or_behind(
                kept.pop("feedback.response"), sum(item["quantities"] for item in responses)
            ),
            "slope_step": SLOPE_STEP,
            "close": CLOSE,
            "most_rounds": MOST_ROUNDS,
        }
    plain = {key: [{**i, "name": _plain(i["name"])} for i in header[key]] for key in ("inputs", "outputs")}
    return {
        "machine": _plain(header["machine"]),
        "name": c_name(header["machine"]),
        **plain,
        "loads": header["loads"],
        "longest_step_s": header["longest_step_s"],
        "jumps": header.get("jumps"),
        "scheme_text": SCHEME_TEXTS[header["scheme"]],
        "exact": exact,
        "states": len(space.arrays["uniform"]),
        "powers": load_input.size,
        "load_input": load_input,
        "magnitudes": [int(item["magnitude"]) for item in header["inputs"]],
        "arrays": {name.replace(".", "_"): values for name, values in kept.items()},
        "tables": tables,
        "scaled_flow": header.get("scaled_flow"),
        "most_axes": max((len(table["grids"]) for table in tables), default=1),
        "weights": max(1, _columns(tables, "operator")),
        "factors": _columns(tables, "feedback"),
        "responses": responses,
        **feedback,
        "gamma": GAMMA,
        "diagonal": 0.5 * GAMMA,
        "stage_weight": STAGE_WEIGHT,
        "start_weight": START_WEIGHT,
    }


def _c_tables(header: Mapping[str, Any], kept: Mapping[str, Array]) -> list[dict[str, Any]]:
    """Tables as the template has them: what they give, and which of its entries is their first."""
    kinds = {name: kind for kind in ("load", "operator", "feedback") for name in header[f"{kind}_tables"]}
    first = {"load": kept["load_gain"].size, "operator": 0, "feedback": 0}
    found = []
    for name, inputs in header["table_inputs"].items():
        kind = kinds[name]
        *sizes, columns = kept[f"{name}.values"].shape
        found.append(
            {
                "name": name,
                "kind": kind,
                "inputs": inputs,
                "grids": [f"{name}_axis{axis}" for axis in range(len(inputs))],
                "sizes": sizes,
                "columns": columns,
                "first": first[kind],
            }
        )
        first[kind] += columns
    return found


def _c_responses(space: StateSpace) -> list[dict[str, Any]]:
    """Responses as the template has them, with numbers of samples, coordinates and quantities."""
    found, coordinate, quantity = [], 0, 0
    for response in space.header["responses"]:
        samples, width = space.arrays[f"{response['name']}.samples"].shape
        quantities = space.arrays[f"{response['name']}.weights"].shape[1]
        coordinates = width - len(response["inputs"])
        found.append(
            {
                **response,
                "samples": samples,
                "width": width,
                "coordinates": coordinates,
                "first_coordinate": coordinate,
                "quantities": quantities,
                "first": quantity,
            }
        )
        coordinate, quantity = coordinate + coordinates, quantity + quantities
    return found


def _or_behind(numbers: Array, count: int) -> NDArray[np.int64]:
    """Numbers of entries; that behind the last of them where there is none."""
    found = numbers.astype(int)
    return np.where(found < 0, count, found)


def _table_of(tables: list[dict[str, Any]], column: Array) -> Array:
    """Index of the feedback table that holds each heat's column."""
    ends = np.cumsum([table["columns"] for table in tables if table["kind"] == "feedback"])
    return np.searchsorted(ends, column, side="right")


def _columns(tables: list[dict[str, Any]], kind: str) -> int:
    """Total number of entries of the tables of one kind."""
    return sum(table["columns"] for table in tables if table["kind"] == kind)


def _numbers(values: Array) -> str:
    """Numbers of an array as C has them, a few a line; infinite ones by the macro of math.h."""
    texts = [
        "INFINITY" if v == np.inf else "-INFINITY" if v == -np.inf else repr(v)
        for v in values.ravel().tolist()
    ]
    return "\n    " + ",\n    ".join(", ".join(texts[i : i + 6]) for i in range(0, len(texts), 6)) + "\n"


def _plain(text: str) -> str:
    """A name that ends no comment and no string, whatever it holds."""
    return re.sub(r"[^\w .|:+()-]", "_", text)


WRITERS = {".npz": _write_npz, ".json": _write_json, ".py": _write_python, ".c": _write_c, ".fmu": _write_fmu}
