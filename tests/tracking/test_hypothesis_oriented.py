import itertools
import math

import numpy as np
import pytest

from assoc.filters import ConstantVelocity, KalmanFilter
from assoc.simulation import simulate
from assoc.tracking import HypothesisOrientedMHT, Initiation, LifeCycle, TrackOrientedMHT
from tests.tracking import plain
from tests.tracking.stepping import stepped


def tracker(**options):
    options = {"max_hypotheses": 5000, "depth": 8, "hypothesis_drop": 1e6, **options}
    options |= {"life_cycle": LifeCycle(missed_probability=1e-12), "initiation": plain.INITIATION}
    return plain.tracker_of(HypothesisOrientedMHT, [plain.sensor()], **options)


def test_equation_2_1():
    one = plain.sensor()
    own = tracker()
    own.step(0.0, [np.array([[500.0, 500, 100]])])
    own.step(1.0, [np.array([[505.0, 500, 100], [520.0, 480, 110]])])
    P_D, P_FA, P_NT = one.detection_probability, one.false_alarm_rate / one.volume, plain.BIRTH / one.volume
    mean, cov = plain.predict(*plain.start(np.array([500.0, 500, 100]), one.covariance), 1.0)
    z = np.array([[505.0, 500, 100], [520.0, 480, 110]])
    p = [math.exp(plain.correct(mean, cov, one_z, one.covariance)[2]) for one_z in z]
    # the first scan: false alarm (N_fa = 1), or new; a new target is detected (the paper's P_NT stands for both)
    new, false = P_D * P_NT, P_FA
    without = [(new + false) ** 2 * false]
    with_track = [(1 - P_D) * (new + false) ** 2 * new, *(P_D * q * (new + false) * new for q in p)]
    wanted = []
    for parent, targets in ((false, 0), (new, 1)):
        for a in (new, false):
            for b in (new, false):
                wanted.append(parent * (1 - P_D) ** targets * a * b)
    for i in range(2):
        wanted += [new * P_D * p[i] * other for other in (new, false)]
    assert sum(wanted) == pytest.approx(sum(without) + sum(with_track))
    wanted = np.sort(wanted)[::-1]
    np.testing.assert_allclose(own.probabilities, wanted / wanted.sum(), rtol=1e-9)


def said_of_the_last_scan(own, rows):
    ids, before = own.state.tracks.track_id[rows], own.state.method_state.window.history[rows, 1]
    return {(track, m) for track, m in zip(ids.tolist(), before.tolist(), strict=True) if m}


def test_n_scan_pruning_leaves_one_story_of_the_oldest_scan():
    times, scans = plain.small_scans(np.random.default_rng(1))
    own = tracker(depth=2, max_hypotheses=50)
    final = []
    for time, z in zip(times, scans, strict=True):
        final += own.step(time, [z]).final
        for one in own.state.method_state.clusters:
            # every hypothesis agrees with the best on the scan before
            said = [said_of_the_last_scan(own, one.branches[held]) for held in one.holds]
            assert all(other == said[0] for other in said)
    assert [decision.scan for decision in final + list(own.flush())] == [0, 1, 2]


def test_the_28_hypotheses_of_reids_example():
    # figures 2.3 to 2.5 of the thesis: two targets, three measurements; the first lies in both gates, the second and
    # third in that of target 2 alone; each may be a false alarm or a new target
    own, many = (
        HypothesisOrientedMHT(
            [plain.sensor()],
            KalmanFilter(ConstantVelocity(plain.Q_SIGMA, kind="continuous")),
            region=plain.REGION,
            life_cycle=LifeCycle(missed_probability=1e-12),
            initiation=Initiation(speed=1.0, birth_rate=5.0, widest=1.0),
            gate_probability=0.99,
            depth=8,
            hypothesis_drop=1e6,
            max_hypotheses=most,
        )
        for most in (1, 1000)
    )
    targets = np.array([[400.0, 500, 100], [430.0, 500, 100]])
    for time in range(4):
        own.step(float(time), [targets])
    assert len(own.tracks) == 2 and len(own.probabilities) == 1
    many.state = own.state
    reach = math.sqrt(2) * plain.sensor().noise[0]
    beyond = targets[1] + [[0, 3.0 * reach, 0], [0, -3.0 * reach, 0]]
    step = many.step(4.0, [np.concatenate([targets.mean(axis=0)[None], beyond])])
    assert len(step.assigned[0]) == 3
    assert len(many.probabilities) == 28
    # 0: false alarm, 1 and 2: the targets, above: a new one; no target twice
    rows = ((a, b, c) for a in (0, 1, 2, 3) for b in (0, 2, 4) for c in (0, 2, 5))
    assert sum(row.count(1) < 2 and row.count(2) < 2 for row in rows) == 28


@pytest.mark.slow
def test_targets_that_are_seldom_detected_are_confirmed_as_by_mht():
    """Of three scans, hardly one detects: what the best hypothesis leaves to false alarms is not decided yet."""
    scans = {HypothesisOrientedMHT: 0, TrackOrientedMHT: 0}
    for kind, seed in itertools.product(scans, range(6)):
        rng, sensor = np.random.default_rng(seed), plain.sensor(P=0.3, rate=100.0)
        own = kind([sensor], KalmanFilter(ConstantVelocity(1.0)), region=plain.REGION, initiation=plain.INITIATION)
        for k in range(60):
            z = rng.uniform(*plain.REGION.T, (rng.poisson(100.0), 3))
            if rng.random() < 0.3:
                z = np.concatenate([z, [[20.0 * k, 500.0, 500.0] + rng.normal(0.0, 10.0, 3)]])
            own.step(float(k), [z])
            if any(track.confirmed for track in own.tracks):
                break
        scans[kind] += k
    assert scans[HypothesisOrientedMHT] <= 1.1 * scans[TrackOrientedMHT] < 6 * 40


def test_a_hundred_aircraft_are_confirmed_within_five_scans():
    scene = simulate("crowd", 3, targets=100, scans=5, interval=4.0, width=40_000.0, height=10_000.0)
    own = HypothesisOrientedMHT.for_scene(scene)
    stepped(own, scene)
    confirmed = np.array([track.position for track in own.tracks if track.confirmed])
    away = np.linalg.norm(confirmed[:, None] - scene.scan(4).truth_positions[None], axis=2)
    assert (away.min(axis=0) < 400).all() and (away.min(axis=1) < 500).all()
