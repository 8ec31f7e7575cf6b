"""Which tracks move, and which are parts of one large target: for pictures of boats among docks and moored boats.

The rule does not ask for speed, which a short track does not know: a track moves once it has been farther from where it
began than noise and a target's size explain. A sensor that is sharper than a ship is long gives plots of its bow and
stern, which become tracks. Two tracks are parts of one hull rather than two boats if the one is ahead of the other, for
hulls are slender and go lengthways, and if the distance between them stays, for hulls are rigid. How long it is
does not matter.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from assoc._parameters import positive
from assoc._system.wrong_types import explains_wrong_types
from assoc._types import Array
from assoc.tracking.records.track import Track

# standard deviation of the direction from one part of a hull to another about its course: beam over length
_SLENDER = 0.2
# share of pairs of boats that keep their distance
_FORMATION = 0.1
# two tracks that were once two rather than one by these odds stay two
_TWO = math.log(1e3)


class Target(NamedTuple):
    """A target made of one track, or of several that are parts of it."""

    track_id: int
    """Id of the track that began to be confirmed first."""
    moving: bool
    position: Array
    """Mean of its tracks, metres, (3,)."""
    velocity: Array
    """Mean of its tracks, m/s, (3,)."""


@explains_wrong_types
@dataclass
class MovingTargets:
    """Tells targets that move from those that stand, picture after picture.

    Parameters
    ----------
    away : float
        A track moves once it has been detected so far from where it was first seen confirmed, metres. It stays a
        moving one when it stops.
    position : sequence of int
        Indices of x, y (and z) in states, ``tracker.filter.motion.position``; velocities follow them.
    """

    away: float = 15.0
    position: Sequence[int] = (0, 1)
    _first: dict[int, Array] = field(default_factory=dict)
    _moved: set[int] = field(default_factory=set)
    _two: set[tuple[int, int]] = field(default_factory=set)

    def __post_init__(self) -> None:
        positive(self.away, "away")

    def of(self, tracks: Sequence[Track]) -> list[Target]:
        """The targets of a picture of confirmed tracks, `moving` or standing, in the order in which they began."""
        living = {track.track_id for track in tracks}
        self._first = {i: place for i, place in self._first.items() if i in living}
        self._moved &= living
        self._two = {pair for pair in self._two if living.issuperset(pair)}
        for track in tracks:
            begin = self._first.setdefault(track.track_id, track.position)
            # a track that is missed may drift away from what stands
            if not track.missed and float(np.linalg.norm(track.position - begin)) > self.away:
                self._moved.add(track.track_id)
        order = {i: n for n, i in enumerate(self._first)}
        tracks = sorted(tracks, key=lambda track: order[track.track_id])
        one = self._parts([track for track in tracks if track.track_id in self._moved])
        groups: list[list[Track]] = []
        for track in tracks:
            home = next((g for g in groups if any((part.track_id, track.track_id) in one for part in g)), None)
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

    def _parts(self, tracks: Sequence[Track]) -> set[tuple[int, int]]:
        """Pairs of ids of these tracks that are parts of one target, the one that began first before the other."""
        if len(tracks) < 2:
            return set()
        first, second = np.triu_indices(len(tracks), 1)
        odds, ids = self._log_odds(tracks, first, second), np.array([track.track_id for track in tracks])
        pairs = np.column_stack([ids[first], ids[second]])
        self._two |= {(a, b) for a, b in pairs[odds < -_TWO].tolist()}
        return {(a, b) for a, b in pairs[odds > 0.0].tolist()} - self._two

    def _log_odds(self, tracks: Sequence[Track], first: Array, second: Array) -> Array:
        """Log odds of K pairs of tracks, by their numbers, for parts of one hull against boats of their own, (K,)."""
        place = np.array(self.position[:2])
        rate = place + len(self.position)
        covariance = np.stack([track.covariance for track in tracks])
        P, V = (both[first] + both[second] for both in (covariance[:, i[:, None], i] for i in (place, rate)))
        at, velocity = (np.array([getattr(track, name)[:2] for track in tracks]) for name in ("position", "velocity"))
        off, mean = at[first] - at[second], (velocity[first] + velocity[second]) / 2.0
        distance, speed = (np.maximum(np.linalg.norm(x, axis=1), 1e-9) for x in (off, mean))
        ahead, course = off / distance[:, None], mean / speed[:, None]
        side = np.stack([-course[:, 1], course[:, 0]], axis=1)
        angle = np.arctan2(np.abs((ahead * side).sum(axis=1)), np.abs((ahead * course).sum(axis=1)))
        across = _along(P, side) / distance**2 + _along(V, side) / (2.0 * speed) ** 2
        # boats may be in any direction of each other
        slender = math.log(math.pi) + _log_normal(angle, _SLENDER**2 + across)
        parting, spread = (ahead * (velocity[first] - velocity[second])).sum(axis=1), _along(V, ahead)
        usual = ((velocity[first] ** 2 + velocity[second] ** 2).sum(axis=1)) / 2.0
        same, free = _log_normal(parting, spread), _log_normal(parting, spread + usual)
        both = np.logaddexp(math.log(_FORMATION) + same, math.log(1.0 - _FORMATION) + free)
        return np.asarray(slender + same - both)


def _along(covariance: Array, direction: Array) -> Array:
    """Variances of vectors (K,) in a direction (K, 2)."""
    return np.asarray(np.einsum("ki,kij,kj->k", direction, covariance, direction))


def _log_normal(x: Array, variance: Array) -> Array:
    return np.asarray(-0.5 * (x**2 / variance + np.log(2.0 * math.pi * variance)))
