"""The paper's filter: its model, rules and numbers.

Its membership functions (figures 7 to 9) have no numbers in the text. Three readings: the sets that the package chose
by eye, the sets and the base noise tuned on random flights (the stand-in by which the paper's rules are judged), and
the numbers of equations 38 to 40 taken literally, in kilometres.
"""

import json
import math
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from assoc._types import Array
from assoc.errors import AssocWarning
from assoc.filters import ConstantAcceleration, FuzzyAdaptiveEKF, FuzzyRules, FuzzyVariable, Gaussian, paper_rules
from assoc.filters.base import Filter
from experiments.filters.b1 import radar_of
from experiments.filters.manoeuvres import Batch
from experiments.filters.tune import from_steps, to_steps

TUNED = Path(__file__).with_name("published_rules.json")
INPUT_SETS = ("NZ", "S", "M", "L")
OUTPUT_SETS = ("NZ", "N1", "LL1", "L")
KILOMETRE = 1000.0
Q0, R0, P0 = 0.005, 3.0, 0.01
"""Equations 38 to 40; the paper gives no units, its errors are of the size of kilometres."""
FIRST_GUESS: dict[str, Any] = {
    "noise": 2.0,
    "inputs": [0.1, 1.0, 2.0, 4.0],
    "q": [0.2, 1.0, 1.5, 4.0],
    "r": [0.2, 1.0, 1.5, 4.0],
}
"""Where the tuning begins: the package's sets, chosen by eye."""


def rules_of(data: dict[str, Any], name: str) -> FuzzyRules:
    """Return the paper's rules for "q" or "r", with triangles on these centres."""
    return FuzzyRules(
        FuzzyVariable.from_centres(INPUT_SETS, data["inputs"], 1.0),
        FuzzyVariable.from_centres(OUTPUT_SETS, data[name], min(0.05, data[name][0])),
        list(zip(INPUT_SETS, OUTPUT_SETS, strict=True)),
        points=201,
    )


def published_filter(data: dict[str, Any]) -> FuzzyAdaptiveEKF:
    """Return the paper's filter with triangles on these centres, constant acceleration of this base noise."""
    return FuzzyAdaptiveEKF(ConstantAcceleration(data["noise"]), rules_of(data, "q"), rules_of(data, "r"))


def chosen_filter() -> FuzzyAdaptiveEKF:
    """Return the paper's filter with the package's sets, chosen by eye."""
    return FuzzyAdaptiveEKF(ConstantAcceleration(FIRST_GUESS["noise"]), paper_rules(), paper_rules())


def tuned() -> dict[str, Any]:
    """Return the parameters that tune_published found."""
    data: dict[str, Any] = json.loads(TUNED.read_text(encoding="utf-8"))
    return data


def vector(data: dict[str, Any]) -> Array:
    """Free vector of the paper's filter: the base noise and the centres of all sets."""
    centres = [to_steps(np.array(data[name]), True) for name in ("inputs", "q", "r")]
    return np.concatenate([[math.log(data["noise"])], *centres])


def from_vector(x: Array) -> dict[str, Any]:
    """Parameters from a free vector."""
    parts = {name: from_steps(x[1 + 4 * i : 5 + 4 * i], True) for i, name in enumerate(("inputs", "q", "r"))}
    return {"noise": float(np.exp(x[0])), **parts}


def literal_errors(filter_: Filter[Any], batch: Batch) -> Array:
    """Squared position errors (K - 2, runs), m^2, with R_0 and P_0 of equations 39 and 40, in kilometres.

    The start is the first measurement, velocity and acceleration 0; the errors are those of `manoeuvres.errors`.
    """
    with warnings.catch_warnings():
        # an angle's noise of 1.7 rad is what the paper prints
        warnings.simplefilter("ignore", AssocWarning)
        radar = radar_of(np.full(3, math.sqrt(R0)))
    seen, truth = batch.measured / np.array([KILOMETRE, 1.0, 1.0]), batch.truth / KILOMETRE
    r, a, e = seen[0].T
    mean = np.zeros((len(r), 9))
    mean[:, :3] = np.stack([r * np.cos(a) * np.cos(e), r * np.sin(a) * np.cos(e), r * np.sin(e)], axis=1)
    state = filter_.start(Gaussian(mean, P0 * np.eye(9)))
    result = []
    for k in range(1, len(truth)):
        state = filter_.update(filter_.predict(state, 1.0), seen[k], radar).state
        if k >= 2:
            result.append(((state.mean[:, :3] - truth[k]) ** 2).sum(axis=1) * KILOMETRE**2)
    return np.array(result)


def literal_motion() -> ConstantAcceleration:
    """Return constant acceleration with Q_0 of equation 38, in kilometres."""
    return ConstantAcceleration(math.sqrt(Q0))
