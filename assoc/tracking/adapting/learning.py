"""Stages of a step that use the estimates, and that learn from what association found."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from assoc._types import Array
from assoc.costs.tracks.gating import near_pairs
from assoc.costs.tracks.tuples import gate_of
from assoc.costs.views import bands_of, bands_of_measured, places_of
from assoc.filters.base import Expected, predict_each
from assoc.filters.imm import InteractingMultipleModel, Mixture
from assoc.filters.measurement import periods_of
from assoc.registration.correction import corrected_measurements
from assoc.scene.own_times import FULL_TURN
from assoc.scene.scan import Scan
from assoc.sensors import Sensor
from assoc.tracking.adapting.in_use import in_use
from assoc.tracking.adapting.residuals import Predicted, Seen, Shown, shown_by
from assoc.tracking.progress import Progress
from assoc.tracking.records.biases import CLOCK
from assoc.tracking.records.clutter import ONE_SAYS, YOUNG
from assoc.tracking.records.estimates import ALARMS, NOISE, declared_values
from assoc.tracking.records.initiation import velocity_components
from assoc.tracking.records.track import among, taken_by
from assoc.tracking.records.track_batch import TrackBatch
from assoc.tracking.settings import TrackerSettings
from assoc.tracking.stages.coverage import densities_at, dwells

# a measurement that missed the gate is sought in one this many times as wide, if so few false alarms are expected there
_WIDER, _FALSE = 4.0, 0.05
# with fewer detections a track may be of several targets
_SETTLED = 5
# residuals of so many tracks are weighed in a scan
_MOST = 64


def correct(progress: Progress) -> Progress:
    """Stage: go on with measurements without the biases, and clocks' errors, that are in use."""
    biases, scan, sensors = progress.state.biases, progress.scan, progress.settings.sensors
    if biases is None or not biases.used.any():
        return progress
    known = biases.of(sensors)
    pairs = zip(sensors, scan.measurements, known, strict=True)
    scan = replace(scan, measurements=tuple(corrected_measurements(*each) for each in pairs))
    late = [own[CLOCK] for own in known]
    if any(late) and progress.state.time is not None and progress.settings.method.own_times:
        times = zip(scan.own_times(), late, strict=True)
        before = progress.state.time
        scan = replace(scan, times=tuple(np.clip(stamps - lag, before, scan.time) for stamps, lag in times))
    return progress._replace(scan=scan)


def use_estimates(progress: Progress) -> Progress:
    """Stage: go on with the settings that the estimates suggest, and with the density of false alarms by place."""
    estimates, clutter = progress.state.estimates, progress.state.clutter
    assert estimates is not None and clutter is not None
    settings = in_use(progress.settings, estimates)
    # units of noise as declared: places are kept in them
    densities, crowds = clutter.used_and_found(progress.settings.sensors, progress.scan)
    # in doubt nothing is taken from scores yet
    densities = tuple(found * (turns >= YOUNG) for found, turns in zip(densities, clutter.clock, strict=True))
    shift = np.log(estimates.used[:, ALARMS] / declared_values(progress.settings.sensors)[:, ALARMS])
    densities = tuple(np.maximum(found - more, 0.0) for found, more in zip(densities, shift.tolist(), strict=True))
    dense = tuple(found > 0.0 for found in densities)
    if settings.by_range is not None:
        bands = map(bands_of_measured, progress.settings.sensors, progress.scan.measurements)
        seen = zip(densities, settings.by_range, bands, strict=True)
        densities = tuple(found - np.log(share[band]) for found, share, band in seen)
    return progress._replace(
        settings=settings, scan=replace(progress.scan, clutter=densities), dense=dense, crowds=crowds
    )


def remember_tracks(progress: Progress) -> Progress:
    """Stage: keep the tracks that association begins with; the map goes on with what they and places predicted."""
    tracks, clutter = progress.settings.method.current(progress.state), progress.state.clutter
    assert clutter is not None
    late = _late(progress, tracks[tracks.confirmed | (tracks.hits >= 2)])
    used, every = densities_at(progress, late, clutter) > 0.0
    progress, scan = progress._replace(before=tracks, late=late, placed=used), progress.scan
    if progress.shared is not None and progress.shared.measured is not None:
        scan = progress.shared.measured
    votes = _votes(progress, scan, late, every)
    return progress._replace(clutter=clutter.after(progress.work.settings.sensors, scan, _turns(progress), votes))


