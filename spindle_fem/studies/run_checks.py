"""Self-checks of every run: what must hold, and what happens when it does not."""

from __future__ import annotations

from collections.abc import Iterable

from spindle_fem.errors import CheckFailedError
from spindle_fem.results.thermal_result import Check, EnergyBalance
from spindle_fem.units import ZERO_CELSIUS_K

BALANCE_LIMIT = 1.0e-8
MEASURE_LIMIT = 1.0e-3
BELOW_COLDEST_LIMIT = 0.01
CLOSING_SHIFT_LIMIT = 1.0e-6


def check_energy(energy: EnergyBalance) -> Check:
    """Heat in equals heat out."""
    return _within(
        "energy balance",
        abs(energy.imbalance_relative),
        BALANCE_LIMIT,
        "",
        "Heat in less heat out, relative.",
    )


def check_coolant(mismatch: float) -> Check:
    """Check that heat from the walls equals the heat carried away by the coolant."""
    return _within(
        "coolant enthalpy",
        mismatch,
        BALANCE_LIMIT,
        "",
        "Film heat less enthalpy rise of the coolant, relative.",
    )


def check_circuits(mismatch: float) -> Check:
    """Check that heat from the walls of circuits equals the heat carried away by their coolant."""
    what = "Film heat less enthalpy rise of each circuit's coolant, relative; the worst."
    return _within("circuit enthalpy", mismatch, BALANCE_LIMIT, "", what)


def check_measures(kind: str, errors: dict[str, float]) -> Check:
    """Meshed areas or volumes against the solid model; the worst is named."""
    worst = max(errors, key=lambda name: abs(errors[name]))
    return _within(f"{kind} against CAD", abs(errors[worst]), MEASURE_LIMIT, "", f"Worst: {worst}.")


def check_coldest(coldest_inside: float, coldest_outside: float) -> Check:
    """Without a heat sink nothing inside is colder than all its surroundings."""
    below = max(0.0, coldest_outside - coldest_inside)
    what = f"Coldest surroundings {coldest_outside - ZERO_CELSIUS_K:.2f} °C."
    if below > BELOW_COLDEST_LIMIT:
        what += (
            " Elements are too large for the steepest film: mesh.order = 2, or a smaller mesh.size_factor."
        )
    return _within("below coldest surroundings", below, BELOW_COLDEST_LIMIT, "K", what)


def check_lubricant(word: str, temperatures: dict[str, float], limit: float) -> Check:
    """The lubricant stays below its limit; ``temperatures`` is the warmest that each bearing's meets, K."""
    hottest = max(temperatures, key=temperatures.get)
    return _within(
        f"{word} temperature",
        temperatures[hottest] - ZERO_CELSIUS_K,
        limit - ZERO_CELSIUS_K,
        "degC",
        f"Warmest {'raceway' if word == 'grease' else 'raceway or balls'}: {hottest}.",
    )


def check_residual(residual: float, limit: float) -> Check:
    """Relative residual of the linear equations."""
    return _within("linear residual", residual, limit, "", "Norm of residual over norm of load.")


def check_closing_shift(shift: float) -> Check:
    """The balance was not closed by force: the shift that closed it is next to nothing."""
    return _within(
        "balance closing shift",
        abs(shift),
        CLOSING_SHIFT_LIMIT,
        "K",
        "Uniform shift that brought the balance from the linear solver's tolerance to round-off.",
    )


def check_fixed_point(change: float, limit: float, iterations: int) -> Check:
    """Heat, films and coolant are those of the field itself."""
    return _within("coupling change", change, limit, "K", f"Last change of {iterations} iterations.")


def _within(name: str, value: float, limit: float, unit: str, explanation: str) -> Check:
    return Check(name, float(value), float(limit), unit, bool(value <= limit), explanation)


def require_checks(checks: Iterable[Check], where: str, written: str = "") -> None:
    """Raise when a check failed; ``written``: file with the results, for the message.

    Raises
    ------
    CheckFailedError
        Names every failed check with value and limit.
    """
    failed = [check for check in checks if not check.passed]
    if failed:
        listing = "; ".join(
            f"{check.name} {check.value:.4g} {check.unit} (limit {check.limit:.4g}). {check.explanation}"
            for check in failed
        )
        raise CheckFailedError(
            where,
            f"a self-check failed: {listing}",
            f"The results are written{f' ({written})' if written else ''}, do not rely on them.",
        )
