"""How much of an association is right, where the source of every measurement is known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from assoc._system.wrong_types import explains_wrong_types
from assoc._types import Array
from assoc.metrics.trajectories import columns_of_rows


@dataclass(frozen=True)
class AssociationAccuracy:
    """Shares from 0 to 1, NaN for 0 / 0.

    Attributes
    ----------
    pair_precision : float
        Of the pairs of measurements put into one group, those that are from one target.
    pair_recall : float
        Of the pairs of measurements from one target, those put into one group.
    purity : float
        Of the measurements in groups, those from the target that is most frequent in their group (a group of
        false alarms has none).
    false_alarms_recognised : float
        Of the false alarms, those in no group.
    targets_recognised : float
        Of the measurements of targets, those in a group.
    """

    pair_precision: float
    pair_recall: float
    purity: float
    false_alarms_recognised: float
    targets_recognised: float


@explains_wrong_types
def association_accuracy(sources: Array, labels: Array, instants: Array | None = None) -> AssociationAccuracy:
    """Compare groups of measurements with their sources.

    Parameters
    ----------
    sources : array_like of int (n,)
        The target behind each measurement, -1 for a false alarm.
    labels : array_like of int (n,)
        The group (tuple or track) of each measurement, negative: called a false alarm.
    instants : array_like of int (n,), optional
        The scan of each measurement: only pairs within a scan count. Without it all pairs count.
    """
    if instants is None:
        instants = np.zeros(np.shape(sources), dtype=np.int64)
    source, label, instant = columns_of_rows(sources=sources, labels=labels, instants=instants)
    real, grouped = source >= 0, label >= 0
    both = real & grouped
    together = _pairs(instant, label, source, chosen=both)
    return AssociationAccuracy(
        pair_precision=_share(together, _pairs(instant, label, chosen=grouped)),
        pair_recall=_share(together, _pairs(instant, source, chosen=real)),
        purity=_share(_largest(instant, label, source, both), int(grouped.sum())),
        false_alarms_recognised=_share(int((~real & ~grouped).sum()), int((~real).sum())),
        targets_recognised=_share(int(both.sum()), int(real.sum())),
    )


def _share(part: float, whole: float) -> float:
    return part / whole if whole else float("nan")


def _pairs(*keys: Array, chosen: Array) -> int:
    """Number of pairs of chosen rows that agree in all keys."""
    _, counts = np.unique(np.stack(keys, axis=1)[chosen], axis=0, return_counts=True)
    return int((counts * (counts - 1) // 2).sum())


def _largest(instant: Array, label: Array, source: Array, chosen: Array) -> int:
    """Rows of the most frequent source of each group, over all groups."""
    cells, counts = np.unique(np.stack([instant, label, source], axis=1)[chosen], axis=0, return_counts=True)
    if not len(cells):
        return 0
    starts = np.flatnonzero(np.concatenate([[True], (np.diff(cells[:, :2], axis=0) != 0).any(axis=1)]))
    return int(np.maximum.reduceat(counts, starts).sum())
