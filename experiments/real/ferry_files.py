"""The Autoferry recordings: lidar, radar and two cameras on a small ferry, and the positions of two boats.

O. K. Helgesen, K. Vasstein, E. F. Brekke, A. Stahl, Heterogeneous multi-sensor tracking for an autonomous surface
vehicle in a littoral environment, Ocean Engineering 252, 2022. A scenario is two JSON files: a list of frames, each of
one sensor, and for each frame the list of boats. Lidar and radar give north and east of each detection relative to the
ferry (two rows, or a flat pair if there is one detection), the cameras azimuths from north (one may be a plain number).
Frames are not in order of time.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping
from typing import Any

import numpy as np

from assoc._files.reading import read_bytes
from assoc._types import Array
from assoc.scene.own_times import FULL_TURN
from assoc.scene.scene import Scene
from assoc.scene.truth import Truth
from assoc.sensors import BearingSensor, Platform, PositionSensor, Sensor

SENSORS: dict[str, tuple[int, dict[str, Any]]] = {
    "lidar": (1, {"noise": [4.0, 4.0], "detection_probability": 0.5, "false_alarm_rate": 0.1, "reach": 120.0}),
    "radar": (2, {"noise": [6.0, 6.0], "detection_probability": 0.9, "false_alarm_rate": 3.0, "reach": 300.0}),
    "infrared": (3, {"noise": [0.06], "detection_probability": 0.3, "false_alarm_rate": 8.0}),
    "colour": (4, {"noise": [0.06], "detection_probability": 0.5, "false_alarm_rate": 15.0}),
}
"""Number of each sensor in the files, and what it is taken for. Noise: a part of a boat's length, metres; of the
cameras three degrees, for their alignment is off by two and stays so. Their false alarms are those in sight of a shore.
Reach: metres; the radar sees farther, but what is more than 300 m away does not matter to a ferry for a minute."""

_HEIGHT = 1.0


def read_autoferry(
    detections: str | os.PathLike[str],
    truth: str | os.PathLike[str] | None = None,
    *,
    sensors: Mapping[str, Mapping[str, Any]] | tuple[str, ...] = tuple(SENSORS),
    interval: float = 1.0,
) -> Scene:
    """Read a scenario as a scene: x east, y north, seconds from the first frame, sensors on the moving ferry.

    A scan is a frame, in which only its sensor measures. Of a ship the lidar has several detections: the tracks of its
    parts are put together by `assoc.tracking.MovingTargets`.

    Parameters
    ----------
    detections, truth : path-like
        ``scenarioN_detections.json`` and ``scenarioN_groundTruth.json``.
    sensors : sequence of str, or mapping of str to mapping
        Which of `SENSORS`; with values, what to change of their parameters. False alarms are as dense at another
        reach, unless told.
    interval : float
        Seconds from one frame of a sensor to its next that is taken: errors and misses of frames in quick succession
        are the same ones over and over, and a tracker takes them for new evidence.

    """
    given = sensors if isinstance(sensors, Mapping) else {name: {} for name in sensors}
    frames = [_frame(frame) for frame in json.loads(read_bytes(detections))]
    boats = None if truth is None else json.loads(read_bytes(truth))
    order = sorted(range(len(frames)), key=lambda k: frames[k][0])
    start, poses = frames[order[0]][0], {frames[k][0]: frames[k][2] for k in order}
    platform = Platform(np.array([*poses]) - start, np.array([*poses.values()]))
    number = {SENSORS[name][0]: s for s, name in enumerate(given)}
    placed = [_sensor(name, changes, platform) for name, changes in given.items()]
    last = np.full(len(placed), -math.inf)
    times, scans, sectors, ids, places = [], [], [], [], []
    for k in order:
        time, code, _, z = frames[k]
        s = number.get(code)
        if s is None or time - last[s] < interval:
            continue
        last[s] = time
        found = z if placed[s].dim == 1 else z[placed[s].in_view(z)]
        times.append(time - start)
        scans.append([found if r == s else np.zeros((0, sensor.dim)) for r, sensor in enumerate(placed)])
        sectors.append([[-math.pi, math.pi if r == s else -math.pi] for r in range(len(placed))])
        if boats is not None:
            ids.append(np.array([boat["targetID"] for boat in boats[k]], dtype=np.int64))
            there = [[boat["position"][1], boat["position"][0], 0.0] for boat in boats[k]]
            places.append(np.array(there).reshape(-1, 3))
    spots = platform.positions[:, :2]
    reach = max([float(sensor.field_of_view.max()) for sensor in placed if sensor.dim == 2], default=500.0)
    region = np.vstack(
        [np.stack([spots.min(axis=0) - reach, spots.max(axis=0) + reach], axis=1), [[-_HEIGHT, _HEIGHT]]]
    )
    return Scene(
        placed, np.array(times), scans, region, None if boats is None else Truth(ids, places),
        os.path.basename(detections), sectors=np.array(sectors),
    )  # fmt: skip


def _frame(frame: Mapping[str, Any]) -> tuple[float, int, Array, Array]:
    """Time, number of the sensor, place of the ferry (3,), and measurements (n, d) of a frame."""
    north, east = frame["ownshipPosition"]
    values = np.array([] if frame["measurement"] is None else frame["measurement"], dtype=np.float64)
    if frame["sensorID"] in (1, 2):
        # rows are north and east; a single detection is a flat pair
        z = values.reshape(2, -1).T[:, ::-1]
    else:
        z = np.mod(1.5 * math.pi - values.reshape(-1, 1), FULL_TURN) - math.pi
    return float(frame["time"]), int(frame["sensorID"]), np.array([east, north, 0.0]), np.ascontiguousarray(z)


def _sensor(name: str, changes: Mapping[str, Any], platform: Platform) -> Sensor:
    usual = SENSORS[name][1]
    parameters = {**usual, **changes}
    reach = parameters.pop("reach", None)
    if reach is None:
        return BearingSensor(name=name, position=np.zeros(3), platform=platform, **parameters)
    if "false_alarm_rate" not in changes:
        parameters["false_alarm_rate"] *= (reach / usual["reach"]) ** 2
    view = np.array([[-reach, reach], [-reach, reach]])
    return PositionSensor(name=name, position=np.zeros(3), field_of_view=view, platform=platform, **parameters)
