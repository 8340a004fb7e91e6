"""``fields.vtu``: the temperature field on curved elements, with names that can be read.

Written without VTK, in the XML format with a raw appended section that VTK,
ParaView and meshio read. Volume elements come first, then the exposed faces
as elements of their own, so that film and fluid temperature have a place.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from spindle_fem.machine.meshing.tagged_mesh import TaggedMesh
from spindle_fem.parallel import in_threads
from spindle_fem.results.thermal_result import ThermalResult
from spindle_fem.units import ZERO_CELSIUS_K

_VTK_QUADRATIC_TRIANGLE = 22
_VTK_QUADRATIC_TETRA = 24
_BLOCK_BYTES = 1 << 20
_CHUNK_ELEMENTS = 16384
_TYPES = {"float64": "Float64", "float32": "Float32", "int32": "Int32", "int64": "Int64", "uint8": "UInt8"}

# Natural coordinates of the ten nodes, and gradients of the shape functions there.
_NODES = np.array(
    [
        [0, 0, 0],
        [1, 0, 0],
        [0, 1, 0],
        [0, 0, 1],
        [0.5, 0, 0],
        [0.5, 0.5, 0],
        [0, 0.5, 0],
        [0, 0, 0.5],
        [0.5, 0, 0.5],
        [0, 0.5, 0.5],
    ],
    dtype=np.float64,
)
_EDGES = ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))


def _shape_gradients() -> NDArray[np.float64]:
    barycentric = np.column_stack([1.0 - _NODES.sum(axis=1), _NODES])
    slope = np.vstack([-np.ones(3), np.eye(3)])
    corners = (4.0 * barycentric - 1.0)[:, :, None] * slope
    edges = [
        4.0 * (barycentric[:, a, None] * slope[b] + barycentric[:, b, None] * slope[a]) for a, b in _EDGES
    ]
    return np.concatenate([corners, np.stack(edges, axis=1)], axis=1)


_GRADIENTS = _shape_gradients()  # (node, shape function, natural direction)


def heat_flux(
    mesh: TaggedMesh, temperature: NDArray[np.float64], conductivity: Mapping[str, float]
) -> NDArray[np.float64]:
    """Heat flux −k ∇T at every node, from the quadratic field on the curved elements.

    Parameters
    ----------
    temperature : (n_nodes,) ndarray, [K]
    conductivity : mapping of part to float, [W/(m·K)]

    Returns
    -------
    (n_nodes, 3) float64 ndarray, [W/m²]
        Mean of the elements that meet at the node, weighted by the volume that
        they have there. Parts share no node, so no mean crosses a joint; the
        mean is of one order more accurate than each element's own gradient
        inside a part, and of the same order on its surface.
    """
    by_part = np.array([conductivity[name] for name in mesh.part_names])
    flux = np.zeros((len(mesh.points), 3))
    weight = np.zeros(len(mesh.points))
    for first in range(0, mesh.n_elements, _CHUNK_ELEMENTS):
        chosen = slice(first, first + _CHUNK_ELEMENTS)
        nodes = mesh.tetrahedra[chosen]
        jacobian = np.einsum("qai,naj->nqij", _GRADIENTS, mesh.points[nodes], optimize=True)
        slope = np.einsum("qai,na->nqi", _GRADIENTS, temperature[nodes], optimize=True)
        # Rows of the inverse by cross products: far quicker than a general solver on 3 x 3.
        along_u, along_v, along_w = jacobian[..., 0, :], jacobian[..., 1, :], jacobian[..., 2, :]
        vw, wu, uv = np.cross(along_v, along_w), np.cross(along_w, along_u), np.cross(along_u, along_v)
        determinant = np.einsum("nqi,nqi->nq", along_u, vw)
        gradient_times_determinant = slope[..., :1] * vw + slope[..., 1:2] * wu + slope[..., 2:] * uv
        scale = -by_part[mesh.part_of_element[chosen]][:, None, None]
        flat = nodes.ravel()
        for axis in range(3):
            flux[:, axis] += np.bincount(
                flat, (scale[..., 0] * gradient_times_determinant[..., axis]).ravel(), len(flux)
            )
        weight += np.bincount(flat, determinant.ravel(), len(flux))
    return flux / weight[:, None]


def write_fields(result: ThermalResult, path: str | Path) -> Path:
    """Write ``fields.vtu``.

    Point data: ``temperature_degC``, ``heat_flux_W_m2``; ``displacement`` (m) of a result with growth in
    three dimensions. Cell data:
    ``part_id`` and ``surface_id`` (−1 on volume elements); field data
    ``part.NAME`` and ``surface.NAME`` hold the number of each name. On faces
    with a film ``film_coefficient_W_m2K`` and ``fluid_temperature_degC``, NaN
    elsewhere.
    """
    mesh, spec = result.mesh, result.spec
    conductivity = {name: spec.part_material(name).thermal_conductivity for name in mesh.part_names}
    surfaces = tuple(mesh.surfaces)
    counts = [len(mesh.surfaces[name]) for name in surfaces]
    film = np.full(mesh.n_elements + sum(counts), np.nan, dtype=np.float32)
    fluid = film.copy()
    first = mesh.n_elements
    for name, count in zip(surfaces, counts, strict=True):
        if name in result.film_coefficient:
            film[first : first + count] = result.film_coefficient[name]
            fluid[first : first + count] = result.fluid_temperature[name] - ZERO_CELSIUS_K
        first += count
    moved = result.solid_growth
    shift = {} if moved is None else {"displacement": moved.displacement.astype(np.float32)}
    return write_tagged_vtu(
        mesh,
        path,
        point_data={
            "temperature_degC": (result.temperature - ZERO_CELSIUS_K).astype(np.float32),
            "heat_flux_W_m2": heat_flux(mesh, result.temperature, conductivity).astype(np.float32),
            **shift,
        },
        cell_data={"film_coefficient_W_m2K": film, "fluid_temperature_degC": fluid},
    )


def write_tagged_vtu(
    mesh: TaggedMesh,
    path: str | Path,
    point_data: Mapping[str, NDArray] | None = None,
    cell_data: Mapping[str, NDArray] | None = None,
) -> Path:
    """Write a tagged mesh with data as VTU.

    Parameters
    ----------
    point_data : mapping of str to (n_nodes,) or (n_nodes, 3) ndarray, optional
    cell_data : mapping of str to ndarray, optional
        Volume elements first, then the faces of every surface in order.
    """
    surfaces = tuple(mesh.surfaces)
    part_index = {name: index for index, name in enumerate(mesh.part_names)}
    faces = [mesh.surfaces[name] for name in surfaces]
    counts = np.array([len(item) for item in faces], dtype=np.int64)
    n_faces = int(counts.sum())
    connectivity = np.concatenate([mesh.tetrahedra.ravel(), *(item.ravel() for item in faces)]).astype(
        np.int32
    )
    offsets = np.cumsum(np.repeat([10, 6], [mesh.n_elements, n_faces])).astype(np.int32)
    types = np.repeat([_VTK_QUADRATIC_TETRA, _VTK_QUADRATIC_TRIANGLE], [mesh.n_elements, n_faces]).astype(
        np.uint8
    )
    owner = np.array([part_index[mesh.part_of_surface[name]] for name in surfaces], dtype=np.int32)
    cells = {
        "part_id": np.concatenate([mesh.part_of_element, np.repeat(owner, counts)]).astype(np.int32),
        "surface_id": np.concatenate(
            [np.full(mesh.n_elements, -1), np.repeat(np.arange(len(surfaces)), counts)]
        ).astype(np.int32),
        **(cell_data or {}),
    }
    blocks: list[NDArray] = []

    def entry(name: str, array: NDArray) -> str:
        blocks.append(np.ascontiguousarray(array))
        components = f' NumberOfComponents="{array.shape[1]}"' if array.ndim == 2 else ""
        kind = _TYPES[array.dtype.name]
        place = f'format="appended" offset="{{{len(blocks) - 1}}}"'
        return f'<DataArray type="{kind}" Name="{name}"{components} {place}/>'

    number = f'NumberOfPoints="{len(mesh.points)}" NumberOfCells="{mesh.n_elements + n_faces}"'
    text = "\n".join(
        [
            '<?xml version="1.0"?>',
            '<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" header_type="UInt64"'
            ' compressor="vtkZLibDataCompressor">',
            "<UnstructuredGrid>",
            "<FieldData>",
            *_numbered("part", mesh.part_names),
            *_numbered("surface", surfaces),
            "</FieldData>",
            f"<Piece {number}>",
            "<PointData>",
            *(entry(name, array) for name, array in (point_data or {}).items()),
            "</PointData>",
            "<CellData>",
            *(entry(name, array) for name, array in cells.items()),
            "</CellData>",
            "<Points>",
            entry("Points", mesh.points),
            "</Points>",
            "<Cells>",
            entry("connectivity", connectivity),
            entry("offsets", offsets),
            entry("types", types),
            "</Cells>",
            "</Piece>",
            "</UnstructuredGrid>",
            '<AppendedData encoding="raw">',
            "_",
        ]
    )
    packed = _compress(blocks)
    starts = np.concatenate([[0], np.cumsum([len(item) for item in packed])])
    path = Path(path)
    with path.open("wb") as file:
        file.write(text.format(*starts[:-1]).encode())
        file.writelines(packed)
        file.write(b"\n</AppendedData>\n</VTKFile>\n")
    return path


def _numbered(kind: str, names: tuple[str, ...]) -> Iterator[str]:
    # One array a name, because readers other than VTK refuse arrays of text.
    for number, name in enumerate(names):
        opening = f'<DataArray type="Int32" Name="{kind}.{name}" NumberOfTuples="1" format="ascii">'
        yield f"{opening}{number}</DataArray>"


def _compress(arrays: list[NDArray]) -> list[bytes]:
    """VTK's compressed arrays: number, size and last size of the blocks, their lengths, the blocks."""
    tasks = []
    for array in arrays:
        data = memoryview(array).cast("B")
        tasks.append([data[first : first + _BLOCK_BYTES] for first in range(0, len(data), _BLOCK_BYTES)])
    packed = iter(in_threads([partial(zlib.compress, block, 1) for task in tasks for block in task]))
    result = []
    for task in tasks:
        blocks = [next(packed) for _ in task]
        last = len(task[-1]) % _BLOCK_BYTES if task else 0
        header = np.array([len(blocks), _BLOCK_BYTES, last, *(len(block) for block in blocks)], dtype="<u8")
        result.append(header.tobytes() + b"".join(blocks))
    return result
