"""What the modified EKF's paper leaves open: debiased Cartesian measurements, missed ones, a radar without elevations.

Equations 2.16 to 2.24 (debiased measurements, which the filter does not use) against samples at 100 km, elevation
30 deg, 30 m and 1.5 deg, in units of the stated standard deviation. The matrices of section 4.1, which depend on the
state, against equations 4.7 to 4.14 and the Jacobian, at starts around table 4.1. Suggestion 5.2, other measurements:
benchmark B1 in the plane with a radar of range and azimuth; and B1 with measurements missed, where a filter only
predicts. Section 2.1, EKF and Kalman filter: the latter takes the positions that measurements point at, converted
plainly with a covariance for each, on B1 and on B1 with a range noise that makes beta 0.05. Full size: a million
samples, 1,000 runs.
"""

import math
from dataclasses import replace
from typing import Any

import numpy as np

from assoc._types import Array
from assoc.filters import (
    ConstantVelocity,
    ExtendedKalmanFilter,
    Gaussian,
    ModifiedEKF,
    UnitRates,
    UnscentedKalmanFilter,
)
from assoc.filters.base import Filter
from assoc.sensors import Radar2D
from experiments.common.claims import Claim
from experiments.common.command import main
from experiments.filters.b1 import Runs, Setting, converted, ratio_interval, run
from experiments.papers.modified_ekf.paper_setting import DT, START

CHOSEN = "chosen by us"
P_D = 0.7


def measured_place(r: Array, theta: Array, phi: Array, v_theta: Array) -> Array:
    """Equations 2.17 and 2.18: Cartesian measurements (n, 3); their third row has the paper's factor cos v_theta."""
    flat = r * np.cos(phi)
    return np.stack([flat * np.cos(theta), flat * np.sin(theta), r * np.sin(phi) * np.cos(v_theta)], axis=1)


def debiased(r: float, theta: float, phi: float, sigmas: Array) -> tuple[Array, Array]:
    """Mean (3,) and covariance (3, 3) of a measurement's error: equations 2.19 to 2.24, C13 = -cos theta sin phi."""
    ct, st, cp, sp = math.cos(theta), math.sin(theta), math.cos(phi), math.sin(phi)
    T = np.array([[ct * cp, -st * cp, -ct * sp, st * sp], [st * cp, ct * cp, -st * sp, -ct * sp], [sp, 0.0, cp, 0.0]])
    s_r, s_t, s_p = sigmas**2
    mean = T[:, 0] * r * math.expm1(-(s_t + s_p) / 2)
    # means of cos^2 and sin^2 of the angles' errors, two times
    cos_t, cos_p, sin_t, sin_p = (1 + math.exp(-2 * s_t), 1 + math.exp(-2 * s_p), -math.expm1(-2 * s_t),
                                  -math.expm1(-2 * s_p))  # fmt: skip
    parts = (r**2 + s_r) / 4 * np.array([cos_t * cos_p, sin_t * cos_p, cos_t * sin_p, sin_t * sin_p])
    parts[0] -= r**2 * math.exp(-(s_t + s_p))
    return mean, T @ np.diag(parts) @ T.T


def about_samples(count: int, rng: np.random.Generator) -> list[Claim]:
    """Compare mean and covariance with those of samples."""
    r, theta, phi, sigmas = 100e3, 0.7, math.radians(30.0), np.array([30.0, math.radians(1.5), math.radians(1.5)])
    v = rng.standard_normal((count, 3)) * sigmas
    truth = measured_place(*np.array([[r], [theta], [phi]]), np.zeros(1))
    off = measured_place(r + v[:, 0], theta + v[:, 1], phi + v[:, 2], v[:, 1]) - truth
    mean, covariance = debiased(r, theta, phi, sigmas)
    L = np.linalg.inv(np.linalg.cholesky(covariance))
    mean_off = float(np.abs(L @ (off.mean(axis=0) - mean)).max())
    spread_off = float(np.abs(L @ np.cov(off.T) @ L.T - np.eye(3)).max())
    return [
        Claim("debiased measurements: largest error of the mean, in standard deviations", "", None, mean_off, None,
              (None, 5.0 / count**0.5), source="equation 2.23; five standard errors, chosen by us"),
        Claim("debiased measurements: largest error of the covariance, relative", "", None, spread_off, None,
              (None, 10.0 / count**0.5), source="equation 2.24; seven standard errors, chosen by us"),
        Claim("debiased measurements: bias of the plain conversion, in standard deviations", "", None,
              float(np.linalg.norm(L @ mean)), source="equation 2.23"),
    ]  # fmt: skip


