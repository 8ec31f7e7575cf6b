"""Scenes as Stone Soup's detections and ground truth."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from datetime import datetime, timedelta
from typing import Any

import numpy as np
from ordered_set import OrderedSet
from stonesoup.base import Property
from stonesoup.buffered_generator import BufferedGenerator
from stonesoup.reader import DetectionReader, GroundTruthReader
from stonesoup.types.array import StateVector
from stonesoup.types.detection import Detection
from stonesoup.types.groundtruth import GroundTruthPath, GroundTruthState

from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.integrations.stonesoup.models import measurement_model
from assoc.scene.scene import Scene

EPOCH = datetime(1970, 1, 1)
"""Default time 0 of a scene: the Unix epoch, without a time zone, as usual in Stone Soup."""


def moment(seconds: float, start: datetime) -> datetime:
    """Time of a scan or measurement; datetimes have a resolution of a microsecond."""
    return start + timedelta(seconds=float(seconds))


class SceneDetectionReader(DetectionReader):  # type: ignore[misc]
    """The measurements of a scene, scan after scan, as detections of Stone Soup.

    Each detection has the measurement model of its sensor and metadata: ``sensor`` (its name, or its number if
    it has none), ``measurement`` (1-based number among the sensor's), and ``target`` (id, or -1 for a false
    alarm) if the scene has the truth. Measurements with times of their own keep them as timestamps; sectors are not
    passed on.
    """

    scene: Scene = Property(doc="What to read.")
    ndim_state: int = Property(default=6, doc="Number of state dimensions of the tracker.")
    mapping: Sequence[int] = Property(default=(0, 2, 4), doc="Where the state holds x, y and z.")
    start_time: datetime = Property(default=EPOCH, doc="Time 0 of the scene. Default 1970-01-01.")

    @BufferedGenerator.generator_method  # type: ignore[untyped-decorator]
    def detections_gen(self) -> Iterator[tuple[datetime, OrderedSet[Detection]]]:
        """Yield the time and the detections of each scan, in the scene's order."""
        models = [measurement_model(sensor, self.ndim_state, self.mapping) for sensor in self.scene.sensors]
        names = [sensor.name or s for s, sensor in enumerate(self.scene.sensors)]
        for k in range(self.scene.num_scans):
            scan = self.scene.scan(k)
            time = moment(scan.time, self.start_time)
            stamps = scan.own_times()
            found: OrderedSet[Detection] = OrderedSet()
            for s, (model, name, measured) in enumerate(zip(models, names, scan.measurements, strict=True)):
                # elevation, bearing, range there; range, azimuth, elevation here
                polar = self.scene.sensors[s].components[0] == "range"
                for i, z in enumerate(measured):
                    metadata: dict[str, Any] = {"sensor": name, "measurement": i + 1}
                    if scan.sources is not None:
                        metadata["target"] = int(scan.sources[s][i])
                    vector = StateVector(z[::-1] if polar else z)
                    when = moment(stamps[s][i], self.start_time)
                    found.add(Detection(vector, timestamp=when, measurement_model=model, metadata=metadata))
            yield time, found


class SceneGroundTruthReader(GroundTruthReader):  # type: ignore[misc]
    """The true targets of a scene as ground truth paths of Stone Soup, growing from scan to scan.

    Velocities are differences of positions; the last state of a target keeps the velocity before it. Path ids
    are "target 0", "target 1", ...
    """

    scene: Scene = Property(doc="What to read; it must know its truth.")
    ndim_state: int = Property(default=6, doc="Number of state dimensions of the tracker.")
    mapping: Sequence[int] = Property(default=(0, 2, 4), doc="Where the state holds x, y and z.")
    velocity_mapping: Sequence[int] = Property(
        default=(1, 3, 5), doc="Where the state holds the velocities; an empty sequence leaves them out."
    )
    start_time: datetime = Property(default=EPOCH, doc="Time 0 of the scene. Default 1970-01-01.")

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        if self.scene.truth is None:
            raise InvalidInputError("scene: expected one that knows its truth")

    @BufferedGenerator.generator_method  # type: ignore[untyped-decorator]
    def groundtruth_paths_gen(self) -> Iterator[tuple[datetime, OrderedSet[GroundTruthPath]]]:
        """Yield the time of each scan and the paths of the targets present."""
        paths: dict[int, GroundTruthPath] = {}
        velocities = _velocities(self.scene)
        for k in range(self.scene.num_scans):
            scan = self.scene.scan(k)
            time = moment(scan.time, self.start_time)
            present: OrderedSet[GroundTruthPath] = OrderedSet()
            assert scan.truth_ids is not None and scan.truth_positions is not None
            for target, position in zip(scan.truth_ids.tolist(), scan.truth_positions, strict=True):
                vector = np.zeros(self.ndim_state)
                vector[list(self.mapping)] = position[: len(self.mapping)]
                vector[list(self.velocity_mapping)] = velocities[k, target][: len(self.velocity_mapping)]
                path = paths.setdefault(target, GroundTruthPath(id=f"target {target}"))
                path.append(GroundTruthState(StateVector(vector), timestamp=time, metadata={"target": target}))
                present.add(path)
            yield time, present


def _velocities(scene: Scene) -> dict[tuple[int, int], Array]:
    """Velocity (3,) of each (scan, target): towards its next position; the last one keeps the velocity before it."""
    assert scene.truth is not None
    seen: dict[int, list[tuple[int, Array]]] = {}
    for k, (ids, places) in enumerate(zip(scene.truth.target_ids, scene.truth.positions, strict=True)):
        for target, position in zip(ids.tolist(), places, strict=True):
            seen.setdefault(target, []).append((k, position))
    result: dict[tuple[int, int], Array] = {}
    for target, history in seen.items():
        velocity = np.zeros(3)
        for (k, position), (after, then) in zip(history, history[1:], strict=False):
            elapsed = float(scene.times[after] - scene.times[k])
            velocity = (then - position) / elapsed if elapsed > 0 else velocity
            result[k, target] = velocity
        result[history[-1][0], target] = velocity
    return result
