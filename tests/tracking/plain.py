"""Plain readings of the trackers' scores: enumeration with a numpy Kalman filter, nothing shared with them.

Trackers that are compared with them are made by `tracker_of`.
"""

import itertools
import math

import numpy as np

from assoc.filters import ConstantVelocity, KalmanFilter
from assoc.sensors import PositionSensor
from assoc.tracking import Initiation

Q_SIGMA, SPEED, BIRTH = 2.0, 30.0, 0.3
REGION = np.array([[-1000.0, 2000.0], [-1000.0, 2000.0], [-1000.0, 2000.0]])


def sensor(P=0.8, rate=2.0, sigma=10.0, view=REGION):
    return PositionSensor(
        position=np.zeros(3),
        noise=np.full(3, sigma),
        detection_probability=P,
        false_alarm_rate=rate,
        field_of_view=view,
    )


INITIATION = Initiation(speed=SPEED, birth_rate=BIRTH, widest=1.0)


def tracker_of(kind, sensors, **options):
    """A tracker of the motion of `predict` whose gates leave out nothing."""
    motion = ConstantVelocity(Q_SIGMA, kind="continuous")
    return kind(sensors, KalmanFilter(motion), **{"region": REGION, "gate_probability": 1 - 1e-12, **options})


def predict(mean, cov, dt, q=Q_SIGMA):
    one, zero = np.eye(3), np.zeros((3, 3))
    F = np.block([[one, dt * one], [zero, one]])
    Q = q**2 * np.block([[dt**3 / 3 * one, dt**2 / 2 * one], [dt**2 / 2 * one, dt * one]])
    return F @ mean, F @ cov @ F.T + Q


def correct(mean, cov, z, R):
    """Kalman's correction by a position, and the log of its predictive density."""
    H = np.hstack([np.eye(3), np.zeros((3, 3))])
    S = H @ cov @ H.T + R
    v = z - H @ mean
    K = cov @ H.T @ np.linalg.inv(S)
    log = -0.5 * (v @ np.linalg.inv(S) @ v + np.linalg.slogdet(2 * math.pi * S)[1])
    return mean + K @ v, (np.eye(6) - K @ H) @ cov, log


def start(z, R, speed=SPEED):
    cov = np.zeros((6, 6))
    cov[:3, :3], cov[3:, 3:] = R, speed**2 * np.eye(3)
    return np.concatenate([z, np.zeros(3)]), cov


def choices(tracks, count):
    """Every way to give each of `count` measurements to a track (0 ...), to a new target (-1) or to nobody (-2)."""
    for way in itertools.product([*range(tracks), -1, -2], repeat=count):
        used = [w for w in way if w >= 0]
        if len(used) == len(set(used)):
            yield way


def enumerate_hypotheses(times, scans, one):
    """All global hypotheses over scans of one sensor: list of (score, tracks); a track: (score, labels, mean, cov)."""
    density = one.false_alarm_rate / one.volume
    hit, miss = math.log(one.detection_probability / density), math.log(1 - one.detection_probability)
    birth = math.log(one.detection_probability * BIRTH / one.false_alarm_rate)
    hypotheses, before = [(0.0, [])], times[0]
    for k, (time, z) in enumerate(zip(times, scans, strict=True)):
        grown = []
        for score, tracks in hypotheses:
            moved = [(s, labels, *predict(m, c, time - before)) for s, labels, m, c in tracks]
            for way in choices(len(moved), len(z)):
                total, after = score, []
                for i, (s, labels, m, c) in enumerate(moved):
                    if i in way:
                        j = way.index(i)
                        m, c, log = correct(m, c, z[j], one.covariance)
                        gain, label = hit + log, j + 1
                    else:
                        gain, label = miss, 0
                    total += gain
                    after.append((s + gain, (*labels, label), m, c))
                for j, w in enumerate(way):
                    if w == -1:
                        total += birth
                        after.append((birth, (0,) * k + (j + 1,), *start(z[j], one.covariance)))
                grown.append((total, after))
        hypotheses, before = grown, time
    return hypotheses


