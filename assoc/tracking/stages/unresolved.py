"""One plot of two targets that a sensor cannot resolve.

Before association, the plots near each pair of confirmed tracks that are known to be two are explained in both ways:
"resolved", each detected or not, and "unresolved", one plot or none around the midpoint of the two (Koch and van Keuk
1997). If the second is more likely, its plot counts as two measurements, one of each track, so that no tracker needs to
know more. Their offsets, and what is added to covariances afterwards, are those of the joint update of both tracks by a
measurement of their midpoint, and by the knowledge that they differ by less than the resolution. Both ways
together tell what the resolution is where nobody said it. The prices are in
`assoc.costs.tracks.unresolved`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from assoc._types import Array
from assoc.costs.tracks.gating import near_pairs
from assoc.costs.tracks.unresolved import (
    Looks,
    explained,
    information,
    looks_of,
    narrowed,
    nearest_plots,
    offers,
    resolutions,
    slopes,
    unresolved_probability,
)
from assoc.costs.views import places_of
from assoc.filters.base import Expected, predict_each
from assoc.filters.batches import arrays_of, concatenate, state_from
from assoc.filters.measurement import periods_of
from assoc.sensors import Sensor
from assoc.tracking.progress import Association, Progress
from assoc.tracking.records.initiation import velocity_components
from assoc.tracking.records.track import among, renamed
from assoc.tracking.records.track_batch import TrackBatch
from assoc.tracking.records.unresolved import SURE, Shared
from assoc.tracking.stages.coverage import dwells

# pairs are looked for in a distance of so many resolutions, for they come closer until the next scan
_REACH = 1.5
# tracks confirmed before they met are two if both were detected in so many of the last scans
_RECENT, _TOGETHER = 10, 5
# pairs that are unresolved with less probability are not looked at, but for so many by which to learn
_LEAST, _LEARNT = 1e-3, 4
# tracks missed more often in a row may have ended
_MISSED = 1


def share(progress: Progress) -> Progress:
    """Stage: let plots of unresolved tracks count twice, and learn resolutions."""
    known = progress.state.unresolved
    tracks = progress.settings.method.current(progress.state)
    sure = known.ids[known.apart >= SURE]
    sure = sure[among(sure, tracks.track_id).all(axis=1)]
    if not len(sure):
        return progress
    # the tracks of pairs alone, and their rows
    tracks = tracks[np.isin(tracks.track_id, sure)]
    order = np.argsort(tracks.track_id, kind="stable")
    first, second = order[np.searchsorted(tracks.track_id, sure, sorter=order)].T
    steady = (tracks.missed[first] <= _MISSED) & (tracks.missed[second] <= _MISSED)
    states = predict_each(progress.settings.filter, tracks.states, np.full(len(tracks), progress.elapsed))
    dwelled = dwells(progress, states)
    covered = dwelled[first] & dwelled[second]
    precision = np.zeros((*covered.shape, max(sensor.dim for sensor in progress.settings.sensors)))
    probability, found = np.zeros(covered.shape), list[tuple[float, int, int, int, Array]]()
    for s in _candidates(progress):
        pairs, declared = np.flatnonzero(covered[:, s]), progress.work.settings.sensors[s]
        if not len(pairs):
            continue
        limits, weights = resolutions(declared), known.weights(s)
        looks = _looks(progress, s, states, tracks.states, (first[pairs], second[pairs]))
        by_limit = unresolved_probability(looks.difference, looks.covariance, limits)
        probability[pairs, s] = P = by_limit @ weights
        near = _told(by_limit, P, declared)
        if not len(near):
            continue
        sensor, z = progress.settings.sensors[s], progress.scan.measurements[s]
        clutter = math.log(sensor.false_alarm_rate / sensor.volume) + progress.scan.crowd(s, np.arange(len(z)))
        one, two, plots = explained(sensor, z, clutter, looks.of(near))
        learns = steady[pairs[near]]
        if declared.resolution is None and learns.any():
            known = known.learnt(s, by_limit[near[learns]], one[learns], two[learns])
        gain = np.log(np.maximum(P[near], 1e-300)) + one - np.log1p(-P[near]) - two
        for n in np.flatnonzero(gain > 0.0).tolist() if len(z) else ():
            pair = looks.of(near[[n]])
            narrow, pull = narrowed(pair.difference, pair.covariance, limits, weights * by_limit[near[[n]]])
            precision[pairs[near[n]], s, : limits.shape[1]] = narrow[0]
            plot = int(plots[n])
            offered = offers(sensor, z[plot], pair, narrow[0], pull[0])
            found.append((float(gain[n]), s, int(pairs[near[n]]), plot, offered))
    progress = progress.with_state(unresolved=known)._replace(shared=Shared(sure, probability))
    progress = _doubled(progress, sure, probability, found)
    if progress.scan.copies is None:
        return progress
    return _with_widths(progress, states, np.stack([first, second], axis=1), dwelled, precision)


def _told(by_limit: Array, probability: Array, sensor: Sensor) -> Array:
    """Pairs whose plots are to be explained: those that may be unresolved, and a few more if that is to be learnt."""
    near = probability > _LEAST
    if sensor.resolution is None:
        may = by_limit.max(axis=1)
        best = np.argsort(-may * ~near, kind="stable")[:_LEARNT]
        near[best[may[best] > _LEAST]] = True
    return np.flatnonzero(near)


def _candidates(progress: Progress) -> list[int]:
    """Sensors that may leave targets unresolved: by what was said, or by what may be learnt."""
    settings, found = progress.work.settings, []
    for s, (sensor, ranging) in enumerate(zip(settings.sensors, settings.ranging.tolist(), strict=True)):
        if (settings.adapt and ranging) if sensor.resolution is None else sensor.resolution.all():
            found.append(s)
    return found


def _looks(progress: Progress, s: int, states: Any, before: Any, rows: tuple[Array, Array]) -> Looks:
    """What sensor s is expected to measure of pairs in these rows of the states."""
    filter, scan, sensor = progress.settings.filter, progress.scan, progress.settings.sensors[s]
    looks = looks_of(filter, sensor, states, *rows)
    if scan.times is None or not len(scan.times[s]):
        return looks
    later = np.maximum(scan.times[s] - (progress.state.time or 0.0), 0.0)[
        nearest_plots(sensor, scan.measurements[s], looks)
    ]
    count, both = len(later), np.concatenate(rows)
    there = predict_each(filter, before[both], np.concatenate([later, later]))
    return looks_of(filter, sensor, there, np.arange(count), np.arange(count, 2 * count))


def _with_widths(progress: Progress, states: Any, rows: Array, dwelled: Array, precision: Array) -> Progress:
    """The step with what the covariances of tracks that share plots lack after updates by plots of their own."""
    settings, shared = progress.settings, progress.shared
    assert shared is not None
    ids, wider = list[int](), list[Array]()
    for k in np.flatnonzero((shared.probability == 1.0).any(axis=1)).tolist():
        for row, one in zip(rows[k].tolist(), shared.ids[k].tolist(), strict=True):
            own = both = states.covariance[row]
            for s in np.flatnonzero(dwelled[row]).tolist():
                sensor = settings.sensors[s]
                H, R = slopes(settings.filter, sensor, states.mean[row]), sensor.covariance
                known = np.linalg.inv(H @ both @ H.T + R)
                if shared.probability[k, s] == 1.0:
                    apart = H @ (states.mean[rows[k, 0]] - states.mean[rows[k, 1]])
                    known = information(R, H @ both @ H.T, apart, precision[k, s, : sensor.dim])
                both = both - both @ H.T @ known @ H @ both
                own = own - own @ H.T @ np.linalg.solve(H @ own @ H.T + R, H @ own)
            values, vectors = np.linalg.eigh(both - own)
            ids.append(one)
            spread = (vectors * np.maximum(values, 0.0)) @ vectors.T
            # symmetric to the last bit, as all covariances are
            wider.append(0.5 * (spread + spread.T))
    return progress._replace(shared=shared._replace(wider=(np.array(ids), np.array(wider))))


def widened(tracks: TrackBatch, ids: Array, wider: Array) -> TrackBatch:
    """The tracks, those with these ids (K,) with covariances larger by (K, n, n)."""
    arrays = arrays_of(tracks.states)
    name = "covariances" if "covariances" in arrays else "covariance"
    if name not in arrays:
        return tracks
    changed = arrays[name].copy()
    for one, more in zip(ids.tolist(), wider, strict=True):
        changed[tracks.track_id == one] += more
    return tracks.moved(state_from(type(tracks.states), {**arrays, name: changed}))


def _doubled(
    progress: Progress, ids: Array, probability: Array, found: list[tuple[float, int, int, int, Array]]
) -> Progress:
    """The step with the surest of these plots twice, the copies last; each plot and each track once a sensor."""
    scan, taken, plots = progress.scan, set[tuple[int, str, int]](), list[tuple[int, int]]()
    values = [np.array(z) for z in scan.measurements]
    copies: list[list[int]] = [[] for _ in values]
    for _, s, pair, plot, offered in sorted(found, key=lambda one: -one[0]):
        keys = {(s, "plot", plot), *((s, "track", int(i)) for i in ids[pair])}
        if not keys & taken:
            taken |= keys
            sensor = progress.settings.sensors[s]
            values[s][plot], copy = sensor.residual(offered, np.zeros(offered.shape))
            values[s] = np.concatenate([values[s], copy[None]])
            copies[s].append(plot)
            plots.append((s, plot))
            probability[pair, s] = 1.0
    if not plots:
        return progress
    twice, shared = scan.with_copies(values, copies), Shared(ids, probability, tuple(plots), measured=scan)
    return progress._replace(scan=twice, shared=shared)


def without_copies(progress: Progress, association: Association, first_new: int) -> Association:
    """What was associated, measurements counted once; no track begins with a plot of two others."""
    assert progress.shared is not None and progress.scan.copies is not None
    association = association._replace(tracks=widened(association.tracks, *progress.shared.wider))
    if not len(association.assigned):
        return association
    assigned, born = [np.array(ids) for ids in association.assigned], set[int]()
    for s, plot in progress.shared.plots:
        if assigned[s][plot] >= first_new:
            born.add(int(assigned[s][plot]))
    born |= {
        int(i) for s, n in enumerate(progress.scan.copies.tolist()) if n for i in assigned[s][-n:] if i >= first_new
    }
    sizes = (progress.scan.sizes - progress.scan.copies).tolist()
    ids = [np.where(np.isin(own, list(born)), 0, own)[:size] for own, size in zip(assigned, sizes, strict=True)]
    tracks = association.tracks
    return association._replace(tracks=tracks[~np.isin(tracks.track_id, list(born))], assigned=ids)


def tell_apart(progress: Progress) -> Progress:
    """Stage: find the pairs of confirmed tracks within reach of a resolution, and count when both were detected."""
    candidates = _candidates(progress)
    if not candidates:
        return progress
    progress = _parted(progress)
    settings, state, step = progress.settings, progress.state, progress.step
    tracks = settings.method.current(state)
    tracks = tracks[tracks.confirmed]
    where = places_of(settings.filter, tracks.states)[0]
    pairs = [np.zeros((0, 2), dtype=np.int64)]
    for s in candidates if len(tracks) > 1 else ():
        pairs.append(_near(settings.sensors[s], resolutions(progress.work.settings.sensors[s]), where))
    rows = np.concatenate(pairs)
    if not len(rows):
        none = np.zeros(0, dtype=np.int64)
        return progress.with_state(
            unresolved=state.unresolved._replace(ids=rows, apart=none, confirmed=np.sort(tracks.track_id))
        )
    rows = np.unique(rows, axis=0)
    before, ids = state.unresolved, np.sort(tracks.track_id[rows], axis=1)
    known = dict(zip(map(tuple, before.ids.tolist()), before.apart.tolist(), strict=True))
    apart = np.zeros(len(ids), dtype=np.int64)
    assert step is not None
    old = np.asarray(np.isin(ids, before.confirmed).all(axis=1))
    detected = np.asarray(np.any([np.isin(ids, taken).all(axis=1) for taken in step.assigned], axis=0))
    for k, ((i, j), pair) in enumerate(zip(rows.tolist(), map(tuple, ids.tolist()), strict=True)):
        if pair in known:
            apart[k] = known[pair]
        elif old[k]:
            both = int(tracks.detections[i] & tracks.detections[j] & ((1 << _RECENT) - 1))
            apart[k] = SURE if both.bit_count() >= _TOGETHER else 0
        if apart[k] < SURE:
            apart[k] += detected[k]
    return progress.with_state(unresolved=before._replace(ids=ids, apart=apart, confirmed=np.sort(tracks.track_id)))


def _parted(progress: Progress) -> Progress:
    """The step with a new track that began beside a pair that shares plots as one of the pair, whose state ends.

    Two that were unresolved for long have both followed one of their targets, if they parted in a manoeuvre.
    """
    settings, state, shared, step = progress.settings, progress.state, progress.shared, progress.step
    if shared is None or shared.measured is None or step is None:
        return progress
    tracks = settings.method.current(state)
    motion = settings.filter.motion
    new = tracks[tracks.confirmed & ~np.isin(tracks.track_id, state.unresolved.confirmed)]
    velocities = velocity_components(motion)
    for x in range(len(new)):
        back = new.started[x] - progress.scan.time
        for k, s in zip(*np.nonzero(shared.probability == 1.0), strict=True):
            pair = tracks[np.isin(tracks.track_id, shared.ids[k])]
            if len(pair) < 2 or not (pair.started < new.started[x]).all():
                continue
            states = concatenate([new.states[[x]], pair.states])
            where = places_of(settings.filter, states)[0]
            where[:, : len(velocities)] += back * states.mean[:, velocities]
            limits = resolutions(progress.work.settings.sensors[s])
            near = _near(settings.sensors[s], limits, where)
            beside = near[near[:, 0] == 0, 1]
            if not len(beside):
                continue
            goes, stays = int(pair.track_id[beside[0] - 1]), int(pair.track_id[2 - beside[0]])
            fresh = int(new.track_id[x])
            state = settings.method.renamed(state, np.array([fresh]), np.array([goes]))
            step = renamed(step, np.array([goes, fresh]), np.array([stays, goes]))
            return progress._replace(state=state, step=step)
    return progress


def _near(sensor: Sensor, limits: Array, where: Array) -> Array:
    """Rows of pairs of tracks at these positions (T, 3) within reach of a sensor's resolution, (K, 2)."""
    sensor = sensor.position_part
    at = sensor.measure(where)
    reach = _REACH * np.minimum(limits[:, : sensor.dim].max(axis=0), 1e9)
    box = Expected(at, np.broadcast_to(np.diag(np.maximum(reach, 1e-12) ** 2), (len(at), sensor.dim, sensor.dim)))
    first, second = near_pairs(box, at, periods_of(sensor), 1.0)
    upper = first < second
    first, second = first[upper], second[upper]
    inside = (np.abs(sensor.residual(at[first], at[second])) <= reach).all(axis=1)
    return np.stack([first[inside], second[inside]], axis=1)
