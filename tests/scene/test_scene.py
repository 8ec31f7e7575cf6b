import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from assoc.errors import InvalidInputError
from assoc.scene import Scene, Truth
from assoc.scene.scene import default_region
from assoc.sensors import BearingSensor, PositionSensor, Radar2D, Radar3D

CIRCLE = [-np.pi, np.pi]


def sensors():
    return [
        Radar3D(name="a", position=[0, 0, 10], noise=[50, 1e-3, 1e-3], field_of_view=[[0, 1e5], CIRCLE, [0, 1.5]]),
        Radar2D(position=[1e4, 0, 0], noise=[[9, 1e-3], [1e-3, 1e-6]], field_of_view=[[0, 5e4], CIRCLE]),
        BearingSensor(position=[0, 1e4, 0], noise=[5e-3], detection_probability=0.7, false_alarm_rate=0.1),
        PositionSensor(position=[0, 0, 0], noise=[5, 5], field_of_view=[[0, 1e4], [0, 1e4]]),
    ]


def make(seed=0, scans=3, truth=True, **changes):
    rng = np.random.default_rng(seed)
    made = sensors()
    measured, ids, places, sources = [], [], [], []
    for _ in range(scans):
        x = rng.uniform(0, 1e4, (rng.integers(0, 4), 3))
        measured.append([s.measure(x) for s in made])
        ids.append(rng.permutation(10)[: len(x)])
        places.append(x)
        sources.append([np.where(rng.random(len(x)) < 0.5, ids[-1], -1) for _ in made])
    arguments = {
        "sensors": made,
        "times": np.arange(scans) * 0.5,
        "measurements": measured,
        "truth": Truth(ids, places, sources) if truth is True else truth or None,
        "name": "täst",
    }
    return Scene(**(arguments | changes))


def assert_same(a, b):
    assert list(a.sensors) == list(b.sensors)
    assert a.name == b.name
    np.testing.assert_array_equal(a.times, b.times)
    np.testing.assert_array_equal(a.region, b.region)
    for k in range(a.num_scans):
        one, other = a.scan(k), b.scan(k)
        for x, y in zip(one.measurements, other.measurements, strict=True):
            np.testing.assert_array_equal(x, y)
        for x, y in [(one.truth_ids, other.truth_ids), (one.truth_positions, other.truth_positions)]:
            np.testing.assert_array_equal(x, y)
        assert (one.sources is None) == (other.sources is None)
        for x, y in zip(one.sources or (), other.sources or (), strict=True):
            np.testing.assert_array_equal(x, y)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 1000), st.integers(1, 5), st.booleans())
def test_files_round_trip(tmp_path_factory, seed, scans, truth):
    path = tmp_path_factory.mktemp("scene") / "s.npz"
    scene = make(seed, scans, truth)
    scene.save(path)
    assert_same(scene, Scene.load(path))
    with np.load(path, allow_pickle=False) as file:
        assert file["format"] == "assoc.scene" and file["version"] == 1


def test_a_scan_is_what_was_put_in():
    scene = make(2)
    scan = scene.scan(1)
    assert scan.index == 1 and scan.time == 0.5
    assert scan.sizes.tolist() == [len(z) for z in scene.measurements[1]] and scan.sizes.dtype == np.int32
    assert len(scan.sources) == 4 and len(scan.truth_ids) == len(scan.truth_positions)
    assert scene.scan(-1).index == 2
    assert make(2, truth=False).scan(0).truth_ids is None
    for k in (3, -4, 1.0, "0"):
        with pytest.raises(InvalidInputError, match="does not exist, the scene has scans 0 to 2"):
            scene.scan(k)


def test_default_region_holds_what_the_sensors_see():
    region = default_region(sensors())
    np.testing.assert_allclose(region, [[-1e5, 1e5], [-1e5, 1e5], [0, 2e4]])
    bearings = [BearingSensor(position=[x, 0, 5], noise=[1e-3]) for x in (0.0, 2e5)]
    np.testing.assert_allclose(default_region(bearings), [[-2e5, 4e5], [-2e5, 2e5], [5, 20_005]])


NAN = float("nan")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"sensors": []}, "sensors: the scene has none"),
        ({"sensors": ["radar"]}, "number 0 is a str"),
        ({"times": [0, 1]}, "measurements: 3 scans, but times has 2"),
        ({"times": [0, 2, 1]}, "must not decrease, scan 2 does"),
        ({"times": []}, "K >= 1"),
        ({"measurements": [[[]] * 3] * 3}, "scan 0: 3 sensors, expected 4"),
        (
            {"measurements": [[[[1, 2]], [], [], []]] * 3},
            r"scan 0, sensor 0 must have shape \(n, 3\), got \(1, 2\)",
        ),
        ({"measurements": [[[], [[1e300, 0]], [], []]] * 3}, "scan 0, sensor 1 must be within"),
        ({"region": [[1, 0], [0, 1], [0, 1]]}, "region must have lower <= upper"),
        ({"region": [[0, 0]] * 3}, "some extent"),
        ({"truth": Truth([[]], [[]])}, "truth has 1 scans, expected 3"),
        ({"truth": Truth([[]] * 3, [[]] * 3, [[[1] * 9] * 4] * 3)}, "sources of scan 0"),
        ({"notes": {"rows": "many"}}, "notes: expected whole numbers, got 'many' for 'rows'"),
    ],
)
def test_bad_scenes_are_refused_in_one_line(changes, words):
    with pytest.raises(InvalidInputError, match=words) as caught:
        make(1, **changes)
    assert "\n" not in str(caught.value)


