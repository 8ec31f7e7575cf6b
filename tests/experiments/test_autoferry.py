"""The Autoferry format, in small files with all its oddities, and the experiment on it."""

import json
import math

import numpy as np

from assoc.sensors import BearingSensor
from experiments.real.ferry_files import read_autoferry


def frame(time, sensor, measurement, own=(10.0, 20.0)):
    return {
        "sensorID": sensor,
        "measurements": [],
        "ownshipPosition": list(own),
        "time": time,
        "measurement": measurement,
    }


FRAMES = [
    frame(105.0, 2, [[100.0, -40.0, 400.0], [0.0, 30.0, 0.0]], (12.0, 22.0)),
    frame(101.0, 1, [7.0, 3.0]),
    frame(102.0, 1, []),
    frame(103.0, 3, -0.5),
    frame(103.5, 3, [0.1, 0.2]),
    frame(104.2, 4, [0.0, math.pi / 2], (11.0, 21.0)),
]
BOATS = [
    [{"targetID": 1, "position": [110.0, 20.0, 0], "time": 1.0}, {"targetID": 2, "position": [0, 50, 0], "time": 1}]
]


def write(folder, frames=FRAMES, boats=BOATS * 6):
    paths = [folder / f"scenario7_{part}.json" for part in ("detections", "groundTruth")]
    for path, content in zip(paths, (frames, boats), strict=True):
        path.write_text(json.dumps(content))
    return paths


def test_frames_become_scans_of_sensors_on_the_ferry(tmp_path):
    scene = read_autoferry(*write(tmp_path))
    assert [sensor.name for sensor in scene.sensors] == ["lidar", "radar", "infrared", "colour"]
    # in order of time, and of a camera one frame a second
    np.testing.assert_allclose(scene.times, [0.0, 1.0, 2.0, 3.2, 4.0])
    looking = [np.flatnonzero(sectors[:, 1] > sectors[:, 0]).tolist() for sectors in scene.sectors]
    assert looking == [[0], [0], [2], [3], [1]]
    lidar, radar, camera = (scene.scan(k).aligned(scene.sensors).measurements for k in (0, 4, 3))
    # x east, y north; beyond the radar's reach nothing is read
    np.testing.assert_allclose(lidar[0], [[23.0, 17.0]])
    np.testing.assert_allclose(radar[1], [[22.0, 112.0], [52.0, -28.0]])
    np.testing.assert_allclose(camera[3], [[math.pi / 2], [0.0]], atol=1e-12)
    standing = scene.at(3.2).sensors[3]
    assert isinstance(standing, BearingSensor)
    np.testing.assert_allclose(standing.position, [21.0, 11.0, 0.0])
    np.testing.assert_allclose(scene.truth.positions[0], [[20.0, 110.0, 0.0], [50.0, 0.0, 0.0]])
