"""Make a reduced model: snapshots, basis, check against the full model, enrichment."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.effects.framework.term import CHANNEL_FILM
from spindle_fem.errors import ConvergenceError
from spindle_fem.machine.view.place_names import ACROSS, AROUND, NEAR, UP
from spindle_fem.model.mesh.kernels.compile import wait_for_columns
from spindle_fem.model.reduced.growing_projection import GrowingProjection
from spindle_fem.model.reduced.kept_operators import keep_operators, kept_operators
from spindle_fem.model.reduced.mesh_model import MeshModel, build_mesh_model
from spindle_fem.model.reduced.reduced_cache import (
    KeptBasis,
    basis_path,
    family_of,
    reduced_digest,
    reduced_path,
)
from spindle_fem.model.reduced.snapshots import Sample
from spindle_fem.model.reduced.solving_order import in_solving_order
from spindle_fem.model.reduced.spindle_inputs import fast_spindle
from spindle_fem.model.reduced.unit_loads import coolant_loads, fluid_loads, friction_loads
from spindle_fem.model.thermal_model import ThermalModel, project
from spindle_fem.operation.channel_cells import cells_of_model
from spindle_fem.operation.coefficient_table import (
    CoefficientTable,
    build_coefficient_table,
    free_parameters,
)
from spindle_fem.operation.coolant_loop import CoolantLoop
from spindle_fem.operation.operating_point import OperatingPoint
from spindle_fem.parallel import beside
from spindle_fem.solvers.prepared_machine import prepare_machine

Array = NDArray[np.float64]
Progress = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class ReductionOptions:
    """Options for making a reduced model.

    Attributes
    ----------
    samples : int
        Sets of coefficients beside the nominal one; where too few, the checks add some.
    checks : int
        Sets that the basis is not made from.
    sigmas : float
        Half width of the sampled range in standard deviations.
    tolerance : float, [-]
        Of the proper orthogonal decomposition.
    error : float, [K]
        Largest error at any probe in the checks, for loads as large as they occur.
    largest : int
        Basis vectors at most; 30 more each time that a check fails.
    highest_speed : float or None, [rad/s]
        Of the sampled range; the heat table's last, or the definition's speed
        where that is higher, when None.
    """

    samples: int = 5
    checks: int = 3
    sigmas: float = 3.0
    tolerance: float = 3.0e-6
    error: float = 5.0e-3
    largest: int = 170
    highest_speed: float | None = None

    def key(self, spec: MachineSpec) -> dict[str, float]:
        """Options on which a model's identity depends."""
        return {**asdict(self), "highest_speed": self.highest_speed_of(spec)}

    def highest_speed_of(self, spec: MachineSpec) -> float:
        """Highest speed that the range holds, rad/s."""
        return spec.highest_speed if self.highest_speed is None else self.highest_speed


@dataclass(frozen=True, slots=True)
class Reduction:
    """A reduced model, and the fields on the mesh, (n, r), that its unknowns stand for."""

    model: ThermalModel
    fields: NDArray[np.float32]


# Laplace frequencies, 1/s: steady state, hours, minutes, half a minute.
SHIFTS = (0.0, 3.0e-4, 3.0e-3)
FAST_SHIFT = 3.0e-2
# Heat of one place that a diagnosis may find a source in, W.
PLACE_HEAT = 50.0
# Error of a solution from which a basis is made, as a share of the largest solution, in the energy norm; the
# resulting error of a projection at a probe is of second order in it.
SOLUTION_ERROR = 1.0e-3
# Relative tolerance of an error estimate.
CHECK_TOLERANCE = 0.02
# Relative tolerance when another machine's basis is tried, whose error is rarely close to the limit.
CHECK_OF_NEAR = 0.1
# Rounds of checks in which a basis grows; in those of the second number another machine's, without snapshots.
ROUNDS, ROUNDS_OF_NEAR = 5, 2
# Steps of the series in the change of one contact that the basis holds, and the share of its conductance
# that is left where all contacts of a group have opened.
CONTACT_ORDERS, OPENED = 2, 0.05
# Shares of the highest speed; the second is the nominal one.
SPEED_SHARES = (0.0, 2.0 / 3.0, 0.25, 1.0, 0.45)


