"""One elastic body against exact solutions: expansion, pressure, rotation, bending, reciprocity."""

from __future__ import annotations

import numpy as np
import pytest

from spindle_fem.machine.geometry.part_shapes import AnnularSegment
from spindle_fem.model.elastic.elastic_body import ElasticBody, Face
from spindle_fem.model.elastic.growth_outputs import AXIAL, RADIAL, SIDEWAYS, BodyOutputs
from spindle_fem.model.elastic.meridian_mesh import MeridianMesh
from spindle_fem.physics.elasticity.elastic_material import ElasticMaterial

STEEL = ElasticMaterial(206e9, 0.3, 12e-6, 7850.0)
INSIDE, OUTSIDE, LENGTH = 0.03, 0.07, 0.1
BORE, MANTLE = Face((0.0, LENGTH), (INSIDE, INSIDE)), Face((0.0, LENGTH), (OUTSIDE, OUTSIDE))


def cylinder(
    size: float = 0.01, length: float = LENGTH, inside: float = INSIDE, outside: float = OUTSIDE, **own
):
    section = MeridianMesh.of([[AnnularSegment(0.0, length, inside, outside)]], size)
    return ElasticBody("cylinder", section, [STEEL.stiffness], **own)


def corner_rise(body: ElasticBody, rise) -> np.ndarray:
    return rise(*body.section.mesh.p)


def test_even_expansion_is_free() -> None:
    body = cylinder()
    shift = body.solve(body.expansion_load @ np.full(body.section.mesh.nvertices, 10.0))
    assert body.mean_shift(BORE, RADIAL) @ shift == pytest.approx(12e-6 * 10.0 * INSIDE, rel=1e-10)
    ends = [body.mean_shift(Face((z, z), (INSIDE, OUTSIDE)), AXIAL) @ shift for z in (0.0, LENGTH)]
    assert ends[1] - ends[0] == pytest.approx(12e-6 * 10.0 * LENGTH, rel=1e-10)


def test_radial_gradient_converges_to_the_hollow_cylinder() -> None:
    """Linear in r, so that its bilinear interpolation is exact; free ends."""
    hot = 50.0
    moment = hot * (OUTSIDE**3 / 3.0 - INSIDE * OUTSIDE**2 / 2.0 + INSIDE**3 / 6.0) / (OUTSIDE - INSIDE)
    exact = 2.0 * 12e-6 * INSIDE / (OUTSIDE**2 - INSIDE**2) * moment
    errors = []
    for size in (0.01, 0.005):
        body = cylinder(size)
        rise = corner_rise(body, lambda z, r: hot * (r - INSIDE) / (OUTSIDE - INSIDE))
        shift = body.solve(body.expansion_load @ rise)
        errors.append(abs(body.mean_shift(BORE, RADIAL) @ shift / exact - 1.0))
    assert errors[1] < 2e-5
    assert errors[0] / errors[1] > 8.0


def test_pressure_in_the_bore_by_lame() -> None:
    body = cylinder(0.0025)
    outputs = BodyOutputs.of(body, {"bore": body.mean_shift(BORE, RADIAL)})
    shape = (OUTSIDE**2 + INSIDE**2) / (OUTSIDE**2 - INSIDE**2)
    exact = INSIDE / 206e9 * (shape + 0.3)
    assert outputs.compliance(np.array([BORE.area]))[0, 0] == pytest.approx(exact, rel=2e-6)


def test_rotating_disc() -> None:
    """Timoshenko & Goodier, section 32: plane stress, so a thin disc."""
    thickness = 5e-4
    section = MeridianMesh.of([[AnnularSegment(0.0, thickness, INSIDE, OUTSIDE)]], 1e-3)
    body = ElasticBody("disc", section, [STEEL.stiffness])
    shift = body.solve(body.spin_load * 1000.0**2)
    exact = 7850.0 * 1e6 * INSIDE / (4.0 * 206e9) * (3.3 * OUTSIDE**2 + 0.7 * INSIDE**2)
    bore = body.mean_shift(Face((0.0, thickness), (INSIDE, INSIDE)), RADIAL)
    assert bore @ shift == pytest.approx(exact, rel=2e-5)


