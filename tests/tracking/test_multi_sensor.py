import numpy as np
import pytest

from assoc.costs.tracks.scores import score_terms
from assoc.costs.tracks.tuples import grow_track_tuples
from assoc.filters import ConstantVelocity, Gaussian, KalmanFilter
from assoc.tracking import Initiation, LifeCycle, MultiSensorTracker, StaticFusionTracker
from tests.tracking import plain

SENSORS = [plain.sensor(0.8, 2.0, 10.0), plain.sensor(0.9, 1.0, 15.0)]
VOLUME = float(np.prod(plain.REGION[:, 1] - plain.REGION[:, 0]))


def tracker(kind=MultiSensorTracker, **options):
    options = {
        "life_cycle": LifeCycle(missed_probability=1e-9),
        "initiation": Initiation(speed=plain.SPEED, birth_rate=plain.BIRTH, widest=1.0),
        "gate_probability": 1 - 1e-12,
        **options,
    }
    motion = ConstantVelocity(plain.Q_SIGMA, kind="continuous")
    return kind(SENSORS, KalmanFilter(motion), region=plain.REGION, **options)


def two_scans(seed):
    rng = np.random.default_rng(seed)
    place = rng.uniform(400, 450, (2, 3))
    scans = []
    for k in range(2):
        scan = []
        for one in SENSORS:
            seen = place[rng.random(2) < 0.9] + 20.0 * k
            extra = rng.uniform(380, 470, (int(rng.integers(0, 2)), 3))
            scan.append(rng.permutation(np.concatenate([rng.normal(seen, one.noise[0]), extra])))
        scans.append(scan)
    return scans


def test_tuple_costs_are_stacked_densities_against_clutter():
    rng = np.random.default_rng(0)
    filter_ = KalmanFilter(ConstantVelocity(1.0))
    mean = np.concatenate([rng.uniform(400, 420, (2, 3)), np.zeros((2, 3))], axis=1)
    cov = np.stack([plain.predict(*plain.start(m[:3], 100 * np.eye(3)), 1.0)[1] for m in mean])
    z = [rng.uniform(390, 430, (2, 3)), rng.uniform(390, 430, (3, 3))]
    terms = score_terms(SENSORS)
    misses = np.broadcast_to(terms.miss, (2, 2))
    found = grow_track_tuples(filter_, Gaussian(mean, cov), z, SENSORS, terms, misses, gate_probability=1 - 1e-12)
    listed = {
        (t, *row): cost for t, row, cost in zip(found.track.tolist(), found.rows.tolist(), found.costs, strict=True)
    }
    alone = -plain.set_score({}, SENSORS, mean[0], cov[0])
    for t in range(2):
        for i in range(3):
            for j in range(4):
                zs = {s: z[s][n - 1] for s, n in ((0, i), (1, j)) if n}
                cost = -plain.set_score(zs, SENSORS, mean[t], cov[t])
                assert ((t, i, j) in listed) == (cost < alone or not zs)
                if (t, i, j) in listed:
                    assert listed[t, i, j] == pytest.approx(cost, abs=1e-9)


@pytest.mark.parametrize("seed", (1, 2, 3))
def test_each_scan_is_the_best_of_all_partitions(seed):
    first, second = two_scans(seed)
    own = tracker()
    step = own.step(0.0, first)
    score, groups = plain.best_partition([], first, SENSORS, VOLUME, plain.BIRTH)
    several = {m for m in groups.values() if len(m) > 1}
    assert groups_of(step) >= several
    assert sum(t.score for t in own.tracks if t.track_id in ids_of(step, several)) == pytest.approx(score, abs=1e-5)

    before = own.tracks
    moved = [(*plain.predict(t.mean, t.covariance, 1.0), t.score) for t in before]
    score, groups = plain.best_partition(moved, second, SENSORS, VOLUME, plain.BIRTH)
    step = own.step(1.0, second)
    after = {t.track_id: t for t in own.tracks}
    for i, track in enumerate(before):
        members = groups.get(i, ())
        assert ids_of(step, {members}) == ({track.track_id} if members else set())
        mean, cov, _ = moved[i]
        for s, j in members:
            mean, cov, _ = plain.correct(mean, cov, second[s][j], SENSORS[s].covariance)
        np.testing.assert_allclose(after[track.track_id].mean, mean, rtol=1e-7, atol=1e-6)
    total = 0.0
    for i, track in enumerate(before):
        mean, cov, old = moved[i]
        zs = {s: second[s][j] for s, j in groups.get(i, ())}
        gain = after[track.track_id].score - old
        assert gain == pytest.approx(plain.set_score(zs, SENSORS, mean, cov), abs=1e-6)
        total += plain.doubted_score(old, zs, SENSORS, mean, cov)
    fresh = {m for key, m in groups.items() if key >= len(before)}
    total += sum(after[i].score for i in ids_of(step, fresh))
    assert total == pytest.approx(score, abs=1e-5)


def test_a_track_in_the_making_does_not_take_a_certain_tracks_measurement():
    """A target turns away from its track; what it then leaves, a new track must not claim for its wide velocity."""
    sensors = [plain.sensor(P=0.9, rate=1.0)]
    own = MultiSensorTracker(
        sensors, KalmanFilter(ConstantVelocity(2.0, kind="continuous")), region=plain.REGION,
        initiation=Initiation(speed=plain.SPEED, birth_rate=plain.BIRTH),
    )  # fmt: skip
    own.begin(0.0, Gaussian(np.array([[500.0, 500.0, 250.0, 0.0, 0.0, 0.0]]), np.diag([25.0] * 3 + [4.0] * 3)))
    # nothing near the track, a lone measurement farther off, then one that is nearer to what the newcomer expects
    own.step(1.0, [np.array([[560.0, 500.0, 250.0]])])
    known, new = own.tracks
    step = own.step(2.0, [np.array([[534.0, 500.0, 250.0]])])
    density = [
        plain.set_score({0: np.array([534.0, 500.0, 250.0])}, sensors, *plain.predict(t.mean, t.covariance, 1.0))
        for t in (known, new)
    ]
    assert density[1] > density[0]
    assert step.assigned[0].tolist() == [known.track_id]


def groups_of(step):
    groups = {}
    for s, ids in enumerate(step.assigned):
        for j, i in enumerate(ids.tolist()):
            if i:
                groups.setdefault(i, []).append((s, j))
    return {tuple(m) for m in groups.values()}


def ids_of(step, groups):
    return {int(step.assigned[s][j]) for m in groups for s, j in m}


@pytest.mark.parametrize("seed", range(3))
def test_static_fusion_keeps_its_tuples_together_and_updates_as_the_plain_filter(seed):
    first, second = two_scans(seed)
    own = tracker(StaticFusionTracker)
    own.step(0.0, first)
    before = {t.track_id: t for t in own.tracks}
    step = own.step(1.0, second)
    for track in own.tracks:
        if track.track_id in before:
            mean, cov = plain.predict(before[track.track_id].mean, before[track.track_id].covariance, 1.0)
            score = before[track.track_id].score
            zs = {s: second[s][j] for s, ids in enumerate(step.assigned) for j in np.flatnonzero(ids == track.track_id)}
            score += plain.set_score(zs, SENSORS, mean, cov)
            for s, z in zs.items():
                mean, cov, _ = plain.correct(mean, cov, z, SENSORS[s].covariance)
            np.testing.assert_allclose(track.mean, mean, rtol=1e-7, atol=1e-6)
            assert track.score == pytest.approx(score, abs=1e-6)
