"""Elastic bodies against published solutions: NAFEMS LE11, Timoshenko's bimetal, Lamé, turning walls."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve
from skfem import Basis, MeshQuad

from spindle_fem.machine.geometry.part_shapes import AnnularSegment
from spindle_fem.model.elastic.elastic_body import ElasticBody, Face
from spindle_fem.model.elastic.forms import strains
from spindle_fem.model.elastic.growth_outputs import AXIAL, RADIAL, BodyOutputs
from spindle_fem.model.elastic.meridian_mesh import MeridianMesh
from spindle_fem.physics.bearings.seat_contact import solve_seats
from spindle_fem.physics.elasticity.elastic_material import ElasticMaterial

STEEL = ElasticMaterial(206e9, 0.3, 12e-6, 7850.0)
INSIDE, OUTSIDE = 0.03, 0.07


def ring(size: float, length: float, inside: float = INSIDE, outside: float = OUTSIDE) -> ElasticBody:
    section = MeridianMesh.of([[AnnularSegment(0.0, length, inside, outside)]], size)
    return ElasticBody("ring", section, [STEEL.stiffness])


def between_planes(body: ElasticBody, load: np.ndarray) -> np.ndarray:
    """Displacement with both end planes held along the axis."""
    z = body.basis.doflocs[0]
    along = np.concatenate([dofs[0] for dofs in (body.basis.nodal_dofs, body.basis.facet_dofs)])
    held = along[(np.abs(z[along] - z.min()) < 1e-9) | (np.abs(z[along] - z.max()) < 1e-9)]
    free = np.setdiff1d(np.arange(body.basis.N), held)
    found = np.zeros(body.basis.N)
    found[free] = spsolve(body.stiffness_matrix()[free][:, free].tocsc(), load[free])
    return found


# ------------------------------------------------------------------ NAFEMS LE11
def arc(radius: float, first: float, last: float):
    def at(s: np.ndarray) -> np.ndarray:
        angle = np.radians(first + (last - first) * s)
        return radius * np.array([np.sin(angle), np.cos(angle)])

    return at


def line(first: tuple[float, float], last: tuple[float, float]):
    return lambda s: np.outer(first, 1.0 - s) + np.outer(last, s)


def le11(count: int) -> ElasticBody:
    """Cylinder, taper and sphere: four blocks between the inside and the outside, (z, r) in m."""
    half = 0.5**0.5
    middle = 0.5 * (half + 1.79)
    sides = (
        (arc(1.0, 0.0, 22.5), arc(1.4, 0.0, 30.0)),
        (arc(1.0, 22.5, 45.0), line((0.7, 1.2124), (1.045, 1.1062))),
        (line((half, half), (middle, half)), line((1.045, 1.1062), (1.39, 1.0))),
        (line((middle, half), (1.79, half)), line((1.39, 1.0), (1.79, 1.0))),
    )
    s, across = np.arange(count) / count, np.linspace(0.0, 1.0, count + 1)
    inner, outer = (
        np.concatenate([pair[k](s) for pair in sides] + [sides[-1][k](np.ones(1))], axis=1) for k in (0, 1)
    )
    points = inner[:, :, None] * (1.0 - across) + outer[:, :, None] * across
    number = np.arange(points[0].size).reshape(points[0].shape)
    cells = np.array([number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]]).reshape(4, -1)
    mesh = MeshQuad(points.reshape(2, -1), cells)
    section = SimpleNamespace(mesh=mesh, region=np.zeros(mesh.nelements, dtype=int))
    return ElasticBody("LE11", section, [ElasticMaterial(210e9, 0.3, 2.3e-4).stiffness])


def stress_at_a(body: ElasticBody) -> float:
    """σ_zz where the sphere's inside meets the plane of symmetry, Pa; T = r + z."""
    mesh, law = body.section.mesh, body.stiffnesses[0]
    shift = between_planes(body, body.expansion_load @ mesh.p.sum(axis=0))
    corner = int(np.argmin(np.hypot(mesh.p[0], mesh.p[1] - 1.0)))
    (element,) = np.flatnonzero((mesh.t == corner).any(axis=0))
    place = mesh.elem.refdom.p[:, mesh.t[:, element] == corner]
    there = Basis(mesh, body.basis.elem, quadrature=(place, np.ones(1)), elements=np.array([element]))
    strain = np.array(strains(there.interpolate(shift), mesh.p[1, corner], 0)[:3])[:, 0, 0]
    return float(law.normal[0] @ strain - law.thermal[0] * mesh.p[:, corner].sum())


def test_nafems_le11() -> None:
    """NAFEMS, The Standard NAFEMS Benchmarks, revision 3 (1990): -105 MPa at A."""
    coarse, fine = (stress_at_a(le11(count)) for count in (8, 16))
    assert fine + (fine - coarse) / 3.0 == pytest.approx(-105e6, rel=0.02)


