"""Stage: tracks that are echoes of other tracks are not confirmed; they are kept, for they may turn out to be targets.

Pairs are formed while a track is young: each of its plots must lie at the range or azimuth of the target's. Evidence
(`assoc.tracking.records.echoes`) is weighed after each scan. What is confirmed and rather an echo than a target goes on
as a tentative track: it keeps its plots, so that they begin no other, but is not shown, and nothing is learnt of it.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from assoc._types import Array
from assoc.sensors import Radar2D, Radar3D
from assoc.tracking.progress import Progress
from assoc.tracking.records.echoes import AZIMUTH, CHANCE, FRESH, HITS, MISSES, RANGE, SQUARE, STRAYS, Echoes
from assoc.tracking.records.track import Step, among, rows_of_ids, taken_by
from assoc.tracking.records.track_batch import TrackBatch
from assoc.tracking.stages.coverage import dwells

# odds above which a track is hidden, and below which it is a target for good
_HIDDEN, _TARGET = math.log(3.0), -8.0
# a track is young up to so many detections
_YOUNG = 12
# and its first detections may be older than the track of the target
_UNTRACKED = 3.0
# standard deviations within which plots share a component, and beyond which they differ
_APART = 3.0
# standard deviations within which other tracks are counted, for how often targets share a component by chance
_ROUND = 30.0


def hide_echoes(progress: Progress) -> Progress:
    """Stage: weigh which tracks are echoes, and take their confirmation back."""
    state, step, settings = progress.state, progress.step, progress.settings
    assert state.echoes is not None and step is not None and progress.association is not None
    radars = [s for s, sensor in enumerate(settings.sensors) if isinstance(sensor, (Radar2D, Radar3D))]
    if not radars:
        return progress
    tracks, before = settings.method.current(state), state.echoes
    known = progress.association.tracks
    echoes = _living(before, state.tracks.track_id, known.track_id[known.confirmed])
    plots, seen = taken_by(tracks.track_id, step.assigned), dwells(progress, tracks.states)
    if len(echoes.ids):
        echoes = _counted(progress, echoes, tracks, plots, seen)
    assert progress.before is not None
    fresh = ~among(tracks.track_id, progress.before.track_id)
    for s in radars:
        echoes = _begun(progress, echoes, tracks, plots, fresh, s)
    echoes = _weighed(progress, echoes, tracks)
    shown = state.tracks.confirmed & ~among(state.tracks.track_id, echoes.hidden)
    kept = state.tracks.with_confirmed(shown)
    return progress.with_state(echoes=echoes, tracks=kept)._replace(step=_without(step, echoes.hidden))


def _living(echoes: Echoes, ids: Array, shown: Array) -> Echoes:
    """The pairs of tracks that are left; those that ended without being shown are counted."""
    if not len(echoes.ids):
        return echoes
    left, short = np.isin(echoes.ids, ids), echoes.short.copy()
    tied = (echoes.counts[:, FRESH] > 0.0) & (echoes.counts[:, HITS] + echoes.counts[:, FRESH] > 2.0)
    ended = ~left[:, 0] & tied & ~np.isin(echoes.ids[:, 0], shown)
    once = np.unique(np.column_stack([echoes.ids[ended, 0], echoes.kinds[ended]]), axis=0)
    np.add.at(short, tuple(once[:, 1:].T), 1.0)
    return echoes.of(np.asarray(left.all(axis=1)))._replace(short=short)


def _apart(progress: Progress, s: int, first: Array, second: Array) -> tuple[Array, Array]:
    """Differences of ranges and azimuths of plots of one sensor (K, 2), and their standard deviations (2,)."""
    sensor, z = progress.settings.sensors[s], progress.scan.measurements[s]
    return sensor.residual(z[first], z[second])[:, :2], np.sqrt(2.0 * np.diagonal(sensor.covariance)[:2])


def _counted(progress: Progress, echoes: Echoes, tracks: TrackBatch, plots: Array, seen: Array) -> Echoes:
    """Count the scan's detections of pairs."""
    counts, (s, axis) = echoes.counts.copy(), echoes.kinds.T
    echo, target = (rows_of_ids(tracks.track_id, ids) for ids in echoes.ids.T)
    covered = np.append(seen, np.zeros((1, seen.shape[1]), dtype=np.bool_), axis=0)
    ours, theirs = plots[echo, s], plots[target, s]
    tied = np.zeros(len(s), dtype=np.bool_)
    for sensor in np.unique(s).tolist():
        both = np.flatnonzero((s == sensor) & (ours > 0) & (theirs > 0))
        off, spread = _apart(progress, sensor, ours[both] - 1, theirs[both] - 1)
        square = (off[np.arange(len(both)), axis[both]] / spread[axis[both]]) ** 2
        tied[both] = square < _APART**2
        counts[both, SQUARE] += np.where(tied[both], square, 0.0)
    counts[:, HITS] += tied
    counts[:, MISSES] += (ours == 0) & (theirs > 0) & covered[echo, s]
    elsewhere = np.count_nonzero(plots[echo] > 0, axis=1) - (ours > 0)
    counts[:, STRAYS] += elsewhere + ((ours > 0) & ~tied & ((theirs > 0) | covered[target, s]))
    return echoes._replace(counts=counts)