@dataclass(frozen=True, slots=True)
class _Sampler:
    """Draws sets of coefficients over the range of a machine's uncertain parameters and speeds."""

    spec: MachineSpec
    full: ThermalModel
    table: CoefficientTable
    sigma: Mapping[str, float]
    options: ReductionOptions

    @classmethod
    def of(cls, spec: MachineSpec, full: ThermalModel, options: ReductionOptions) -> _Sampler:
        """Of a machine whose mesh model, or a projection of it, is known."""
        table = build_coefficient_table(spec, full.contacts, full.gap_radii)
        return cls(spec, full, table, free_parameters(spec), options)

    @property
    def usual_speed(self) -> float:
        """Speed of the nominal coefficients, rad/s."""
        return SPEED_SHARES[1] * self.options.highest_speed_of(self.spec)

    def sample(self, factors: Mapping[str, float], speed: float) -> Sample:
        """Coefficients with factors at a speed."""
        point = replace(OperatingPoint.of(self.spec), speed=speed)
        chosen = self.table.factors(factors)
        chosen.pop("heat.inner_share", None)
        base = self.table.base(point)
        coefficients = {
            name: base[name] * self.table.scale(name, chosen) for name in self.full.coefficient_names
        }
        capacities = {
            name: value * self.table.scale(name, chosen) for name, value in self.table.capacities().items()
        }
        film = nominal_channel_film(self.spec, self.full, point) * self.table.scale(CHANNEL_FILM, chosen)
        return Sample(coefficients, film, capacities)

    def random_samples(self, number: int, seed: int, sigmas: float) -> list[Sample]:
        """Latin hypercube over all parameters; the speeds take turns."""
        from scipy.stats import qmc  # slow to load

        names = tuple(self.sigma)
        highest = self.options.highest_speed_of(self.spec)
        unit = qmc.LatinHypercube(max(1, len(names)), rng=seed).random(number)
        found = []
        for row, values in enumerate(unit):
            factors = {
                name: float(np.exp(sigmas * self.sigma[name] * (2.0 * value - 1.0)))
                for name, value in zip(names, values, strict=False)
            }
            found.append(self.sample(factors, SPEED_SHARES[row % len(SPEED_SHARES)] * highest))
        return found

    def ranges(self) -> dict[str, tuple[float, float]]:
        """Lowest and highest coefficient that the samples may have."""
        ends = []
        highest = self.options.highest_speed_of(self.spec)
        for share in SPEED_SHARES:
            for sign in (-1.0, 1.0):
                factors = {
                    name: float(np.exp(sign * self.options.sigmas * s)) for name, s in self.sigma.items()
                }
                sample = self.sample(factors, share * highest)
                ends.append(
                    sample.coefficients
                    | sample.capacities
                    | ({CHANNEL_FILM: float(sample.channel_film.mean())} if sample.channel_film.size else {})
                )
        return {name: (min(e[name] for e in ends), max(e[name] for e in ends)) for name in ends[0]}


def nominal_channel_film(spec: MachineSpec, full: ThermalModel, point: OperatingPoint) -> Array:
    """Film of every coolant cell with the wall at inlet temperature, (n_cells,) W/(m²·K)."""
    if not full.cell_area.size:
        return np.zeros(0)
    wall = np.full(full.cell_area.shape, point.coolant_inlet_temperature)
    return CoolantLoop(spec, cells_of_model(full)).at(point, wall).film_coefficient.ravel()


