"""The state of a tracker between two steps: an immutable record; a step takes one and returns another.

To go back, keep an old state; to save, write it (`assoc.tracking.file`). Nothing in a state is modified.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from assoc._types import Array
from assoc.tracking.records.biases import Biases
from assoc.tracking.records.clutter import ClutterMap
from assoc.tracking.records.doubles import Doubles
from assoc.tracking.records.echoes import Echoes
from assoc.tracking.records.estimates import Estimates
from assoc.tracking.records.extents import Extents
from assoc.tracking.records.ghosts import Unseen
from assoc.tracking.records.identity_evidence import Identities
from assoc.tracking.records.track_batch import TrackBatch, empty_batch
from assoc.tracking.records.unresolved import Unresolved
from assoc.tracking.settings import TrackerSettings


class TrackerState(NamedTuple):
    """A tracker between two steps."""

    tracks: TrackBatch
    """Tracks; in a multiple hypothesis tracker, the branches."""
    turns: Array
    """Mean number of turns of each sensor in a scan, (S,)."""
    method_state: Any
    """Further state of this kind of tracker; see `assoc.tracking.method`."""
    lost: TrackBatch
    """Confirmed tracks that ended not long ago; see `assoc.tracking.stages.taking_up`."""
    doubles: Doubles
    """Pairs of tracks that may have one target; see `assoc.tracking.stages.merging`."""
    unresolved: Unresolved
    """Pairs of tracks that a sensor may not resolve; see `assoc.tracking.stages.unresolved`."""
    time: float | None = None
    """Time of the last scan, seconds; None before the first."""
    scan: int = 0
    """Number of scans so far."""
    pace: float = 0.0
    """Usual seconds from scan to scan, 0 while it is not known."""
    next_id: int = 1
    solver_calls: int = 0
    """Number of calls of the solver so far."""
    identities: Identities | None = None
    estimates: Estimates | None = None
    """What was learnt about sensors and targets; None where the tracker does not adapt."""
    clutter: ClutterMap | None = None
    """Where false alarms come from; None where the tracker does not adapt."""
    biases: Biases | None = None
    """Biases of sensors that see the same targets; None where the tracker does not adapt."""
    echoes: Echoes | None = None
    """Tracks that may be echoes of others; None where the tracker does not adapt."""
    extents: Extents | None = None
    """Targets that return several plots a scan; None where none may."""
    starter: Starter | None = None
    rng: Any = None
    """State of the filter's random generator, if it has one."""
    warned: bool = False
    """Whether the tracker has warned that the measurements can start no track."""


class Starter(NamedTuple):
    """Tentative tracks of bearings alone; see `assoc.tracking.stages.starter`."""

    state: TrackerState
    unseen: Unseen
    """Misses in a row of the tracks that have left the starter."""


def first_state(settings: TrackerSettings) -> TrackerState:
    """The state of a tracker before its first scan."""
    tracks, count, starter = empty_batch(settings.filter), len(settings.sensors), None
    if settings.starter is not None:
        # the random generator is the tracker's
        starter = Starter(first_state(settings.starter)._replace(rng=None), Unseen.none(count))
    return TrackerState(
        tracks,
        np.ones(count),
        settings.method.begun(settings, tracks),
        empty_batch(settings.filter),
        Doubles.none(count),
        Unresolved.none(count),
        identities=None if settings.identity is None else Identities(settings.identity),
        estimates=Estimates.declared(settings.sensors) if settings.adapt else None,
        clutter=ClutterMap.empty(settings.sensors) if settings.adapt else None,
        biases=Biases.none(settings.sensors) if settings.adapt else None,
        echoes=Echoes.none(count) if settings.adapt else None,
        extents=Extents.none(count) if settings.extended else None,
        starter=starter,
        rng=rng_of(settings),
    )


def may_return(state: TrackerState) -> set[int]:
    """Ids of the tracks that live, in the best hypothesis or another one, or that may be taken up again."""
    batches = [state.tracks, state.lost, *([state.starter.state.tracks] if state.starter is not None else [])]
    return {track for batch in batches for track in batch.track_id.tolist()}


def rng_of(settings: TrackerSettings) -> Any:
    """State of the filter's random generator; None where it has none."""
    rng = getattr(settings.filter, "rng", None)
    return None if rng is None else rng.bit_generator.state
