"""Detections as a scene, which all of `assoc` takes, and a scene as detections."""

from scene import SENSORS, make

from assoc.integrations.stonesoup import SceneDetectionReader, scene_from_detections

if __name__ == "__main__":
    stream, paths = make(seed=1)
    scene = scene_from_detections(stream, SENSORS, truth=paths)
    detections = SceneDetectionReader(scene, ndim_state=4, mapping=(0, 2))  # without options: x, vx, y, vy, z, vz
    print(scene.num_scans, "scans,", sum(len(found) for _, found in detections), "detections")
