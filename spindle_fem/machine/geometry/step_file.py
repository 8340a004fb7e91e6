"""The solid model as a STEP file."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from spindle_fem.errors import GeometryError, PathError
from spindle_fem.machine.geometry.assembly import AssemblyGeometry
from spindle_fem.machine.geometry.cad_solids import build_solids, gmsh_session


def export_step(assembly: AssemblyGeometry, path: str | Path) -> Path:
    """Write the solid model in mm, balls as spheres included, as STEP.

    Parameters
    ----------
    path : str or Path
        Ends in .step or .stp.

    Raises
    ------
    GeometryError
        Another suffix.
    PathError
        The file cannot be written, or not whole.
    """
    import gmsh

    path = Path(path)
    if path.suffix.lower() not in (".step", ".stp"):
        raise GeometryError(str(path), f'suffix "{path.suffix}".', "Allowed: .step, .stp.")
    scaled = _in_millimetres(assembly)
    with gmsh_session() as geometry:
        solids = build_solids(scaled, geometry)
        names = {tag: name for name, tag in solids.volume_of_part.items()}
        for row in scaled.balls:
            for number, (x, y, z) in enumerate(row.centres, row.first):
                if row.length:
                    start, along = [x, y, z - 0.5 * row.length], [0.0, 0.0, row.length]
                    solid = geometry.add_cylinder(start, along, 0.5 * row.ball_diameter)
                    names[solid.dim_tag[1]] = f"{row.name}.roller_{number}"
                else:
                    solid = geometry.add_ball([x, y, z], 0.5 * row.ball_diameter)
                    names[solid.dim_tag[1]] = f"{row.name}.ball_{number}"
        geometry.synchronize()
        for tag, name in names.items():
            gmsh.model.setEntityName(3, tag, name)
        try:
            with _quiet_writer():
                gmsh.write(str(path))
        except Exception as error:  # gmsh has no class of its own
            what = f"cannot be written whole ({error})."
            raise PathError(str(path), what, "Make room, or give another path.") from error
    return path


@contextmanager
def _quiet_writer() -> Iterator[None]:
    """OpenCASCADE reports on the process's own standard output, past gmsh's options and Python's stream."""
    sys.stdout.flush()
    kept, nowhere = os.dup(1), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 1)
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)
        os.close(nowhere)


def _in_millimetres(assembly: AssemblyGeometry) -> AssemblyGeometry:
    """Lengths times 1000: scaling solids afterwards would turn them into splines."""

    def scaled(item: object, *names: str) -> object:
        changes = {name: getattr(item, name) for name in names}
        return replace(
            item,
            **{
                name: tuple(1.0e3 * part for part in value) if isinstance(value, tuple) else 1.0e3 * value
                for name, value in changes.items()
            },
        )

    channel = assembly.channel
    if channel is not None:
        channel = replace(
            channel,
            definition=scaled(channel.definition, "inner_radius", "depth", "width", "pitch", "z_start"),
            ports=tuple(
                scaled(port, "z", "radius", "start_radius", "seam_radius", "end_radius")
                for port in channel.ports
            ),
        )
    return replace(
        assembly,
        edges=tuple(scaled(edge, "z", "r") for edge in assembly.edges),
        channel=channel,
        balls=tuple(scaled(row, "z", "pitch_radius", "ball_diameter", "length") for row in assembly.balls),
    )
