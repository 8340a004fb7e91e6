"""``result.nc``: what a run found, as one xarray Dataset with units and sources."""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel

from spindle_fem.definition.load import write_machine
from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.errors import BadInputError
from spindle_fem.results.output_folder import replace_bytes
from spindle_fem.results.run_summary import package_versions
from spindle_fem.results.thermal_result import ThermalResult
from spindle_fem.units import ZERO_CELSIUS_K

if TYPE_CHECKING:
    import xarray as xr

RESULT_SCHEMA = "spindle-fem/result/1"


def spec_digest(spec: MachineSpec) -> str:
    """SHA-256 of the fully resolved definition: equal machines have equal digests."""
    text = json.dumps(spec.model_dump(mode="json", by_alias=True), sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()


def default_paths(spec: MachineSpec) -> list[str]:
    """Paths of the values that the definition left to the program, such as ``film.0.factor``."""
    return sorted(_defaults(spec, ""))


def _defaults(value: Any, path: str) -> Iterator[str]:
    if isinstance(value, BaseModel):
        for name, field in type(value).model_fields.items():
            inner = f"{path}{field.alias or name}"
            if name == "marks":
                continue
            if name not in value.model_fields_set:
                yield inner
                if not isinstance(getattr(value, name), BaseModel):
                    continue
            yield from _defaults(getattr(value, name), f"{inner}.")
    elif isinstance(value, Mapping):
        for key, item in value.items():
            yield from _defaults(item, f"{path}{key}.")
    elif isinstance(value, tuple):
        for index, item in enumerate(value):
            yield from _defaults(item, f"{path}{index}.")


# Three points inside, exact for polynomials of degree two.
_QUADRATURE = np.array([[1.0 / 6.0, 1.0 / 6.0], [2.0 / 3.0, 1.0 / 6.0], [1.0 / 6.0, 2.0 / 3.0]])


def _shapes() -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    u, v = _QUADRATURE.T
    w = 1.0 - u - v
    zero = np.zeros_like(u)
    value = np.stack(
        [w * (2 * w - 1), u * (2 * u - 1), v * (2 * v - 1), 4 * u * w, 4 * u * v, 4 * v * w], axis=1
    )
    along_u = np.stack([1 - 4 * w, 4 * u - 1, zero, 4 * (w - u), 4 * v, -4 * v], axis=1)
    along_v = np.stack([1 - 4 * w, zero, 4 * v - 1, -4 * u, 4 * u, 4 * (w - v)], axis=1)
    return value, along_u, along_v


_VALUE, _ALONG_U, _ALONG_V = _shapes()


def _facet_weights(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    u = np.einsum("qa,nai->nqi", _ALONG_U, corners)
    v = np.einsum("qa,nai->nqi", _ALONG_V, corners)
    return np.linalg.norm(np.cross(u, v), axis=2) / 6.0


def _at_quadrature(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return values @ _VALUE.T


def build_dataset(result: ThermalResult, sources: tuple[str, ...] = ()) -> xr.Dataset:
    """Everything a run found but the field itself, with units and long names.

    Parameters
    ----------
    sources : tuple of str
        Literature behind the models that were used, for the attributes.

    Returns
    -------
    xarray.Dataset
        Dimensions ``bearing``, ``heat_term``, ``heat_path``, ``cell`` (along
        the channel), ``probe``, ``surface``, ``joint``, ``sink``, ``part``.
        Temperatures in degC.
    """
    import xarray as xr

    variables: dict[str, Any] = {}
    coordinates: dict[str, Any] = {}
    _add_bearings(result, variables, coordinates)
    _add_coolant(result, variables, coordinates)
    _add_mesh(result, variables, coordinates)
    _add_named(
        variables,
        coordinates,
        "probe",
        "probe_temperature",
        _celsius_map(result.probes),
        "degC",
        "probe reading",
    )
    _add_named(
        variables,
        coordinates,
        "joint",
        "joint_heat",
        result.heat_flows,
        "W",
        "heat from the first to the second part",
    )
    _add_named(variables, coordinates, "sink", "heat_out", result.energy.heat_out, "W", "heat that leaves")
    _add_named(variables, coordinates, "source", "heat_in", result.energy.heat_in_by, "W", "heat put in")
    attributes = {
        "schema": RESULT_SCHEMA,
        "title": result.spec.title or result.spec.name,
        "machine": result.spec.name,
        "machine_definition_toml": write_machine(result.spec),
        "machine_defaults": "\n".join(default_paths(result.spec)),
        "spec_sha256": spec_digest(result.spec),
        "mesh_digest": result.mesh.digest,
        "element_order": result.order,
        "temperature_unknowns": result.n_unknowns,
        "heat_in_W": result.energy.heat_in,
        "heat_out_W": float(sum(result.energy.heat_out.values())),
        "imbalance_relative": result.energy.imbalance_relative,
        "temperature_min_degC": result.temperature_minimum - ZERO_CELSIUS_K,
        "temperature_max_degC": result.temperature_maximum - ZERO_CELSIUS_K,
        "versions": json.dumps(package_versions()),
        "sources": "\n".join(dict.fromkeys((*sources, *_sources_of(result)))),
        "warnings": "\n".join(f"{warning.code}: {warning.text}" for warning in result.warnings),
        "Conventions": "units by attribute; temperatures in degC",
    }
    return xr.Dataset(variables, coordinates, attributes)


def write_dataset(dataset: xr.Dataset, path: str | Path, *, group: str | None = None) -> Path:
    """Write a Dataset as NetCDF-4, compressed; with ``group`` it is added to the file."""
    encoding = {
        name: {"zlib": True, "complevel": 4}
        for name, item in dataset.data_vars.items()
        if item.dtype.kind in "fiu" and item.ndim and item.size > 1000
    }
    # In memory first: HDF5 itself does not survive a full disk.
    path = Path(path)
    content = io.BytesIO(path.read_bytes() if group else b"")
    dataset.to_netcdf(content, mode="a" if group else "w", group=group, engine="h5netcdf", encoding=encoding)
    return replace_bytes(path, content.getvalue())


def read_dataset(path: str | Path, *, group: str | None = None) -> xr.Dataset:
    """Read a Dataset into memory.

    Raises
    ------
    BadInputError
        There is no such file, it is no NetCDF, or its schema is not known.
    """
    if not Path(path).is_file():
        raise BadInputError(str(path), "there is no such file.", "Give the folder of a finished run.")
    try:
        dataset = load_netcdf(path, group)
    except (OSError, ValueError, KeyError) as error:
        raise BadInputError(str(path), f"cannot be read ({error}).", "Run again to write it anew.") from error
    schema = dataset.attrs.get("schema")
    if group is None and schema != RESULT_SCHEMA:
        raise BadInputError(str(path), f"schema is {schema!r}.", f'Known: "{RESULT_SCHEMA}".')
    return dataset


def load_netcdf(path: str | Path, group: str | None = None) -> xr.Dataset:
    """Dataset of a file, in memory.

    Raises
    ------
    OSError, ValueError, KeyError
        It is no NetCDF, or spoilt.
    """
    import h5py
    import xarray as xr

    # If attributes cannot be read, h5netcdf leaves a half-opened file, which reports an error when deleted.
    with h5py.File(path) as file:
        dict(file.attrs)
    return xr.load_dataset(path, group=group, engine="h5netcdf")


def _celsius_map(values: Mapping[str, float]) -> dict[str, float]:
    return {name: value - ZERO_CELSIUS_K for name, value in values.items()}


def _variable(
    dimensions: Any, values: Any, unit: str, long_name: str
) -> tuple[Any, NDArray[np.float64], dict[str, str]]:
    return dimensions, np.asarray(values, dtype=np.float64), {"units": unit, "long_name": long_name}


def _text_coordinate(name: str, values: Any, long_name: str) -> tuple[str, NDArray[Any], dict[str, str]]:
    return name, np.array(list(values), dtype=object), {"long_name": long_name}


def _add_named(
    variables: dict[str, Any],
    coordinates: dict[str, Any],
    dimension: str,
    name: str,
    values: Mapping[str, float],
    unit: str,
    long_name: str,
) -> None:
    if values:
        coordinates[dimension] = _text_coordinate(dimension, values, dimension)
        variables[name] = _variable(dimension, list(values.values()), unit, long_name)


_BEARING_FIELDS = (
    ("heat", "W", "friction heat", 1.0),
    ("ring_difference", "K", "mean inner minus mean outer raceway temperature", 1.0),
    ("contact_angle_inner", "degree", "contact angle at the inner raceway", 180.0 / np.pi),
    ("contact_angle_outer", "degree", "contact angle at the outer raceway", 180.0 / np.pi),
    ("preload", "N", "axial force between the rings", 1.0),
    ("axial_load", "N", "axial force with the external load", 1.0),
    ("axial_stiffness", "N/um", "axial stiffness of the bearing's set", 1.0e-6),
    ("film_thickness", "um", "central lubricant film, thinner contact", 1.0e6),
    ("film_thickness_ratio", "1", "film thickness over combined roughness (lambda)", 1.0),
)


def _add_bearings(result: ThermalResult, variables: dict[str, Any], coordinates: dict[str, Any]) -> None:
    bearings = result.bearings
    if not bearings:
        return
    states = list(bearings.values())
    coordinates["bearing"] = _text_coordinate("bearing", bearings, "bearing")
    for name, unit, long_name, factor in _BEARING_FIELDS:
        values = [factor * getattr(state, name) for state in states]
        variables[f"bearing_{name}"] = _variable("bearing", values, unit, long_name)
    for place in ("inner", "outer", "ball"):
        values = [getattr(state, f"temperature_{place}") - ZERO_CELSIUS_K for state in states]
        text = "ball temperature" if place == "ball" else f"mean temperature of the {place} raceway"
        variables[f"bearing_temperature_{place}"] = _variable("bearing", values, "degC", text)
    for dimension, attribute, long_name in (
        ("heat_term", "terms", "friction heat term by term"),
        ("heat_path", "heat_to", "friction heat by the body that it enters"),
    ):
        keys = list(dict.fromkeys(key for state in states for key in getattr(state, attribute)))
        coordinates[dimension] = _text_coordinate(dimension, keys, long_name)
        table = [[getattr(state, attribute).get(key, 0.0) for key in keys] for state in states]
        variables[f"bearing_{dimension}"] = _variable(("bearing", dimension), table, "W", long_name)


def _add_coolant(result: ThermalResult, variables: dict[str, Any], coordinates: dict[str, Any]) -> None:
    coolant = result.coolant
    if coolant is None:
        return
    coordinates["cell"] = ("cell", np.arange(len(coolant.position)), {"long_name": "cell along the channel"})
    for name, values, unit, long_name in (
        ("channel_position", coolant.position, "m", "developed length from the inlet"),
        ("channel_angle", np.degrees(coolant.angle), "degree", "helix angle from the inlet"),
        (
            "bulk_temperature",
            coolant.bulk_temperature - ZERO_CELSIUS_K,
            "degC",
            "bulk temperature of the coolant",
        ),
        ("wall_temperature", coolant.wall_temperature - ZERO_CELSIUS_K, "degC", "mean wall temperature"),
        ("film_coefficient", coolant.film_coefficient, "W/(m2 K)", "film coefficient of the channel wall"),
        ("film_coefficient_low", coolant.film_low, "W/(m2 K)", "film coefficient, low"),
        ("film_coefficient_high", coolant.film_high, "W/(m2 K)", "film coefficient, high"),
    ):
        variables[name] = _variable("cell", values, unit, long_name)
    for name, value, unit, long_name in (
        ("coolant_flow", coolant.flow, "m3/s", "coolant flow"),
        ("coolant_asked_flow", coolant.asked_flow, "m3/s", "coolant flow asked of the pump"),
        ("coolant_inlet_temperature", coolant.inlet_temperature - ZERO_CELSIUS_K, "degC", "coolant inlet"),
        (
            "coolant_outlet_temperature",
            coolant.outlet_temperature - ZERO_CELSIUS_K,
            "degC",
            "mixed coolant outlet",
        ),
        ("coolant_heat", coolant.heat, "W", "heat taken up by the coolant"),
        ("coolant_pressure_drop", coolant.pressure_drop, "Pa", "pressure drop of channel and ports"),
        ("coolant_ports_pressure_drop", coolant.ports_pressure_drop, "Pa", "pressure drop of the ports"),
        ("coolant_pumping_power", coolant.pumping_power, "W", "flow times pressure drop"),
        ("coolant_reynolds", coolant.reynolds, "1", "Reynolds number on the hydraulic diameter at the inlet"),
    ):
        variables[name] = _variable((), value, unit, long_name)


def _add_mesh(result: ThermalResult, variables: dict[str, Any], coordinates: dict[str, Any]) -> None:
    mesh = result.mesh
    names = list(mesh.surfaces)
    coordinates["surface"] = _text_coordinate("surface", names, "exposed surface")
    rows = []
    for name in names:
        facets = mesh.surfaces[name]
        weights = _facet_weights(mesh.points[facets])
        area = weights.sum()
        film = fluid = np.nan
        if name in result.film_coefficient:
            each = weights.sum(axis=1)
            film = float(each @ result.film_coefficient[name] / area)
            fluid = float(each @ result.fluid_temperature[name] / area) - ZERO_CELSIUS_K
        at_points = _at_quadrature(result.temperature[facets]) - ZERO_CELSIUS_K
        nodes = result.temperature[facets] - ZERO_CELSIUS_K
        rows.append((area, (weights * at_points).sum() / area, nodes.min(), nodes.max(), film, fluid))
    columns = np.array(rows, dtype=np.float64).reshape(len(names), 6).T
    for values, (name, unit, long_name) in zip(
        columns,
        (
            ("surface_area", "m2", "area of the mesh"),
            ("surface_temperature_mean", "degC", "area mean temperature"),
            ("surface_temperature_min", "degC", "lowest temperature"),
            ("surface_temperature_max", "degC", "highest temperature"),
            ("surface_film_coefficient", "W/(m2 K)", "area mean heat transfer coefficient"),
            ("surface_fluid_temperature", "degC", "area mean temperature of the fluid"),
        ),
        strict=True,
    ):
        variables[name] = _variable("surface", values, unit, long_name)
    coordinates["part"] = _text_coordinate("part", mesh.part_names, "part")
    part_of_node = np.zeros(len(mesh.points), dtype=np.int64)
    part_of_node[mesh.tetrahedra] = mesh.part_of_element[:, None]
    lowest = np.full(len(mesh.part_names), np.inf)
    highest = np.full(len(mesh.part_names), -np.inf)
    np.minimum.at(lowest, part_of_node, result.temperature)
    np.maximum.at(highest, part_of_node, result.temperature)
    variables["part_temperature_min"] = _variable(
        "part", lowest - ZERO_CELSIUS_K, "degC", "lowest temperature"
    )
    variables["part_temperature_max"] = _variable(
        "part", highest - ZERO_CELSIUS_K, "degC", "highest temperature"
    )
    volumes = [mesh.cad_volume[name] for name in mesh.part_names]
    variables["part_volume"] = _variable("part", volumes, "m3", "volume of the solid model")


def _sources_of(result: ThermalResult) -> tuple[str, ...]:
    sources = []
    if result.coolant is not None:
        sources.append(f"film of the channel: {result.coolant.source}")
    extra = result.extra.get("sources", ())
    return tuple(sources) + tuple(str(item) for item in extra)
