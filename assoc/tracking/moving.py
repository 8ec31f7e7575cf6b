"""Which tracks move, and which are parts of one large target: for pictures of boats among docks and moored boats.

The rule does not ask for speed, which a short track does not know: a track moves once it has been farther from where it
began than noise and a target's size explain. Tracks of bow and stern, side by side with one velocity, are one target.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from assoc._parameters import positive
from assoc._types import Array
from assoc.tracking.records.track import Track


class Target(NamedTuple):
    """A target made of one track, or of several that move together."""

    track_id: int
    """Id of the track that began to be confirmed first."""
    moving: bool
    position: Array
    """Mean of its tracks, metres, (3,)."""
    velocity: Array
    """Mean of its tracks, m/s, (3,)."""


@dataclass
class MovingTargets:
    """Tells targets that move from those that stand, picture after picture.

    Parameters
    ----------
    away : float
        A track moves once it has been detected so far from where it was first seen confirmed, metres. It stays a
        moving one when it stops.
    length : float
        Moving tracks nearer to each other than this, metres, are one target ...
    together : float
        ... if their velocities differ by less than this, m/s.
    """

    away: float = 15.0
    length: float = 40.0
    together: float = 1.0
    _first: dict[int, Array] = field(default_factory=dict)
    _moved: set[int] = field(default_factory=set)

    def __post_init__(self) -> None:
        for name in ("away", "length", "together"):
            positive(getattr(self, name), name)

    def of(self, tracks: Sequence[Track]) -> list[Target]:
        """The targets of a picture of confirmed tracks, `moving` or standing, in the order in which they began."""
        living = {track.track_id for track in tracks}
        self._first = {i: place for i, place in self._first.items() if i in living}
        self._moved &= living
        for track in tracks:
            begin = self._first.setdefault(track.track_id, track.position)
            # a track that is missed may drift away from what stands
            if not track.missed and float(np.linalg.norm(track.position - begin)) > self.away:
                self._moved.add(track.track_id)
        order = list(self._first)
        groups: list[list[Track]] = []
        for track in sorted(tracks, key=lambda track: order.index(track.track_id)):
            home = next((group for group in groups if self._one(group[0], track)), None)
            if home is None:
                groups.append([track])
            else:
                home.append(track)
        return [
            Target(
                group[0].track_id,
                group[0].track_id in self._moved,
                np.mean([track.position for track in group], axis=0),
                np.mean([track.velocity for track in group], axis=0),
            )
            for group in groups
        ]

    def _one(self, a: Track, b: Track) -> bool:
        if a.track_id not in self._moved or b.track_id not in self._moved:
            return False
        near = float(np.linalg.norm(a.position - b.position)) < self.length
        return near and float(np.linalg.norm(a.velocity - b.velocity)) < self.together
