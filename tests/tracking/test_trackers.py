"""What must be true of every tracker."""

from functools import cache

import numpy as np
import pytest

from assoc import InvalidInputError, filters, simulation
from assoc.sensors import PositionSensor
from assoc.tracking import (
    TRACKERS,
    LifeCycle,
    MultiSensorTracker,
    NearestNeighbourTracker,
    StaticFusionTracker,
    TrackOrientedMHT,
)
from tests.sizes import sample
from tests.tracking.stepping import stepped

KINDS = list(TRACKERS.values())


@cache
def scene(scans=8, seed=1):
    return simulation.simulate("three-radar", seed, scans=scans)


@pytest.mark.parametrize("kind", KINDS)
def test_targets_are_found_and_decisions_are_complete(kind):
    one = scene()
    tracker = kind.for_scene(one)
    steps = stepped(tracker, one)
    last = one.scan(one.num_scans - 1)
    confirmed = np.array([t.position for t in tracker.tracks if t.confirmed])
    away = np.linalg.norm(confirmed[:, None] - last.truth_positions[None], axis=2)
    assert (away.min(axis=0) < 250).all() and (away.min(axis=1) < 250).all()
    final = [d for step in steps for d in step.final]
    final += tracker.flush()
    assert [d.scan for d in final] == list(range(one.num_scans))
    right = total = 0
    majority = {}
    for decision in final:
        scan = one.scan(decision.scan)
        for z, ids, flags, sources in zip(
            scan.measurements, decision.assigned, decision.confirmed, scan.sources, strict=True
        ):
            assert ids.shape == flags.shape == (len(z),)
            assert not flags[ids == 0].any()
            for i, source in zip(ids[flags].tolist(), sources[flags].tolist(), strict=True):
                majority.setdefault(i, []).append(source)
    for sources in majority.values():
        right += max(sources.count(s) for s in set(sources))
        total += len(sources)
    assert right >= 0.97 * total


@sample("kind", KINDS, every=2)
def test_the_order_of_the_measurements_does_not_matter(kind):
    one, rng = scene(), np.random.default_rng(5)
    plain, shuffled = kind.for_scene(one), kind.for_scene(one)
    for k in range(one.num_scans):
        scan = one.scan(k)
        orders = [rng.permutation(len(z)) for z in scan.measurements]
        step = plain.step(scan.time, scan.measurements)
        other = shuffled.step(scan.time, [z[order] for z, order in zip(scan.measurements, orders, strict=True)])
        for s, order in enumerate(orders):
            assert np.array_equal(step.assigned[s][order], other.assigned[s])
    assert [t.track_id for t in plain.tracks] == [t.track_id for t in shuffled.tracks]
    for a, b in zip(plain.tracks, shuffled.tracks, strict=True):
        np.testing.assert_allclose(a.mean, b.mean, rtol=1e-9)


@sample("kind", KINDS, every=3)
def test_the_order_of_the_sensors_matters_little(kind):
    """Filters linearise at one sensor after the other: positions move by far less than they are uncertain."""
    one = scene()
    positions = []
    for order in ([0, 1, 2], [2, 1, 0], [1, 2, 0]):
        tracker = kind([one.sensors[s] for s in order], TrackOrientedMHT.for_scene(one).filter, region=one.region)
        for k in range(one.num_scans):
            tracker.step(one.scan(k).time, [one.scan(k).measurements[s] for s in order])
        found = [t for t in tracker.tracks if t.confirmed]
        positions.append(np.array(sorted(t.position.tolist() for t in found)))
    sigma = np.sqrt(max(t.covariance[:3, :3].trace() for t in found))
    for other in positions[1:]:
        np.testing.assert_allclose(positions[0], other, atol=0.1 * sigma)


@pytest.mark.parametrize("kind", KINDS)
def test_scans_without_measurements_and_time_standing_still(kind):
    one = scene()
    empty = [np.zeros((0, 3))] * 3
    tracker = kind.for_scene(one)
    assert tracker.tracks == [] and tracker.time is None
    tracker.step(0.0, empty)
    stepped(tracker, one)
    before = len([t for t in tracker.tracks if t.confirmed])
    tracker.step(one.times[-1], empty)
    assert len([t for t in tracker.tracks if t.confirmed]) == before > 0
    ended = [i for k in range(12) for i in tracker.step(one.times[-1] + 1.0 + k, empty).ended.tolist()]
    assert not tracker.tracks and len(ended) == before


@pytest.mark.parametrize("kind", KINDS)
def test_known_targets_are_taken_over(kind):
    one = scene()
    first, last = one.scan(0), one.scan(one.num_scans - 1)
    velocity = (one.scan(1).truth_positions - first.truth_positions) / (one.times[1] - one.times[0])
    mean = np.concatenate([first.truth_positions, velocity], axis=1)
    tracker = kind.for_scene(one)
    ids = tracker.begin(first.time, filters.Gaussian(mean, np.diag([1e3] * 3 + [1e2] * 3)))
    assert ids.tolist() == [1, 2, 3] and all(track.confirmed for track in tracker.tracks)
    stepped(tracker, one, 1)
    places = {track.track_id: track.position for track in tracker.tracks if track.confirmed}
    assert set(places) == {1, 2, 3}
    for target, i in zip(last.truth_ids, ids, strict=True):
        assert np.linalg.norm(places[int(i)] - last.truth_positions[target]) < 250
    with pytest.raises(InvalidInputError, match="begun already"):
        tracker.begin(0.0, filters.Gaussian(mean, np.eye(6)))


