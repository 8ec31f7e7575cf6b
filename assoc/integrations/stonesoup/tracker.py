"""Our trackers as trackers of Stone Soup."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from datetime import datetime
from typing import Any

import numpy as np
from stonesoup.base import Property
from stonesoup.reader import DetectionReader
from stonesoup.tracker.base import Tracker
from stonesoup.types.track import Track

from assoc.errors import InvalidInputError
from assoc.integrations.stonesoup.adapted import AdaptedSensor
from assoc.integrations.stonesoup.frame import make_frame
from assoc.integrations.stonesoup.ordering import sorted_detections
from assoc.integrations.stonesoup.scenes import in_sets, region_of
from assoc.integrations.stonesoup.tracks import GrowingTracks, StateSpace
from assoc.tracking import TRACKERS, LatePlots
from assoc.tracking.filter_choice import manoeuvre_noise, open_heights, two_speeds
from assoc.tracking.fusion import SystemTracks


class AssocTracker(Tracker):  # type: ignore[misc]
    """Any of our trackers: track-oriented MHT, JIPDA and others, with initiation and deletion of their own.

    Sets with the same time are one scan of all sensors. Its tracks have the property ``exist_prob``, the probability
    that the target is there. They are those that are confirmed and not lost; an update has the detections that the
    track took for its own, with MHT those of its best hypothesis so far.

    Attributes
    ----------
    tracker : assoc.tracking.Tracker or assoc.tracking.LatePlots
        The tracker inside.
    """

    detector: DetectionReader = Property(doc="A reader, feeder or simulator, or any list of such pairs.")
    sensors: Sequence[AdaptedSensor] = Property(doc="What detects, each made by `adapt`.")
    kind: str = Property(default="mht", doc="One of ``assoc.tracking.TRACKERS``; JIPDA is ``joint-probabilistic``.")
    options: Mapping[str, Any] = Property(
        default_factory=dict, doc="Options of the tracker: filter, life_cycle, initiation, registration, seed, ..."
    )
    interval: float = Property(default=1.0, doc="Usual seconds from scan to scan, which the default filter suits.")
    horizon: float = Property(
        default=None,
        doc="Seconds: detections that are late by less are put into their scan. Default: none may be late.",
    )
    asynchronous: bool = Property(
        default=False, doc="Whether a set is a dwell of those sensors alone of which it has detections."
    )
    region: Any = Property(default=None, doc="Bounds of x, y, z, shape (3, 2), as of a scene.")
    velocity_mapping: Sequence[int] = Property(
        default=None, doc="Where the state holds the velocities. Default: each follows its position."
    )

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        if self.kind not in TRACKERS:
            raise InvalidInputError(f"kind: unknown tracker {self.kind!r}; known: {', '.join(TRACKERS)}")
        frame = self._frame = make_frame(self.sensors)
        options = dict(self.options)
        if options.get("filter") is None:
            heights = {"dimensions": 2} if frame.planar else {"unscented": open_heights(frame.sensors)}
            options["filter"] = two_speeds(manoeuvre_noise(float(self.interval)), **heights)
        inner = TRACKERS[self.kind](frame.sensors, region=region_of(frame, self.region), **options)
        self.tracker = inner if self.horizon is None else LatePlots(inner, float(self.horizon))
        self._motion = inner.filter.motion
        self._grown = GrowingTracks(StateSpace(frame.ndim_state, frame.mapping, self.velocity_mapping))
        self._zero: datetime | None = None
        self._now: datetime | None = None
        self._steps: Iterator[tuple[datetime, set[Track]]] | None = None

    @property
    def tracks(self) -> set[Track]:
        """The tracks after the last step."""
        return self._grown.present

    def __next__(self) -> tuple[datetime, set[Track]]:
        if self._steps is None:
            if self.detector is None:
                raise InvalidInputError("detector: expected one to iterate over, got None")
            joined = in_sets(self.detector)
            self._steps = (self.update_tracker(time, [d for part in sets for d in part]) for time, sets in joined)
        return next(self._steps)

    def update_tracker(self, time: datetime, detections: Any) -> tuple[datetime, set[Track]]:
        """Process the detections of one scan.

        Parameters
        ----------
        time : datetime
            A time before the last one is that of late detections: the tracks are then those of the last time.
        detections : set of Detection
            Of all sensors.

        Returns
        -------
        datetime, set of Track

        Raises
        ------
        InvalidInputError
            Detections are late and there is no ``horizon``, or one is of none of the sensors.
        """
        zero = self._zero = self._zero or time
        now = max(time, self._now or time)
        parts = self._frame.split(sorted_detections(detections))
        stamps = [np.array([((d.timestamp or time) - zero).total_seconds() for d in part]) for part in parts]
        seconds = (now - zero).total_seconds()
        before = -np.inf if self._now is None else (self._now - zero).total_seconds()
        if self.horizon is None and (
            time < now or min((part.min() for part in stamps if len(part)), default=now) < before
        ):
            raise InvalidInputError(
                f"detector: detections come after those of {self._now}, expected a horizon in seconds"
            )
        covered = np.array([time == now and (len(part) > 0 or not self.asynchronous) for part in parts])
        step = self.tracker.step(
            seconds,
            self._frame.measurements(parts),
            None if all((part == seconds).all() for part in stamps) else stamps,
            None if covered.all() else np.where(covered[:, None], [-np.pi, np.pi], 0.0),
        )
        self._now = now
        found: dict[int, list[Any]] = {}
        for ids, part in zip(step.assigned, parts, strict=True):
            for i, detection in zip(ids.tolist(), part, strict=True):
                found.setdefault(i, []).append(detection)
        living = self.tracker.tracks
        shown = SystemTracks.of([track for track in living if track.reported], self._motion)
        self._grown.step(now, shown, found, {track.track_id for track in living})
        return now, self.tracks