def reduced_model_of(
    spec: MachineSpec,
    *,
    options: ReductionOptions | None = None,
    as_given: bool = False,
    progress: Progress = lambda stage: None,
) -> ThermalModel:
    """Reduced model of a machine, from the cache where it was made before.

    Parameters
    ----------
    as_given : bool
        Whether the coefficients stay as the definition gives them: a model of
        a machine that differs in coefficients only will do where its range
        holds these, otherwise where it holds all that they may become.
    progress : callable
        Called with the name of each stage as it begins.
    """
    chosen = options or ReductionOptions()
    digest = reduced_digest(spec, chosen.key(spec))
    found = ThermalModel.load(reduced_path(digest))
    if found is not None and found.digest == digest:
        return found
    for path in family_of(digest):
        found = ThermalModel.load(path)
        if found is not None and (
            _holds(found, spec, chosen.highest_speed_of(spec)) if as_given else _covers(found, spec, chosen)
        ):
            return found
    full = kept_operators(digest)
    if full is None:
        machine = prepare_machine(spec, progress=progress)
        progress("reduced model: operators")
        full = in_solving_order(build_mesh_model(machine))
        del machine
        kept = beside(partial(keep_operators, full, digest))
    else:
        kept = None
    near = _nearest(digest, full)
    built = build_reduced_model(spec, full, chosen, near=near, progress=progress)
    if kept is not None:
        kept()
    built.model.save(reduced_path(digest))
    if near is None or built.fields is not near.fields:
        KeptBasis(full.mesh_digest, built.fields).save(digest)
    return built.model


def _nearest(digest: str, full: MeshModel) -> Reduction | None:
    """The smallest reduction of another machine of the family on the same mesh; None where none is kept."""
    with_basis = [path for path in family_of(digest) if basis_path(path).is_file()]
    for path in sorted(with_basis, key=lambda path: path.stat().st_size):
        model, basis = ThermalModel.load(path), KeptBasis.beside(path)
        if model is not None and basis is not None and basis.mesh == full.mesh_digest:
            return Reduction(model, basis.fields)
    return None


def _holds(model: ThermalModel, spec: MachineSpec, highest_speed: float) -> bool:
    """Whether every coefficient of a machine is in the range of a model, from rest to a speed (rad/s)."""
    fast = fast_spindle(model, spec)
    values = [fast.table.capacities()]
    for share in SPEED_SHARES:
        point = replace(OperatingPoint.of(spec), speed=share * highest_speed)
        values.append(fast.coefficients(point, {}))
    return not any(model.outside_range(item) for item in values)


def _covers(model: ThermalModel, spec: MachineSpec, options: ReductionOptions) -> bool:
    """Whether a model was made and checked, as closely as asked, wherever a machine's parameters may go."""
    ranges = _Sampler.of(spec, model, options).ranges()
    outside = (model.outside_range({name: pair[end] for name, pair in ranges.items()}) for end in (0, 1))
    return model.errors["probes"] <= options.error and not any(outside)


