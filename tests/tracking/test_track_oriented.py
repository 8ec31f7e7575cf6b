from functools import cache

import numpy as np
import pytest

from assoc.sensors import PositionSensor
from assoc.simulation.observation import observe
from assoc.tracking import LifeCycle, TrackOrientedMHT
from tests.tracking import plain

SEEDS = (0, 4, 5)


@cache
def best_of(seed):
    times, scans = plain.small_scans(np.random.default_rng(seed))
    return times, scans, max(plain.enumerate_hypotheses(times, scans, plain.sensor()), key=lambda one: one[0])


def tracker(depth=3, **options):
    options = {"initiation": plain.INITIATION, "max_branches": 10_000, "branch_drop": 1e6, **options}
    options = {"life_cycle": LifeCycle(missed_probability=1e-9), **options}
    return plain.tracker_of(TrackOrientedMHT, [plain.sensor()], depth=depth, **options)


@pytest.mark.parametrize("seed", SEEDS)
def test_best_hypothesis_of_the_window_is_that_of_enumeration(seed):
    times, scans, (best, tracks) = best_of(seed)
    own = tracker()
    for time, z in zip(times, scans, strict=True):
        own.step(time, [z])
    assert sum(track.score for track in own.tracks) == pytest.approx(best, abs=1e-6)
    wanted = sorted((s, *m) for s, _, m, _ in tracks)
    for track, (score, *mean) in zip(sorted(own.tracks, key=lambda t: t.score), wanted, strict=True):
        assert track.score == pytest.approx(score, abs=1e-6)
        np.testing.assert_allclose(track.mean, mean, rtol=1e-7, atol=1e-7)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("solver", ["exact", "lagrangian", "aco"])
def test_late_decisions_are_those_of_enumeration(seed, solver):
    times, scans, (_, tracks) = best_of(seed)
    own = tracker(solver=solver)
    final = []
    for time, z in zip(times, scans, strict=True):
        final += own.step(time, [z]).final
    final += own.flush()
    assert [decision.scan for decision in final] == [0, 1, 2]
    parts = set()
    for k in (1, 2):
        # the first scan may also name targets in the making, which the best hypothesis calls false alarms
        for label in set(final[k].assigned[0].tolist()) - {0}:
            parts.add((k, *np.flatnonzero(final[k].assigned[0] == label) + 1))
    assert parts == {(k, t[1][k]) for t in tracks for k in (1, 2) if t[1][k]}


@pytest.mark.parametrize("depth", [1, 2, 3])
def test_targets_side_by_side_keep_their_tracks(depth):
    """Every window holds a formation that one sensor hardly resolves."""
    rng = np.random.default_rng(1)
    view = np.array([[-20_000.0, 20_000.0], [-20_000.0, 20_000.0], [0.0, 10_000.0]])
    sensors = [
        PositionSensor(
            position=np.zeros(3), noise=np.full(3, 80.0), detection_probability=0.9, false_alarm_rate=5.0,
            field_of_view=view,
        )
        for _ in range(3)
    ]  # fmt: skip
    abreast = np.array([[0.0, 300.0 * i, 5_000.0] for i in range(4)])
    ids = [np.arange(4)] * 20
    places = [abreast + [200.0 * 4.0 * k - 8_000.0, 0.0, 0.0] for k in range(20)]
    scene = observe(sensors, 4.0 * np.arange(20), ids, places, rng, region=view)
    own, known = TrackOrientedMHT.for_scene(scene, depth=depth), set()
    for k in range(20):
        own.step(scene.times[k], scene.scan(k).measurements)
        confirmed = [track for track in own.tracks if track.confirmed]
        known |= {track.track_id for track in confirmed}
        assert k < 1 or len(confirmed) == 4
    assert len(known) == 4