def matrices(state: Array) -> tuple[Array, Array]:
    """Section 4.1: the matrix of the continuous state space (6, 6), and that of section 4.1.1 for a step of DT."""
    x, y, z = state[:3]
    s = math.hypot(x, y)
    r = math.hypot(s, z)
    rates, step = np.zeros((6, 6)), np.eye(6)
    rates[:2, :2] = [[1 / r - z / s, -1.0], [1.0, 1 / r - z / s]]
    rates[2, 2], rates[5, 2] = 1 / r + s / z, 2 * s / (z * r) - 1.0
    rates[3:5, :3] = [[-2 - 2 * z / (r * s), -2 / r, 2 * y / s], [2 / r, -2 - 2 * z / (r * s), -2 * x / s]]
    step[:2, :3] += DT * np.array([[1 / r, -1.0, -x / s], [1.0, 1 / r, -y / s]])
    step[2, 0], step[2, 2] = DT * s / x, DT / r + 1.0
    step[3:5, :3] = DT * rates[3:5, :3]
    step[5, 0], step[5, 2] = DT * 2 * s / (x * r), -DT
    return rates, step


def about_matrices(rng: np.random.Generator) -> list[Claim]:
    """Compare the products of the matrices of section 4.1 with the model, and the second with its Jacobian."""
    motion = UnitRates(np.eye(6))
    states = START + rng.standard_normal((1000, 6))
    both = [matrices(state) for state in states]
    rates, steps = (np.array(part) for part in zip(*both, strict=True))
    moved, jacobian = motion.propagate(states, DT), motion.jacobian(states, DT)
    flown, turned = (np.einsum("bij,bj->bi", matrix, states) for matrix in (rates, steps))
    # a step changes a state by little: what counts is the change
    least = np.abs(moved - states).max()
    grown, derived = (matrix - np.eye(6) for matrix in (steps, jacobian))
    rounding = (None, 1e-9)
    return [
        Claim("state-space matrices: largest difference of the continuous one's rates, relative", "", None,
              float(np.abs(flown - motion.rates(states)).max() / np.abs(flown).max()), None, rounding,
              source="section 4.1, equations 4.7 to 4.12"),
        Claim("state-space matrices: largest difference of the discrete one's steps, relative", "", None,
              float(np.abs(turned - moved).max() / least), None, rounding, source="section 4.1.1, equation 4.14"),
        Claim("state-space matrices: A of section 4.1.2 less the Jacobian, relative to the Jacobian less 1", "", None,
              float(np.linalg.norm(grown - derived) / np.linalg.norm(derived)), source="sections 4.1.2 and 4.2"),
    ]  # fmt: skip


def follow(filter_: Filter[Any], start: Gaussian, truth: Array, measured: Array, seen: Array, sensor: Any) -> Array:
    """Squared position errors (K / 2, runs) of the second half; `seen` (K, runs) says which runs have a measurement."""
    state, found = filter_.start(start), []
    axes = len(filter_.motion.position)
    for k in range(len(truth)):
        state = filter_.predict(state, 1.0)
        rows = np.flatnonzero(seen[k])
        done = filter_.update(state[rows], measured[k][rows], sensor).state
        mean, covariance = state.mean.copy(), state.covariance.copy()
        mean[rows], covariance[rows] = done.mean, done.covariance
        state = Gaussian(mean, covariance)
        if k >= len(truth) // 2:
            found.append(((mean[:, :axes] - truth[k][:, :axes]) ** 2).sum(axis=1))
    return np.array(found)