def _late(progress: Progress, tracks: TrackBatch) -> TrackBatch:
    """These tracks, predicted to the scan."""
    if progress.timed is None or not len(tracks):
        return tracks
    return tracks.moved(predict_each(progress.settings.filter, tracks.states, np.full(len(tracks), progress.elapsed)))


def learn(progress: Progress) -> Progress:
    """Stage: count detections, misses and false alarms, and weigh residuals."""
    state, step, settings = progress.state, progress.step, progress.settings
    estimates, tracks, late, used = state.estimates, progress.before, progress.late, progress.placed
    assert estimates is not None and step is not None and tracks is not None and late is not None and used is not None
    assert state.clutter is not None and progress.clutter is not None
    tracks, late, used, clutter = tracks[tracks.confirmed], late[late.confirmed], used[late.confirmed], progress.clutter
    dwelled = dwells(progress, late.states)
    rows = taken_by(tracks.track_id, step.assigned)[:-1]
    if len(tracks):
        _seek(progress, late, rows, dwelled)
    contested, doubtful = _contested(progress, late)
    if progress.shared is not None:
        hidden = progress.shared.hidden(tracks.track_id)
        rows[hidden], dwelled[hidden] = 0, False
    if progress.gathered is not None:
        large = np.isin(tracks.track_id, progress.gathered.ids)
        rows[large], dwelled[large] = 0, False
    # tracks in dense clutter say little about sensors
    plain = ~used.any(axis=1)
    plain &= ~np.any([np.append(False, dense)[row] for dense, row in zip(progress.dense, rows.T, strict=True)], axis=0)
    hits = (rows > 0) & plain[:, None]
    dwelled = hits | (dwelled & plain[:, None])
    sure = hits & ~contested
    turns = _turns(progress)
    # where false alarms are dense they are no part of the usual ones
    usual = zip(step.confirmed, progress.dense, doubtful, strict=True)
    alarms = np.array([np.count_nonzero(~(taken | dense | either)) for taken, dense, either in usual])
    # before tracks are confirmed, targets look like false alarms
    declared = progress.work.settings.sensors
    if state.scan >= 3:
        estimates = estimates.heard(declared, alarms, turns)
    where = places_of(settings.filter, late.states)[0]
    bands = np.stack([bands_of(sensor, where) for sensor in settings.sensors], axis=1)
    estimates = estimates.counted(declared, tracks.track_id, dwelled & ~contested, sure, bands)
    fresh = np.flatnonzero((tracks.missed == 0) & hits.any(axis=1))
    # in turns, if there are many: these are enough
    fresh = np.roll(fresh, -_MOST * state.scan)[:_MOST]
    if len(fresh):
        shown = _residuals(progress, tracks, late, rows, fresh)
        estimates = estimates.gained(shown.noise, shown.manoeuvres).weighed(shown.matrix, shown.right)
        if state.biases is not None:
            progress = progress.with_state(biases=state.biases.after(declared, *shown.biases))
    grown = np.flatnonzero((state.clutter.clock < YOUNG) & (clutter.clock >= YOUNG))
    tentative = np.flatnonzero(~state.tracks.confirmed)
    if len(grown) and len(tentative):
        # what tracks gained before a place was sure, they gained too easily
        gained, young = np.zeros(len(state.tracks)), state.tracks[tentative]
        gained[tentative] = densities_at(progress, young, clutter)[0][:, grown].sum(axis=1) * young.hits
        progress = progress.with_state(tracks=state.tracks.scored(state.tracks.states, -gained))
    return progress.with_state(estimates=estimates.forgotten(turns).settled(declared), clutter=clutter)


