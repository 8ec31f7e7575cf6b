import numpy as np

from assoc import simulation
from assoc.simulation.observation import velocities_from

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


def test_recorded_tracks_with_range_rate(tmp_path):
    path = tmp_path / "tracks.csv"
    path.write_text(CSV)
    scene = simulation.simulate("from-tracks", 1, file=str(path), interval=5.0, range_rate_noise=1.0)
    assert scene.sensors[0].dim == 4 and scene.sensors[0].field_of_view[3, 1] > 20
