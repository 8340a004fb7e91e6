"""Growth of a machine's bodies as a group of ``result.nc``, for views that draw it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator

from spindle_fem.model.elastic.deformed_shape import BodyShape

if TYPE_CHECKING:
    import xarray as xr

GROWTH_GROUP = "growth"


def growth_dataset(shapes: Mapping[str, BodyShape]) -> xr.Dataset:
    """Corners of every body in the meridian plane and their shift since assembly.

    Returns
    -------
    xarray.Dataset
        ``place`` and ``shift`` (m, along z and r) on ``corner``, ``body`` the name's number of each.
    """
    import xarray as xr

    counts = [len(shape.points) for shape in shapes.values()]
    return xr.Dataset(
        {
            "place": (
                ("corner", "direction"),
                np.concatenate([shape.points for shape in shapes.values()]).astype(np.float32),
                {"units": "m", "long_name": "as assembled"},
            ),
            "shift": (
                ("corner", "direction"),
                np.concatenate([shape.shift for shape in shapes.values()]).astype(np.float32),
                {"units": "m", "long_name": "since assembly, mean round the axis"},
            ),
            "body": ("corner", np.repeat(np.arange(len(counts)), counts).astype(np.int32)),
        },
        {"direction": ["z", "r"], "body_name": list(shapes)},
    )


def has_growth(path: Path) -> bool:
    """Whether a run left the growth of its bodies."""
    import h5py

    with h5py.File(path, "r") as file:
        return GROWTH_GROUP in file


def shift_of_points(
    growth: xr.Dataset, points: NDArray[np.float64], part: NDArray[np.int64], part_names: tuple[str, ...]
) -> NDArray[np.float64]:
    """Shift of points of the machine since assembly.

    Parameters
    ----------
    points : (n, 3) ndarray, [m]
    part : (n,) ndarray of int
        Part of each. Of a part that is none of the bodies points move with the nearest body.

    Returns
    -------
    (n, 3) ndarray, [m]
    """
    place, shift = (growth[name].values.astype(np.float64) for name in ("place", "shift"))
    body = growth["body"].values
    names = [str(name) for name in growth["body_name"].values]
    radius = np.hypot(points[:, 0], points[:, 1])
    meridian = np.column_stack([points[:, 2], radius])
    found = NearestNDInterpolator(place, shift)(meridian)
    for number, name in enumerate(names):
        if name not in part_names:
            continue
        own = part == part_names.index(name)
        inside = LinearNDInterpolator(place[body == number], shift[body == number])(meridian[own])
        near = NearestNDInterpolator(place[body == number], shift[body == number])(meridian[own])
        found[own] = np.where(np.isfinite(inside), inside, near)
    outwards = points[:, :2] / np.maximum(radius, 1.0e-9)[:, None]
    return np.column_stack([found[:, 1:] * outwards, found[:, 0]])
