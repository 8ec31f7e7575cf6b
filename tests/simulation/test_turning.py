"""Turning radars: when they look, what they see, and what they say they looked at."""

import math

import numpy as np
import pytest

from assoc.scene.own_times import looked_at
from assoc.simulation import simulate

TURNS = (4.0, 5.0, 5.5)


@pytest.fixture(scope="module")
def scene():
    return simulate("rotating-radars", 3, aircraft=8, duration=300.0, interval=2.0, false_alarms=20.0)


def plots(scene, s):
    """Times, measurements and sources of one radar."""
    times = np.concatenate([scan[s] for scan in scene.measurement_times])
    return (
        times,
        np.concatenate([scan[s] for scan in scene.measurements]),
        np.concatenate([scan[s] for scan in scene.truth.sources]),
    )


@pytest.mark.parametrize("s", range(3))
def test_a_target_is_seen_once_a_turn_where_it_is(scene, s):
    times, z, sources = plots(scene, s)
    hits = looks = 0
    for target in range(8):
        own = times[sources == target]
        turns = np.diff(own) / TURNS[s]
        # the target moves on while the antenna turns; missed looks leave gaps of whole turns
        off = np.abs(turns - np.round(turns))
        assert np.quantile(off, 0.9) < 0.05 and off.max() < 0.2 and turns.min() > 0.8
        hits, looks = hits + len(own), looks + 300.0 / TURNS[s]
    assert abs(hits / looks - 0.9) < 4 * math.sqrt(0.09 / looks)
    # the measurement is of the target at that time, not at the end of the scan
    sensor = scene.sensors[s]
    ids = np.stack(list(scene.truth.positions))
    for target in range(8):
        mine = (sources == target) & (times > 2.0)
        track = np.stack([np.interp(times[mine], scene.times, ids[:, target, axis]) for axis in range(3)], axis=1)
        off = (z[mine] - sensor.measure(track)) / sensor.noise
        off[:, 1] = np.mod(off[:, 1] * sensor.noise[1] + np.pi, 2 * np.pi) - np.pi
        off[:, 1] /= sensor.noise[1]
        assert 0.8 < off.std() < 1.3


@pytest.mark.parametrize("s", range(3))
def test_everything_is_measured_in_the_sector_that_was_looked_at(scene, s):
    for k in range(scene.num_scans):
        scan = scene.scan(k)
        width = scan.sectors[s, 1] - scan.sectors[s, 0]
        assert width == pytest.approx(2 * math.pi * 2.0 / TURNS[s])
        false = scan.sources[s] < 0
        assert looked_at(scan.sectors[s], scan.measurements[s][false, 1]).all()
        # noise may carry the azimuth of a target past the edge
        wide = scan.sectors[s] + [-0.01, 0.01]
        assert looked_at(wide, scan.measurements[s][:, 1]).all()
        assert (scan.times[s] > scan.time - 2.0).all() and (scan.times[s] <= scan.time).all()


@pytest.mark.parametrize("s", range(3))
def test_false_alarms_are_as_many_a_turn_as_the_sensor_says(scene, s):
    times, z, sources = plots(scene, s)
    count = 20.0 * 300.0 / TURNS[s]
    assert abs((sources < 0).sum() - count) < 4 * math.sqrt(count)
    assert scene.sensors[s].in_view(z[sources < 0]).all()
