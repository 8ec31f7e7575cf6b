"""Which measurements may belong to which tracks: k-d tree, then boxes."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np

from assoc.filters.base import Expected
from assoc.filters.measurement import Measurement

Array = np.ndarray[Any, np.dtype[Any]]

# up to so many combinations looking at each is quicker than a tree
_BRUTE = 40_000


def near_pairs(expected: Expected, measurements: Array, angular: tuple[bool, ...], gate: float) -> tuple[Array, Array]:
    """Pairs of tracks and measurements that may pass a chi-square gate; none that does is left out.

    Parameters
    ----------
    expected : Expected
        Means (B, d) and covariances (B, d, d) of what each track leads one to expect.
    measurements : array (M, d)
    angular : tuple of bool
        Which components are angles (they are compared around the circle).
    gate : float
        Squared Mahalanobis distance.

    Returns
    -------
    track, measurement : int arrays (K,)
        Ordered by track, then measurement.
    """
    h, z = expected.mean, measurements
    if not len(h) or not len(z):
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    reach, turning = _reach(expected, gate), np.array(angular)
    if len(h) * len(z) <= _BRUTE:
        off = _apart(z[None, :, :], h[:, None, :], turning)
        tracks, found = np.nonzero((off <= reach[:, None, :]).all(axis=2))
        return tracks, found
    tracks, found = _by_tree(h, z, reach, turning)
    inside = (_apart(z[found], h[tracks], turning) <= reach[tracks]).all(axis=1)
    return tracks[inside], found[inside]


def _reach(expected: Expected, gate: float) -> Array:
    """Largest component of a residual within the gate: |v_i| <= sqrt(gate S_ii)."""
    reach: Array = np.sqrt(gate * np.einsum("bii->bi", expected.covariance)) * (1 + 1e-9)
    return reach


def within(
    expected: Expected, rows: Array, measurements: Array, found: Array, angular: tuple[bool, ...], gate: float
) -> Array:
    """Which pairs (row of `expected`, row of `measurements`) may pass a chi-square gate; bool (K,)."""
    off = _apart(measurements[found], expected.mean[rows], np.array(angular))
    return np.asarray((off <= _reach(expected, gate)[rows]).all(axis=1))


def _apart(a: Array, b: Array, turning: Array) -> Array:
    off: Array = np.abs(a - b)
    if turning.any():
        part = off[..., turning] % (2 * math.pi)
        off[..., turning] = np.minimum(part, 2 * math.pi - part)
    return off


def _by_tree(h: Array, z: Array, reach: Array, turning: Array) -> tuple[Array, Array]:
    from scipy.spatial import cKDTree

    # in units of a usual reach every track's box becomes a ball of the largest norm
    unit = np.median(reach, axis=0)
    unit = np.where(unit > 0, unit, 1.0)
    width = np.where(turning, 2 * math.pi / unit, 0.0)
    points, centres = z / unit, h / unit
    for axis in np.flatnonzero(turning):
        points[:, axis] = np.minimum(np.mod(points[:, axis], width[axis]), np.nextafter(width[axis], 0.0))
        centres[:, axis] = np.minimum(np.mod(centres[:, axis], width[axis]), np.nextafter(width[axis], 0.0))
    tree = cKDTree(points, boxsize=width if turning.any() else None)
    radius = (reach / unit).max(axis=1)
    lists = tree.query_ball_point(centres, radius, p=np.inf, return_sorted=True)
    lengths = np.fromiter(map(len, lists), dtype=np.int64, count=len(lists))
    found = np.fromiter(itertools.chain.from_iterable(lists), dtype=np.int64, count=int(lengths.sum()))
    return np.repeat(np.arange(len(h)), lengths), found


def angular_components(sensor: Measurement) -> tuple[bool, ...]:
    """Which components of a measurement are angles; none for models that are no sensor."""
    return getattr(sensor, "angular", (False,) * sensor.dim)[: sensor.dim]
