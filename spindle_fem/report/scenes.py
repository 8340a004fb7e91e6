"""Off-screen three-dimensional views with PyVista; no display is needed.

One plotter serves all views. A view is an image with its projection
(:class:`Picture`); text and colour bars are added by
:mod:`spindle_fem.report.figure_style`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Any

import numpy as np
import pyvista as pv
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkLogger
from vtkmodules.vtkRenderingCore import vtkWindowToImageFilter

from spindle_fem.definition.drawn_tables import element_rows
from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.report.drawn_surfaces import SegmentSet, TriangleSet
from spindle_fem.report.figure_style import ColourBar

EDGE_COLOUR = "#1b2127"
LINE_LIFT = 3.0e-4
# Subdivisions of a ball's surface; sides of a roller.
SUBDIVISIONS, SIDES = 3, 48


@dataclass(frozen=True, slots=True)
class Picture:
    """A rendered view.

    Attributes
    ----------
    image : (height, width, 3) uint8 ndarray
    world_to_pixels : (2, 4) float64 ndarray
        Affine map of a point in m (parallel projection) to pixels from the
        upper left corner.
    """

    image: NDArray[np.uint8]
    world_to_pixels: NDArray[np.float64]

    @property
    def width(self) -> int:
        """Width in pixels."""
        return self.image.shape[1]

    @property
    def height(self) -> int:
        """Height in pixels."""
        return self.image.shape[0]

    def to_pixels(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Pixel coordinates (n, 2) of points (n, 3) in m."""
        return points @ self.world_to_pixels[:, :3].T + self.world_to_pixels[:, 3]


