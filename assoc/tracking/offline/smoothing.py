"""Smoothing of finished tracks: each position uses all measurements of its track, earlier and later ones.

Once the association is final, each track is filtered again from its first detection to its last, and smoothed by the
backward recursion of Rauch, Tung and Striebel. The IMM's mixtures are smoothed by their moments
(`assoc.filters.FixedLagSmoother`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from assoc._system.wrong_types import explains_wrong_types
from assoc._types import Array
from assoc.costs.positions import positions_and_covariances
from assoc.errors import InvalidInputError
from assoc.filters.smoother import FixedLagSmoother, Window
from assoc.scene.scan import Scan
from assoc.scene.scene import Scene
from assoc.tracking.records.initiation import velocity_components
from assoc.tracking.records.track import Decision, Track
from assoc.tracking.track_table import TrackTable
from assoc.tracking.tracker import Tracker


@explains_wrong_types
def smoothed(
    tracker: Tracker, scene: Scene, decisions: Sequence[Decision], *, altitudes: Mapping[int, float] | None = None
) -> TrackTable:
    """Smooth the confirmed tracks of a scene.

    Parameters
    ----------
    tracker : Tracker
        Only its filter and its initiation are used; it is not changed.
    scene : Scene
    decisions : sequence of Decision
        The final decisions of all scans, see `assoc.tracking.track_scene`.
    altitudes : mapping of track id to metres, optional
        See `TrackTable.add`.

    Returns
    -------
    TrackTable
        One row for each track and scan, from its first detection to its last, scans that missed it included; where
        measurements have times of their own, one for each of its measurements and missed scans. Existence is 1; there
        is no score (NaN).

    Raises
    ------
    InvalidInputError
        The decisions belong to other scans.
    """
    for decision in decisions:
        scan = scene.scan(decision.scan)
        if decision.time != scan.time or [len(ids) for ids in decision.assigned] != scan.sizes.tolist():
            raise InvalidInputError(f"decisions: that of scan {decision.scan} is of another scan than the scene's")
    ordered = sorted(decisions, key=lambda decision: decision.scan)
    flags = [pair for decision in ordered for pair in zip(decision.assigned, decision.confirmed, strict=True)]
    sure = {i for ids, confirmed in flags for i in ids[confirmed]}
    rows: dict[int, dict[int, Array]] = {int(i): {} for i in sorted(sure) if i > 0}
    for decision in ordered:
        for s, ids in enumerate(decision.assigned):
            for m in np.flatnonzero(np.isin(ids, list(rows))).tolist():
                taken = rows[int(ids[m])].setdefault(decision.scan, np.zeros(len(decision.assigned), dtype=np.int32))
                taken[s] = m + 1
    table = TrackTable(scene.origin)
    for track_id, found in rows.items():
        table.add(_track(tracker, scene, track_id, found), tracker.filter.motion.position, altitudes)
    table.name_targets(scene)
    return table


def _track(tracker: Tracker, scene: Scene, track_id: int, found: dict[int, Array]) -> list[Track]:
    """One track smoothed, by its measurements of each scan."""
    filter, first, last = tracker.filter, min(found), max(found)
    nothing, seen = np.zeros(len(scene.sensors), dtype=np.int32), 0
    smoother = FixedLagSmoother(filter, int(sum(map(np.count_nonzero, found.values()))) + last - first + 1)
    window, times, hits = None, [], []
    for k in range(first, last + 1):
        scan = scene.scan(k).aligned(scene.sensors)
        seen += k in found
        for time, taken in _moments(scan, found.get(k, nothing)):
            standing = scene.at(time)
            if window is None:
                window = _begun(tracker, smoother, standing, scan, taken)
            else:
                window = smoother.predict(window, max(time - times[-1], 0.0))
                for s, m in enumerate(taken.tolist()):
                    if m:
                        window, _ = smoother.update(window, scan.measurements[s][m - 1 : m], standing.sensors[s])
            times.append(time)
            hits.append((seen, k in found))
    assert window is not None
    states = window.smoothed()
    position, velocity = list(filter.motion.position), velocity_components(filter.motion)
    tracks, detected = [], times[0]
    for time, (count, hit), state in zip(times, hits, states, strict=True):
        place, speed = np.zeros(3), np.zeros(3)
        place[: len(position)], speed[: len(velocity)] = state.mean[0, position], state.mean[0, velocity]
        detected = time if hit else detected
        known = track_id, time, state.mean[0], state.covariance[0], place, speed
        tracks.append(Track(*known, True, np.nan, count, times[0], detected, 1.0))
    return tracks


def _moments(scan: Scan, taken: Array) -> list[tuple[float, Array]]:
    """When a track's measurements of a scan (S,) were made, and which then; the scan's time where it has none."""
    if scan.times is None or not taken.any():
        return [(scan.time, taken)]
    stamps = np.array([scan.times[s][m - 1] if m else np.nan for s, m in enumerate(taken.tolist())])
    return [(float(time), np.where(stamps == time, taken, 0)) for time in np.unique(stamps[taken > 0])]


def _begun(tracker: Tracker, smoother: FixedLagSmoother[Any], scene: Scene, scan: Scan, rows: Array) -> Window[Any]:
    """The window at a track's first detection, which gives the position; the velocity has its prior."""
    positions, covariances = positions_and_covariances(scene, scan, rows[None])
    return Window(tracker.settings.initiation.start(smoother.filter, positions, covariances))
