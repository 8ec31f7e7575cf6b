"""Plain readings of the trackers' scores: enumeration with a numpy Kalman filter, nothing shared with them."""

import itertools
import math

import numpy as np

from assoc.sensors import PositionSensor

Q_SIGMA, SPEED, BIRTH = 2.0, 30.0, 0.3
REGION = np.array([[0.0, 1000.0], [0.0, 1000.0], [0.0, 500.0]])


def sensor(P=0.8, rate=2.0, sigma=10.0):
    return PositionSensor(
        position=np.zeros(3),
        noise=np.full(3, sigma),
        detection_probability=P,
        false_alarm_rate=rate,
        field_of_view=REGION,
    )


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
