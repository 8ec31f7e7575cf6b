"""Many tracks as arrays: what trackers keep of them between scans."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from assoc.filters.base import Filter
from assoc.filters.batches import arrays_of, concatenate, state_from
from assoc.filters.state import gaussian
from assoc.tracking.initiation import velocity_components
from assoc.tracking.life_cycle import LifeCycle
from assoc.tracking.track import Track

Array = np.ndarray[Any, np.dtype[Any]]

_ALL_BITS = np.int64((1 << 62) - 1)


@dataclass(frozen=True, eq=False)
class Bank:
    """T tracks (or branches of tracks).

    Attributes
    ----------
    states
        The filter's states, all of one time.
    track_id : int64 array (T,)
    score, best : arrays (T,)
        Log likelihood ratio, and its largest value so far.
    confirmed : bool array (T,)
    detections : int64 array (T,)
        One bit a scan, the last one lowest: whether the track was detected.
    missed, hits : int64 arrays (T,)
        Scans in a row without a detection; scans with one.
    started, last_detection : arrays (T,)
        Seconds.
    """

    states: Any
    track_id: Array
    score: Array
    best: Array
    confirmed: Array
    detections: Array
    missed: Array
    hits: Array
    started: Array
    last_detection: Array

    def __len__(self) -> int:
        return len(self.track_id)

    def __getitem__(self, rows: Any) -> Bank:
        """Return the tracks that an index array, mask or slice selects."""
        return Bank(**{field.name: getattr(self, field.name)[rows] for field in fields(self)})

    @staticmethod
    def new(states: Any, track_id: Array, score: Array, when: Array | float) -> Bank:
        """Tracks that begin now, each with one detection that the scan's `passed` will count."""
        count = len(track_id)
        times = np.broadcast_to(np.asarray(when, dtype=np.float64), (count,)).copy()
        none = np.zeros(count, dtype=np.int64)
        score = np.asarray(score, dtype=np.float64)
        return Bank(
            states, np.asarray(track_id, dtype=np.int64), score, score.copy(), np.zeros(count, dtype=np.bool_),
            none, none.copy(), none.copy(), times, times.copy(),
        )  # fmt: skip

    @staticmethod
    def concatenate(parts: Sequence[Bank]) -> Bank:
        """Return one bank with the tracks of several."""
        names = [field.name for field in fields(Bank) if field.name != "states"]
        joined = {name: np.concatenate([getattr(part, name) for part in parts]) for name in names}
        return Bank(states=concatenate([part.states for part in parts]), **joined)

    def moved(self, states: Any) -> Bank:
        """The same tracks with other states."""
        return replace(self, states=states)

    def scored(self, states: Any, gain: Array | float, detected_at: Array | None = None) -> Bank:
        """Tracks after a scan of one sensor, or of all: states, what the score gains, and detections.

        Parameters
        ----------
        states
        gain : array (T,) or float
        detected_at : array (T,), optional
            Time of the detection, NaN where the track was missed; left out, all were missed.
        """
        score = self.score + gain
        last = self.last_detection
        if detected_at is not None:
            last = np.where(np.isnan(detected_at), last, np.fmax(last, detected_at))
        return replace(self, states=states, score=score, best=np.maximum(self.best, score), last_detection=last)

    def counted(self, detected: Array) -> Bank:
        """Tracks at the end of a scan in which these (bool (T,)) were detected by any sensor."""
        hit = detected.astype(np.int64)
        return replace(
            self,
            detections=((self.detections << np.int64(1)) & _ALL_BITS) | hit,
            missed=np.where(detected, 0, self.missed + 1),
            hits=self.hits + hit,
        )

    def sworn(self) -> Bank:
        """The same tracks, all confirmed."""
        return replace(self, confirmed=np.ones(len(self), dtype=np.bool_))

    def confirm(self, life_cycle: LifeCycle) -> Bank:
        """Confirm the tracks whose time has come."""
        return replace(self, confirmed=self.confirmed | life_cycle.confirms(self.score, self.detections))

    def doomed(self, life_cycle: LifeCycle, time: float, patience: float) -> Array:
        """Which tracks are to be deleted; see `LifeCycle.deletes`."""
        silent = time - self.last_detection
        return life_cycle.deletes(self.confirmed, self.score, self.best, silent, self.missed, patience)

    def arrays(self, prefix: str = "") -> dict[str, Array]:
        """Everything as plain arrays."""
        found = {f"{prefix}{name}": value for name, value in self._columns().items()}
        return found | {f"{prefix}state.{name}": value for name, value in arrays_of(self.states).items()}

    def restored(self, arrays: dict[str, Array], prefix: str = "") -> Bank:
        """A bank of the kind of this one, made of the arrays of another."""
        columns = {name: arrays[f"{prefix}{name}"] for name in self._columns()}
        state = {name: arrays[f"{prefix}state.{name}"] for name in arrays_of(self.states)}
        return Bank(states=state_from(type(self.states), state), **columns)

    def _columns(self) -> dict[str, Array]:
        return {field.name: getattr(self, field.name) for field in fields(self) if field.name != "states"}

    def tracks(self, filter: Filter[Any], time: float) -> list[Track]:
        """Hand out the tracks."""
        motion = filter.motion
        position, velocity = np.zeros((len(self), 3)), np.zeros((len(self), 3))
        mean, covariance = self.states.mean, self.states.covariance
        position[:, : len(motion.position)] = mean[:, list(motion.position)]
        places = velocity_components(motion)
        velocity[:, : len(places)] = mean[:, places]
        return [
            Track(
                track_id=int(self.track_id[i]),
                time=time,
                mean=mean[i].copy(),
                covariance=covariance[i].copy(),
                position=position[i],
                velocity=velocity[i],
                confirmed=bool(self.confirmed[i]),
                score=float(self.score[i]),
                hits=int(self.hits[i]),
                started=float(self.started[i]),
                last_detection=float(self.last_detection[i]),
            )
            for i in range(len(self))
        ]


def empty_bank(filter: Filter[Any]) -> Bank:
    """No tracks, with states of the filter's kind."""
    n = filter.motion.dim
    one = filter.start(gaussian(np.zeros((1, n)), np.eye(n)[None]))
    nothing = np.zeros(0, dtype=np.int64)
    return Bank.new(one[nothing], nothing, np.zeros(0), np.zeros(0))