def _begun(progress: Progress, echoes: Echoes, tracks: TrackBatch, plots: Array, fresh: Array, s: int) -> Echoes:
    """Add pairs of young tracks and those at whose range or azimuth a plot of sensor s lies.

    Those are `fresh`, bool (T,), that began in this scan.
    """
    here = np.flatnonzero(plots[:-1, s])
    # what may be an echo of one target may turn to the echo of another
    open = among(tracks.track_id[here], echoes.ids[:, 0])
    young, here = here[(tracks.hits[here] <= _YOUNG) | open], here[tracks.hits[here] > 1]
    if not len(young) or not len(here):
        return echoes
    z, sensor = progress.scan.measurements[s], progress.settings.sensors[s]
    low, width = sensor.field_of_view[:2, 0], np.diff(sensor.field_of_view[:2], axis=1)[:, 0]
    expected, tied = echoes.expected.copy(), np.zeros(len(tracks) + 1)
    np.maximum.at(tied, rows_of_ids(tracks.track_id, echoes.ids[:, 0]), echoes.counts[:, HITS])
    # detections before that no pair explains, but for those when the other was not yet tracked
    alone = np.maximum(tracks.hits - _UNTRACKED - tied[:-1], 0.0)
    for axis in (RANGE, AZIMUTH):
        values, ours, theirs = z[:, axis], plots[young, s] - 1, plots[here, s] - 1
        spread = np.sqrt(2.0 * np.diagonal(sensor.covariance)[:2])
        density = len(here) * spread[axis] / width[axis]
        # where other tracks are dense around, as in a swarm, nothing can be told
        around = _windows(values, ours, theirs[tracks.confirmed[here]], _ROUND * spread[axis], sensor.angular[axis])[2]
        crowd = np.maximum((around.sum(axis=0) - 1.0) / (2.0 * _ROUND), density)
        sparse = np.flatnonzero(math.sqrt(2.0 * math.pi) * crowd < 1.0)
        # twice in a row, or once where tracks begin with their second plot; and others than false alarms are shown
        once, new_hits = 2.0 * _APART * density, tracks.hits[young[sparse][fresh[young[sparse]]]]
        reach = 1.0 if axis == RANGE else 1.0 - ((z[theirs, RANGE] - low[RANGE]) / width[RANGE]).mean()
        expected[s, axis] += ((once * reach) ** np.where(new_hits > 1, 1.0, 2.0)).sum()
        first, second = _near(values, ours[sparse], theirs, _APART * spread[axis], sensor.angular[axis])
        if not len(first):
            continue
        chance = np.full(len(first), math.sqrt(2.0 * math.pi) * density)
        first, second = young[sparse[first]], here[second]
        off = _apart(progress, s, plots[first, s] - 1, plots[second, s] - 1)[0]
        away, square = off[:, 1 - axis] / spread[1 - axis], (off[:, axis] / spread[axis]) ** 2
        if axis == AZIMUTH:
            # an echo is a little farther, at any scale: its detour is as likely between 1 and 2 km as between 2 and 4
            chance *= np.maximum(off[:, RANGE], 0.0) / width[RANGE] * math.log(width[RANGE] / spread[RANGE])
        else:
            away = np.abs(away)
        ids = np.stack([tracks.track_id[first], tracks.track_id[second]], axis=1)
        new = np.flatnonzero((away > _APART) & (square < _APART**2) & (first != second))
        if not len(new):
            continue
        new = new[~_known(echoes, ids[new], s, axis)]
        counts = np.zeros((len(new), 6))
        counts[:, HITS], counts[:, STRAYS] = 1.0, alone[first[new]]
        counts[:, SQUARE], counts[:, CHANCE], counts[:, FRESH] = (
            square[new],
            chance[new],
            (fresh * tracks.hits)[first[new]],
        )
        echoes = echoes._replace(
            ids=np.concatenate([echoes.ids, ids[new]]),
            kinds=np.concatenate([echoes.kinds, np.tile([s, axis], (len(counts), 1))]),
            counts=np.concatenate([echoes.counts, counts]),
        )
    return echoes._replace(expected=expected)


