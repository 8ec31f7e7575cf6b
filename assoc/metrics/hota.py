"""HOTA: detection and association of tracks in equal parts, over all thresholds of similarity."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from assoc._system.wrong_types import explains_wrong_types
from assoc._text.shown import Shown
from assoc._types import Array
from assoc.metrics.ospa import check_cutoff, distances
from assoc.metrics.trajectories import Trajectories, epochs

THRESHOLDS = np.arange(1, 20) / 20.0
"""Of similarity: 0.05, 0.1, ... 0.95."""
_ROUNDING = 1e-12


@dataclass(frozen=True, repr=False)
class Hota(Shown):
    """Means over the thresholds, 0 to 1, 1 is best; NaN without truth and without tracks.

    Attributes
    ----------
    hota : float
        Of the geometric means of the other two.
    detection : float
        Pairs of a target and a track / all instants of targets and of tracks.
    association : float
        Mean over the pairs: instants at which this target and this track are a pair / instants of either.
    """

    hota: float
    detection: float
    association: float

    def __repr__(self) -> str:
        return f"Hota({self.hota:.3f}, detection {self.detection:.3f}, association {self.association:.3f})"


@explains_wrong_types
def hota(truth: Trajectories, tracks: Trajectories, cutoff: float) -> Hota:
    """Higher order tracking accuracy.

    A target and a track d metres apart have the similarity 1 - d / cutoff, at least 0. At each instant they are paired
    so that the sum of similarity times the overall agreement of the two identities is largest; for each threshold the
    pairs of at least this similarity count.

    Parameters
    ----------
    truth, tracks : Trajectories
    cutoff : float
        Metres: a track this far away does not match a target.

    References
    ----------
    Luiten et al., HOTA: a higher order metric for evaluating multi-object tracking, IJCV 129 (2021), equations 5 to 9
    and section 5.3 on the matching.
    """
    check_cutoff(cutoff, 1.0)
    if not len(truth) + len(tracks):
        return Hota(float("nan"), float("nan"), float("nan"))
    (_, rows, of_target), (_, columns, of_track) = (
        np.unique(side.ids, return_inverse=True, return_counts=True) for side in (truth, tracks)
    )
    width = max(len(of_track), 1)
    alike = [
        (rows[i], columns[j], np.maximum(0.0, 1.0 - distances(truth.positions[i], tracks.positions[j]) / cutoff))
        for _, i, j in epochs(truth, tracks)
    ]
    keys, together = _summed([((g[:, None] * width + t)[s > 0], _shares(s)[s > 0]) for g, t, s in alike if s.size])
    fit = together / (of_target[keys // width] + of_track[keys % width] - together) if len(keys) else together
    paired, near = [np.zeros(0, dtype=np.int64)], [np.zeros(0)]
    for g, t, s in alike:
        if not (s > 0).any():
            continue
        key = g[:, None] * width + t
        index = np.minimum(np.searchsorted(keys, key), len(keys) - 1)
        score = np.where(keys[index] == key, fit[index], 0.0) * s
        i, j = linear_sum_assignment(score, maximize=True)
        paired.append(key[i, j])
        near.append(s[i, j])
    every, value = np.concatenate(paired), np.concatenate(near)
    detection, association = np.zeros(len(THRESHOLDS)), np.zeros(len(THRESHOLDS))
    for k, threshold in enumerate(THRESHOLDS.tolist()):
        pairs, count = np.unique(every[value >= threshold - _ROUNDING], return_counts=True)
        hits = int(count.sum())
        detection[k] = hits / (len(truth) + len(tracks) - hits)
        if hits:
            either = of_target[pairs // width] + of_track[pairs % width] - count
            association[k] = float((count * (count / either)).sum()) / hits
    return Hota(float(np.sqrt(detection * association).mean()), float(detection.mean()), float(association.mean()))


def _shares(similarity: Array) -> Array:
    """Similarity over that of the two with anything (n, m), as an intersection over a union."""
    either = similarity.sum(axis=0)[None] + similarity.sum(axis=1)[:, None] - similarity
    return similarity / np.maximum(either, _ROUNDING)


def _summed(parts: list[tuple[Array, Array]]) -> tuple[Array, Array]:
    """Sums of the values by key, keys ascending."""
    if not parts:
        return np.zeros(0, dtype=np.int64), np.zeros(0)
    keys, index = np.unique(np.concatenate([key for key, _ in parts]), return_inverse=True)
    return keys, np.bincount(index, np.concatenate([value for _, value in parts]), len(keys))