def _votes(progress: Progress, scan: Scan, tracks: TrackBatch, there: Array) -> list[Array]:
    """How much better places predicted each measurement than predicted tracks did, (n_s,) for each sensor.

    Differences of log likelihoods, limited; 0 outside of places, but for the first turns. Places return Poisson numbers
    of plots; tracks are detected or missed: each of those `there`, bool (T, S), that has no measurement counts against
    tracks.
    """
    settings, clutter = progress.settings, progress.state.clutter
    assert clutter is not None
    votes = [np.zeros(len(z)) for z in progress.crowds]
    for s, (sensor, found) in enumerate(zip(settings.sensors, progress.crowds, strict=True)):
        # in the first turns tracks may well predict what no place does yet
        rows = np.flatnonzero(found) if clutter.clock[s] >= YOUNG - 1.0 else np.arange(len(found))
        if not len(rows):
            continue
        dense, z, missed = np.zeros(len(rows)), scan.measurements[s][rows], 0.0
        if len(tracks):
            expected = settings.filter.expected(tracks.states, sensor)
            gate = gate_of(sensor, settings.gate_probability)
            track, near = near_pairs(expected, z, periods_of(sensor), gate)
            off = sensor.residual(z[near], expected.mean[track])
            square = np.einsum("ki,kij,kj->k", off, np.linalg.inv(expected.covariance)[track], off)
            size = 0.5 * np.linalg.slogdet(2.0 * np.pi * expected.covariance)[1][track]
            density = sensor.detection_probability * sensor.volume / sensor.false_alarm_rate
            own = density * np.exp(-0.5 * square - size)
            np.add.at(dense, near, own)
            hit = np.minimum(np.bincount(track, own / (1.0 + dense[near]), len(tracks)), 1.0)
            missed = -math.log1p(-sensor.detection_probability) * ((1.0 - hit) * there[:, s]).sum()
        more = (found[rows] > 0.0) * (missed / max(int(np.count_nonzero(found)), 1) - 1.0)
        votes[s][rows] = np.clip(found[rows] - np.log1p(dense) + more, -ONE_SAYS, ONE_SAYS)
    return votes


def _turns(progress: Progress) -> Array:
    """Turns of each sensor in the scan, (S,)."""
    sectors = progress.scan.sectors
    if sectors is None:
        return np.ones(len(progress.settings.sensors))
    return np.asarray((sectors[:, 1] - sectors[:, 0]) / FULL_TURN)


def _contested(progress: Progress, late: TrackBatch) -> tuple[Array, list[Array]]:
    """Who was missed cannot be told of tracks whose gates overlap: they take the plots of targets without a track.

    Their dwells, bool (T, S), and the measurements in their gates, bool (n_s,) of each sensor. Both are known before
    the scan, so that what is left is no choice among detections and misses.
    """
    settings, sizes = progress.settings, progress.scan.sizes.tolist()
    contested, doubtful = np.zeros((len(late), len(sizes)), dtype=np.bool_), [np.zeros(n, np.bool_) for n in sizes]
    for s, (z, sensor) in enumerate(zip(progress.scan.measurements, settings.sensors, strict=True)):
        if len(late) < 2:
            continue
        gate, periods = gate_of(sensor, settings.gate_probability), periods_of(sensor)
        expected = settings.filter.expected(late.states, sensor)
        # two gates of one size overlap within twice that
        first, second = near_pairs(expected, expected.mean, periods, 4.0 * gate)
        first, second = np.stack([first, second])[:, first != second]
        if not len(first):
            continue
        off = sensor.residual(expected.mean[second], expected.mean[first])
        square = np.einsum("ki,kij,kj->k", off, np.linalg.inv(expected.covariance[first]), off)
        near = square <= 4.0 * gate
        contested[first[near], s] = contested[second[near], s] = True
        rows = np.flatnonzero(contested[:, s])
        gates = Expected(expected.mean[rows], expected.covariance[rows])
        doubtful[s][near_pairs(gates, z, periods, gate)[1]] = True
    return contested, doubtful