def _windows(values: Array, first: Array, second: Array, reach: float, angle: bool) -> tuple[Array, Array, Array]:
    """Which of the second plots, given by their numbers, are near the first in one component.

    They are `count` of them from `low` on in their `order`; of each turn (T, n). Returns order, low and count.
    """
    order = np.argsort(values[second], kind="stable")
    ordered, turns = values[second][order], [-2.0 * math.pi, 0.0, 2.0 * math.pi] if angle else [0.0]
    middle = values[first] + np.array(turns)[:, None]
    low = np.searchsorted(ordered, middle - reach)
    return order, low, np.searchsorted(ordered, middle + reach) - low


def _near(values: Array, first: Array, second: Array, reach: float, angle: bool) -> tuple[Array, Array]:
    """Pairs of plots, given by their numbers, that are near in one component."""
    order, low, count = _windows(values, first, second, reach, angle)
    row = np.repeat(np.tile(np.arange(len(first)), len(low)), count.ravel())
    at = np.arange(len(row)) + np.repeat(low.ravel() - np.cumsum(count) + count.ravel(), count.ravel())
    return row, order[at]


def _known(echoes: Echoes, ids: Array, s: int, axis: int) -> Array:
    """Which of these pairs are there already, bool (K,)."""
    ours = echoes.ids[(echoes.kinds[:, 0] == s) & (echoes.kinds[:, 1] == axis)]
    ours = ours[np.isin(ours[:, 0], ids[:, 0])]
    most = 1 + max(ids.max(initial=0), ours.max(initial=0))
    return np.isin(ids @ [most, 1], ours @ [most, 1])


def rather_echoes(progress: Progress, tracks: TrackBatch) -> Array:
    """Which tracks, tentative ones too, are rather echoes than targets, bool (T,)."""
    echoes = progress.state.echoes
    if echoes is None or not len(echoes.ids):
        return np.zeros(len(tracks), dtype=np.bool_)
    return np.isin(tracks.track_id, echoes.ids[_log_odds(progress, echoes, tracks) > _HIDDEN, 0])


def _log_odds(progress: Progress, echoes: Echoes, tracks: TrackBatch) -> Array:
    """Log odds of each pair, (K,)."""
    settings, (s, _) = progress.settings, echoes.kinds.T
    P = np.array([sensor.detection_probability for sensor in settings.sensors])[s]
    share: Any = np.append(settings.views.at_means(tracks.states), np.ones((1, len(settings.sensors))), axis=0)
    return echoes.log_odds(P * share[rows_of_ids(tracks.track_id, echoes.ids[:, 0]), s])


def _weighed(progress: Progress, echoes: Echoes, tracks: TrackBatch) -> Echoes:
    """Decide which tracks are hidden, and forget pairs that are decided."""
    echo, target = (rows_of_ids(tracks.track_id, ids) for ids in echoes.ids.T)
    odds, confirmed = _log_odds(progress, echoes, tracks), np.append(tracks.confirmed, False)
    above = (odds > _HIDDEN) & confirmed[target] & (confirmed[echo] | among(echoes.ids[:, 0], echoes.hidden))
    # echoes have no echoes of their own; the surest first
    rows, theirs, sure = {}, set[int](), np.flatnonzero(above)
    for row in sure[np.argsort(-odds[sure], kind="stable")].tolist():
        one, other = echoes.ids[row].tolist()
        if one not in theirs and one not in rows and other not in rows:
            rows[one] = row
            theirs.add(other)
    hidden, found = np.array(sorted(rows), dtype=np.int64), echoes.found.copy()
    new = [rows[one] for one in hidden[~among(hidden, echoes.hidden)].tolist()]
    np.add.at(found, tuple(echoes.kinds[new].T), 1.0)
    # tracks are taken for targets when they are young no more
    grown = tracks.confirmed & (tracks.hits == _YOUNG + 1) & (tracks.missed == 0)
    targets = echoes.targets + np.count_nonzero(~among(tracks.track_id[grown], hidden))
    echoes = echoes._replace(hidden=hidden, found=found, targets=float(targets))
    return echoes.of((odds > _TARGET) | (np.append(tracks.hits, 0)[echo] <= _YOUNG))


def _without(step: Step, hidden: Array) -> Step:
    """The step with these tracks not confirmed."""
    if not len(hidden):
        return step

    def flags(confirmed: tuple[Array, ...], assigned: tuple[Array, ...]) -> tuple[Array, ...]:
        return tuple(sure & ~np.isin(ids, hidden) for sure, ids in zip(confirmed, assigned, strict=True))

    final = tuple(replace(old, confirmed=flags(old.confirmed, old.assigned)) for old in step.final)
    return replace(
        step, confirmed=flags(step.confirmed, step.assigned), final=final, ended=np.setdiff1d(step.ended, hidden)
    )