def build_reduced_model(
    spec: MachineSpec,
    full: MeshModel,
    options: ReductionOptions | None = None,
    *,
    near: Reduction | None = None,
    progress: Progress = lambda stage: None,
) -> Reduction:
    """Project a machine's mesh model and check the projection against it.

    Snapshots are full solutions at several Laplace frequencies (moment
    matching, rational Krylov) for every source and fluid at the nominal
    coefficients, and for the physical loads at coefficients drawn over the
    range; only what the projection on those before misses is solved for. Their
    proper orthogonal decomposition in the energy of the nominal operator is the
    basis. The check corrects projected solutions at other coefficients by the
    full model; where they err by more than ``options.error``, the full
    solutions join.

    Parameters
    ----------
    full : MeshModel
        In solving order.
    near : Reduction, optional
        Of a machine on the same mesh with other coefficients: its basis takes the place of the
        snapshots, and what two rounds of checks ask for is added to it.

    Raises
    ------
    ConvergenceError
        The checks still err after ``ROUNDS`` with snapshots.
    """
    chosen = options or ReductionOptions()
    sampler = _Sampler.of(spec, full, chosen)
    nominal = sampler.sample({}, sampler.usual_speed)
    wait_for_columns()
    grown = GrowingProjection(full, nominal, None if near is None else (near.fields, near.model))
    wanted = None
    if near is None:
        progress("reduced model: snapshots")
        wanted = _wanted(grown, nominal, spec)
        _add_snapshots(grown, sampler, nominal, wanted)
    seed = 2
    for attempt in range(ROUNDS if near is None else ROUNDS + ROUNDS_OF_NEAR):
        if near is not None and attempt == ROUNDS_OF_NEAR:
            progress("reduced model: snapshots")
            _add_snapshots(grown, sampler, nominal, wanted)
            near = None
        progress("reduced model: basis")
        if near is None:
            basis = grown.leading(chosen.largest + 30 * attempt, chosen.tolerance)
        else:
            basis = np.eye(grown.size)
        progress("reduced model: check")
        share = CHECK_TOLERANCE if near is None else CHECK_OF_NEAR
        worst = {"probes": 0.0, "places": 0.0}
        # Solutions that have joined can no longer judge: every round draws others.
        samples = sampler.random_samples(chosen.checks, seed, 0.9 * chosen.sigmas)
        grown.expect(samples, SHIFTS)
        for sample in samples:
            loads = physical_loads(full, sample, spec)
            missing = np.hstack(grown.missing(sample, loads, SHIFTS, basis, share))
            errors = {"probes": _largest(full.probes @ missing), "places": _largest(full.places @ missing)}
            worst = {key: max(value, errors[key]) for key, value in worst.items()}
            if errors["probes"] > chosen.error:
                # What was good enough in the energy norm was not at the probes of this machine.
                wanted = _wanted(grown, nominal, spec) if wanted is None else wanted
                grown.enrich(sample, loads, SHIFTS, wanted * chosen.error / errors["probes"])
        seed += 100
        if worst["probes"] <= chosen.error:
            own = {"digest": reduced_digest(spec, chosen.key(spec)), "ranges": sampler.ranges()}
            if near is not None and len(basis) == near.model.size:
                return Reduction(replace(near.model, errors=worst, **own), near.fields)
            fields = grown.fields(basis)
            one = np.eye(1, basis.shape[1])[0]
            # The matrices of the mesh in double precision: what was worked out on the way is right to 1e-6.
            return Reduction(replace(project(full, fields.astype(float), one), errors=worst, **own), fields)
    raise ConvergenceError(
        "reduced model",
        f"its probes still err by {worst['probes']:.3g} K with {basis.shape[1]} basis vectors.",
        f"Asked: {chosen.error:g} K. Allow more basis vectors or a larger error.",
    )


def _wanted(grown: GrowingProjection, nominal: Sample, spec: MachineSpec) -> float:
    """Error in the energy norm of a solution from which a basis is made."""
    return SOLUTION_ERROR * grown.size_of(nominal, physical_loads(grown.full, nominal, spec))


def _snapshot_samples(sampler: _Sampler) -> list[Sample]:
    """Coefficients beside the nominal ones: each group of joints opened, and draws over the range."""
    joints = [{f"joint.{group.name}": OPENED} for group in sampler.spec.joint]
    opened = [sampler.sample(factors, sampler.usual_speed) for factors in joints]
    return [*opened, *sampler.random_samples(sampler.options.samples, 1, sampler.options.sigmas)]


def _add_snapshots(grown: GrowingProjection, sampler: _Sampler, nominal: Sample, wanted: float) -> None:
    """Sources one by one at the nominal coefficients, then physical loads over the range."""
    others = _snapshot_samples(sampler)
    grown.expect([nominal, *others], SHIFTS)
    _add_nominal(grown, nominal, sampler.spec, wanted)
    for sample in others:
        grown.enrich(sample, physical_loads(grown.full, sample, sampler.spec), SHIFTS, wanted)


