"""One target becomes two: one track keeps the id, the other names it as its parent."""

import numpy as np
import pytest

from assoc import filters
from assoc.tracking import TRACKERS, Initiation, LatePlots, TrackTable
from tests.tracking import plain


@pytest.mark.parametrize("kind", TRACKERS.values())
def test_the_new_track_names_its_parent(kind, tmp_path):
    """A second target leaves the first at half time; a third begins far away at that time."""
    rng, sensors = np.random.default_rng(3), [plain.sensor(P=0.9, rate=0.5) for _ in range(3)]
    filter = filters.KalmanFilter(filters.ConstantVelocity(plain.Q_SIGMA, kind="continuous"))
    options = {"region": plain.REGION, "initiation": Initiation(speed=plain.SPEED)}
    tracker, seen, table = kind(sensors, filter, **options), set(), TrackTable()
    for k in range(24):
        path = np.array([[20.0 * k, 500.0, 250.0], [20.0 * k, 500.0 + 9.0 * (k - 10), 250.0], [800.0, 5.0 * k, 0.0]])
        there = path[: 3 if k > 10 else 1]
        found = [there[rng.random(len(there)) < 0.9] for _ in sensors]
        step = tracker.step(float(k), [z + rng.normal(0.0, 10.0, z.shape) for z in found])
        seen |= {track.track_id for track in tracker.tracks if track.reported}
        assert not len(step.merged)
    tracker.save(tmp_path / "tracker.npz")
    again = kind(sensors, filter, **options)
    again.restore(tmp_path / "tracker.npz")
    tracks = [track for track in again.tracks if track.reported]
    table.add(tracks)
    first, second, far = sorted(tracks, key=lambda track: (track.position[2] < 100.0, track.started))
    assert len(seen) == 3 and first.track_id == min(seen)
    assert (first.parent, second.parent, far.parent) == (0, first.track_id, 0)
    assert sorted(table.to_frame()["parent"]) == [0, 0, first.track_id]
    # names that are handed out
    late = LatePlots(kind(sensors, filter, **options))
    late.tracker.state, late.names = again.state, {i: 100 + i for i in seen}
    named = {track.track_id: track.parent for track in late.tracks if track.reported}
    assert named == {100 + track.track_id: 100 * (track.parent > 0) + track.parent for track in tracks}
