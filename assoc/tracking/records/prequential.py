"""Whether an estimate is used in place of what was declared: only while it predicts better what comes next.

Both say how likely an observation is before it is learnt from; logarithms of the ratios are summed, and forgotten like
all that is learnt. As long as the declared is right the ratio has the mean 1, whatever the estimate: its product ever
reaches 1 / a with a probability of at most a. So the estimate is taken at that; ties go back to the declared.

A. P. Dawid, Statistical theory: the prequential approach, J. Royal Statistical Society A 147, 1984. J. Ville, Etude
critique de la notion de collectif, 1939.
"""

from __future__ import annotations

import math

import numpy as np

from assoc._types import Array

# share of right declarations that are ever replaced
_BY_CHANCE = 0.01
NEEDED = -math.log(_BY_CHANCE)
"""Evidence from which on an estimate is used."""


def trusted(evidence: Array, before: Array) -> Array:
    """Which estimates are to be used, by the logarithms of the ratios and by whether they were used before; bool."""
    return np.asarray((evidence > NEEDED) | (before & (evidence > 0.0)))


def mean_evidence(evidence: Array) -> Array:
    """Evidence for the mean of what several estimates predict."""
    return np.asarray(np.logaddexp.reduce(evidence) - math.log(len(evidence)))


def gain_of_shares(hits: Array, dwells: Array, estimate: Array, declared: Array) -> Array:
    """Gain of the evidence for `estimate` against `declared` by `hits` of `dwells` detected."""
    missed = np.log1p(-estimate) - np.log1p(-declared)
    return np.asarray(hits * np.log(estimate / declared) + (dwells - hits) * missed)


def gain_of_rates(count: Array, turns: Array, estimate: Array, declared: Array) -> Array:
    """The same by a count in so many turns, of rates a turn."""
    return np.asarray(count * np.log(estimate / declared) - (estimate - declared) * turns)


def gain_of_variances(squares: Array, estimate: Array, declared: Array) -> Array:
    """The same by squares of normal residuals."""
    return np.asarray(0.5 * (np.log(declared / estimate) + squares / declared - squares / estimate))