def test_adjoint_gives_what_a_direct_solution_gives() -> None:
    body = cylinder()
    outputs = BodyOutputs.of(
        body, {"bore": body.mean_shift(BORE, RADIAL), "mantle": body.mean_shift(MANTLE, RADIAL)}
    )
    rise = np.random.default_rng(1).normal(20.0, 5.0, body.section.mesh.nvertices)
    direct = outputs.loads.T @ body.solve(body.expansion_load @ rise)
    np.testing.assert_allclose(outputs.by_temperature() @ rise, direct, rtol=1e-10)


def test_compliance_is_reciprocal() -> None:
    """Work of one pressure on the other's shift; the two faces' areas differ."""
    body = cylinder()
    outputs = BodyOutputs.of(
        body, {"bore": body.mean_shift(BORE, RADIAL), "mantle": body.mean_shift(MANTLE, RADIAL)}
    )
    areas = np.array([BORE.area, -MANTLE.area])
    compliance = outputs.compliance(areas)
    assert compliance[0, 1] * areas[0] == pytest.approx(compliance[1, 0] * areas[1], rel=1e-9)


@pytest.mark.parametrize("motion", ["shift", "tilt"])
def test_rigid_motions_of_a_section_meet_no_force(motion: str) -> None:
    body = cylinder(harmonic=1)
    z, r = body.basis.doflocs
    kind = np.empty(body.basis.N, dtype=int)
    for component in range(3):
        for dofs in (body.basis.nodal_dofs, body.basis.facet_dofs, body.basis.interior_dofs):
            kind[dofs[component]] = component
    amount = 1.0 if motion == "shift" else z
    along = np.zeros_like(z) if motion == "shift" else -r
    moved = np.select([kind == 0, kind == 1, kind == 2], [along, amount, -amount])
    outputs = BodyOutputs.of(body, {"mantle": body.mean_shift(MANTLE, SIDEWAYS)})
    expected = 1.0 if motion == "shift" else 0.5 * LENGTH
    assert outputs.loads[:, 0] @ moved == pytest.approx(expected, rel=1e-9)
    stiffness = body.stiffness_matrix()
    assert np.abs(stiffness @ moved).max() < 1e-9 * abs(stiffness).max()


def test_a_body_warmer_above_bends_to_the_circle_of_its_gradient() -> None:
    """T = g y leaves no stress; the axis curves by α g: a quadratic field, held by biquadratic elements."""
    body = cylinder(harmonic=1)
    gradient = 100.0
    rise = gradient * body.section.mesh.p[1]
    thirds = [Face((a, b), (INSIDE, INSIDE)) for a, b in ((0.0, 0.02), (0.04, 0.06), (0.08, 0.1))]
    first, middle, last = (body.mean_shift(face, SIDEWAYS) for face in thirds)
    sagitta = BodyOutputs.of(body, {"sagitta": middle - 0.5 * (first + last)}).by_temperature() @ rise
    assert sagitta[0] == pytest.approx(12e-6 * gradient * 0.04**2 / 2.0, rel=1e-9)


def test_lands_carry_no_axial_stress_and_half_of_the_hoop() -> None:
    lands = STEEL.lands(0.01, 0.012, 0.024)
    assert lands.normal[0, 0] < 1e-5 * STEEL.stiffness.normal[0, 0]
    assert lands.normal[2, 2] == pytest.approx(0.5 * 206e9 / (1.0 - 0.09))
    # slender lands bend: stiffness with the cube of width over height
    slender = [STEEL.lands(0.1, width, 0.024).shear[0] for width in (0.002, 0.004)]
    assert slender[1] / slender[0] == pytest.approx(8.0, rel=0.01)


def test_unknown_face_is_refused() -> None:
    from spindle_fem.errors import GeometryError

    with pytest.raises(GeometryError, match="no face at"):
        cylinder().mean_shift(Face((0.0, LENGTH), (0.05, 0.05)), RADIAL)