@dataclass(frozen=True, slots=True)
class View:
    """Fixed camera with parallel projection.

    Attributes
    ----------
    towards_viewer, up : (3,) sequence
    frame : (n, 3) ndarray, [m]
        Points that must be inside the frame.
    """

    towards_viewer: Sequence[float]
    up: Sequence[float]
    frame: NDArray[np.float64]

    def axes(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Unit vectors to the right, up and towards the viewer."""
        towards = np.asarray(self.towards_viewer, dtype=np.float64)
        towards /= np.linalg.norm(towards)
        right = np.cross(np.asarray(self.up, dtype=np.float64), towards)
        right /= np.linalg.norm(right)
        return right, np.cross(towards, right), towards


class SceneRenderer:
    """Renders layers of triangles and lines between ``open`` and ``close``, or as a context manager."""

    def __init__(self) -> None:
        self._plotter: Any = None
        self._lines: list[Any] = []

    def __enter__(self) -> SceneRenderer:
        self.open()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def open(self) -> None:
        """Make the window, off the screen."""
        # Without a screen VTK reports the missing X server before it takes EGL or OSMesa.
        verbosity = vtkLogger.GetCurrentVerbosityCutoff()
        vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)
        try:
            self._plotter = pv.Plotter(off_screen=True, window_size=(64, 64), lighting="none")
            self._plotter.background_color = "white"
            self._plotter.enable_parallel_projection()
            self._plotter.enable_anti_aliasing("msaa", multi_samples=4)
            self._plotter.show(auto_close=False, interactive=False)
        finally:
            vtkLogger.SetStderrVerbosity(verbosity)

    def close(self) -> None:
        """Give the window back."""
        self._plotter.close()

    def clear(self) -> None:
        """Remove every layer."""
        self._plotter.clear_actors()
        self._lines.clear()

    def add_coloured(
        self,
        shape: TriangleSet,
        bar: ColourBar,
        *,
        column: int = 0,
        lit: bool = True,
        closed: bool = False,
    ) -> Any:
        """Layer coloured by one value of its points; unlit it matches the colour bar exactly.

        ``closed`` says that what faces away is hidden by something in front of it, and need not be drawn.
        """
        if not len(shape.triangles):
            return None
        mesh = _polydata(shape)
        mesh.point_data["value"] = shape.values[:, column]
        return self._plotter.add_mesh(
            mesh,
            scalars="value",
            cmap=bar.colour_map,
            clim=(bar.low, bar.high),
            show_scalar_bar=False,
            render=False,
            reset_camera=False,
            culling="back" if closed else False,
            **_shading(shape, lit),
        )

    def add_parts(
        self, shape: TriangleSet, colours: Sequence[str], *, lit: bool = True, closed: bool = False
    ) -> Any:
        """Layer coloured by the label of its triangles; ``closed`` as in :meth:`add_coloured`."""
        from matplotlib.colors import to_rgb

        if not len(shape.triangles):
            return None
        table = (np.array([to_rgb(colour) for colour in colours]) * 255.0).astype(np.uint8)
        mesh = _polydata(shape)
        mesh.cell_data["colour"] = table[shape.label]
        return self._plotter.add_mesh(
            mesh,
            scalars="colour",
            rgb=True,
            show_scalar_bar=False,
            render=False,
            reset_camera=False,
            culling="back" if closed else False,
            **_shading(shape, lit),
        )

    def add_lines(
        self, lines: SegmentSet, colour: str = EDGE_COLOUR, width: float = 1.5, opacity: float = 1.0
    ) -> Any:
        """Layer of segments, drawn in front of triangles at the same place."""
        number = len(lines.points)
        if not number:
            return None
        mesh = pv.PolyData()
        mesh.points = lines.points.reshape(-1, 3)
        mesh.lines = np.column_stack([np.full(number, 2), np.arange(2 * number).reshape(-1, 2)]).ravel()
        actor = self._plotter.add_mesh(
            mesh,
            color=colour,
            line_width=width,
            opacity=opacity,
            lighting=False,
            show_scalar_bar=False,
            render=False,
            reset_camera=False,
        )
        self._lines.append(actor)
        return actor

    def render(self, view: View, width_px: int = 1552, *, margin_px: float = 6.0) -> Picture:
        """Image of all layers, the frame of the view filling the width.

        Parameters
        ----------
        margin_px : float
            Left free on each side.
        """
        right, up, towards = view.axes()
        across, along, depth = view.frame @ right, view.frame @ up, view.frame @ towards
        scale = (width_px - 2.0 * margin_px) / np.ptp(across)  # pixels a metre
        height_px = max(2, round(np.ptp(along) * scale + 2.0 * margin_px))
        centre = sum(
            0.5 * (value.min() + value.max()) * axis
            for value, axis in ((across, right), (along, up), (depth, towards))
        )
        plotter = self._plotter
        plotter.render_window.SetSize(width_px, height_px)  # pyvista's setter would render as well
        camera = plotter.camera
        camera.focal_point = centre
        camera.position = centre + 2.0 * towards
        camera.up = up
        camera.parallel_scale = 0.5 * height_px / scale
        plotter.renderer.camera_set = True
        for actor in self._lines:  # a third of a millimetre in front of the faces that they bound
            actor.position = LINE_LIFT * towards
        self._light(right, up, towards, centre)
        plotter.renderer.ResetCameraClippingRange()
        affine = np.empty((2, 4))
        affine[0, :3], affine[1, :3] = scale * right, -scale * up
        affine[0, 3] = 0.5 * width_px - scale * (centre @ right)
        affine[1, 3] = 0.5 * height_px + scale * (centre @ up)
        return Picture(self._image(), affine)

    def _image(self) -> NDArray[np.uint8]:
        window = self._plotter.render_window
        window.Render()
        reader = vtkWindowToImageFilter()
        reader.SetInput(window)
        reader.ShouldRerenderOff()  # software rendering is most of the cost of a picture
        reader.ReadFrontBufferOff()
        reader.SetInputBufferTypeToRGB()
        reader.Update()
        image = reader.GetOutput()
        width, height, _ = image.GetDimensions()
        pixels = vtk_to_numpy(image.GetPointData().GetScalars()).reshape(height, width, 3)
        return np.ascontiguousarray(pixels[::-1])

    def _light(
        self,
        right: NDArray[np.float64],
        up: NDArray[np.float64],
        towards: NDArray[np.float64],
        centre: NDArray[np.float64],
    ) -> None:
        plotter = self._plotter
        plotter.remove_all_lights()
        for direction, intensity in (
            (towards + 0.6 * up - 0.4 * right, 0.75),
            (towards - 0.8 * up + 0.7 * right, 0.3),
        ):
            light = pv.Light(position=centre + 5.0 * direction, focal_point=centre, intensity=intensity)
            light.positional = False
            plotter.add_light(light)


def _unit_sphere() -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    sphere = pv.Icosphere(radius=1.0, nsub=SUBDIVISIONS)
    points = np.asarray(sphere.points, dtype=np.float64)
    return points, points, np.asarray(sphere.faces).reshape(-1, 4)[:, 1:].astype(np.int64)


def _unit_cylinder() -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Points, normals and triangles of a cylinder of radius 1 from z = -1 to 1, its rims sharp."""
    turn = 2.0 * np.pi * np.arange(SIDES) / SIDES
    ring = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(SIDES)])
    axis = np.array([0.0, 0.0, 1.0])
    # Both rings of the wall, then both ends: each point as often as it has normals.
    points = np.concatenate([ring - axis, ring + axis, ring - axis, ring + axis])
    normals = np.concatenate([ring, ring, np.tile(-axis, (SIDES, 1)), np.tile(axis, (SIDES, 1))])
    first = np.arange(SIDES)
    after = (first + 1) % SIDES
    wall = [(first, after, after + SIDES), (first, after + SIDES, first + SIDES)]
    inner = np.arange(1, SIDES - 1)
    start = np.full_like(inner, 2 * SIDES)
    near = (start, start + inner + 1, start + inner)
    far = (start + SIDES, start + SIDES + inner, start + SIDES + inner + 1)
    return points, normals, np.concatenate([np.column_stack(own) for own in (*wall, near, far)])


