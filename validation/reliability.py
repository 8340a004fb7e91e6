"""How often a first set is right, given its evidence (``python -m validation.reliability STUDY=RESULTS``).

Fits what :mod:`spindle_fem.inference.reliability` states, by maximum likelihood
over diagnoses of concealed recordings that named something of the catalogue,
where nothing was concealed as well.
"""

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import expit

from spindle_fem.inference.reliability import features

from .score import first_right

Array = NDArray[np.float64]

NAMES = (
    "constant",
    "by the logit of evidence",
    "by the last effect's share",
    "by what a larger set gains",
)
# Precision of the normal prior of every coefficient but the constant: few cases are wrong.
RIDGE = 0.6


def experience(study: Path, results: Path) -> tuple[Array, Array]:
    """Features and whether the set was right, of every diagnosis that named something.

    Parameters
    ----------
    study, results : Path
        As :mod:`validation.score` takes them.

    Returns
    -------
    features : (n, 4) ndarray
    right : (n,) ndarray
        0 or 1.
    """
    rows, right = [], []
    for path in sorted((study / "answers").glob("*.json")):
        answer: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        found = results / answer["case"] / "diagnosis.json"
        if not found.exists() or any(e.get("outside_catalogue") for e in answer["effects"]):
            continue
        diagnosis = json.loads(found.read_text(encoding="utf-8"))
        if diagnosis["findings"]:
            evidence = diagnosis.get("evidence")
            if evidence is None:
                raise SystemExit(f"{found}: says nothing of evidence. Diagnose the study anew.")
            probability, share, more = (
                evidence[key] for key in ("probability", "share_of_last", "gain_of_more")
            )
            rows.append(features(probability, share, more))
            right.append(float(first_right(answer, diagnosis["findings"])))
    return np.array(rows).reshape(-1, len(NAMES)), np.array(right)


def fitted(rows: Array, right: Array) -> Array:
    """Coefficients of the logistic regression, (4,)."""

    def cost(coefficients: Array) -> float:
        score = rows @ coefficients
        # -log σ(s) = log(1 + e^-s)
        likelihood = np.logaddexp(0.0, np.where(right > 0.5, -score, score)).sum()
        return float(likelihood + 0.5 * RIDGE * np.sum(coefficients[1:] ** 2))

    return minimize(cost, np.zeros(rows.shape[1])).x


def log_loss(probability: Array, right: Array) -> float:
    """Mean logarithmic loss of stated probabilities; 0 is perfect.

    >>> round(log_loss(np.array([0.5, 0.5]), np.array([1.0, 0.0])), 3)
    0.693
    """
    stated = np.clip(probability, 1e-4, 1.0 - 1e-4)
    return float(-np.mean(right * np.log(stated) + (1.0 - right) * np.log1p(-stated)))


def main() -> None:
    """Print the coefficients, and the loss of what evidence alone and what they state."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("pairs", nargs="+", metavar="STUDY=RESULTS")
    pairs = [tuple(map(Path, item.split("=", 1))) for item in parser.parse_args().pairs]
    found = [experience(*pair) for pair in pairs]
    rows, right = np.vstack([f[0] for f in found]), np.concatenate([f[1] for f in found])
    coefficients = fitted(rows, right)
    for name, value in zip(NAMES, coefficients, strict=True):
        print(f"{name:32s} {value:7.3f}")
    alone, stated = expit(rows[:, 1]), np.minimum(expit(rows[:, 1]), expit(rows @ coefficients))
    print(f"{len(right)} diagnoses, {int(right.sum())} right")
    print(
        f"log loss: by evidence alone {log_loss(alone, right):.3f}, as stated {log_loss(stated, right):.3f}"
    )


if __name__ == "__main__":
    main()