# ------------------------------------------------------------------ closed forms
@pytest.mark.parametrize(("thickness_ratio", "modulus_ratio"), [(1.0, 1.0), (0.5, 2.0)])
def test_bimetal_of_timoshenko(thickness_ratio: float, modulus_ratio: float) -> None:
    """A plate of two metals of one Poisson's ratio bends to a sphere as the strip does to a circle.

    Source: Timoshenko, J. Opt. Soc. Am. 11 (1925) 233. Edges disturb a few thicknesses only.
    """
    height, hot, expansion = 2e-3, 50.0, (12e-6, 20e-6)
    upper = height * thickness_ratio / (1.0 + thickness_ratio)
    layers = [(0.0, height - upper), (height - upper, height)]
    section = MeridianMesh.of([[AnnularSegment(*z, 0.02, 0.08)] for z in layers], 1e-3)
    moduli = (100e9, 100e9 * modulus_ratio)
    body = ElasticBody(
        "plate",
        section,
        [ElasticMaterial(e, 0.3, a).stiffness for e, a in zip(moduli, expansion, strict=True)],
    )
    shift = body.solve(body.expansion_load @ np.full(section.mesh.nvertices, hot))
    radii = np.array([0.035, 0.065])
    z, r = section.mesh.p
    nodes = [int(np.argmin(np.hypot(z, r - radius))) for radius in radii]
    lift = np.diff(shift[body.basis.nodal_dofs[0, nodes]])[0]
    m, n = thickness_ratio, modulus_ratio
    shape = 3.0 * (1.0 + m) ** 2 + (1.0 + m * n) * (m**2 + 1.0 / (m * n))
    curvature = 6.0 * (expansion[1] - expansion[0]) * hot * (1.0 + m) ** 2 / (height * shape)
    assert abs(lift) == pytest.approx(0.5 * curvature * np.diff(radii**2)[0], rel=1e-6)


def test_a_clamped_bar_takes_its_expansion_as_stress() -> None:
    """σ = E α ΔT: what the ends would move apart over what they yield to a pressure."""
    body, hot = ring(0.01, 0.1), 40.0
    ends = [Face((z, z), (INSIDE, OUTSIDE)) for z in (0.0, 0.1)]
    apart = body.mean_shift(ends[1], AXIAL) - body.mean_shift(ends[0], AXIAL)
    outputs = BodyOutputs.of(body, {"apart": apart})
    grown = outputs.by_temperature()[0].sum() * hot
    stress = grown / outputs.compliance(np.array([ends[0].area]))[0, 0]
    assert stress == pytest.approx(206e9 * 12e-6 * hot, rel=1e-10)


def test_free_expansion_leaves_no_stress() -> None:
    body, hot = ring(0.01, 0.1), 50.0
    shift = body.solve(body.expansion_load @ np.full(body.section.mesh.nvertices, hot))
    law, r = STEEL.stiffness, body.basis.default_parameters()["x"][1]
    strain = np.array(strains(body.basis.interpolate(shift), r, 0)[:3])
    stress = np.einsum("ij,jep->iep", law.normal, strain) - law.thermal[:, None, None] * hot
    assert np.abs(stress).max() < 1e-6 * 206e9 * 12e-6 * hot


def turning_wall(r: np.ndarray, speed: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Radial shift of a hollow cylinder held at its ends, its slope, and shift over radius.

    Source: Timoshenko & Goodier, section 32, with the constants of plane strain.
    """
    young, poisson = 206e9 / (1.0 - 0.3**2), 0.3 / 0.7
    a, b = INSIDE**2, OUTSIDE**2
    scale = 7850.0 * speed**2 * (3.0 + poisson) * (1.0 - poisson) / (8.0 * young)
    out, back = (1.0 + poisson) / (1.0 - poisson), (1.0 + poisson) / (3.0 + poisson)
    shift = scale * ((a + b) * r + out * a * b / r - back * r**3)
    slope = scale * (a + b - out * a * b / r**2 - 3.0 * back * r**2)
    return shift, slope, shift / r


def test_turning_wall_converges_at_the_rate_of_theory() -> None:
    """Third order of the displacement in the mean square, second order in energy."""
    errors = []
    for size in (0.01, 0.005):
        body = ring(size, 0.02)
        found = body.basis.interpolate(between_planes(body, body.spin_load * 1000.0**2))
        r = body.basis.default_parameters()["x"][1]
        shift, slope, around = turning_wall(r, 1000.0)
        weight = body.basis.dx * r
        _, out, hoop = strains(found, r, 0)[:3]
        law = STEEL.stiffness.normal[1:, 1:]
        off = np.array([out - slope, hoop - around])
        errors.append(
            [
                np.sqrt((weight * (found[1] - shift) ** 2).sum()),
                np.sqrt((weight * np.einsum("iep,ij,jep->ep", off, law, off)).sum()),
            ]
        )
    rates = np.log2(np.divide(*errors))
    assert rates == pytest.approx([3.0, 2.0], abs=0.15)


def test_press_fit_of_lame() -> None:
    """δ on the radius: pressure, and how far bore and outside move."""
    length, seat, delta, bore, outside = 0.02, 0.05, 10e-6, 0.02, 0.08
    face = Face((0.0, length), (seat, seat))
    free = {"bore": Face((0.0, length), (bore, bore)), "outside": Face((0.0, length), (outside, outside))}
    bodies = {"bore": ring(1.25e-3, length, bore, seat), "outside": ring(1.25e-3, length, seat, outside)}
    outputs = {
        name: BodyOutputs.of(
            body, {"seat": body.mean_shift(face, RADIAL), "free": body.mean_shift(free[name], RADIAL)}
        ).compliance(np.array([face.area, 0.0]))
        for name, body in bodies.items()
    }
    softness = sum(yields[0, 0] for yields in outputs.values())
    (pressure,), _ = solve_seats(np.array([-delta]), np.array([[softness]]), np.array([face.area]))
    ring_shape = (outside**2 + seat**2) / (outside**2 - seat**2) + 0.3
    hub_shape = (seat**2 + bore**2) / (seat**2 - bore**2) - 0.3
    assert pressure == pytest.approx(delta / (seat / 206e9 * (ring_shape + hub_shape)), rel=1e-6)
    by_lame = {
        "bore": -2.0 * pressure * seat**2 * bore / (206e9 * (seat**2 - bore**2)),
        "outside": 2.0 * pressure * seat**2 * outside / (206e9 * (outside**2 - seat**2)),
    }
    for name, sign in (("bore", -1.0), ("outside", 1.0)):
        assert sign * outputs[name][1, 0] * pressure == pytest.approx(by_lame[name], rel=1e-6)