def ball_triangles(
    spec: MachineSpec,
    values: dict[str, float],
    shown: Callable[[NDArray[np.float64]], NDArray[np.bool_]] = lambda centres: np.ones(len(centres), bool),
) -> TriangleSet:
    """Every ball as a sphere and every roller as a cylinder, ``values`` by bearing at their points.

    ``label`` counts the bearings; the first ball is at θ = 0. ``shown`` selects by the
    centres (n, 3) which to draw.
    """
    found = [
        TriangleSet(
            np.zeros((0, 3)),
            np.zeros((0, 3), np.int64),
            np.zeros((0, 1)),
            np.zeros(0, np.int32),
            np.zeros((0, 3)),
        )
    ]
    first = 0
    for number, (group, bearing) in enumerate(spec.bearings):
        for row in element_rows(bearing, spec.bearing_types[group.type_name(bearing)]):
            points, normals, faces = _unit_cylinder() if row.length else _unit_sphere()
            size = 0.5 * np.array([row.ball_diameter, row.ball_diameter, row.length or row.ball_diameter])
            centres = np.array(row.centres)
            centres = centres[shown(centres)]
            offset = first + len(points) * np.arange(len(centres))[:, None, None]
            found.append(
                TriangleSet(
                    (centres[:, None, :] + size * points).reshape(-1, 3),
                    (faces + offset).reshape(-1, 3),
                    np.full((len(centres) * len(points), 1), values[bearing.name]),
                    np.full(len(centres) * len(faces), number, dtype=np.int32),
                    np.tile(normals, (len(centres), 1)),
                )
            )
            first += len(centres) * len(points)
    return TriangleSet(
        *(
            np.concatenate([getattr(item, name) for item in found])
            for name in ("points", "triangles", "values", "label", "normals")
        )
    )


def _polydata(shape: TriangleSet) -> pv.PolyData:
    mesh = pv.PolyData.from_regular_faces(shape.points, shape.triangles)
    if shape.normals is not None:
        mesh.point_data["Normals"] = shape.normals.astype(np.float32)
        mesh.GetPointData().SetActiveNormals("Normals")
    return mesh


def _shading(shape: TriangleSet, lit: bool) -> dict[str, Any]:
    if not lit:
        return {"lighting": False}
    smooth = shape.normals is not None
    return {
        "lighting": True,
        "ambient": 0.5,
        "diffuse": 0.66,
        "specular": 0.0,
        "interpolation": "Gouraud" if smooth else "Flat",
    }
