"""Scenes from Stone Soup's detections and ground truth."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from datetime import datetime
from itertools import groupby
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.integrations.stonesoup.adapted import AdaptedSensor
from assoc.integrations.stonesoup.frame import Frame, make_frame
from assoc.integrations.stonesoup.ordering import sorted_detections, sorted_paths
from assoc.scene.scene import Scene, default_region
from assoc.scene.truth import Truth
from assoc.sensors import Sensor


def scene_from_detections(
    detections: Iterable[tuple[datetime, Iterable[Any]]],
    sensors: Sequence[AdaptedSensor],
    *,
    truth: Iterable[Any] | None = None,
    start: datetime | None = None,
    region: ArrayLike | None = None,
    name: str = "",
) -> Scene:
    """Make a scene from the detections of a Stone Soup reader, feeder or simulator.

    Sets with the same time are one scan: a ``PlatformDetectionSimulator`` yields one set for each sensor.
    Detections with other timestamps than their set keep them as times of their own. If no sensor measures heights,
    the scene lies in the plane z = 0.

    Parameters
    ----------
    detections : iterable of (datetime, set of Detection)
        Any ``DetectionReader``; times must not decrease.
    sensors : sequence of AdaptedSensor
        See `adapt`.
    truth : iterable of GroundTruthPath, optional
        The true targets; a ``TrueDetection`` refers to its path. They are read after the detections, so that a
        simulator's own paths may be given. Paths are numbered in the order of their
        first states.
    start : datetime, optional
        The scene's time 0; by default the time of the first scan.
    region : array_like (3, 2), optional
        See `Scene`.
    name : str, optional

    Returns
    -------
    Scene

    Raises
    ------
    InvalidInputError
        No detections, decreasing times, or a detection of none of the sensors.
    """
    frame = make_frame(sensors)
    moments, scans = [], []
    for time, sets in by_time(detections):
        moments.append(time)
        scans.append(frame.split(sorted_detections(d for found in sets for d in found)))
    if not scans:
        raise InvalidInputError("detections: the reader yielded none, expected at least one scan")
    zero = moments[0] if start is None else start
    return Scene(
        sensors=frame.sensors,
        times=np.array([(moment - zero).total_seconds() for moment in moments]),
        measurements=[frame.measurements(parts) for parts in scans],
        measurement_times=_own_times(moments, scans, zero),
        region=region_of(frame, region),
        truth=None if truth is None else _truth(sorted_paths(truth), moments, scans, frame),
        name=name,
    )


def _own_times(
    moments: Sequence[datetime], scans: Sequence[Sequence[Sequence[Any]]], zero: datetime
) -> list[list[Array]] | None:
    """Time of each detection, seconds; None if all have the times of their sets."""
    stamps = [
        [[d.timestamp or time for d in part] for part in parts] for time, parts in zip(moments, scans, strict=True)
    ]
    if all(stamp == time for time, parts in zip(moments, stamps, strict=True) for part in parts for stamp in part):
        return None
    return [[np.array([(stamp - zero).total_seconds() for stamp in part]) for part in parts] for parts in stamps]


def by_time(detections: Iterable[tuple[datetime, Iterable[Any]]]) -> Iterator[tuple[datetime, list[list[Any]]]]:
    """Sets of detections that follow each other and have the same time, in order of time."""
    previous: datetime | None = None
    for time, group in groupby(detections, key=lambda pair: pair[0]):
        if previous is not None and time < previous:
            raise InvalidInputError(f"detections: time {time} comes after {previous}, expected increasing times")
        previous = time
        yield time, [list(found) for _, found in group]


def region_of(frame: Frame, region: ArrayLike | None) -> Array:
    """Return the given or the default region; without heights it lies in the plane."""
    sensors: Sequence[Sensor] = frame.sensors
    box = np.array(default_region(sensors) if region is None else region, dtype=np.float64)
    if frame.planar and box.shape == (3, 2):
        # then slant ranges of range-azimuth radars on the ground equal ground ranges
        box[2] = 0.0
    return box


def _truth(
    paths: Sequence[Any], moments: Sequence[datetime], scans: Sequence[Sequence[Sequence[Any]]], frame: Frame
) -> Truth:
    number = {id(path): i for i, path in enumerate(paths)}
    known: dict[datetime, list[tuple[int, Array]]] = {}
    for i, path in enumerate(paths):
        # of several states of a path at one time the last one counts
        for moment, state in {state.timestamp: state for state in path}.items():
            position = np.zeros(3)
            position[: len(frame.mapping)] = np.asarray(state.state_vector, dtype=np.float64).ravel()[
                list(frame.mapping)
            ]
            known.setdefault(moment, []).append((i, position))
    present = [known.get(moment, []) for moment in moments]
    return Truth(
        target_ids=[np.array([i for i, _ in targets], dtype=np.int64) for targets in present],
        positions=[np.array([position for _, position in targets]).reshape(len(targets), 3) for targets in present],
        sources=[
            [np.array([number.get(id(getattr(d, "groundtruth_path", None)), -1) for d in p], dtype=np.int64) for p in s]
            for s in scans
        ],
    )
