"""What a tracker knows between two steps: one immutable record, which a step takes and another of which it returns.

Going back is keeping an old state, saving is writing it (`assoc.tracking.file`). Nothing in a state is written to.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from assoc._types import Array
from assoc.registration.online import OnlineRegistration
from assoc.tracking.births.ghosts import Unseen
from assoc.tracking.identity_evidence import Identities
from assoc.tracking.settings import TrackerSettings
from assoc.tracking.track_batch import TrackBatch, empty_batch


class TrackerState(NamedTuple):
    """A tracker between two steps."""

    tracks: TrackBatch
    """Tracks; of a multiple hypothesis tracker the branches of its trees."""
    turns: Array
    """Turns that each sensor does in a scan, on average, (S,)."""
    own: Any
    """What this kind of tracker knows besides; see `assoc.tracking.associate.method`."""
    time: float | None = None
    """Of the last scan, seconds."""
    scan: int = 0
    """Number of scans so far."""
    pace: float = 0.0
    """Usual seconds from scan to scan, 0 while it is not known."""
    next_id: int = 1
    solver_calls: int = 0
    """Problems that the solver was given so far."""
    registration: OnlineRegistration | None = None
    identities: Identities | None = None
    nursery: Nursery | None = None
    rng: Any = None
    """State of the filter's random generator, if it has one."""
    warned: bool = False
    """Whether a warning has said that the measurements can start no track."""


class Nursery(NamedTuple):
    """Tracks of bearings alone in the making; see `assoc.tracking.births.nursery`."""

    state: TrackerState
    unseen: Unseen
    """How often in a row each sensor has missed each track that has left the nursery."""


def first_state(settings: TrackerSettings) -> TrackerState:
    """The state of a tracker before its first scan."""
    tracks, count, nursery = empty_batch(settings.filter), len(settings.sensors), None
    if settings.nursery is not None:
        # the random generator is the tracker's
        nursery = Nursery(first_state(settings.nursery)._replace(rng=None), Unseen.none(count))
    return TrackerState(
        tracks,
        np.ones(count),
        settings.method.begun(settings, tracks),
        registration=settings.registration,
        identities=None if settings.identity is None else Identities(settings.identity),
        nursery=nursery,
        rng=rng_of(settings),
    )


def rng_of(settings: TrackerSettings) -> Any:
    """State of the filter's random generator; None where it has none."""
    rng = getattr(settings.filter, "rng", None)
    return None if rng is None else rng.bit_generator.state
