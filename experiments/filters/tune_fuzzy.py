"""Tune the fuzzy rules and, with the same care, the IMM; writes assoc/filters/fuzzy_parameters.json.

Both see the same random flights and the same measurements. None of these flights is in the report
(experiments/fuzzy_ekf.py). The search for the rules begins where a longer one, by adaptation of a covariance matrix,
ended after 1,200 evaluations on the same flights.

    python -m experiments.filters.tune_fuzzy [--evaluations N] [--seed N] [--output FILE]
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import minimize

from assoc.errors import AssocError
from assoc.filters import CoordinatedTurn, FuzzyAdaptiveEKF
from assoc.filters.base import Filter
from experiments.filters.manoeuvres import Batch, errors, imm, random_flights

Array = np.ndarray[Any, np.dtype[Any]]

LEVELS = 4
OUTPUT = Path(__file__).resolve().parents[2] / "assoc" / "filters" / "fuzzy_parameters.json"


WINDOWS = (2, 7)
INPUTS = ((0.496, 1.70, 3.11, 4.82), (0.335, 1.02, 3.16, 17.0))
"""Where the search begins: centres of the inputs, for each window."""
OUTPUTS = ((-2.35, -0.261, 1.41, 3.86), (0.162, 0.773, 1.14, 1.39), (-3.91, -1.67, -1.06, -0.271))
"""Centres of log10 q of the acceleration and of the turn rate, and of log10 of the variance of a turn rate of 0."""


def fuzzy_vector() -> Array:
    """Return the start of the search."""
    inputs = [np.log(np.diff([0.0, *centres])) for centres in INPUTS]
    outputs = [np.concatenate([centres[:1], np.log(np.diff(centres))]) for centres in OUTPUTS]
    return np.concatenate([*inputs, *outputs])


def fuzzy_data(x: Array) -> dict[str, Any]:
    """Parameters of the fuzzy filter from a free vector; inputs and outputs are kept increasing."""
    parts = x.reshape(-1, LEVELS)
    inputs = [np.cumsum(np.exp(steps)).tolist() for steps in parts[: len(WINDOWS)]]
    outputs = [np.cumsum(np.concatenate([c[:1], np.exp(c[1:])])).tolist() for c in parts[len(WINDOWS) :]]
    return {
        "acceleration_noise": 1.0,
        "rate_noise": 0.01,
        "groups": [0, 0, 0, 0, 0, 0, 1],
        "window": WINDOWS[0],
        "inputs": inputs[0],
        "others": [{"window": w, "inputs": one} for w, one in zip(WINDOWS[1:], inputs[1:], strict=True)],
        "outputs": outputs[:2],
        "calm": outputs[2],
        "immediate": True,
    }


def fuzzy_filter(data: dict[str, Any]) -> FuzzyAdaptiveEKF:
    """Return the fuzzy filter of these parameters, on a coordinated turn."""
    return FuzzyAdaptiveEKF.from_data(CoordinatedTurn(data["acceleration_noise"], data["rate_noise"]), data)


def imm_data(x: Array) -> dict[str, float]:
    """Parameters of the IMM from a free vector."""
    stay = 1 / (1 + np.exp(-x[4:6]))
    return {
        "straight_noise": float(np.exp(x[0])),
        "rate_spread": float(np.exp(x[1])),
        "turn_noise": float(np.exp(x[2])),
        "rate_noise": float(np.exp(x[3])),
        "stay_straight": float(stay[0]),
        "stay_turning": float(stay[1]),
    }


def score(make: Callable[[], Filter[Any]], batch: Batch) -> float:
    """Mean over the flights of the logarithm of the RMSE, so that gentle and hard flights weigh alike."""
    try:
        squared = errors(make(), batch).mean(axis=0)
    except AssocError:
        return 1e3
    return float(0.5 * np.log(squared).mean())


def search(
    objective: Callable[[Array], float], start: Array, evaluations: int, spread: float = 0.35
) -> tuple[Array, float]:
    """Nelder and Mead, begun again from the best once it has shrunk."""
    best, value = start, objective(start)
    for part in (0.6, 0.4):
        simplex = np.vstack([best, best + spread * np.eye(len(best))])
        found = minimize(
            objective,
            best,
            method="Nelder-Mead",
            options={
                "maxfev": int(part * evaluations),
                "initial_simplex": simplex,
                "adaptive": True,
                "xatol": 1e-3,
                "fatol": 1e-5,
            },
        )
        if found.fun < value:
            best, value = found.x, float(found.fun)
    return best, value


def main() -> None:
    """Tune and write."""
    parser = argparse.ArgumentParser(description="Tune the fuzzy rules and the IMM on random flights.")
    parser.add_argument("--evaluations", type=int, default=1200, help="of the IMM's search (default 1200)")
    parser.add_argument("--polish", type=int, default=120, help="evaluations of the rules' search (default 120)")
    parser.add_argument("--flights", type=int, default=120, help="random flights (default 120)")
    parser.add_argument("--seed", type=int, default=20_000, help="of flights and noise (default 20000)")
    parser.add_argument("--output", type=Path, default=OUTPUT, help="the parameter file to write")
    chosen = parser.parse_args()
    rng = np.random.default_rng(chosen.seed)
    batch = Batch.draw(random_flights(chosen.flights, rng), 1, rng)

    rules, value = search(
        lambda x: score(lambda: fuzzy_filter(fuzzy_data(x)), batch), fuzzy_vector(), chosen.polish, 0.1
    )
    print(f"fuzzy: {np.exp(value):.2f} m")
    start = np.concatenate([np.log([1.0, 0.1, 3.0, 0.02]), [3.5, 3.0]])
    x, value = search(lambda x: score(lambda: imm(imm_data(x)), batch), start, chosen.evaluations)
    print(f"IMM: {np.exp(value):.2f} m")
    about = (
        f"tuned by experiments/filters/tune_fuzzy.py --seed {chosen.seed} on {chosen.flights} random flights, "
        f"{chosen.polish} evaluations for the rules, {chosen.evaluations} for the IMM"
    )
    text = json.dumps({"about": about, **fuzzy_data(rules), "imm": imm_data(x)}, indent=2)
    chosen.output.write_text(text + "\n", encoding="utf-8")
    print(f"{chosen.output}: written")


if __name__ == "__main__":
    main()
