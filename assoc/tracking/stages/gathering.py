"""Plots of targets with an extent are put together before association, and told apart again after it.

Those within the extent of such a target are replaced by their mean, so that no tracker needs to know more. The mean is
as unsure as its place on the target: it is moved to where it corrects the track by the sensor's noise as it should by
its own, and covariances are widened afterwards.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from assoc._types import Array
from assoc.costs.gating import chi_square_quantiles
from assoc.costs.tracks.unresolved import slopes
from assoc.filters.base import predict_each
from assoc.tracking.progress import Association, Gathered, Progress
from assoc.tracking.records.extents import one_by_one
from assoc.tracking.stages.unresolved import widened

# plots of a target lie in this share of its normal distribution
_WITHIN = 0.99


def gather(progress: Progress) -> Progress:
    """Stage: put the plots of each target with an extent together."""
    extents, settings = progress.state.extents, progress.settings
    assert extents is not None
    tracks = settings.method.current(progress.state)
    known = np.flatnonzero(extents.extended & np.isin(extents.ids, tracks.track_id))
    if not len(known):
        return progress
    order = np.argsort(tracks.track_id, kind="stable")
    tracks = tracks[order[np.searchsorted(tracks.track_id, extents.ids[known], sorter=order)]]
    at = predict_each(settings.filter, tracks.states, np.full(len(tracks), progress.elapsed))
    scan, values = progress.scan, [np.array(z) for z in progress.scan.measurements]
    updates: list[list[tuple[Array, Array, Array]]] = [[] for _ in known]
    groups, kept, index = list[Array](), list[Array](), list[Array]()
    for s, (z, sensor) in enumerate(zip(scan.measurements, settings.sensors, strict=True)):
        first, number, group = np.arange(len(z)), np.arange(len(z)), np.full(len(z), -1)
        if len(z) and settings.ranging[s]:
            states = seen_at(progress, tracks.states, s, progress.elapsed)
            expected = settings.filter.expected(states, sensor)
            group = _grouped(progress, states, extents.covariance[known], s)
        for n in np.unique(group[group >= 0]).tolist():
            rows = np.flatnonzero(group == n)
            first[rows] = rows[0]
            H, S = slopes(settings.filter, sensor, states.mean[n]), expected.covariance[n]
            noise = (sensor.covariance + _of_extent(progress, H, extents.covariance[known[n]])) / len(rows)
            off = sensor.residual(z[rows], expected.mean[[n]]).mean(axis=0)
            # what moves the track by the sensor's noise as the mean does by its own
            pull = S @ np.linalg.solve(S - sensor.covariance + noise, off)
            values[s][rows[0]] = sensor.residual((expected.mean[n] + pull)[None], np.zeros((1, sensor.dim)))[0]
            updates[n].append((H, sensor.covariance, noise))
        rows = np.flatnonzero(first == number)
        groups.append(group)
        kept.append(rows)
        index.append(np.searchsorted(rows, first))
    wider = np.stack([_widths(at.covariance[n], ups) for n, ups in enumerate(updates)])
    gathered = Gathered(extents.ids[known], tuple(groups), tuple(index), scan, wider)
    short = replace(
        scan, measurements=tuple(z[rows] for z, rows in zip(values, kept, strict=True)), times=_of(scan.times, kept),
        identities=_of(scan.identities, kept), clutter=_of(scan.clutter, kept),
    )  # fmt: skip
    return progress._replace(
        scan=short,
        dense=_of(tuple(progress.dense) or None, kept) or (),
        crowds=_of(progress.crowds or None, kept) or (),
        gathered=gathered,
    )


def _of(parts: Any, rows: list[Array]) -> Any:
    return None if parts is None else tuple(part[own] for part, own in zip(parts, rows, strict=True))


def seen_at(progress: Progress, states: Any, s: int, elapsed: float) -> Any:
    """States at the time when sensor s saw what is nearest to them; they are of `elapsed` seconds before the scan."""
    scan, filter, sensor = progress.scan, progress.settings.filter, progress.settings.sensors[s]
    at = predict_each(filter, states, np.full(len(states), elapsed)) if elapsed > 0.0 else states
    if scan.times is None or elapsed == 0.0 or not len(scan.times[s]):
        return at
    off = sensor.residual(scan.measurements[s][None], filter.expected(at, sensor).mean[:, None])
    near = np.einsum("kni,ij,knj->kn", off, np.linalg.inv(sensor.covariance), off).argmin(axis=1)
    return predict_each(filter, states, np.maximum(scan.times[s][near] - (progress.state.time or 0.0), 0.0))


def _of_extent(progress: Progress, H: Array, covariance: Array) -> Array:
    """Covariance of plots (d, d) by that of places (3, 3)."""
    axes = list(progress.settings.filter.motion.position)
    slope = H[:, axes]
    return np.asarray(slope @ covariance[: len(axes), : len(axes)] @ slope.T)


def _grouped(progress: Progress, states: Any, covariances: Array, s: int) -> Array:
    """The target with an extent (its row) that each plot of sensor s is of, -1 for none, int (n,)."""
    settings, sensor = progress.settings, progress.settings.sensors[s]
    z, d = progress.scan.measurements[s], sensor.position_part.dim
    expected = settings.filter.expected(states, sensor)
    slope = [slopes(settings.filter, sensor, mean) for mean in states.mean]
    spread = expected.covariance + np.stack(
        [_of_extent(progress, H, X) for H, X in zip(slope, covariances, strict=True)]
    )
    off = sensor.residual(z[None], expected.mean[:, None])[..., :d]
    spread = spread[:, :d, :d]
    square = np.einsum("kni,kij,knj->kn", off, np.linalg.inv(spread), off)
    far = np.where(square > float(chi_square_quantiles(_WITHIN, d)[d]), np.inf, square)
    far = far + np.linalg.slogdet(spread)[1][:, None]
    return np.where(np.isfinite(far.min(axis=0)), far.argmin(axis=0), -1)


def _widths(covariance: Array, updates: list[tuple[Array, Array, Array]]) -> Array:
    """What the covariance (n, n) of a track lacks after updates (slopes, noise, true noise) with the first noise."""
    own = both = covariance
    for H, R, noise in updates:
        own = own - own @ H.T @ np.linalg.solve(H @ own @ H.T + R, H @ own)
        both = both - both @ H.T @ np.linalg.solve(H @ both @ H.T + noise, H @ both)
    return _positive(both - own)


def _positive(matrix: Array) -> Array:
    values, vectors = np.linalg.eigh(0.5 * (matrix + matrix.T))
    spread = (vectors * np.maximum(values, 0.0)) @ vectors.T
    # symmetric to the last bit, as all covariances are
    return np.asarray(0.5 * (spread + spread.T))


def with_widths(progress: Progress, association: Association) -> Association:
    """What was associated, tracks of targets with an extent as unsure as their plots say."""
    gathered = progress.gathered
    assert gathered is not None
    taken = np.ones(len(gathered.ids), dtype=np.bool_)
    # a tracker with several hypotheses does not say it: all branches are as unsure
    known = zip(gathered.groups, gathered.numbers, association.assigned, strict=True) if association.assigned else ()
    for group, index, owners in known:
        for n in np.unique(group[group >= 0]).tolist():
            taken[n] &= owners[index[np.argmax(group == n)]] == gathered.ids[n]
    return association._replace(tracks=widened(association.tracks, gathered.ids[taken], gathered.wider[taken]))


def plot_by_plot(progress: Progress) -> Progress:
    """Stage: say of each single plot whose it is, also of scans before that are decided only now."""
    extents, gathered, step = progress.state.extents, progress.gathered, progress.step
    assert extents is not None and step is not None
    if gathered is not None:
        extents = extents.with_past(progress.state.scan, gathered.numbers)
    if not len(extents.past):
        return progress
    final = tuple(one_by_one(decision, extents.past) for decision in step.final)
    step = replace(one_by_one(step, extents.past), final=final)
    last = max((decision.scan for decision in final), default=-1)
    past = extents.past[extents.past[:, 0] > last]
    return progress._replace(step=step).with_state(extents=extents._replace(past=past))