def small_scans(rng, scans=3, targets=2, extra=1, sigma=10.0):
    """Times and measurements: targets that move near each other, some missed, and false alarms."""
    place, velocity = rng.uniform(400, 460, (targets, 3)), rng.normal(0, SPEED, (targets, 3))
    times, found = [0.0], []
    for k in range(scans):
        if k:
            dt = float(rng.uniform(0.5, 2.0))
            times.append(times[-1] + dt)
            place = place + dt * velocity
        seen = place[rng.random(targets) < 0.85]
        z = np.concatenate([seen + rng.normal(0, sigma, seen.shape), rng.uniform(380, 480, (extra, 3))])
        found.append(rng.permutation(z))
    return times, found


def stacked_log_density(mean, cov, zs, Rs):
    """Log of the density of several positions of one target, all at once."""
    count = len(zs)
    H = np.tile(np.hstack([np.eye(3), np.zeros((3, 3))]), (count, 1))
    R = np.zeros((3 * count, 3 * count))
    for i, one in enumerate(Rs):
        R[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = one
    S = H @ cov @ H.T + R
    v = np.concatenate(zs) - H @ mean
    return -0.5 * (v @ np.linalg.solve(S, v) + np.linalg.slogdet(2 * math.pi * S)[1])


def set_score(zs, present, mean, cov, log_prior=0.0):
    """Score of measurements (sensor -> z) of one target with this prior of its state, misses of the others included."""
    total = log_prior
    for s, one in enumerate(present):
        if s in zs:
            total += math.log(one.detection_probability * one.volume / one.false_alarm_rate)
        else:
            total += math.log(1 - one.detection_probability)
    if zs:
        total += stacked_log_density(mean, cov, list(zs.values()), [present[s].covariance for s in zs])
    return total


def new_target_score(zs, present, volume, birth):
    """Score of measurements as a new target, born anywhere: the position integrated out against birth / volume."""
    order = list(zs)
    first, rest = order[0], order[1:]
    R = present[first].covariance
    cov = np.zeros((6, 6))
    cov[:3, :3] = R
    density = stacked_log_density(np.append(zs[first], np.zeros(3)), cov, [zs[s] for s in rest],
                                  [present[s].covariance for s in rest]) if rest else 0.0  # fmt: skip
    total = math.log(birth / volume) + density
    for s, one in enumerate(present):
        if s in zs:
            total += math.log(one.detection_probability * one.volume / one.false_alarm_rate)
        else:
            total += math.log(1 - one.detection_probability)
    return total


def doubted_score(score, zs, present, mean, cov):
    """`set_score` of a track that is a target with the probability its score says: averaged over both cases."""
    p = 1.0 / (1.0 + math.exp(-score))
    gain = set_score(zs, present, mean, cov)
    return math.log(1.0 - p + p * math.exp(gain))


def best_partition(tracks, scan, present, volume, birth):
    """The largest sum of scores of one scan, by trying all: each measurement to a track, a group or nobody.

    A track is its mean, covariance and score.
    """
    everything = [(s, j) for s, z in enumerate(scan) for j in range(len(z))]

    def score(groups):
        total = 0.0
        for t, (mean, cov, before) in enumerate(tracks):
            total += doubted_score(before, {s: scan[s][j] for s, j in groups.get(t, [])}, present, mean, cov)
        for key, members in groups.items():
            if key >= len(tracks):
                total += new_target_score({s: scan[s][j] for s, j in members}, present, volume, birth)
        return total

    best = (-math.inf, {})

    def place(i, groups, top):
        nonlocal best
        if i == len(everything):
            value = score(groups)
            if value > best[0]:
                best = (value, {key: tuple(sorted(m)) for key, m in groups.items()})
            return
        s, _ = one = everything[i]
        place(i + 1, groups, top)
        for key in [*range(len(tracks)), *range(len(tracks), top + 1)]:
            members = groups.get(key, [])
            if any(other == s for other, _ in members):
                continue
            place(i + 1, {**groups, key: [*members, one]}, max(top, key + 1))

    place(0, {}, len(tracks))
    return best
