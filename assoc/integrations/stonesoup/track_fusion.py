"""Tracks of several trackers of Stone Soup as one picture."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from datetime import datetime
from heapq import merge
from itertools import groupby
from typing import Any

import numpy as np
from stonesoup.base import Property
from stonesoup.tracker.base import Tracker
from stonesoup.types.track import Track

from assoc.integrations.stonesoup.ordering import sorted_paths
from assoc.integrations.stonesoup.tracks import GrowingTracks, StateSpace
from assoc.tracking.fusion import FusedPicture, FusionParameters, SystemTracks, TrackFusion


class TrackFusionTracker(Tracker):  # type: ignore[misc]
    """Decides which tracks of several trackers are of one target, and fuses them by covariance intersection.

    Fused tracks keep their ids. ``track.metadata["members"]`` are the ids of the tracks that were fused, None of a
    tracker that has none of the target. At each time that any tracker yields, the last tracks of the others are moved
    to it.

    Attributes
    ----------
    fusion : assoc.tracking.fusion.TrackFusion
    """

    trackers: Sequence[Tracker] = Property(doc="Trackers of any kind, or anything that yields times and tracks.")
    mapping: Sequence[int] = Property(default=(0, 2), doc="Where the states hold x, y (and z).")
    velocity_mapping: Sequence[int] = Property(
        default=None, doc="Where they hold the velocities. Default: each follows its position."
    )
    ndim_state: int = Property(default=4, doc="Number of state dimensions.")
    parameters: Mapping[str, Any] = Property(
        default_factory=dict, doc="Of ``assoc.tracking.fusion.FusionParameters``: coverage, noise, patience, ..."
    )

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._space = StateSpace(self.ndim_state, self.mapping, self.velocity_mapping)
        self.fusion = TrackFusion(len(self.trackers), FusionParameters(**self.parameters))
        self._grown = GrowingTracks(self._space)
        self._steps: Iterator[tuple[datetime, set[Track]]] | None = None

    @property
    def tracks(self) -> set[Track]:
        """The fused tracks after the last step."""
        return self._grown.present

    def __next__(self) -> tuple[datetime, set[Track]]:
        if self._steps is None:
            self._steps = self._fused()
        return next(self._steps)

    def _yielded(self, s: int) -> Iterator[tuple[datetime, int, SystemTracks, dict[int, str]]]:
        """What tracker s yields, as it is at that time: trackers go on changing their sets."""
        numbers: dict[str, int] = {}
        for time, tracks in self.trackers[s]:
            there = [track for track in sorted_paths(tracks) if len(track)]
            ids = [numbers.setdefault(track.id, len(numbers) + 1) for track in there]
            yield time, s, self._space.read(there, ids), dict(zip(ids, (track.id for track in there), strict=True))

    def _fused(self) -> Iterator[tuple[datetime, set[Track]]]:
        last: dict[int, tuple[datetime, SystemTracks]] = {}
        names: list[dict[int, str]] = [{} for _ in self.trackers]
        zero: datetime | None = None
        all_steps = merge(*map(self._yielded, range(len(self.trackers))), key=lambda step: step[0])
        for time, group in groupby(all_steps, key=lambda step: step[0]):
            zero = zero or time
            for _, s, states, ids in group:
                last[s], names[s] = (time, states), ids
            noise = self.fusion.parameters.noise
            now = [
                last[s][1].moved((time - last[s][0]).total_seconds(), noise) if s in last else self._space.read([], [])
                for s in range(len(self.trackers))
            ]
            picture = self.fusion.step((time - zero).total_seconds(), now)
            self._grown.step(time, _states(picture), {}, set(self.fusion.ids.tolist()))
            members = {
                str(track.track_id): tuple(of.get(i) for of, i in zip(names, row.tolist(), strict=True))
                for track, row in zip(picture.tracks, picture.members, strict=True)
            }
            for track in self.tracks:
                track.metadata["members"] = members[track.id]
            yield time, self.tracks


def _states(picture: FusedPicture) -> SystemTracks:
    tracks = picture.tracks
    return SystemTracks(
        np.array([track.track_id for track in tracks], dtype=np.int64),
        np.array([track.mean for track in tracks]).reshape(-1, 6),
        np.array([track.covariance for track in tracks]).reshape(-1, 6, 6),
        np.array([track.existence for track in tracks], dtype=np.float64),
    )
