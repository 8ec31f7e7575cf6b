"""One sensor's measurements of one scan against predicted tracks, each at its own time if it has one."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from assoc._types import Array
from assoc.costs.tracks.tuples import TrackPairs, gate_of, track_pairs
from assoc.filters.base import Filter
from assoc.filters.batches import concatenate
from assoc.sensors import Sensor


class GatedPairs(NamedTuple):
    """What a sensor's measurements may mean to B tracks."""

    predicted: Any
    """The tracks at the scan's time, not corrected, B states."""
    pairs: TrackPairs
    """Measurements in the gates, and the tracks corrected by them, at the scan's time."""
    when: Array
    """Time of the measurement of each pair, seconds."""


def gated_pairs(
    filter: Filter[Any],
    states: Any,
    before: float,
    time: float,
    measurements: Array,
    stamps: Array | None,
    sensor: Sensor,
    gate_probability: float,
    evidence: Callable[[Array, Array], tuple[Array, Array]] | None = None,
) -> GatedPairs:
    """Predict tracks, gate measurements and correct every pair.

    Parameters
    ----------
    filter : Filter
    states
        B states at the time `before`.
    before, time : float
        Seconds; the time of the states and that of the scan.
    measurements : array (n, d)
    stamps : array (n,) or None
        The measurements' own times, from `before` to `time`; None: all are of `time`.
    sensor : Sensor
    gate_probability : float
    evidence : callable (track, measurement) -> (log ratio, possible), optional
        What else than their places says which pairs (K,) belong together: it adds to the log likelihood, and rules out.
    """
    gate = gate_of(sensor, gate_probability)
    predicted = _later(filter, states, time - before)
    if stamps is None:
        pairs = track_pairs(filter, predicted, measurements, sensor, gate)
        return _weighed(GatedPairs(predicted, pairs, np.full(len(pairs.track), time)), evidence)
    parts, when = [], []
    for stamp in np.unique(stamps):
        numbers = np.flatnonzero(stamps == stamp)
        there = _later(filter, states, float(stamp) - before)
        found = track_pairs(filter, there, measurements[numbers], sensor, gate)
        parts.append(
            found._replace(measurement=numbers[found.measurement], states=_later(filter, found.states, time - stamp))
        )
        when.append(np.full(len(found.track), stamp))
    if not parts:
        nothing = np.zeros(0, dtype=np.int64)
        return GatedPairs(predicted, TrackPairs(nothing, nothing, np.zeros(0), predicted[nothing]), np.zeros(0))
    joined = TrackPairs(
        np.concatenate([part.track for part in parts]),
        np.concatenate([part.measurement for part in parts]),
        np.concatenate([part.log_likelihood for part in parts]),
        concatenate([part.states for part in parts]),
    )
    return _weighed(GatedPairs(predicted, joined, np.concatenate(when)), evidence)


def _weighed(gated: GatedPairs, evidence: Callable[[Array, Array], tuple[Array, Array]] | None) -> GatedPairs:
    if evidence is None or not len(gated.pairs.track):
        return gated
    pairs = gated.pairs
    says, possible = evidence(pairs.track, pairs.measurement)
    kept = np.flatnonzero(possible)
    chosen = TrackPairs(
        pairs.track[kept], pairs.measurement[kept], (pairs.log_likelihood + says)[kept], pairs.states[kept]
    )
    return GatedPairs(gated.predicted, chosen, gated.when[kept])


def _later(filter: Filter[Any], states: Any, dt: float) -> Any:
    return filter.predict(states, dt) if len(states) and dt > 0.0 else states
