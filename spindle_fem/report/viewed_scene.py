"""Content of the interactive view, and its encoding for the page.

A scene is a surface to draw and, where a cut can be moved, the tetrahedra behind it; layers of values at
its points, at one time or several; balls and named places with their histories. Everything goes into a page
as one deflated block of columns, quantised to 16 bits, and a small header.
"""

from __future__ import annotations

import base64
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from matplotlib.colors import Colormap
from numpy.typing import NDArray

from spindle_fem.report.figure_style import DIFFERENCE_MAP, TEMPERATURE_MAP

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

_STEPS = 65535.0  # of 16 bits


def _no_triangles() -> Indices:
    return np.zeros((0, 3), dtype=np.int64)


@dataclass(frozen=True, slots=True)
class Layer:
    """Values to colour by.

    Attributes
    ----------
    name : str
        Stands in the list of layers and above the colour bar.
    unit : str
    values : (t, n) ndarray
        At every point, a row a time; n = 0 where only balls and places are coloured.
    difference : bool
        Coloured about zero.
    """

    name: str
    unit: str
    values: Array
    difference: bool = False

    @property
    def colour_map(self) -> Colormap:
        """Colour map of the layer's values."""
        return DIFFERENCE_MAP if self.difference else TEMPERATURE_MAP


@dataclass(frozen=True, slots=True)
class Sphere:
    """A ball or roller of a bearing or, with a name, a probe or a node.

    Attributes
    ----------
    place : (3,) ndarray, [m]
    radius : float, [m]
    values : mapping of str to (t,) ndarray
        By name of the layer, a value a time; NaN where none was read. A layer that is missing leaves it grey.
    length : float, [m]
        Along the axis, of a roller; 0 for a sphere.
    """

    place: Array
    radius: float
    values: Mapping[str, Array]
    name: str = ""
    length: float = 0.0


@dataclass(frozen=True, slots=True)
class Curve:
    """One quantity of a named place over time: ``times`` in s, ``values`` in the unit of the layers."""

    name: str
    times: Array
    values: Array


