"""Scenes to Stone Soup and back."""

from datetime import datetime, timedelta

import numpy as np
import pytest

import assoc
from assoc.errors import InvalidInputError
from assoc.simulation import simulate

pytest.importorskip("stonesoup")

from stonesoup.models.measurement.nonlinear import CartesianToBearingRange
from stonesoup.types.array import StateVector
from stonesoup.types.detection import Detection, TrueDetection
from stonesoup.types.groundtruth import GroundTruthPath, GroundTruthState

from assoc.integrations.stonesoup import SceneDetectionReader, SceneGroundTruthReader, adapt, scene_from_detections
from tests.running import printed


def three_radars(scans=8):
    return simulate("three-radar", seed=3, scans=scans)


def adapted(scene):
    from assoc.integrations.stonesoup import measurement_model

    return [
        adapt(
            measurement_model(sensor),
            detection_probability=sensor.detection_probability,
            false_alarm_rate=sensor.false_alarm_rate,
            field_of_view=sensor.field_of_view,
            name=sensor.name,
        )
        for sensor in scene.sensors
    ]


def test_a_scene_survives_the_way_there_and_back():
    scene = three_radars()
    start = datetime(2026, 1, 1)
    reader = SceneDetectionReader(scene, start_time=start)
    back = scene_from_detections(reader, adapted(scene), start=start, region=scene.region)
    np.testing.assert_allclose(back.times, scene.times)
    assert back.measurement_times is None
    assert [type(s) for s in back.sensors] == [type(s) for s in scene.sensors]
    for ours, theirs in zip(scene.measurements, back.measurements, strict=True):
        for one, other in zip(ours, theirs, strict=True):
            # detections are sorted by elevation on the way
            np.testing.assert_allclose(one[np.argsort(one[:, 2])], other, rtol=0, atol=1e-12)
    costs = [[s.cost for s in assoc.associate(one).solutions] for one in (scene, back)]
    np.testing.assert_allclose(costs[0], costs[1])


def test_detections_say_where_they_come_from():
    scene = three_radars(3)
    for k, (time, found) in enumerate(SceneDetectionReader(scene)):
        assert time == datetime(1970, 1, 1) + timedelta(seconds=float(scene.times[k]))
        count = 0
        for s, sensor in enumerate(scene.sensors):
            mine = [d for d in found if d.metadata["sensor"] == sensor.name]
            assert [d.metadata["measurement"] for d in mine] == list(range(1, len(mine) + 1))
            assert [d.metadata["target"] for d in mine] == scene.scan(k).sources[s].tolist()
            count += len(mine)
        assert count == scene.scan(k).sizes.sum() == len(found)


def test_ground_truth_paths():
    scene = three_radars(4)
    for k, (_, paths) in enumerate(SceneGroundTruthReader(scene)):
        states = np.array([np.asarray(p[-1].state_vector, float).ravel() for p in paths])
        np.testing.assert_allclose(states[:, [0, 2, 4]], scene.scan(k).truth_positions)
        assert all(len(path) == k + 1 for path in paths)
    by_id = {path.id: path for path in paths}
    assert set(by_id) == {"target 0", "target 1", "target 2"}
    first, second = (np.asarray(by_id["target 2"][i].state_vector, float).ravel() for i in (0, 1))
    # target 2 of the scenario flies straight at (-600, -250, 300) m/s
    np.testing.assert_allclose(first[[1, 3, 5]], [-600.0, -250.0, 300.0], rtol=1e-9)
    np.testing.assert_allclose(second[[1, 3, 5]], (second - first)[[0, 2, 4]], rtol=1e-9)
    with pytest.raises(InvalidInputError, match="expected one that knows its truth"):
        SceneGroundTruthReader(assoc.Scene(scene.sensors, scene.times, scene.measurements))


def planar_model(x, y):
    return CartesianToBearingRange(
        ndim_state=4,
        mapping=(0, 2),
        noise_covar=np.diag([1e-6, 100.0]),
        translation_offset=StateVector([x, y]),
    )


def test_truth_and_scans_put_together_from_sets_of_one_time():
    models = [planar_model(0.0, 0.0), planar_model(5e3, 0.0)]
    zero = datetime(2026, 1, 1)
    paths = [GroundTruthPath(), GroundTruthPath()]
    stream = []
    for k in range(3):
        time = zero + timedelta(seconds=k)
        for i, path in enumerate(paths):
            if k or i:  # the first path begins a scan later
                path.append(GroundTruthState(StateVector([1e3 + 10 * k, 10, 4e3 - 900 * i, 0]), timestamp=time))
        for model in models:
            found = {
                TrueDetection(model.function(p[-1]), timestamp=time, measurement_model=model, groundtruth_path=p)
                for p in paths
                if len(p)
            }
            found.add(Detection(StateVector([0.3 + k, 700.0]), timestamp=time, measurement_model=model))
            stream.append((time, found))
    scene = scene_from_detections(stream, [adapt(m, max_range=2e4) for m in models], truth=reversed(paths))
    assert scene.num_scans == 3
    assert scene.region[2].tolist() == [0.0, 0.0]
    assert [len(ids) for ids in scene.truth.target_ids] == [1, 2, 2]
    assert scene.scan(1).truth_positions[:, 2].tolist() == [0.0, 0.0]
    for k in range(3):
        scan = scene.scan(k)
        place = dict(zip(scan.truth_ids.tolist(), scan.truth_positions, strict=True))
        for sensor, z, source in zip(scene.sensors, scan.measurements, scan.sources, strict=True):
            assert sorted(source)[0] == -1 and len(source) == len(place) + 1
            for measured, target in zip(z, source, strict=True):
                if target >= 0:
                    np.testing.assert_allclose(sensor.measure(place[target][None])[0], measured)
    result = assoc.associate(scene)
    assert result.totals()["share_correct"] == 1.0


def test_without_stone_soup_the_error_names_the_command():
    code = (
        "import sys; sys.modules['stonesoup'] = None\n"
        "try:\n    import assoc.integrations.stonesoup\n"
        "except ImportError as error: print(error)"
    )
    assert "pip install 'assoc[stonesoup]'" in printed("-W", "error", "-c", code)
