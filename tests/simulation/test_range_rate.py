import numpy as np
import pytest

from assoc import simulation
from assoc.errors import InvalidInputError
from assoc.sensors import Radar3D
from assoc.simulation.observation import observe, velocities_from

CSV = "id,time,lat,lon,altitude\n" + "".join(
    f"a,{t},{50 + t * 1e-3},{8 + t * 1e-3},3000\nb,{t},{50.1 - t * 1e-3},{8.1},4000\n" for t in range(0, 60, 5)
)


def test_velocities_from_positions():
    times = np.array([0.0, 1.0, 3.0, 4.0])
    ids = [np.array([5, 2]), np.array([2]), np.array([2, 7]), np.array([7, 2])]
    path = lambda t: np.array([10.0 * t, -3.0 * t, t * t])  # noqa: E731
    places = [np.array([[1.0, 1, 1], path(0)]), path(1)[None], np.array([path(3), [4.0, 4, 4]]),
              np.array([[6.0, 3, 4], path(4)])]  # fmt: skip
    found = velocities_from(times, ids, places)
    np.testing.assert_allclose(found[0], [[0, 0, 0], [10, -3, 1]])
    np.testing.assert_allclose(found[1], [[10, -3, 3]])
    np.testing.assert_allclose(found[2], [[10, -3, 5], [2, -1, 0]])
    np.testing.assert_allclose(found[3], [[2, -1, 0], [10, -3, 7]])
    assert [one.shape for one in velocities_from(times, [[]] * 4, [[]] * 4)] == [(0, 3)] * 4


def test_velocities_are_not_taken_across_an_absence():
    there, gone = [np.array([[0.0, 0, 0]]), np.array([[100.0, 0, 0]])], [np.zeros((0, 3))] * 8
    found = velocities_from(np.arange(12.0), [[7], [7], *[[]] * 8, [7], [7]], [*there, *gone, *there])
    np.testing.assert_allclose(np.concatenate(found), [[100.0, 0, 0]] * 4)
    # one that is there for a single scan each time flies from one to the next
    alone = velocities_from(np.arange(3.0), [[7], [], [7]], [there[0], gone[0], there[1]])
    np.testing.assert_allclose(np.concatenate(alone), [[50.0, 0, 0]] * 2)


@pytest.mark.parametrize("name", ["three-radar", "crowd", "dubins-uav"])
def test_scenarios_with_range_rate(name):
    options = {"sensor": "radar", "targets": 20, "scans": 5} if name == "crowd" else {}
    scene = simulation.simulate(name, 3, range_rate_noise=0.5, **options)
    assert all(isinstance(sensor, Radar3D) and sensor.dim == 4 for sensor in scene.sensors)
    ids = [scene.scan(k).truth_ids for k in range(scene.num_scans)]
    places = [scene.scan(k).truth_positions for k in range(scene.num_scans)]
    velocities = velocities_from(scene.times, ids, places)
    off = []
    for k in range(1, scene.num_scans - 1):
        scan = scene.scan(k)
        for sensor, z, source in zip(scene.sensors, scan.measurements, scan.sources, strict=True):
            assert sensor.in_view(z[source < 0]).all()
            row = {int(i): n for n, i in enumerate(ids[k])}
            for measured, target in zip(z[source >= 0], source[source >= 0], strict=True):
                n = row[int(target)]
                exact = sensor.measure(places[k][n : n + 1], velocities[k][n : n + 1])[0]
                off.append(measured[3] - exact[3])
    # differences of positions are not quite the trajectories' velocities where a target turns
    assert np.median(np.abs(off)) < 0.6 and len(off) > 50


def test_off_is_as_it_was():
    with_option, without = (simulation.simulate("three-radar", 2, **kw) for kw in ({"range_rate_noise": 0.0}, {}))
    for one, other in zip(with_option.measurements, without.measurements, strict=True):
        assert all(np.array_equal(a, b) for a, b in zip(one, other, strict=True))


def test_recorded_tracks_with_range_rate(tmp_path):
    path = tmp_path / "tracks.csv"
    path.write_text(CSV)
    scene = simulation.simulate("from-tracks", 1, file=str(path), interval=5.0, range_rate_noise=1.0)
    assert scene.sensors[0].dim == 4 and scene.sensors[0].field_of_view[3, 1] > 20


def test_what_is_refused():
    with pytest.raises(InvalidInputError, match="range_rate_noise: expected a number, at least 0"):
        simulation.simulate("three-radar", 1, range_rate_noise=-1.0)
    with pytest.raises(InvalidInputError, match="range_rate_noise: only radars measure range rate"):
        simulation.simulate("crowd", 1, range_rate_noise=1.0)


def test_given_velocities_are_taken():
    radar = Radar3D(
        position=np.zeros(3), noise=[1e-3, 1e-9, 1e-9, 1e-6], detection_probability=1 - 1e-12, false_alarm_rate=1e-9,
        field_of_view=[[0, 1e5], [-4, 2], [-1, 1], [-100, 100]],
    )  # fmt: skip
    places, speeds = [np.array([[1e3, 0.0, 0.0]])], [np.array([[7.0, 3.0, 0.0]])]
    rng = np.random.default_rng(0)
    scene = observe([radar], [0.0], [np.array([0])], places, rng, velocities=speeds)
    assert scene.measurements[0][0][0, 3] == pytest.approx(7.0, abs=1e-4)