def some_filters():
    cv = filters.ConstantVelocity(20.0, kind="continuous")
    turn = filters.CoordinatedTurn(20.0, 0.05)
    padded = filters.ExtendedKalmanFilter(filters.Padded(cv, 0.1))
    yield "modified", filters.ModifiedEKF(cv)
    yield "unscented", filters.UnscentedKalmanFilter(turn)
    yield "ensemble", filters.EnsembleKalmanFilter(cv, 200, 1)
    yield "acceleration", filters.ExtendedKalmanFilter(filters.ConstantAcceleration(5.0))
    yield (
        "imm",
        filters.InteractingMultipleModel([padded, filters.ExtendedKalmanFilter(turn)], [[0.95, 0.05], [0.1, 0.9]]),
    )
    yield "fuzzy", filters.FuzzyAdaptiveEKF.from_data(filters.CoordinatedTurn(20.0, 0.05), filters.tuned_data())


@pytest.mark.parametrize(("name", "filter_"), list(some_filters()))
@pytest.mark.parametrize("kind", [MultiSensorTracker, TrackOrientedMHT])
def test_any_filter(kind, name, filter_, tmp_path):
    one = scene(6)
    tracker = kind.for_scene(one, filter_)
    stepped(tracker, one, 0, 5)
    tracker.save(tmp_path / "state.npz")
    stepped(tracker, one, 5)
    confirmed = np.array([t.position for t in tracker.tracks if t.confirmed])
    away = np.linalg.norm(confirmed[:, None] - one.scan(5).truth_positions[None], axis=2)
    assert away.min(axis=0).max() < 400
    ends = [t.mean for t in tracker.tracks]
    again = kind.for_scene(one, filter_)
    again.restore(tmp_path / "state.npz")
    stepped(again, one, 5)
    assert all(np.array_equal(a, t.mean) for a, t in zip(ends, again.tracks, strict=True))


def test_planar_states():
    view = [[-2e4, 2e4], [-2e4, 2e4]]
    sensor = PositionSensor(
        position=np.zeros(3), noise=[30.0, 30.0], detection_probability=0.9, false_alarm_rate=0.5, field_of_view=view
    )
    motion = filters.ConstantVelocity(2.0, dimensions=2, kind="continuous")
    for kind in KINDS:
        tracker = kind([sensor], filters.KalmanFilter(motion))
        for k in range(6):
            tracker.step(10.0 * k, [np.array([[1000.0 * k, 500.0]])])
        (track,) = [t for t in tracker.tracks if t.confirmed]
        assert track.mean.shape == (4,) and track.position[2] == 0
        np.testing.assert_allclose(track.velocity, [100, 0, 0], atol=2)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: MultiSensorTracker.for_scene(scene(), solver="acoo"), "unknown name 'acoo'; did you mean aco"),
        (lambda: MultiSensorTracker.for_scene(scene(), "ekf"), "filter must be a filter"),
        (
            lambda: MultiSensorTracker.for_scene(scene(), life_cycle={"m": 3}),
            "life_cycle must be a LifeCycle, got dict",
        ),
        (lambda: MultiSensorTracker.for_scene(scene(), time_limit=-1.0), "time_limit: expected seconds > 0, got -1.0"),
        (lambda: MultiSensorTracker.for_scene(scene(), max_tuples=1e6), "max_tuples must be a whole number above 0"),
        (lambda: LifeCycle(confirmation="x"), "confirmation must be 'score' or 'm-of-n'"),
        (lambda: LifeCycle(m=5, n=4), "m <= n"),
        (lambda: LifeCycle(deletion_time=-1.0), "deletion_time must be a number above 0"),
    ],
)
def test_bad_settings_are_refused_at_once(make, message):
    with pytest.raises(InvalidInputError, match=message):
        make()


def test_a_state_saved_under_other_settings_is_refused(tmp_path):
    MultiSensorTracker.for_scene(scene()).save(tmp_path / "state.npz")
    other = MultiSensorTracker.for_scene(scene(), gate_probability=0.99)
    with pytest.raises(InvalidInputError, match=r"other settings: gate_probability was '0\.999', is '0\.99'"):
        other.restore(tmp_path / "state.npz")


def test_m_of_n_and_deletion_by_count():
    view = [[-2e4, 2e4], [-2e4, 2e4]]
    sensor = PositionSensor(position=np.zeros(3), noise=[30.0, 30.0], field_of_view=view)
    seen = [1, 0, 1, 1, 0, 0, 1, 0, 0, 0, 0]
    cycle = LifeCycle(confirmation="m-of-n", m=3, n=4, deletion="count", deletion_count=3, missed_probability=1e-9)
    motion = filters.ConstantVelocity(2.0, dimensions=2, kind="continuous")
    # multiple hypothesis trackers show only what their best hypothesis holds
    for kind in (MultiSensorTracker, StaticFusionTracker, NearestNeighbourTracker):
        tracker = kind([sensor], filters.KalmanFilter(motion), life_cycle=cycle)
        story = []
        for k, there in enumerate(seen):
            tracker.step(10.0 * k, [np.array([[10.0 * k, 500.0]] * there).reshape(-1, 2)])
            story.append({t.track_id: t.confirmed for t in tracker.tracks}.get(1))
        assert story[3:9] == [True] * 6
        assert not any(story[:3])
        assert story[9] is None