@dataclass(frozen=True, slots=True)
class Scene:
    """Everything that a view shows.

    Attributes
    ----------
    points : (n, 3) ndarray, [m]
    part_names : tuple of str
    vertex_point : (v,) ndarray of int
        The point of each corner of the surface: a point has several where normals differ.
    normals : (v, 3) ndarray
    triangles, caps : (m, 3) ndarray of int
        Of the vertices: the surface, and a section that lies still at x = 0 where there are no tetrahedra.
    triangle_part, cap_part : (m,) ndarray of int
    tetrahedra : (e, 4) ndarray of int
        Of the points; the page works out from them what a cut shows.
    tetrahedron_part : (e,) ndarray of int
    times : (t,) ndarray, [s]
        Empty or one where nothing changes.
    shift : (n, 3) ndarray or None, [m]
        Of every point since assembly.
    exaggeration : float
        By which shifts are multiplied as a start.
    histories : mapping of str to tuple of Curve
        By name of the sphere.
    links : tuple of pairs of (3,) ndarray, [m]
        Lines to draw.
    notes : tuple of str
        Sentences below the view.
    """

    points: Array
    layers: tuple[Layer, ...]
    part_names: tuple[str, ...] = ()
    vertex_point: Indices = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    normals: Array = field(default_factory=lambda: np.zeros((0, 3)))
    triangles: Indices = field(default_factory=_no_triangles)
    triangle_part: Indices = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    caps: Indices = field(default_factory=_no_triangles)
    cap_part: Indices = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    tetrahedra: Indices = field(default_factory=lambda: np.zeros((0, 4), dtype=np.int64))
    tetrahedron_part: Indices = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    times: Array = field(default_factory=lambda: np.zeros(0))
    shift: Array | None = None
    exaggeration: float = 1.0
    balls: tuple[Sphere, ...] = ()
    places: tuple[Sphere, ...] = ()
    histories: Mapping[str, tuple[Curve, ...]] = field(default_factory=dict)
    links: tuple[tuple[Array, Array], ...] = ()
    notes: tuple[str, ...] = ()

    def payload(self) -> dict[str, Any]:
        """Data for the page's program: a header and one deflated block in base64."""
        low, high = self.points.min(axis=0), self.points.max(axis=0)
        span = float((high - low).max())
        scales = {layer.name: self._scale(layer) for layer in self.layers}
        columns: dict[str, NDArray[Any]] = {
            # Column by column, and indices as differences, so that deflating finds the pattern.
            "points": _quantised((self.points - low) / span).T,
            "vertex": _differences(self.vertex_point),
            "normals": np.round(self.normals * 127.0).astype(np.int8).T,
        }
        shown: list[dict[str, Any]] = [{"name": name} for name in self.part_names]
        for key, elements, part in (
            ("triangles", self.triangles, self.triangle_part),
            ("caps", self.caps, self.cap_part),
            ("tetrahedra", self.tetrahedra, self.tetrahedron_part),
        ):
            order = np.argsort(part, kind="stable")
            ends = np.searchsorted(part[order], np.arange(len(shown) + 1))
            for number, entry in enumerate(shown):
                entry[key] = [int(ends[number]), int(ends[number + 1] - ends[number])]
            columns[key] = _differences(elements[order])
        for number, layer in enumerate(self.layers):
            if layer.values.size:
                start, end = scales[layer.name]
                values = _quantised((layer.values - start) / (end - start))
                # Times as differences of 16 bits, which run over as the page's sums do.
                columns[f"layer{number}"] = np.diff(values, axis=0, prepend=np.zeros_like(values[:1]))
        header: dict[str, Any] = {
            "low": low.tolist(),
            "span": span,
            "size": (high - low).tolist(),
            "parts": shown,
            "times": np.round(self.times, 3).tolist(),
            "layers": [self._layer_header(layer, *scales[layer.name]) for layer in self.layers],
            "balls": [self._sphere(item) for item in self.balls],
            "places": [self._sphere(item) for item in self.places],
            "histories": {
                name: [
                    {"name": item.name, "times": _rounded(item.times, 1), "values": _rounded(item.values, 3)}
                    for item in curves
                ]
                for name, curves in self.histories.items()
            },
            "links": [[_rounded(end, 5) for end in link] for link in self.links],
            "notes": list(self.notes),
            "shifted": self.shift is not None,
        }
        if self.shift is not None:
            largest = max(float(np.abs(self.shift).max()), 1.0e-12)
            columns["shift"] = np.round(self.shift.T / largest * 32767.0).astype("<i2")
            sizes = np.linalg.norm(self.shift, axis=1)
            header |= {
                "shift_scale": largest / 32767.0,
                "exaggeration": self.exaggeration,
                "largest_shift_um": 1.0e6 * float(sizes.max()),
            }
        blocks = {key: np.ascontiguousarray(value) for key, value in columns.items()}
        header["columns"] = [[key, value.dtype.str.lstrip("<|"), value.size] for key, value in blocks.items()]
        packed = zlib.compress(b"".join(value.tobytes() for value in blocks.values()), 6)
        return {**header, "block": base64.b64encode(packed).decode()}

    def _scale(self, layer: Layer) -> tuple[float, float]:
        """Ends of the colour scale over all times, balls and places: one for all of a kind, to compare."""
        # Differences of fields and residuals at probes have unrelated sizes.
        alike = [
            item
            for item in self.layers
            if item.difference == layer.difference
            and (not item.difference or bool(item.values.size) == bool(layer.values.size))
        ]
        spheres = [
            values
            for item in (*self.balls, *self.places)
            for other in alike
            if (values := item.values.get(other.name)) is not None
        ]
        found = np.concatenate([np.ravel(item) for item in (*(other.values for other in alike), *spheres)])
        found = found[np.isfinite(found)]
        low, high = (float(found.min()), float(found.max())) if found.size else (0.0, 1.0)
        if layer.difference:
            high = max(abs(low), abs(high), 1.0e-3)
            return -high, high
        return low, max(high, low + 1.0e-3)

    def _layer_header(self, layer: Layer, low: float, high: float) -> dict[str, Any]:
        colours = (layer.colour_map(np.linspace(0.0, 1.0, 256))[:, :3] * 255.0).round().astype(np.uint8)
        return {
            "name": layer.name,
            "unit": layer.unit,
            "low": low,
            "high": high,
            "difference": layer.difference,
            "times": len(layer.values),
            "coloured": bool(layer.values.size),
            "colours": base64.b64encode(colours.tobytes()).decode(),
        }

    def _sphere(self, item: Sphere) -> dict[str, Any]:
        values = [
            _rounded(item.values[layer.name], 3) if layer.name in item.values else None
            for layer in self.layers
        ]
        place = _rounded(item.place, 5)
        found = {"name": item.name, "place": place, "radius": item.radius, "values": values}
        return found | {"length": item.length} if item.length else found


def _quantised(share: Array) -> NDArray[np.uint16]:
    return np.round(np.clip(share, 0.0, 1.0) * _STEPS).astype("<u2")


def _differences(indices: Indices) -> NDArray[np.int32]:
    return np.diff(indices.ravel().astype("<i4"), prepend=np.int32(0)).astype("<i4")


def _rounded(values: Array, decimals: int) -> list[float | None]:
    """Plain numbers for JSON, with None for NaN."""
    found = np.round(np.asarray(values, dtype=np.float64), decimals)
    return [value if np.isfinite(value) else None for value in found.tolist()]
