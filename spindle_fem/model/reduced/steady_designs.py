"""Steady designs of the fast model: one machine and operating point, many values of its parameters.

What parameters move is summed from few small matrices on a basis of its own,
so that a design is one small dense solve.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dgesv
from scipy.stats import qmc

from spindle_fem.effects.framework.term import CHANNEL_FILM
from spindle_fem.errors import ConvergenceError, OutOfValidityError, SpecError
from spindle_fem.model.reduced.coolant_maps import coolant_maps
from spindle_fem.model.reduced.drive import heat_of_table
from spindle_fem.model.reduced.fast_model import FastModel
from spindle_fem.model.reduced.natural_films import natural_film_terms
from spindle_fem.operation.operating_point import OperatingPoint

Array = NDArray[np.float64]

SNAPSHOTS, CHECKS = 80, 30
# Share of the named heat, and rise of a fluid [K], at most in the checks.
HEAT_SHARE, FLUID_RISE = 1.3, 10.0
FIRST_SIZE, MORE = 20, 4
# The coolant's maps are fitted by powers of the factor on the channel film.
FILM_POWERS = 7
AT_ONCE = 256


def design_loads(fast: FastModel, point: OperatingPoint) -> dict[str, Array]:
    """Loads that designs at an operating point may have in any amounts.

    Parameters
    ----------
    fast : FastModel
    point : OperatingPoint

    Returns
    -------
    mapping of str to (n_w,) ndarray
        ``<set>.<side>``: the table's heat of a bearing set [W], all on that
        side, so that its amount is the share times the factor on the heat;
        and each fluid by its name, 1 K (1 for ``coolant_friction``).
    """
    heat = heat_of_table(fast.spec, np.array([point.speed]), np.array([point.thrust]))[0]
    found = {}
    for group in fast.spec.bearing_set:
        for number, side in enumerate(("inner_raceway", "outer_raceway", "balls")):
            vector = np.zeros(len(fast.load_names))
            for bearing in group.bearing:
                vector[fast.heat_rows(bearing.name)[number]] = heat[fast.bearings.index(bearing.name)]
            if vector.any() and (side != "balls" or fast.spec.heat.ball_share > 0.0):
                found[f"{group.name}.{side}"] = vector
    for position in range(len(fast.heat_places), len(fast.load_names)):
        found[fast.load_names[position]] = np.eye(len(fast.load_names))[position]
    return found


@dataclass(frozen=True, slots=True)
class _Sums:
    """Weighted sums that make a design's system; the weights are those of :meth:`SteadyDesigns._weights`.

    Attributes
    ----------
    conduction : (k, r, r) ndarray
        Transposed: what LAPACK takes column by column.
    loads : (k, r, m) ndarray
    outlet : (k, r) ndarray
    outlet_loads : (k, m) ndarray
    outputs : (n_out, r) ndarray
        The outlet's row is zero.
    """

    conduction: Array
    loads: Array
    outlet: Array
    outlet_loads: Array
    outputs: Array

    def projected(self, basis: Array) -> _Sums:
        """Galerkin projection on a smaller basis, (r, s)."""
        return _Sums(
            np.ascontiguousarray(np.einsum("ra,krs,sb->kab", basis, self.conduction, basis, optimize=True)),
            np.ascontiguousarray(np.einsum("ra,krm->kam", basis, self.loads)),
            self.outlet @ basis,
            self.outlet_loads,
            self.outputs @ basis,
        )


class SteadyDesigns:
    """Steady probe temperatures of a machine where its parameters are what designs differ in.

    The basis is cut to steady states over the range of the parameters and
    checked at others, drawn anew, against the fast model that it is made of.

    Parameters
    ----------
    fast : FastModel
        Of a machine whose loads do not follow its temperatures.
    point : OperatingPoint
        Speed, flow and inlet temperature at which the films are taken.
    names : sequence of str
        Parameters that designs vary. Those of heat alone need not be among
        them: they are in the amounts of the loads.
    loads : mapping of str to (n_w,) ndarray, optional
        Load inputs (:attr:`FastModel.load_names`) that designs have in any
        amounts; :func:`design_loads` when absent.
    sigmas : float
        Half width of the range in standard deviations of the priors.
    error : float, [K]
        Largest error of any probe in the checks, for loads as large as they occur.

    Attributes
    ----------
    names, loads, channels : tuple of str
    limits : (p,) ndarray
        Largest logarithm of a factor, either way.
    size : int
        Basis vectors.
    checked_error : float, [K]
        Largest error in the checks; that of the fast model itself comes on top.

    Raises
    ------
    SpecError
        Loads that follow temperatures, or a parameter that the machine does not have.
    ConvergenceError
        The checks err by more than asked on the whole basis.
    """

    def __init__(
        self,
        fast: FastModel,
        point: OperatingPoint,
        names: Sequence[str],
        loads: Mapping[str, Array] | None = None,
        *,
        sigmas: float = 3.0,
        error: float = 5.0e-3,
    ) -> None:
        if fast.extra_terms or natural_film_terms(fast.spec):
            raise SpecError(
                "steady designs",
                "friction or films of this machine follow its temperatures.",
                'Take a study with backend = "reduced", or follow a transient until it has settled.',
            )
        self.fast, self.point = fast, point
        given = design_loads(fast, point) if loads is None else loads
        self.names, self.loads, self.channels = tuple(names), tuple(given), fast.channels
        self._rows = np.array(list(given.values())).reshape(len(given), len(fast.load_names))
        self.limits = sigmas * np.array([fast.sigmas([name])[name] for name in self.names])
        outlet = next((p.name for p in fast.spec.probe if p.kind == "coolant_outlet"), None)
        self._outlet = None if outlet is None else self.channels.index(outlet)
        groups, members = self._groups()
        film = self._exponents_of(CHANNEL_FILM)
        self._film_limit = float(np.abs(film) @ self.limits)
        powers = np.arange(FILM_POWERS if self._film_limit > 0.0 else 1)
        self._exponents = np.vstack((groups, np.outer(powers, film)))
        whole = self._sums(members, powers)
        rng = np.random.default_rng(1)
        basis = self._basis(whole, rng)
        values, amounts = self._draws(rng, CHECKS)
        exact = np.array([self._exact(*pair) for pair in zip(values, amounts, strict=True)])
        for size in range(min(FIRST_SIZE, basis.shape[1]), basis.shape[1] + MORE, MORE):
            self._own = whole.projected(basis[:, :size])
            self.checked_error = float(np.abs(self._answers(values, amounts) - exact).max())
            if self.checked_error <= error:
                break
        else:
            raise ConvergenceError(
                "steady designs",
                f"probes still err by {self.checked_error:.3g} K with {basis.shape[1]} basis vectors.",
                f"Asked: {error:g} K.",
            )
        self.size = self._own.outputs.shape[1]
        self._matrix = self._own.conduction.reshape(len(self._exponents), -1)
        self._right = self._own.loads.reshape(len(self._exponents), -1)

    # ---------------------------------------------------------------- answers
    def amounts(self, loads: Array) -> Array:
        """Amounts of the named loads in load inputs, (n, m).

        Parameters
        ----------
        loads : (n, n_w) ndarray
            As :meth:`FastModel.load_inputs` makes them, W and K.

        Raises
        ------
        SpecError
            They hold something that is not named.
        """
        found = np.linalg.lstsq(self._rows.T, np.transpose(loads), rcond=None)[0].T
        left = np.abs(found @ self._rows - loads)
        if left.max(initial=0.0) > 1e-9 * np.abs(loads).max(initial=1.0):
            place = self.fast.load_names[int(np.argmax(left.max(axis=0)))]
            raise SpecError(
                "steady designs",
                f"{place} has a load that none of them names.",
                f"Named: {', '.join(self.loads)}.",
            )
        return found

    def temperatures(self, log_factors: Array, amounts: Array) -> Array:
        """Probes of one design, (c,) K.

        Parameters
        ----------
        log_factors : (p,) ndarray
            Logarithm of the factor on each parameter.
        amounts : (m,) ndarray
            Of the loads.

        Raises
        ------
        OutOfValidityError
            A factor outside the range of the basis.
        """
        if (np.abs(log_factors) > self.limits).any():
            self._refuse(log_factors)
        own, size = self._own, self.size
        weights = np.exp(self._exponents @ log_factors)
        right = np.dot(weights, self._right).reshape(size, -1) @ amounts
        matrix = np.dot(weights, self._matrix).reshape(size, size).T
        _, _, state, failed = dgesv(matrix, right, overwrite_a=True, overwrite_b=True)
        if failed:
            raise ConvergenceError("steady designs", "nothing carries the heat away.")
        found = own.outputs @ state
        if self._outlet is not None:
            found[self._outlet] = weights @ (own.outlet @ state + own.outlet_loads @ amounts)
        return found

    def many(self, log_factors: Array, amounts: Array) -> Array:
        """Probes of many designs at once, (n, c) K.

        Parameters
        ----------
        log_factors : (n, p) ndarray
        amounts : (n, m) ndarray

        Raises
        ------
        OutOfValidityError
            As :meth:`temperatures`.
        """
        outside = np.any(np.abs(log_factors) > self.limits, axis=1)
        if outside.any():
            self._refuse(log_factors[np.argmax(outside)])
        return self._answers(log_factors, amounts)

    def _refuse(self, log_factors: Array) -> None:
        worst = int(np.argmax(np.abs(log_factors) - self.limits))
        given, limit = float(np.exp(log_factors[worst])), float(np.exp(self.limits[worst]))
        raise OutOfValidityError(
            "steady designs",
            f"the factor {given:.3g} on {self.names[worst]} is outside its range.",
            f"Allowed: {1.0 / limit:.3g} to {limit:.3g}; make them anew with more sigmas.",
        )

    def _answers(self, log_factors: Array, amounts: Array) -> Array:
        sums, found = self._own, np.empty((len(amounts), len(self.channels)))
        for first in range(0, len(amounts), AT_ONCE):
            rows = slice(first, first + AT_ONCE)
            weights = np.exp(log_factors[rows] @ self._exponents.T)
            matrix = np.tensordot(weights, sums.conduction, axes=1).transpose(0, 2, 1)
            right = np.tensordot(weights, sums.loads, axes=1) @ amounts[rows, :, None]
            states = np.linalg.solve(matrix, right)[:, :, 0]
            found[rows] = states @ sums.outputs.T
            if self._outlet is not None:
                outlet = states @ sums.outlet.T + amounts[rows] @ sums.outlet_loads.T
                found[rows, self._outlet] = np.einsum("nk,nk->n", weights, outlet)
        return found

    # ----------------------------------------------------------------- system
    def _exponents_of(self, coefficient: str) -> Array:
        """Power in which each parameter multiplies a coefficient, (p,)."""
        table = self.fast.table
        group = table.groups[coefficient]
        return np.array([float(sum(t in group for t in table.targets(name))) for name in self.names])

    def _groups(self) -> tuple[Array, list[list[str]]]:
        """Coefficients that the same parameters scale: powers (g, p), and the members of each group."""
        found: dict[tuple[float, ...], list[str]] = {}
        for name in self.fast.model.coefficient_names:
            found.setdefault(tuple(self._exponents_of(name).tolist()), []).append(name)
        return np.array(list(found)).reshape(len(found), len(self.names)), list(found.values())

    def _sums(self, members: Sequence[Sequence[str]], powers: Array) -> _Sums:
        """On the whole basis: a sum for each group of coefficients, then one for each power of the film."""
        fast, model = self.fast, self.fast.model
        values = fast.coefficients(self.point, {})
        number = len(members) + len(powers)
        conduction = np.zeros((number, model.size, model.size))
        inputs = np.zeros((number, model.size, len(fast.load_names)))
        for row, names in enumerate(members):
            for name in names:
                conduction[row] += values[name] * model.operators[model.coefficient_names.index(name)]
                if name in model.fluid_names:
                    load = model.fluid_load[model.fluid_names.index(name)]
                    inputs[row, :, fast.fluid_column(name)] += values[name] * load
        # Heat moves with no parameter, as the power zero does.
        for column, place in enumerate(fast.heat_places):
            inputs[len(members), :, column] = model.place(place)
        outputs = np.zeros((len(self.channels), model.size))
        outputs[[row for row, probe in enumerate(fast.spec.probe) if probe.kind == "point"]] = model.probes
        outlet, outlet_inputs = np.zeros((number, model.size)), np.zeros((number, len(fast.load_names)))
        if fast.loop is not None:
            inlet, friction = (fast.load_names.index(name) for name in ("coolant_inlet", "coolant_friction"))
            own, maps = slice(len(members), None), self._film_maps(powers)
            conduction[own] = maps["conduction"].transpose(0, 2, 1)
            inputs[own, :, inlet], inputs[own, :, friction] = maps["inlet_load"], maps["constant_load"]
            outlet[own] = maps["outlet"]
            outlet_inputs[own, inlet] = maps["outlet_inlet"]
            outlet_inputs[own, friction] = maps["outlet_constant"]
        return _Sums(conduction, inputs @ self._rows.T, outlet, outlet_inputs @ self._rows.T, outputs)

    def _film_maps(self, powers: Array) -> dict[str, Array]:
        """Coefficients of the coolant's maps as powers of the factor on the channel film."""
        number = len(powers)
        nodes = np.exp(self._film_limit * np.cos(np.pi * (np.arange(number) + 0.5) / number))
        found = [
            coolant_maps(
                self.fast.model, *self.fast.channel_film(self.point, {}, {CHANNEL_FILM: float(node)})
            )
            for node in nodes
        ]
        fit = np.linalg.inv(nodes[:, None] ** powers)
        return {
            name: np.tensordot(fit, np.array([getattr(maps, name) for maps in found]), axes=1)
            for name in type(found[0]).__slots__
        }

    # ------------------------------------------------------------------ basis
    def _draws(self, rng: np.random.Generator, number: int) -> tuple[Array, Array]:
        """Parameters over their range and loads as they occur, (n, p) and (n, m)."""
        unit = qmc.LatinHypercube(max(1, len(self.names)), rng=rng).random(number)[:, : len(self.names)]
        heat = np.abs(self._rows[:, : len(self.fast.heat_places)]).any(axis=1)
        part = rng.random((number, len(self.loads)))
        amounts = np.where(heat, HEAT_SHARE * part, FLUID_RISE * (2.0 * part - 1.0))
        if "coolant_friction" in self.loads:
            amounts[:, self.loads.index("coolant_friction")] = 1.0
        return self.limits * (2.0 * unit - 1.0), amounts

    def _exact(self, log_factors: Array, amounts: Array) -> Array:
        """Probes of the fast model itself, (c,) K."""
        fast, loads = self.fast, amounts @ self._rows
        factors = fast.table.factors(dict(zip(self.names, np.exp(log_factors).tolist(), strict=True)))
        operators = fast.operators(self.point, factors)
        states = np.linalg.solve(operators.conduction, operators.loads @ loads)
        return operators.outputs @ states + operators.output_inputs @ loads

    def _basis(self, whole: _Sums, rng: np.random.Generator) -> Array:
        """Leading directions of steady states, the uniform field first, (r, n)."""
        values, amounts = self._draws(rng, SNAPSHOTS)
        largest = np.abs(amounts).max(axis=0, initial=0.0)
        columns = []
        for weights in np.exp(values @ self._exponents.T):
            matrix = np.tensordot(weights, whole.conduction, axes=1).T
            columns.append(np.linalg.solve(matrix, np.tensordot(weights, whole.loads, axes=1) * largest))
        states = np.hstack(columns)
        one = self.fast.model.one / np.linalg.norm(self.fast.model.one)
        # The reduced coordinates are orthonormal in energy, so that plain ones are the right weights.
        states -= np.outer(one, one @ states)
        modes, sizes, _ = np.linalg.svd(states, full_matrices=False)
        return np.column_stack((one, modes[:, sizes > 1e-12 * sizes[0]]))