def _source_places(full: MeshModel, spec: MachineSpec) -> list[str]:
    """Places that the machine's own heat sources warm, or a diagnosis may need one, beside friction's."""
    rings = {
        f"{bearing.name}.{side}" for _, bearing in spec.bearings for side in ("inner_ring", "outer_ring")
    }
    segments = {f"{part.name}.{segment.name}" for part in spec.part for segment in part.segment}
    single = {f"{part.name}.{part.segment[0].name}" for part in spec.part if len(part.segment) == 1}
    other = [name for name in full.place_names if name in segments - single or name in rings]
    other += [part.name for part in spec.part if len(part.segment) == 1]
    other += [name for name in full.place_names if name.startswith((NEAR, AROUND, UP, ACROSS))]
    return list(dict.fromkeys((*other, *(source.place for source in spec.source))))


def _add_nominal(grown: GrowingProjection, nominal: Sample, spec: MachineSpec, wanted: float) -> None:
    """Every source and fluid by itself at the nominal coefficients."""
    full = grown.full
    heat = friction_loads(
        full, [[bearing.name] for _, bearing in spec.bearings], ("inner_raceway", "outer_raceway", "balls")
    )
    loads = np.hstack(
        (
            heat,
            PLACE_HEAT * full.place_rows(_source_places(full, spec)).T,
            fluid_loads(full, nominal.coefficients, together=False),
            coolant_loads(full, nominal.channel_film, 5),
        )
    )
    for shift in SHIFTS:
        grown.enrich(nominal, loads, [shift], wanted)
    _add_contacts(grown, nominal, spec, wanted)
    grown.enrich(nominal, heat, [FAST_SHIFT], wanted)


def _add_contacts(grown: GrowingProjection, nominal: Sample, spec: MachineSpec, wanted: float) -> None:
    """Add the effect of each single contact, at the nominal coefficients.

    The uncertain parameters move the contacts of a set together: no other solution contains the field beside
    one seat that is worse than the others. ``K⁻¹ g J u``, and the same of that, are the first terms of
    the series in a share of one conductance g with the operator J.
    """
    names = [name for name in grown.full.coefficient_names if name.startswith("joint.")]
    loads = physical_loads(grown.full, nominal, spec)
    for shift in SHIFTS:
        [solved] = grown.enrich(nominal, loads, [shift], wanted).coordinates
        fields = grown.fields(solved)
        # All loads press heat through a contact almost alike: the largest combination represents them.
        flows = [
            (rows, _largest_combination(flow)) for rows, flow in grown.flows(names, [fields] * len(names))
        ]
        for order in range(CONTACT_ORDERS):
            columns = np.zeros((len(fields), len(names)), dtype=np.float32)
            for column, name, (rows, flow) in zip(columns.T, names, flows, strict=True):
                column[rows] = nominal.coefficients[name] * flow
            [solved] = grown.enrich(nominal, columns, [shift], wanted).coordinates
            if order + 1 < CONTACT_ORDERS:
                changes = grown.fields(solved)
                flows = grown.flows(names, changes.T)


def _largest_combination(columns: Array) -> Array:
    """The combination of columns (n, m) of the largest norm that unit weights can have, (n,)."""
    _, vectors = np.linalg.eigh(columns.T @ columns)
    return columns @ vectors[:, -1]


def physical_loads(full: MeshModel, sample: Sample, spec: MachineSpec) -> Array:
    """Loads that occur: heat of each set on inner and on outer raceways, air, coolant."""
    groups = [[bearing.name for bearing in group.bearing] for group in spec.bearing_set]
    return np.hstack(
        (
            friction_loads(full, groups, ("inner_raceway", "outer_raceway")),
            fluid_loads(full, sample.coefficients, together=True),
            coolant_loads(full, sample.channel_film, 1),
        )
    )


def _largest(values: Array) -> float:
    return float(np.abs(values).max()) if values.size else 0.0
