"""Which biases are observable, by the information matrix.

References
----------
Y. Bar-Shalom, P. Willett, X. Tian, Tracking and Data Fusion, 2011, chapter 9 (registration); S. Blackman, R. Popoli,
Design and Analysis of Modern Tracking Systems, 1999, section 10.5.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from assoc._types import Array
from assoc.registration.terms import Term, label_of
from assoc.sensors import Sensor

OPEN = 0.5
"""A bias, or a sum of biases, counts as observed when its spread has shrunk to less than this share."""
_SHARE = 0.2
_MOST_NAMED = 4


def observed_shares(information: Array, spreads: Array) -> Array:
    """Share of each bias's spread that is left after the measurements, (n,): 1 if they have no information on it."""
    scaled = information * np.outer(spreads, spreads)
    left: Array = np.sqrt(np.diagonal(np.linalg.inv(scaled + np.eye(len(spreads)))))
    return left


def open_directions(information: Array, spreads: Array) -> Array:
    """Sums of biases that are not observable, (m, n) with rows of length one, in spreads of each bias."""
    scaled = information * np.outer(spreads, spreads)
    values, vectors = np.linalg.eigh(0.5 * (scaled + scaled.T))
    found: Array = vectors[:, 1.0 / np.sqrt(1.0 + np.maximum(values, 0.0)) > OPEN].T
    if len(found) < 2:
        return found
    # any combination of them is open too: those of few biases are easiest to read
    from scipy.linalg import qr

    _, upper, order = qr(found, pivoting=True)
    few = np.zeros_like(found)
    few[:, order] = np.linalg.solve(upper[:, : len(found)], upper)
    shortened: Array = few / np.linalg.norm(few, axis=1, keepdims=True)
    return shortened


def describe(direction: Array, terms: Sequence[Term], sensors: Sequence[Sensor]) -> str:
    """Name the biases that move together in a direction that is not observable."""
    order = np.argsort(-np.abs(direction), kind="stable")
    # the shift of very many sensors together has small parts only
    share = min(_SHARE, 0.5 * float(np.abs(direction).max()))
    order = order[np.abs(direction[order]) > share]
    signs = np.sign(direction) * np.sign([term.scale for term in terms])
    parts = []
    for number in order[:_MOST_NAMED]:
        term, sign = terms[number], signs[order[0]] * signs[number]
        parts.append(f"{'+' if sign > 0 else '-'} {term.shown} of {label_of(sensors, term.sensor)}")
    text = " ".join(parts).removeprefix("+ ")
    return text + (" ..." if len(order) > _MOST_NAMED else "")
