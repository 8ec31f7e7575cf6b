"""Late measurements: the tracks are those of a tracker that got everything in order."""

import numpy as np
import pytest

from assoc import filters
from assoc.errors import AssocWarning, InvalidInputError, LimitExceededError
from assoc.sensors import PositionSensor
from assoc.simulation import simulate
from assoc.tracking import TRACKERS, LatePlots
from tests.sizes import sample
from tests.tracking.stepping import stepped

KINDS = ["multi-sensor", "mht", "nearest-neighbour", "joint-probabilistic"]


@pytest.fixture(scope="module")
def scene():
    return simulate("rotating-radars", 2, aircraft=4, duration=40.0, false_alarms=2.0)


def arrivals(scene, delay):
    """Measurements and their times, by the scan in which they arrive; `delay` gives seconds for each (K, S) block."""
    count = len(scene.sensors)
    found = [([[] for _ in range(count)], [[] for _ in range(count)]) for _ in range(scene.num_scans)]
    for k in range(scene.num_scans):
        for s in range(count):
            for z, t in zip(scene.measurements[k][s], scene.measurement_times[k][s], strict=True):
                at = min(int(np.searchsorted(scene.times, t + delay(k, s))), scene.num_scans - 1)
                found[at][0][s].append(z)
                found[at][1][s].append(t)
    return [
        ([np.reshape(z, (-1, one.dim)) for z, one in zip(rows, scene.sensors, strict=True)], list(map(np.array, times)))
        for rows, times in found
    ]


def states(tracks):
    return {track.track_id: track.mean for track in tracks if track.confirmed}


@sample("kind", KINDS, every=3)
def test_tracks_are_those_of_measurements_in_order(scene, kind):
    rng = np.random.default_rng(0)
    plain, late = TRACKERS[kind].for_scene(scene), LatePlots(TRACKERS[kind].for_scene(scene))
    known = {}
    blocks = rng.uniform(0.0, 25.0, (scene.num_scans, 3)) * (rng.random((scene.num_scans, 3)) < 0.3)
    for k, (z, times) in enumerate(arrivals(scene, lambda k, s: blocks[k, s])):
        scan = scene.scan(k)
        plain.step(scan.time, scan.measurements, scan.times, scan.sectors)
        step = late.step(scan.time, z, times, scan.sectors)
        assert [len(one) for one in step.assigned] == [len(one) for one in z]
        assert step.late == sum(int((t < scan.time - 2.0).sum()) for t in times)
        # an id stays with its target
        for i, mean in states(late.tracks).items():
            assert i not in known or np.linalg.norm(known[i][:2] - mean[:2]) < 1_500.0
            known[i] = mean
    assert late.late > 20 and late.refused == 0
    expected, found = states(plain.tracks), states(late.tracks)
    assert len(found) == len(expected) == 4
    for mean in expected.values():
        assert min(np.abs(mean - other).max() for other in found.values()) < 1e-6
    # a past scan is revised too
    earlier = late.past_tracks(-4)
    assert earlier[0].time == late.scans[-4] == scene.times[-4]
    assert late.time == scene.times[-1]
    assert states(late.tracks).keys() == found.keys()


def test_what_is_too_old_is_refused_and_counted(scene):
    late = LatePlots(TRACKERS["nearest-neighbour"].for_scene(scene), horizon=6.0)
    stepped(late, scene, 0, 10, times=True)
    before = states(late.tracks)
    one = scene.measurements[0][0][:1]
    nothing = [np.zeros((0, 3))] * 2
    step = late.step(21.0, [one, *nothing], [np.array([11.9]), *[np.zeros(0)] * 2], np.zeros((3, 2)))
    assert (step.late, step.refused, late.refused) == (0, 1, 1)
    assert step.assigned[0].tolist() == [0]
    assert states(late.tracks).keys() == before.keys()
    step = late.step(22.0, [one, *nothing], [np.array([20.5]), *[np.zeros(0)] * 2], np.zeros((3, 2)))
    assert (step.late, step.refused, late.refused) == (1, 0, 1)


def test_a_step_that_fails_leaves_all_as_it_was(scene):
    late = LatePlots(TRACKERS["multi-sensor"].for_scene(scene, max_tuples=200))
    stepped(late, scene, 0, 6, times=True)
    before, scans = states(late.tracks), late.scans
    many = np.repeat(scene.measurements[0][0][:1], 300, axis=0)
    nothing = [np.zeros((0, 3))] * 2
    with pytest.raises(LimitExceededError):
        late.step(14.0, [many, *nothing], [np.full(300, 5.0), *[np.zeros(0)] * 2], np.zeros((3, 2)))
    assert late.scans == scans and late.late == 0
    assert {i: m.tolist() for i, m in states(late.tracks).items()} == {i: m.tolist() for i, m in before.items()}
    for times in ([np.full(300, 15.0)], [np.zeros(3)]):
        with pytest.raises(InvalidInputError, match="times"):
            late.step(14.0, [many, *nothing], [*times, *[np.zeros(0)] * 2])
    with pytest.raises(InvalidInputError, match="scan must be a number"):
        late.past_tracks(99)
    with pytest.raises(InvalidInputError, match="tracker must be"):
        LatePlots(None)


