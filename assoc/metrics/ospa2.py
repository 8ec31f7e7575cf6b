"""OSPA(2): a distance between sets of tracks, not of points, so that switched identities cost."""

from __future__ import annotations

import numpy as np

from assoc._system import memory
from assoc._system.wrong_types import explains_wrong_types
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.metrics.ospa import Ospa, check_cutoff, distances, ospa_of_distances
from assoc.metrics.trajectories import Trajectories, epochs


@explains_wrong_types
def ospa2(
    truth: Trajectories,
    tracks: Trajectories,
    cutoff: float,
    order: float = 1.0,
    *,
    base_order: float = 1.0,
    window: int | None = 10,
) -> tuple[Array, list[Ospa]]:
    """OSPA(2) over sliding windows.

    The distance of a track to a target is the mean, over the instants of the window at which either is
    present, of their distance (at most the cutoff; the cutoff where only one is present).

    Parameters
    ----------
    truth, tracks : Trajectories
    cutoff : float
        c, metres.
    order : float, default 1
        p of the OSPA over tracks.
    base_order : float, default 1
        q of the mean over time.
    window : int or None, default 10
        Instants that count, up to and including that of the value; None: all so far.

    Returns
    -------
    times : array (K,)
        Every instant of the truth or the tracks, seconds.
    values : list of Ospa

    References
    ----------
    Beard, Vo & Vo, A solution for large-scale multi-object tracking, IEEE Trans. Signal Processing 68
    (2020), eq. 17 to 19.
    """
    check_cutoff(cutoff, order)
    check_cutoff(cutoff, base_order)
    if window is not None and (isinstance(window, bool) or not isinstance(window, int) or window < 1):
        raise InvalidInputError(f"window: expected a whole number >= 1 or None, got {window!r}")
    instants = list(epochs(truth, tracks))
    target_ids, target_of = np.unique(truth.ids, return_inverse=True)
    track_ids, track_of = np.unique(tracks.ids, return_inverse=True)
    shape = (len(target_ids), len(track_ids))
    memory.require(
        64.0 * shape[0] * shape[1],
        f"OSPA(2) of {shape[0]} targets and {shape[1]} tracks",
        "compare a shorter time, with fewer identities",
    )
    # running sums over the window
    total, both = np.zeros(shape), np.zeros(shape)
    present = [np.zeros(shape[0]), np.zeros(shape[1])]
    steps: list[tuple[Array, Array, Array]] = []
    times, values = [], []
    for k, (time, rows, columns) in enumerate(instants):
        between = distances(truth.positions[rows], tracks.positions[columns])
        steps.append((target_of[rows], track_of[columns], (np.minimum(between, cutoff) / cutoff) ** base_order))
        changes = [(1.0, steps[k])]
        if window is not None and k >= window:
            changes.append((-1.0, steps[k - window]))
        for sign, (i, j, cost) in changes:
            total[np.ix_(i, j)] += sign * cost
            both[np.ix_(i, j)] += sign
            present[0][i] += sign
            present[1][j] += sign
        here = [np.flatnonzero(count > 0.5) for count in present]
        inside = np.ix_(*here)
        either = present[0][here[0]][:, None] + present[1][here[1]] - both[inside]
        # sums that went up and down again may be a rounding error below 0
        alone = either - both[inside]
        mean = np.maximum(total[inside] + alone, 0.0) / np.maximum(either, 1.0)
        times.append(time)
        values.append(ospa_of_distances(cutoff * mean ** (1.0 / base_order), cutoff, order))
    return np.array(times), values
