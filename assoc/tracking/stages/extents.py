"""Several plots of one target: a number of them that differs from scan to scan, spread over its extent.

A large ship, or a car near a lidar, returns a random number of plots from random places. A tracker of points gives it
several tracks, which jump about. For each confirmed track with more than one plot around it, the plots of each scan are
explained in both ways: by one target, with a Poisson number of plots (Gilholm and Salmond 2005) that are spread about
the middle of the tracks there, with one of several covariances, which follow from the plots before; and by several
points, each detected or not. Numbers of plots decide, for those of points hardly vary; where plots are can only speak
against an extent. So targets that fly close together stay what they are. How the plots of a target with an extent lie
to each other says how large it is (Koch 2008, without his product of extent and motion); what becomes of them is in
`assoc.tracking.stages.gathering`.

References
----------
K. Gilholm, D. Salmond, Spatial distribution model for tracking extended objects, IEE Proc. Radar, Sonar and Navigation
152, 2005. J. W. Koch, Bayesian approach to extended object and cluster tracking using random matrices, IEEE Trans.
Aerospace and Electronic Systems 44, 2008.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from assoc._types import Array
from assoc.costs.tracks.gating import near_pairs
from assoc.costs.views import places_of
from assoc.filters.base import Expected, predict_each
from assoc.filters.measurement import periods_of
from assoc.sensors import Sensor
from assoc.tracking.progress import Progress
from assoc.tracking.records.extents import SPREADS, Extents
from assoc.tracking.records.track_batch import TrackBatch
from assoc.tracking.stages.coverage import dwells, misses_of
from assoc.tracking.stages.gathering import seen_at
from assoc.tracking.stages.merging import merged
from assoc.tracking.stages.unresolved import widened

# plots within so many standard deviations of a track are weighed; tracks within so many spreads may be of one target
_NEAR, _MEMBERS = 3.0, 2.0
# where there are such targets, tracks with so many hits are weighed before they are confirmed
_TENTATIVE = 2
# share of plots of targets that have no track
_UNTRACKED = 0.2
# a track's detections in the last scans say how often it is detected, P_d counts as so many of them
_RECENT, _LOOKS = 20, 4.0


def weigh_extents(progress: Progress) -> Progress:
    """Stage: weigh which tracks are of targets with an extent, and how large these are."""
    settings, tracks, state = progress.settings, progress.before, progress.state
    assert state.extents is not None and tracks is not None
    tracks = tracks[np.argsort(tracks.track_id, kind="stable")]
    tracks = tracks[np.isin(tracks.track_id, state.tracks.track_id)]
    extents, elapsed = state.extents.of(tracks.track_id), 0.0 if progress.timed is None else progress.elapsed
    if not len(tracks):
        return progress.with_state(extents=extents)
    late = predict_each(settings.filter, tracks.states, np.full(len(tracks), elapsed)) if elapsed else tracks.states
    seen, before = dwells(progress, late), extents
    scan = progress.scan if progress.gathered is None else progress.gathered.scan
    watched = tracks.confirmed | (tracks.hits >= _TENTATIVE if extents.extended.any() else False)
    for s in np.flatnonzero(settings.ranging).tolist():
        if progress.gathered is not None:
            extents = _spread(progress, tracks, late, extents, s, seen)
        if len(scan.measurements[s]) > 1 or extents.open.any():
            states = seen_at(progress, tracks.states, s, elapsed)
            extents = _weighed(progress, tracks, states, extents, s, watched & seen[:, s])
    return _begun(progress, tracks, late, extents.after(before))


def _weighed(progress: Progress, tracks: TrackBatch, states: Any, extents: Extents, s: int, watched: Array) -> Extents:
    """Weigh the plots of sensor s around those tracks that are `watched`, bool (T,)."""
    settings, sensor = progress.settings, progress.settings.sensors[s]
    scan = progress.scan if progress.gathered is None else progress.gathered.scan
    part, expected = sensor.position_part, settings.filter.expected(states, sensor)
    z = np.ascontiguousarray(scan.measurements[s][:, : part.dim])
    mean, point = expected.mean[:, : part.dim], np.ascontiguousarray(expected.covariance[:, : part.dim, : part.dim])
    where, axes = places_of(settings.filter, states)[0], len(settings.filter.motion.position)
    slope = part.jacobian(where)[:, :, :axes]
    covariance = point + slope @ extents.covariance[:, :axes, :axes] @ slope.swapaxes(1, 2)
    chance = -np.expm1(misses_of(progress, states, s))
    number = np.where(extents.extended, extents.numbers[:, s], _detected(tracks, chance))
    # out of sight, as in a notch of range rates, no plots say nothing
    rows = np.flatnonzero(watched & (chance > 0.5 * sensor.detection_probability))
    wide = point[rows] + SPREADS[0] ** 2 * slope[rows] @ slope[rows].swapaxes(1, 2)
    track, near = near_pairs(Expected(mean[rows], wide), z, periods_of(part), _NEAR**2)
    # plots of a slow ship come back to a place as those of clutter do: places do not count
    alarms = sensor.false_alarm_rate / part.volume
    open, several = extents.open[rows], np.bincount(track, minlength=len(rows)) > 1
    for k in np.flatnonzero(open | several).tolist():
        row, plots = int(rows[k]), near[track == k]
        away = np.linalg.norm(where - where[row], axis=1)
        if extents.extended[row] and not (tracks.confirmed & (away < _MEMBERS * SPREADS[0])).sum() > 1:
            continue
        if not open[k]:
            # the dwell that made one look is no evidence
            extents = extents.opened(row, axes)
            continue
        around = np.flatnonzero(away < 2.0 * _NEAR * SPREADS[0])
        members = away[around] <= _MEMBERS * SPREADS[:, None]
        weights = members * number[around]
        by_tracks = number[around, None] * _density(part, z[plots], mean[around], covariance[around])
        middle = part.measure(weights @ where[around] / weights.sum(axis=1)[:, None])
        unsure = (1.0 / members.sum(axis=1))[:, None, None]
        spread = part.covariance + unsure * (point[row] - part.covariance)
        spread = spread + (1.0 + unsure) * (slope[row] @ extents.shapes[row, :, :axes, :axes] @ slope[row].T)
        target = _density(part, z[plots], middle, spread)
        own = extents.rates(row, s)[:, None] * target
        own = own / (alarms + (~members).astype(float) @ by_tracks + own)
        # where plots are, given their number: of the tracks, or of one that is not yet there
        points = (1.0 - _UNTRACKED) * (members @ by_tracks) / weights.sum(axis=1)[:, None] + _UNTRACKED * target
        ratio = (own * (np.log(target) - np.log(points))).sum(axis=1)
        scatter = _scatter(part, z[plots], own, slope[row])
        extents = extents.weighed(row, s, float(chance[row]), ratio, own.sum(axis=1), scatter)
    return extents


def _detected(tracks: TrackBatch, chance: Array) -> Array:
    """Probability of a plot of each track: of its target's being there, and being detected; (T,)."""
    age = np.minimum(tracks.hits + tracks.missed, _RECENT)
    bits = [int(b & ((1 << _RECENT) - 1)).bit_count() for b in tracks.detections.tolist()]
    there = np.where(tracks.confirmed, 1.0, 1.0 / (1.0 + np.exp(-np.clip(tracks.score, -50.0, 50.0))))
    # bits are of all sensors
    return np.asarray(there * np.minimum((_LOOKS * chance + np.minimum(bits, age)) / (_LOOKS + age), chance))


