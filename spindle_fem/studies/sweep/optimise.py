"""Search for better designs: what to try next, from what was solved so far."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from typing import Any

from spindle_fem.errors import BadInputError
from spindle_fem.studies.sweep.designs import Axis, Design, choice, make_design
from spindle_fem.studies.sweep.evaluate_design import FILM_HIGH, FILM_LOW
from spindle_fem.studies.sweep.judge_designs import Limit
from spindle_fem.studies.sweep.results_table import OK, Row
from spindle_fem.studies.sweep.study_file import Study
from spindle_fem.units import ZERO_CELSIUS_K

Solve = Callable[[Sequence[Design]], list[Row]]


def search_designs(
    study: Study, axes: Sequence[Axis], limits: Sequence[Limit], rows: Sequence[Row], solve: Solve
) -> list[Row]:
    """Try further designs inside the ranges, batch by batch.

    The tree-structured Parzen estimator of optuna proposes, from the planned
    designs and its own; it takes several objectives, limits, words and whole
    numbers, and few trials. The batch, not the number of workers, decides what
    it knows when it proposes, so a search that is repeated or resumed proposes
    the same designs.

    Parameters
    ----------
    study : Study
        With objectives and a search.
    rows : sequence of Row
        Of the planned designs.
    solve : callable
        Rows of some designs, in their order.

    Returns
    -------
    list of Row
        Of the designs that were tried.

    Raises
    ------
    BadInputError
        optuna is not installed.

    Source: Bergstra et al. (2011), NeurIPS 24; Ozaki et al. (2022), J. Artif. Intell. Res. 73, 1209-1250.
    """
    try:
        import optuna
    except ImportError as error:
        raise BadInputError(
            "search", "needs the package optuna.", "Install spindle-fem[optimise]."
        ) from error
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    settings = study.search
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
        sampler = optuna.samplers.TPESampler(
            seed=settings.seed,
            multivariate=True,
            constant_liar=True,
        )
        directions = [item.direction for item in study.objective]
        finder = optuna.create_study(sampler=sampler, directions=directions)
        space = {axis.path: _distribution(optuna, axis) for axis in axes}
        for row in rows:
            if row["status"] == OK:
                _add_known(optuna, finder, space, axes, study, limits, row)
        tried: list[Row] = []
        while len(tried) < settings.trials:
            number = min(settings.batch, settings.trials - len(tried))
            trials = [finder.ask(fixed_distributions=space) for _ in range(number)]
            first = len(rows) + len(tried) + 1
            designs = [_design(first + i, trial.params, axes) for i, trial in enumerate(trials)]
            for trial, row in zip(trials, solve(designs), strict=True):
                if row["status"] == OK:
                    for name, value in _excess(row, limits).items():
                        trial.set_constraint(name, value)
                    finder.tell(trial, _values(study, row))
                else:
                    finder.tell(trial, state=optuna.trial.TrialState.FAIL)
                tried.append(row)
    return tried


def _distribution(optuna: Any, axis: Axis) -> Any:
    if axis.low is None:
        return optuna.distributions.CategoricalDistribution(list(range(len(axis.choices))))
    if axis.rule is None:
        return optuna.distributions.IntDistribution(int(axis.low), int(axis.high))
    return optuna.distributions.FloatDistribution(axis.low, axis.high)


def _design(number: int, values: dict[str, Any], axes: Sequence[Axis]) -> Design:
    chosen = [
        axis.choices[values[axis.path]]
        if axis.low is None
        else choice(axis.path, values[axis.path], axis.rule)
        for axis in axes
    ]
    return make_design(number, chosen, axes)


def _add_known(
    optuna: Any,
    finder: Any,
    space: dict[str, Any],
    axes: Sequence[Axis],
    study: Study,
    limits: Sequence[Limit],
    row: Row,
) -> None:
    values = {axis.path: _coordinate(axis, row[axis.path]) for axis in axes}
    finder.add_trial(
        optuna.trial.create_trial(
            params=values,
            distributions=space,
            values=_values(study, row),
            constraints=_excess(row, limits),
        )
    )


def _coordinate(axis: Axis, shown: Any) -> Any:
    """Coordinate of a shown value on an axis: index in a list, else SI value clipped to the range."""
    if axis.low is None:
        return [one.shown for one in axis.choices].index(shown)
    if axis.rule is not None and axis.rule.kind == "temperature":
        shown = shown + ZERO_CELSIUS_K
    return min(max(shown, axis.low), axis.high)


def _values(study: Study, row: Row) -> list[float]:
    return [float(row[item.output]) for item in study.objective]


def _excess(row: Row, limits: Sequence[Limit]) -> dict[str, float]:
    """Relative violation of each limit; at most 0 if it holds at both ends of the film's band."""
    found = {}
    for number, limit in enumerate(limits):
        values = [row.get(limit.output + end) for end in ("", FILM_LOW, FILM_HIGH)]
        values = [value for value in values if value is not None]
        if limit.high is not None:
            found[f"{number}.max"] = (max(values) - limit.high) / max(abs(limit.high), 1e-12)
        if limit.low is not None:
            found[f"{number}.min"] = (limit.low - min(values)) / max(abs(limit.low), 1e-12)
    return found
