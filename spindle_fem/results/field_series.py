"""``fields.vtkhdf``: temperature fields over time in one file, which ParaView opens as a time series.

VTK's own HDF5 format, version 2: the mesh is stored once, each time adds its temperatures.
"""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from spindle_fem.errors import BadInputError
from spindle_fem.machine.meshing.tagged_mesh import TaggedMesh
from spindle_fem.results.output_folder import replace_bytes
from spindle_fem.units import ZERO_CELSIUS_K

_QUADRATIC_TETRA = 24
TEMPERATURE, PART = "temperature_degC", "part"
_PACKED = {"compression": "gzip", "compression_opts": 1, "shuffle": True}


class FieldSeries:
    """A file of fields on one mesh; use as a context manager.

    Parameters
    ----------
    path : Path
        Replaced where it exists, when the block ends without error.
    """

    def __init__(self, path: Path, mesh: TaggedMesh) -> None:
        # In memory first: HDF5 itself does not survive a full disk.
        self._path = path
        self._file = h5py.File(path, "w", driver="core", backing_store=False)
        root = self._file.create_group("VTKHDF")
        root.attrs["Version"] = (2, 0)
        root.attrs.create("Type", np.bytes_(b"UnstructuredGrid"))
        cells, nodes = mesh.tetrahedra.shape
        self._points = len(mesh.points)
        for name, number in (("Points", self._points), ("Cells", cells), ("ConnectivityIds", cells * nodes)):
            root[f"NumberOf{name}"] = np.array([number])
        arrays = {
            "Points": mesh.points.astype(np.float32),
            "Connectivity": mesh.tetrahedra.ravel(),
            "Offsets": nodes * np.arange(cells + 1),
            "Types": np.full(cells, _QUADRATIC_TETRA, dtype=np.uint8),
            f"CellData/{PART}": mesh.part_of_element.astype(np.int32),
        }
        for name, values in arrays.items():
            root.create_dataset(name, data=values, **_PACKED)
        root[f"CellData/{PART}"].attrs["names"] = list(mesh.part_names)
        self._temperature = root.create_dataset(
            f"PointData/{TEMPERATURE}", (0,), np.float32, maxshape=(None,), chunks=(self._points,), **_PACKED
        )
        self._steps = root.create_group("Steps")
        self._steps.attrs["NSteps"] = 0
        self._steps.create_dataset("Values", (0,), np.float64, maxshape=(None,))
        # Where each time finds its part, its mesh and its data: all but the temperatures are the same again.
        scalars = ("PartOffsets", "NumberOfParts", "PointOffsets", f"CellDataOffsets/{PART}")
        for name in (*scalars, f"PointDataOffsets/{TEMPERATURE}"):
            self._steps.create_dataset(name, (0,), np.int64, maxshape=(None,))
        for name in ("CellOffsets", "ConnectivityIdOffsets"):
            self._steps.create_dataset(name, (0, 1), np.int64, maxshape=(None, 1))

    def __enter__(self) -> FieldSeries:
        return self

    def __exit__(self, kind: object, *_: object) -> None:
        self._file.flush()
        content = self._file.id.get_file_image()
        self._file.close()
        if kind is None:
            replace_bytes(self._path, content)

    def add(self, time: float, temperature: NDArray[np.float64]) -> None:
        """Add a field; one at a time that is there already is left out.

        Parameters
        ----------
        time : float, [s]
        temperature : (n_nodes,) ndarray, [K]
        """
        values = self._steps["Values"]
        number = len(values)
        if number and time <= values[-1]:
            return
        self._temperature.resize((number + 1) * self._points, axis=0)
        self._temperature[number * self._points :] = temperature - ZERO_CELSIUS_K
        entries = {"Values": time, "NumberOfParts": 1}
        entries[f"PointDataOffsets/{TEMPERATURE}"] = number * self._points
        for name in ("PartOffsets", "PointOffsets", "CellOffsets", "ConnectivityIdOffsets"):
            entries[name] = 0
        entries[f"CellDataOffsets/{PART}"] = 0
        for name, value in entries.items():
            self._steps[name].resize(number + 1, axis=0)
            self._steps[name][number] = value
        self._steps.attrs["NSteps"] = number + 1


def read_series(path: Path) -> tuple[dict[str, NDArray], tuple[str, ...]]:
    """Mesh, times and temperatures of a file that :class:`FieldSeries` wrote.

    Returns
    -------
    arrays : dict
        ``points`` (n, 3) m, ``tetrahedra`` (e, 10), ``part`` (e,), ``times`` (t,) s,
        ``temperature`` (t, n) °C.
    part_names : tuple of str

    Raises
    ------
    BadInputError
        There is no such file, or it is no time series of fields.
    """
    try:
        with h5py.File(path, "r") as file:
            root = file["VTKHDF"]
            points = root["Points"][()].astype(np.float64)
            cells = int(root["NumberOfCells"][0])
            part = root[f"CellData/{PART}"]
            times = root["Steps/Values"][()]
            arrays = {
                "points": points,
                "tetrahedra": root["Connectivity"][()].reshape(cells, -1).astype(np.int64),
                "part": part[()].astype(np.int64),
                "times": times,
                "temperature": root[f"PointData/{TEMPERATURE}"][()].reshape(len(times), len(points)),
            }
            return arrays, tuple(str(name) for name in part.attrs["names"])
    except (OSError, KeyError, ValueError) as error:
        raise BadInputError(
            str(path), f"cannot be read as fields over time ({error}).", "Run the command again."
        ) from error
