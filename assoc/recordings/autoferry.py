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
from assoc._parameters import positive
from assoc._system.wrong_types import explains_wrong_types
from assoc._types import Array
from assoc.errors import InvalidInputError
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


@explains_wrong_types
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

    Raises
    ------
    InvalidInputError
        A file is not of this form; the message names the file and the frame.
    """
    given = sensors if isinstance(sensors, Mapping) else {name: {} for name in sensors}
    for name in given:
        if name not in SENSORS:
            raise InvalidInputError(f"sensors: unknown name {name!r}; known: {', '.join(SENSORS)}")
    positive(interval, "interval", zero=True)
    frames = [_frame(detections, k, frame) for k, frame in enumerate(_listed(detections))]
    boats = None if truth is None else _listed(truth)
    if boats is not None and len(boats) != len(frames):
        raise InvalidInputError(f"{truth}: has {len(boats)} frames, the detections {len(frames)}")
    if not frames:
        raise InvalidInputError(f"{detections}: holds no frames")
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
            there = [_boat(truth, k, boat) for boat in boats[k]]
            ids.append(np.array([i for i, _ in there], dtype=np.int64))
            places.append(np.array([position for _, position in there]).reshape(-1, 3))
    spots = platform.positions[:, :2]
    reach = max([float(sensor.field_of_view.max()) for sensor in placed if sensor.dim == 2], default=500.0)
    region = np.vstack(
        [np.stack([spots.min(axis=0) - reach, spots.max(axis=0) + reach], axis=1), [[-_HEIGHT, _HEIGHT]]]
    )
    return Scene(
        placed, np.array(times), scans, region, None if boats is None else Truth(ids, places),
        os.path.basename(detections), sectors=np.array(sectors),
    )  # fmt: skip


def _listed(path: Any) -> list[Any]:
    try:
        found = json.loads(read_bytes(path))
    except (ValueError, RecursionError) as error:
        raise InvalidInputError(f"{path}: is not JSON ({error})") from None
    if not isinstance(found, list):
        raise InvalidInputError(f"{path}: expected a list of frames, got {type(found).__name__}")
    return found


def _frame(path: Any, k: int, frame: Any) -> tuple[float, int, Array, Array]:
    """Time, number of the sensor, place of the ferry (3,), and measurements (n, d) of a frame."""
    try:
        time, code = float(frame["time"]), int(frame["sensorID"])
        north, east = (float(x) for x in frame["ownshipPosition"])
        values = np.array([] if frame["measurement"] is None else frame["measurement"], dtype=np.float64)
        if code in (1, 2):
            # rows are north and east; a single detection is a flat pair
            z = values.reshape(2, -1).T[:, ::-1]
        else:
            z = np.mod(1.5 * math.pi - values.reshape(-1, 1), FULL_TURN) - math.pi
        if not (math.isfinite(time) and np.isfinite(z).all() and math.isfinite(north + east)):
            raise ValueError("numbers must be finite")
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        what = "time, sensorID, ownshipPosition (north, east) and measurement"
        raise InvalidInputError(f"{path}: frame {k}: expected {what} ({type(error).__name__}: {error})") from None
    return time, code, np.array([east, north, 0.0]), np.ascontiguousarray(z)


def _boat(path: Any, k: int, boat: Any) -> tuple[int, list[float]]:
    try:
        north, east = (float(x) for x in boat["position"][:2])
        return int(boat["targetID"]), [east, north, 0.0]
    except (KeyError, TypeError, ValueError) as error:
        raise InvalidInputError(
            f"{path}: frame {k}: expected targetID and position ({type(error).__name__}: {error})"
        ) from None


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