def about_filters(count: int, rng: np.random.Generator) -> list[Claim]:
    """B1 with missed measurements, and in the plane with a radar of range and azimuth, missed ones and not."""
    setting = Setting()
    runs, plane = Runs.draw(setting, count, rng), Runs.draw(replace(setting, elevation=0.0), count, rng)
    flat = ConstantVelocity(setting.acceleration_noise, dimensions=2)
    start, axes, columns = plane.start(), [0, 1, 3, 4], (Ellipsis, [0, 1])
    radar = Radar2D(position=np.zeros(3), noise=setting.radar.noise[:2], field_of_view=setting.radar.field_of_view[:2])
    # in the plane the height is 0 throughout
    truth = plane.truth[2:][..., axes]
    places = np.pad(truth[..., :2], ((0, 0), (0, 0), (0, 1)))
    noise = (
        plane.measured[2:][columns]
        - setting.radar.measure(plane.truth[2:].reshape(-1, 6)[:, :3]).reshape(*plane.measured[2:].shape)[columns]
    )
    seen_2d = radar.measure(places.reshape(-1, 3)).reshape(*places.shape[:2], 2) + noise
    flat_start = Gaussian(start.mean[:, axes], start.covariance[np.ix_(range(count), axes, axes)])
    every, some = np.ones(seen_2d.shape[:2], bool), rng.random(seen_2d.shape[:2]) < P_D
    cases = {
        f"B1, P_d {P_D:g}": (setting.motion, runs.start(), runs.truth[2:], runs.measured[2:], some, setting.radar),
        "B1 in the plane, Radar2D": (flat, flat_start, truth, seen_2d, every, radar),
        f"B1 in the plane, Radar2D, P_d {P_D:g}": (flat, flat_start, truth, seen_2d, some, radar),
    }
    claims = []
    for name, (motion, *given) in cases.items():
        full, plain, ukf = (follow(kind(motion), *given) for kind in (ModifiedEKF, ExtendedKalmanFilter,
                                                                     UnscentedKalmanFilter))  # fmt: skip
        for rival, other in (("EKF", plain), ("UKF", ukf)):
            ratio = float(np.sqrt(full.mean() / other.mean()))
            band = (None, 0.8) if rival == "EKF" else (None, 1.06)
            claims.append(Claim(f"{name}: full modified EKF / {rival} (RMSE)", "", None, ratio,
                                ratio_interval(full, other, rng), band, source=CHOSEN))  # fmt: skip
    return claims


def follow_converted(runs: Runs) -> Array:
    """Squared position errors (K / 2, runs) of the second half of a Kalman filter of converted positions."""
    setting, start, found = runs.setting, runs.start(), []
    F, Q = (matrix[0] for matrix in setting.motion.matrices(setting.interval))
    m, P = start.mean, start.covariance
    for k in range(2, len(runs.truth)):
        m, P = m @ F.T, F @ P @ F.T + Q
        place, R = converted(runs.measured[k], setting.radar.covariance)
        K = P[:, :, :3] @ np.linalg.inv(P[:, :3, :3] + R)
        m, P = m + np.einsum("bij,bj->bi", K, place - m[:, :3]), P - K @ P[:, :3]
        if k >= 2 + setting.steps // 2:
            found.append(((m[:, :3] - runs.truth[k][:, :3]) ** 2).sum(axis=1))
    return np.array(found)


def about_kalman(count: int, rng: np.random.Generator) -> list[Claim]:
    """The EKF against a Kalman filter of converted positions."""
    setting, claims = Setting(), []
    fine = replace(setting, range_noise=setting.distance * setting.angle_noise**2 / 0.05)
    for name, one in (("B1", setting), ("B1, beta 0.05", fine)):
        runs = Runs.draw(one, count, rng)
        plain, linear = run(ExtendedKalmanFilter(one.motion), runs).squared, follow_converted(runs)
        claims.append(Claim(f"{name}: EKF / Kalman filter of converted positions (RMSE)", "", None,
                            float(np.sqrt(plain.mean() / linear.mean())), ratio_interval(plain, linear, rng),
                            (None, 1.0), source="section 2.1, cited there"))  # fmt: skip
    return claims


def experiment(quick: bool, rng: np.random.Generator) -> list[Claim]:
    """Judge the debiased measurements and the filter; --quick has fewer samples and runs."""
    claims = about_samples(20_000 if quick else 1_000_000, rng) + about_filters(40 if quick else 1000, rng)
    return claims + about_matrices(rng) + about_kalman(40 if quick else 1000, rng)


if __name__ == "__main__":
    raise SystemExit(main("papers.modified_ekf.beyond", experiment, __doc__))