def _density(sensor: Sensor, z: Array, mean: Array, covariance: Array) -> Array:
    """Normal densities (K, n) at plots (n, d), of means (K, d) and covariances (K, d, d)."""
    off = sensor.residual(z[None], mean[:, None])
    square = np.einsum("kni,kij,knj->kn", off, np.linalg.inv(covariance), off)
    exponent = -0.5 * (square + np.linalg.slogdet(2.0 * math.pi * covariance)[1][:, None])
    return np.asarray(np.exp(np.maximum(exponent, -300.0)))


def _scatter(part: Sensor, z: Array, own: Array, slope: Array) -> Array:
    """Sum of squares of places about their mean, without noise, of plots (n, d) with weights (G, n); (G, 3, 3)."""
    found = np.zeros((len(own), 3, 3))
    if not len(z):
        return found
    off, total = part.residual(z, z[:1]), np.maximum(own.sum(axis=1), 1e-12)
    off = off[None] - (own @ off / total[:, None])[:, None]
    square = np.einsum("gn,gni,gnj->gij", own, off, off)
    square -= np.maximum(total - 1.0, 0.0)[:, None, None] * part.covariance
    back, axes = np.linalg.pinv(slope), slope.shape[1]
    found[:, :axes, :axes] = back @ square @ back.T * (total > 1.0)[:, None, None]
    return found


def _spread(progress: Progress, tracks: TrackBatch, states: Any, extents: Extents, s: int, seen: Array) -> Extents:
    """Learn from the plots that sensor s returned of targets with an extent."""
    gathered, settings = progress.gathered, progress.settings
    assert gathered is not None
    sensor, axes = settings.sensors[s], len(settings.filter.motion.position)
    z, where = gathered.scan.measurements[s], places_of(settings.filter, states)[0]
    part = sensor.position_part
    for n, one in enumerate(gathered.ids.tolist()):
        row = int(np.searchsorted(tracks.track_id, one))
        if row == len(tracks) or tracks.track_id[row] != one or not seen[row, s]:
            continue
        own = z[gathered.groups[s] == n][:, : part.dim]
        found = None
        if len(own) > 1:
            off = part.residual(own, own[:1])
            off = off - off.mean(axis=0)
            back = np.linalg.pinv(part.jacobian(where[[row]])[0][:, :axes])
            noise = part.covariance
            found = np.zeros((3, 3))
            found[:axes, :axes] = back @ (off.T @ off / (len(own) - 1.0) - noise) @ back.T
        extents = extents.spread(row, s, len(own), found)
    return extents


def _begun(progress: Progress, tracks: TrackBatch, states: Any, extents: Extents) -> Progress:
    """The step with the tracks that are now known to be of targets with an extent, as unsure of where these are."""
    settings = progress.settings
    chosen = extents.chosen(tracks.confirmed)
    where, axes = places_of(settings.filter, states)[0], list(settings.filter.motion.position)
    gone = np.zeros(len(tracks), dtype=np.bool_)
    for row in np.flatnonzero(chosen >= 0).tolist():
        away = np.linalg.norm(where - where[row], axis=1)
        if gone[row]:
            continue
        members = (away <= _MEMBERS * SPREADS[chosen[row]]) & tracks.confirmed & ~gone
        extents = extents.with_extent(row, int(chosen[row]))
        wider = np.zeros((settings.filter.motion.dim,) * 2)
        wider[np.ix_(axes, axes)] = extents.covariance[row, : len(axes), : len(axes)]
        for other in np.flatnonzero(members).tolist():
            if other != row:
                gone[other] = True
                progress = merged(progress, tracks, np.array([[row, other]]))
        batch = widened(progress.state.tracks, tracks.track_id[[row]], wider[None])
        progress = progress.with_state(tracks=batch)
    return progress.with_state(extents=extents.kept())