@pytest.mark.parametrize("kind", ["mht", "mht-hypothesis"])
def test_what_is_final_is_told_once(scene, kind):
    """The oldest scan that is kept is taken in anew, and with it what it says of scans before."""
    late = LatePlots(TRACKERS[kind].for_scene(scene), horizon=6.0)
    final = [one for step in stepped(late, scene, 0, 9, times=True) for one in step.final]
    one, nothing = scene.measurements[0][0][:1], [np.zeros((0, 3))] * 2
    times = [np.array([late.scans[0]]), *[np.zeros(0)] * 2]
    step = late.step(late.time + 1.0, [one, *nothing], times, np.zeros((3, 2)))
    assert step.late == 1
    final += [*step.final, *late.flush()]
    assert [one.scan for one in final] == list(range(10))


def dense_scans(rng):
    """Twelve scans of three targets and two sensors with forty false alarms each, P_d 0.7."""
    position, velocity = rng.uniform(-1_500.0, 1_500.0, (3, 3)), rng.normal(0.0, 40.0, (3, 3))
    for k in range(12):
        scan = []
        for _ in range(2):
            seen = rng.random(3) < 0.7
            hits = (position + velocity * k)[seen] + rng.normal(0.0, 20.0, (int(seen.sum()), 3))
            scan.append(np.concatenate([hits, rng.uniform(-3e3, 3e3, (rng.poisson(40), 3))]))
        yield scan


@pytest.mark.slow
@sample("seed", [7, 2, 30], every=3)
def test_confirmed_tracks_keep_their_ids_where_tentative_ones_turn_out_to_be_others(seed):
    """A late measurement may let a tentative track begin anew, or not any more: the confirmed one keeps its id."""
    rng, view = np.random.default_rng(seed), ((-3e3, 3e3),) * 3
    sensor = PositionSensor(
        position=(0, 0, 0), noise=(20.0,) * 3, detection_probability=0.7, false_alarm_rate=40.0, field_of_view=view
    )
    motion = filters.KalmanFilter(filters.ConstantVelocity(2.0))
    late = LatePlots(TRACKERS["multi-sensor"]([sensor, sensor], motion, region=np.array(view)), 100.0)
    held = []
    for k, scan in enumerate([*dense_scans(rng)]):
        come = [rng.random(len(z)) < 0.85 for z in scan]
        held.append([z[~mask] for z, mask in zip(scan, come, strict=True)])
        now = [z[mask] for z, mask in zip(scan, come, strict=True)]
        late.step(float(k), now, [np.full(len(z), float(k)) for z in now])
    for k, scan in enumerate(held[:8]):
        before = {track.track_id: track.mean for track in late.tracks if track.confirmed}
        late.step(11.0, scan, [np.full(len(z), k - 1e-6) for z in scan])
        after = {track.track_id: track.mean for track in late.tracks if track.confirmed}
        for i in before.keys() - after.keys():
            near = [np.linalg.norm(before[i][:3] - after[j][:3]) for j in after.keys() - before.keys()]
            assert min(near, default=np.inf) > 60.0


def test_memory_of_past_scans_is_limited(scene):
    """The oldest are forgotten, with one warning, and what would come late to them is refused."""
    plain, late = (LatePlots(TRACKERS["mht"].for_scene(scene), memory=memory) for memory in (1e9, 60e3))
    with pytest.warns(AssocWarning, match="raise memory or lower horizon") as said:
        stepped(late, scene, 0, 12, times=True)
    stepped(plain, scene, 0, 12, times=True)
    assert len(said) == 1 and len(plain.past) == 12 and 0 < len(late.past) < 12
    assert states(late.tracks).keys() == states(plain.tracks).keys()
    assert sum(sum(a.nbytes for a in past.before.tracks.arrays().values()) for past in late.past) <= 60e3
    one, nothing = scene.measurements[0][0][:1], [np.zeros((0, 3))] * 2
    times = [np.array([late.scans[0] - 3.0]), *[np.zeros(0)] * 2]
    steps = [tracker.step(late.time + 1.0, [one, *nothing], times, np.zeros((3, 2))) for tracker in (late, plain)]
    assert [(step.late, step.refused) for step in steps] == [(0, 1), (1, 0)]