def _seek(progress: Progress, late: TrackBatch, rows: Array, dwelled: Array) -> None:
    """Add measurements outside of the gates of tracks that were missed: without them, noise would seem smaller."""
    settings, step = progress.settings, progress.step
    assert step is not None
    for s, (z, sensor) in enumerate(zip(progress.scan.measurements, settings.sensors, strict=True)):
        missed = np.flatnonzero((rows[:, s] == 0) & dwelled[:, s] & (late.missed == 0))
        free = np.flatnonzero(~among(step.assigned[s], late.track_id)) if len(missed) else missed
        if not len(free):
            continue
        gate, periods = gate_of(sensor, settings.gate_probability), periods_of(sensor)
        expected = settings.filter.expected(late.states[missed], sensor)
        # in logarithms: determinants of covariances that floats can hold may be none that they can
        size = 0.5 * np.linalg.slogdet(expected.covariance)[1] + sensor.dim * np.log(2.0 * np.sqrt(gate))
        most = np.log(_FALSE * sensor.volume / sensor.false_alarm_rate) - size
        wider = np.exp(np.minimum(np.log(_WIDER), most / sensor.dim))
        wide = Expected(expected.mean, expected.covariance * (wider**2)[:, None, None])
        track, found = near_pairs(wide, z[free], periods, gate)
        off = sensor.residual(z[free[found]], expected.mean[track])
        square = np.einsum("ki,kij,kj->k", off, np.linalg.inv(wide.covariance)[track], off)
        open_track, open_found = np.ones(len(missed), dtype=np.bool_), np.ones(len(free), dtype=np.bool_)
        for k in np.argsort(square, kind="stable").tolist():
            t, m = track[k], found[k]
            if square[k] <= gate and wider[t] > 1.0 and open_track[t] and open_found[m]:
                open_track[t] = open_found[m] = False
                rows[missed[t], s] = free[m] + 1


def _residuals(progress: Progress, tracks: TrackBatch, late: TrackBatch, rows: Array, fresh: Array) -> Shown:
    """What the measurements of these tracks say about variances."""
    settings, estimates = progress.settings, progress.state.estimates
    assert estimates is not None
    axes = list(settings.filter.motion.position)
    states = late.states[fresh]
    times = progress.scan.own_times() if progress.timed is not None else None
    seen = []
    for s, z in enumerate(progress.scan.measurements):
        track = np.flatnonzero(rows[fresh, s])
        number = rows[fresh[track], s] - 1
        at = states[track]
        if times is not None and len(track):
            # not before the tracks' last measurement
            at = predict_each(settings.filter, tracks.states[fresh[track]], times[s][number] - progress.state.time)
        position = np.zeros((len(track), 3))
        if len(track):
            position[:, : len(axes)] = at.mean[:, axes]
        nearest, free = np.full(len(track), np.inf), np.ones(len(z), dtype=np.bool_)
        free[rows[rows[:, s] > 0, s] - 1] = False
        young = np.flatnonzero(late.hits[fresh[track]] < _SETTLED)
        # where targets return several plots those of no track are mostly their own
        if len(young) and free.any() and not settings.extended:
            nearest[young] = _nearest(settings, at[young], settings.sensors[s].position_part, z[free])
        seen.append(Seen(track, z[number], position, nearest))
    declared = progress.work.settings.sensors
    filter, dt = progress.work.settings.filter, progress.elapsed
    models = filter.filters if isinstance(filter, InteractingMultipleModel) else (filter,)
    at = states.mean[:1]
    noises = np.stack(
        [model.motion.noise(at, dt)[0][np.ix_(axes, axes)] if dt else np.zeros((len(axes),) * 2) for model in models]
    )
    velocities, moving = np.zeros((len(states), len(axes))), velocity_components(settings.filter.motion)
    velocities[:, : len(moving)] = states.mean[:, moving]
    return shown_by(
        declared,
        seen,
        _predicted(states, axes, velocities, noises),
        estimates.used[:, NOISE],
        estimates.factors,
        estimates.manoeuvres,
    )


def _nearest(settings: TrackerSettings, states: Any, part: Sensor, free: Array) -> Array:
    """See `Seen`, given the measurements of no track (n, d), of which there is one."""
    expected = settings.filter.expected(states, part)
    off = part.residual(np.ascontiguousarray(free[:, : part.dim])[None], expected.mean[:, None])
    square = np.einsum("kni,kij,knj->kn", off, np.linalg.inv(expected.covariance), off)
    # one may lie exactly where a track is expected
    return np.asarray(np.maximum(square.min(axis=1), np.finfo(float).eps))


def _predicted(states: Any, axes: list[int], velocities: Array, noises: Array) -> Predicted:
    """Positions of predicted states."""
    mean, covariance = states.mean[:, axes], states.covariance[:, axes][:, :, axes]
    if not isinstance(states, Mixture):
        weights = np.ones((len(mean), 1))
        return Predicted(
            covariance, np.zeros((len(mean), 1, len(axes))), covariance[:, None], weights, velocities, noises
        )
    offsets = states.means[:, :, axes] - mean[:, None]
    return Predicted(
        covariance, offsets, states.covariances[:, :, axes][:, :, :, axes], states.weights, velocities, noises
    )