def test_bad_files_name_path_and_field(tmp_path):
    path = tmp_path / "s.npz"
    make(3).save(path)
    with np.load(path) as file:
        good = dict(file)
    changes = {
        "sensor_kind": (np.array(["sonar"] * 4), "'sonar' for sensor 0, expected one of radar3d"),
        "sensor_dim": (np.array([3, 2, 1, 9]), "'sensor_dim' must hold 1 to 4"),
        "sensor_position": (np.zeros((4, 2)), "'sensor_position' has shape"),
        "sensor_covariance": (-good["sensor_covariance"], "sensor 0: .* positive definite"),
        "measurement_values": (good["measurement_values"] * NAN, "must be finite"),
        "measurement_offsets": (
            good["measurement_offsets"][:, ::-1].copy(),
            "'measurement_offsets' must begin",
        ),
        "truth_ids": (np.zeros(0, int), "'truth_ids' has shape"),
        "times": (np.array([0.0, 1, 2, 3]), "'measurement_offsets' has shape"),
        "version": (np.array(7), "has version 7"),
    }
    for name, (value, words) in changes.items():
        np.savez(path, **(good | {name: value}))
        with pytest.raises(InvalidInputError, match=words) as caught:
            Scene.load(path)
        assert str(caught.value).startswith(str(path)) and "\n" not in str(caught.value), name
    for name in good:
        np.savez(path, **{key: value for key, value in good.items() if key != name})
        if name in ("name", "region", "measurement_sources"):
            Scene.load(path)
        else:
            with pytest.raises(InvalidInputError, match=f"'{name}' is missing|no field 'format'|has shape"):
                Scene.load(path)
    huge = good["measurement_offsets"].copy()
    huge[:, -1] = 2**62
    np.savez(path, **(good | {"measurement_offsets": huge}))
    with pytest.raises(InvalidInputError, match="'measurement_values' has shape"):
        Scene.load(path)


def own_times(scene, seed=1):
    rng = np.random.default_rng(seed)
    scans = zip(scene.times, scene.measurements, strict=True)
    times = [[t - rng.uniform(0, 0.4, len(z)) for z in scan] for t, scan in scans]
    low = rng.uniform(-3, 3, (scene.num_scans, len(scene.sensors)))
    sectors = np.stack([low, low + rng.uniform(0, 2 * np.pi, low.shape)], axis=2)
    return make(measurement_times=times, sectors=sectors)


def test_own_times_and_sectors_survive_a_file_of_version_2(tmp_path):
    scene = own_times(make())
    scene.save(tmp_path / "timed.npz")
    again = Scene.load(tmp_path / "timed.npz")
    assert_same(scene, again)
    for k in range(scene.num_scans):
        for a, b in zip(scene.scan(k).own_times(), again.scan(k).own_times(), strict=True):
            np.testing.assert_array_equal(a, b)
        np.testing.assert_array_equal(scene.scan(k).sectors, again.scan(k).sectors)
        assert not again.scan(k).at_once
    with np.load(tmp_path / "timed.npz") as file:
        assert file["version"] == 2


def test_bad_own_times_are_named(tmp_path):
    good = own_times(make())
    late = [[t + 1.0 for t in scan] for scan in good.measurement_times]
    short = [[t[:-1] for t in scan] for scan in good.measurement_times]
    for changes, words in [
        ({"measurement_times": late}, "measurement_times of scan 0 of sensor 0 must not be after the scan's time"),
        ({"measurement_times": short}, "measurement_times of scan 0 of sensor 0 must have shape"),
        ({"measurement_times": good.measurement_times[:1]}, "measurement_times: 1 scans, but times has 3"),
        ({"measurement_times": [[np.zeros(0)]] * 3}, "must be one array for each of 4 sensors"),
        ({"sectors": np.zeros((3, 4))}, "sectors must have shape"),
        ({"sectors": good.sectors[..., ::-1]}, "sectors of scan 0: that of sensor 0 must be from an azimuth"),
    ]:
        with pytest.raises(InvalidInputError, match=words):
            make(**changes)
    good.save(tmp_path / "good.npz")
    with np.load(tmp_path / "good.npz") as file:
        arrays = dict(file)
    for name, value in [("measurement_times", np.zeros(1)), ("sectors", np.zeros((3, 4, 1)))]:
        np.savez(tmp_path / "bad.npz", **(arrays | {name: value}))
        with pytest.raises(InvalidInputError, match=f"bad.npz: .*{name}"):
            Scene.load(tmp_path / "bad.npz")
