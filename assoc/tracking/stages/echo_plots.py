"""Stages: false alarms are denser at the ranges of confirmed tracks, as far as plots have shown.

A side lobe returns a plot at the target's range, anywhere else in azimuth. So many a target are estimated, by how
likely each plot of no confirmed track is one of them rather than a false alarm or of a tentative track, and used while
they predict these plots better than without.

A. Dempster, N. Laird, D. Rubin, Maximum likelihood from incomplete data via the EM algorithm, J. Royal Statistical
Society B 39, 1977: the estimate is a step of it in each scan.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from assoc.costs.tracks.gating import near_pairs
from assoc.costs.tracks.tuples import gate_of
from assoc.filters.measurement import periods_of
from assoc.sensors import Radar2D, Radar3D
from assoc.tracking.progress import EchoPlots, Progress
from assoc.tracking.records.clutter import YOUNG
from assoc.tracking.records.echoes import AZIMUTH, RANGE
from assoc.tracking.records.estimates import KEEP
from assoc.tracking.records.prequential import trusted
from assoc.tracking.records.track import among
from assoc.tracking.records.track_batch import TrackBatch
from assoc.tracking.stages.echoes import near

# standard deviations within which plots share a component, and beyond which they differ
_APART = 3.0


def expect_echoes(progress: Progress) -> Progress:
    """Stage: raise the densities of false alarms at plots where confirmed tracks would have echoes."""
    echoes, tracks, scan = progress.state.echoes, progress.before, progress.scan
    assert tracks is not None and echoes is not None and scan.clutter is not None
    tracks = tracks[~among(tracks.track_id, echoes.hidden)]
    # where plots have times of their own, tracks would have to be predicted to each
    if progress.timed is not None or not tracks.confirmed.any():
        return progress
    clutter, known = [], []
    for s, found in enumerate(scan.clutter):
        plots = _expected(progress, tracks, s)
        more = plots.echoes * echoes.per_target[s] * echoes.trusted[s]
        clutter.append(np.logaddexp(found, np.log(np.maximum(more, 1e-300))))
        known.append(plots)
    return progress._replace(scan=replace(scan, clutter=tuple(clutter)), echo_plots=tuple(known))


def count_echoes(progress: Progress) -> Progress:
    """Stage: learn how many echoes a target has from the plots of no confirmed track."""
    echoes, step = progress.state.echoes, progress.step
    assert echoes is not None and step is not None and progress.state.clutter is not None
    gain, count, looks = np.zeros((3, *echoes.plots.shape))
    for s, (plots, taken) in enumerate(zip(progress.echo_plots, step.confirmed, strict=False)):
        # before tracks are confirmed, targets look like echoes of those that are
        if progress.state.clutter.clock[s] < YOUNG:
            continue
        free, looks[s] = np.flatnonzero(~taken), plots.looks
        each, others = plots.echoes[free] * echoes.per_target[s], 1.0 + plots.tracks[free]
        count[s] = (each / (others + each)).sum()
        gain[s] = np.log1p(each / others).sum() - echoes.per_target[s] * looks[s]
    evidence = KEEP * (echoes.plot_evidence + gain)
    return progress.with_state(
        echoes=echoes._replace(
            plots=KEEP * (echoes.plots + count),
            looks=KEEP * (echoes.looks + looks),
            plot_evidence=evidence,
            trusted=trusted(evidence, echoes.trusted > 0.0).astype(np.float64),
        )
    )


def _expected(progress: Progress, tracks: TrackBatch, s: int) -> EchoPlots:
    """What is expected of the plots of a sensor by these tracks, some of which are confirmed."""
    settings, z = progress.settings, progress.scan.measurements[s]
    sensor, gate = settings.sensors[s], gate_of(settings.sensors[s], settings.gate_probability)
    ratio, by_tracks = np.zeros((2, len(z)))
    if not isinstance(sensor, (Radar2D, Radar3D)) or not len(z):
        return EchoPlots(ratio, by_tracks, 0)
    expected = settings.filter.expected(tracks.states, sensor)
    track, found = near_pairs(expected, z, periods_of(sensor), gate)
    off = sensor.residual(z[found], expected.mean[track])
    square = np.einsum("ki,kij,kj->k", off, np.linalg.inv(expected.covariance)[track], off)
    # tentative tracks are targets with the odds of their scores
    sure = np.exp(-np.logaddexp(0.0, -tracks.score[track]))
    there = sensor.detection_probability * sensor.volume / sensor.false_alarm_rate * sure
    size = 0.5 * np.linalg.slogdet(2.0 * np.pi * expected.covariance)[1][track]
    by_tracks += np.bincount(found, there * np.exp(-0.5 * square - size), len(z))
    # the nearest plot of each confirmed track
    order = np.argsort(square, kind="stable")
    order = order[(square[order] < gate) & tracks.confirmed[track[order]]]
    own = np.unique(found[order[np.unique(track[order], return_index=True)[1]]])
    spread = np.sqrt(2.0 * np.diagonal(sensor.covariance)[:2])
    plot, of = near(z[:, RANGE], np.arange(len(z)), own, _APART * spread[RANGE], False)
    off = sensor.residual(z[plot], z[own[of]])[:, :2] / spread
    good = (np.abs(off[:, RANGE]) < _APART) & (np.abs(off[:, AZIMUTH]) > _APART)
    density = np.exp(-0.5 * off[good, RANGE] ** 2) / (math.sqrt(2.0 * math.pi) * spread[RANGE])
    width = float(np.diff(sensor.field_of_view[RANGE])[0])
    ratio += np.bincount(plot[good], density * width / sensor.false_alarm_rate, len(z))
    return EchoPlots(ratio, by_tracks, len(own))
