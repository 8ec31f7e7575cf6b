"""Recordings of several radars as one scene: nothing lost, own times, and sectors that hold the plots."""

import numpy as np
import pytest

from assoc.recordings import Recording, radar_of, scene_of_radars
from assoc.recordings.several import parts_of_radars
from assoc.scene.own_times import looked_at
from assoc.sensors import Radar2D
from assoc.simulation import simulate_recording


@pytest.fixture(scope="module")
def recordings():
    exact = {"range_step": 0.0, "bearing_step": 0.0, "duration": 120.0, "aircraft": 6}
    return [
        simulate_recording("rotating-radar", seed, rotation=turn, **exact).recording
        for seed, turn in ((1, 4.0), (2, 5.5))
    ]


def radars(recordings):
    return [radar_of(one, range_noise=80.0, azimuth_noise=1e-3) for one in recordings]


def test_every_plot_is_in_the_scene_at_its_time_and_in_the_sector(recordings):
    scene = scene_of_radars(recordings, radars(recordings))
    assert np.diff(scene.times) == pytest.approx(2.0, rel=0.01)
    for s, (one, turn) in enumerate(zip(recordings, (4.0, 5.5), strict=True)):
        times = np.concatenate([scan[s] for scan in scene.measurement_times])
        np.testing.assert_array_equal(times, one.times)
        np.testing.assert_array_equal(np.concatenate([scan[s] for scan in scene.measurements]), one.measurements)
        inside = total = 0
        for k in range(scene.num_scans):
            wide = scene.sectors[k, s] + [-0.05, 0.05]
            inside += int(looked_at(wide, scene.measurements[k][s][:, 1]).sum())
            total += len(scene.measurements[k][s])
        assert inside > 0.98 * total
        widths = scene.sectors[5:-5, s, 1] - scene.sectors[5:-5, s, 0]
        np.testing.assert_allclose(widths, 2 * np.pi * 2.0 / turn, rtol=0.01)


def test_a_recording_that_ends_within_a_scan_looked_until_its_last_plot():
    """An antenna that turns in 4 s sees something every tenth of a second; the first radar for 40.5 s."""
    ends = 40.5, 60.0
    seen = [np.linspace(0.0, end, round(10 * end) + 1) for end in ends]
    made = [Recording(t, np.full(len(t), 1e4), np.pi / 2 - 2 * np.pi * t / 4.0) for t in seen]
    scene = scene_of_radars(made, radars(made), rotations=np.array([4.0, 4.0]))
    # the antenna goes clockwise from north
    np.testing.assert_allclose(scene.sectors[20, 0], [np.pi / 4, np.pi / 2], atol=1e-6)
    np.testing.assert_allclose(scene.sectors[20, 1], [-np.pi / 2, np.pi / 2], atol=1e-6)
    assert scene.sectors[21, 0, 0] == scene.sectors[21, 0, 1]


def test_plots_with_and_without_heights_share_the_detections():
    """Of 100 plots of aircraft 80 have a height; 50 false ones have neither height nor code."""
    times = np.arange(150.0)
    codes, heights = np.repeat([1234, 1234, 0], [80, 20, 50]), np.repeat([9000.0, np.nan, np.nan], [80, 20, 50])
    recording = Recording(times, np.full(150, 5e4), np.zeros(150), identities=codes, altitudes=heights)
    radar = Radar2D(
        position=np.zeros(3), noise=[50, 0.002, 30], detection_probability=0.9, false_alarm_rate=2.0, name="north",
        field_of_view=[[0, 1e5], [-np.pi, np.pi], [-1e3, 2e4]],
    )  # fmt: skip
    plain, heard = parts_of_radars([recording], [radar])
    assert [len(plain.recording), len(heard.recording)] == [70, 80] and (plain.radar.dim, heard.radar.dim) == (2, 3)
    assert plain.radar.detection_probability == pytest.approx(0.18)
    assert heard.radar.detection_probability == pytest.approx(0.72)
    assert plain.radar.false_alarm_rate == 2.0 and heard.radar.false_alarm_rate == pytest.approx(0.2)
    (one,) = parts_of_radars([recording.take(np.arange(80))], [radar])
    assert one.radar is radar or one.radar.detection_probability == 0.9
