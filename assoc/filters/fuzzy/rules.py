"""Fuzzy rules that come with the package: the paper's, and tuned ones."""

from __future__ import annotations

import json
from collections.abc import Mapping
from importlib.resources import files
from typing import Any

from assoc._parameters import positive
from assoc._system.wrong_types import explains_wrong_types
from assoc.filters.fuzzy.inference import FuzzyRules, FuzzyVariable

PAPER_SETS: dict[str, Mapping[str, tuple[float, float, float, float]]] = {
    "input": {
        "near zero": (0.0, 0.0, 0.1, 0.6),
        "small": (0.1, 1.0, 1.0, 2.0),
        "medium": (1.0, 2.0, 2.0, 4.0),
        "large": (2.0, 4.0, 6.0, 6.0),
    },
    "output": {
        "near zero": (0.0, 0.0, 0.2, 0.6),
        "near 1": (0.2, 1.0, 1.0, 1.5),
        "little larger than 1": (1.0, 1.5, 1.5, 3.0),
        "large": (2.0, 4.0, 6.0, 6.0),
    },
}
"""Membership functions under the paper's names; it shows no numbers, these are chosen."""


@explains_wrong_types
def paper_rules() -> FuzzyRules:
    """Return the paper's four rules, the same for q and r, with the chosen `PAPER_SETS`."""
    input_sets, output_sets = FuzzyVariable(PAPER_SETS["input"]), FuzzyVariable(PAPER_SETS["output"])
    return FuzzyRules(input_sets, output_sets, list(zip(input_sets.sets, output_sets.sets, strict=True)), points=201)


@explains_wrong_types
def tuned_data() -> dict[str, Any]:
    """Return the tuned parameters that come with the package, for `FuzzyAdaptiveEKF.from_data`.

    They were tuned by experiments/filters/tune.py for a coordinated turn with `acceleration_noise` and
    `rate_noise`.
    """
    text = files("assoc.filters.fuzzy").joinpath("tuned_parameters.json").read_text(encoding="utf-8")
    data: dict[str, Any] = json.loads(text)
    positive(data["acceleration_noise"], "acceleration_noise")
    return data
