"""States of tracks between Stone Soup and our trackers: position and velocity in six numbers."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from datetime import datetime
from typing import Any

import numpy as np
from stonesoup.types.array import CovarianceMatrix, StateVector
from stonesoup.types.hypothesis import SingleHypothesis
from stonesoup.types.multihypothesis import MultipleHypothesis
from stonesoup.types.numeric import Probability
from stonesoup.types.prediction import GaussianStatePrediction
from stonesoup.types.track import Track
from stonesoup.types.update import GaussianStateUpdate

from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.tracking.fusion import SystemTracks, open_states


class StateSpace:
    """Where a state of Stone Soup holds x, y (and z), and their velocities; by default each follows its position."""

    def __init__(self, ndim_state: int, mapping: Sequence[int], velocity_mapping: Sequence[int] | None = None) -> None:
        position = list(mapping)
        velocity = [i + 1 for i in position] if velocity_mapping is None else list(velocity_mapping)
        self.ndim_state, self.own = int(ndim_state), np.array([*position, *velocity], dtype=np.int64)
        inside = ((self.own >= 0) & (self.own < self.ndim_state)).all()
        if len(position) not in (2, 3) or len(velocity) != len(position) or not inside:
            raise InvalidInputError(
                f"mapping, velocity_mapping: expected indices of x, y (and z) and of their velocities below "
                f"{self.ndim_state}, got {position} and {velocity}"
            )
        self.six = np.concatenate([np.arange(len(position)), 3 + np.arange(len(position))])

    def read(self, tracks: Sequence[Track], ids: Sequence[int]) -> SystemTracks:
        """Our form of the tracks' last states, with these whole numbers as ids."""
        mean, covariance = open_states(len(tracks))
        for row, track in enumerate(tracks):
            mean[row, self.six] = np.asarray(track.state.mean, dtype=np.float64).ravel()[self.own]
            whole = np.asarray(track.state.covar, dtype=np.float64)
            covariance[row, self.six[:, None], self.six] = whole[self.own[:, None], self.own]
        existence = [float(getattr(track, "exist_prob", 1.0)) for track in tracks]
        return SystemTracks(np.array(ids, dtype=np.int64), mean, covariance, np.array(existence, dtype=np.float64))

    def write(self, mean: Array, covariance: Array) -> tuple[StateVector, CovarianceMatrix]:
        """Stone Soup's form of one state; other components are 0."""
        vector, covar = np.zeros(self.ndim_state), np.zeros((self.ndim_state, self.ndim_state))
        vector[self.own] = mean[self.six]
        covar[self.own[:, None], self.own] = covariance[self.six[:, None], self.six]
        return StateVector(vector), CovarianceMatrix(covar)


class GrowingTracks:
    """Tracks of Stone Soup that get a state in each step."""

    def __init__(self, space: StateSpace) -> None:
        self.space, self.present = space, set[Track]()
        self._known: dict[int, Track] = {}

    def step(
        self, time: datetime, states: SystemTracks, found: Mapping[int, Iterable[Any]], living: Collection[int]
    ) -> None:
        """Add the states, at this time, of the tracks that are present from now on.

        `found` is what each track was updated with, by its id; the tracks of `living` ids may still come back.
        """
        self._known = {i: track for i, track in self._known.items() if i in living}
        self.present = set()
        for i, mean, covariance, existence in zip(states.ids.tolist(), *states[1:], strict=True):
            vector, covar = self.space.write(mean, covariance)
            used = [SingleHypothesis(None, detection) for detection in found.get(i, ())]
            if used:
                hypothesis = used[0] if len(used) == 1 else MultipleHypothesis(used)
                state = GaussianStateUpdate(vector, covar, hypothesis=hypothesis, timestamp=time)
            else:
                state = GaussianStatePrediction(vector, covar, timestamp=time)
            track = self._known.setdefault(i, Track(id=str(i)))
            track.exist_prob = Probability(existence)
            if len(track) and track.timestamp == time:
                track[-1] = state
            else:
                track.append(state)
            self.present.add(track)
