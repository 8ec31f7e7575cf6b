"""GOSPA: OSPA without the division by the number of targets, so that it splits into three costs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment

from assoc._system.wrong_types import explains_wrong_types
from assoc._types import Array
from assoc.metrics.ospa import check_cutoff, distances, point_sets
from assoc.metrics.trajectories import Trajectories, epochs


class Gospa(NamedTuple):
    """GOSPA (alpha = 2) of two sets of points.

    Attributes
    ----------
    distance : float
        Metres; ``distance ** order == localisation + missed + false``.
    localisation, missed, false : float
        Its three parts, metres to the power of the order: errors of estimates that have a target, targets
        without an estimate, estimates without a target; each of the last two costs cutoff ** order / 2.
    pairs : int array (k, 2)
        The target and the estimate (numbers from 0) of each pair closer than the cutoff.
    """

    distance: float
    localisation: float
    missed: float
    false: float
    pairs: Array


@explains_wrong_types
def gospa(truth: Array, estimates: Array, cutoff: float, order: float = 2.0) -> Gospa:
    """Generalised optimal subpattern assignment metric, alpha = 2.

    Parameters
    ----------
    truth, estimates : array_like (m, d) and (n, d)
        Points, metres.
    cutoff : float
        c: an estimate further than this from every target is false, metres.
    order : float, default 2
        p, at least 1.

    Returns
    -------
    Gospa

    References
    ----------
    Rahmathullah, Garcia-Fernandez & Svensson, Generalized optimal sub-pattern assignment metric, FUSION
    2017, proposition 1.
    """
    x, y = point_sets(truth, estimates)
    check_cutoff(cutoff, order)
    return _gospa(distances(x, y), cutoff, order)


def _gospa(between: Array, cutoff: float, order: float) -> Gospa:
    # in units of the cutoff: no power overflows before the last line
    cost = (np.minimum(between, cutoff) / cutoff) ** order
    rows, columns = linear_sum_assignment(cost)
    near = between[rows, columns] < cutoff
    pairs = np.stack([rows[near], columns[near]], axis=1)
    localisation = float(cost[rows[near], columns[near]].sum())
    missed, false = ((count - len(pairs)) / 2 for count in between.shape)
    with np.errstate(over="ignore"):
        unit = float(np.float64(cutoff) ** order)
    return Gospa(
        float(cutoff * (localisation + missed + false) ** (1.0 / order)),
        # 0, even if the unit is infinite
        unit * localisation if localisation else 0.0,
        unit * missed if missed else 0.0,
        unit * false if false else 0.0,
        pairs,
    )


@explains_wrong_types
def gospa_over_time(
    truth: Trajectories, tracks: Trajectories, cutoff: float, order: float = 2.0
) -> tuple[Array, list[Gospa]]:
    """GOSPA at every instant of the truth or the tracks; see `gospa`.

    Returns
    -------
    times : array (K,)
        Seconds.
    values : list of Gospa
        With pairs of identities (target, track) in place of numbers.
    """
    check_cutoff(cutoff, order)
    times, values = [], []
    for time, rows, columns in epochs(truth, tracks):
        value = _gospa(distances(truth.positions[rows], tracks.positions[columns]), cutoff, order)
        pairs = np.stack([truth.ids[rows][value.pairs[:, 0]], tracks.ids[columns][value.pairs[:, 1]]], axis=1)
        times.append(time)
        values.append(value._replace(pairs=pairs))
    return np.array(times), values


@explains_wrong_types
def mean_gospa(values: Sequence[Gospa], order: float = 2.0) -> dict[str, float]:
    """Mean over time of GOSPA and of its parts, each ``mean(x ** order) ** (1 / order)``, metres.

    With order 2 these are root mean squares. The parts add up to the whole as they do at one instant:
    ``distance ** order == localisation ** order + missed ** order + false ** order``.

    Parameters
    ----------
    values : sequence of Gospa
        Of this order, one for each instant.
    order : float, default 2

    References
    ----------
    Rahmathullah, Garcia-Fernandez & Svensson, FUSION 2017, section V, where the mean is over runs.
    """
    check_cutoff(1.0, order)
    if len(values) == 0:
        return {"distance": 0.0, "localisation": 0.0, "missed": 0.0, "false": 0.0}
    names = ("localisation", "missed", "false")
    parts = {name: float(np.mean([getattr(value, name) for value in values])) for name in names}
    return {name: value ** (1.0 / order) for name, value in {"distance": sum(parts.values()), **parts}.items()}
