"""Consistency: NEES and NIS of every filter on a linear case and on B1, with their chi-square bounds.

300 runs of 100 steps. NEES is averaged over the runs at the last step, because NEES of one run is correlated in time.
NIS is not for an exact filter, so it is averaged over the second half of the steps, too. The bounds are those of means
of as many independent values (99.9 %). On the linear case the exact filters must lie inside; on B1 no filter is exact,
and the table says by how much. Ensembles have 100 or 1,000 members.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from assoc._types import Array
from assoc.filters import ConstantVelocity, ExtendedKalmanFilter, Gaussian, ModifiedEKF, bounds, nees
from assoc.filters.base import Filter
from assoc.sensors import PositionSensor, Sensor
from experiments.common.claims import Claim
from experiments.common.command import main, mean_interval
from experiments.filters.b1 import Runs, Setting
from experiments.filters.kinds import of_each_kind

STEPS = 100
NOISE = 1.0


@dataclass(frozen=True)
class Case:
    """Truth (K, runs, 6), measurements (K, runs, 3), the start and the sensor."""

    truth: Array
    measured: Array
    start: Gaussian
    sensor: Sensor


def linear_case(count: int, rng: np.random.Generator, steps: int = STEPS) -> Case:
    """Nearly constant velocity, positions measured, the start drawn from the prior: all assumptions hold."""
    F, Q = (matrix[0] for matrix in ConstantVelocity(NOISE).matrices(1.0))
    P = np.diag([1e4, 1e4, 1e4, 100.0, 100.0, 100.0])
    mean = np.tile(np.array([5e3, 4e3, 1e3, -50.0, 20.0, 0.0]), (count, 1))
    states = [mean + rng.standard_normal((count, 6)) @ np.sqrt(P)]
    root = np.kron(np.array([[0.5, 0.0], [1.0, 0.0]]), np.eye(3)) * NOISE
    for _ in range(steps):
        states.append(states[-1] @ F.T + rng.standard_normal((count, 6)) @ root.T)
    assert np.allclose(root @ root.T, Q)
    sensor = PositionSensor(position=np.zeros(3), noise=np.full(3, 50.0), field_of_view=np.array([[-1e6, 1e6]] * 3))
    truth = np.stack(states)
    measured = truth[..., :3] + 50.0 * rng.standard_normal((*truth.shape[:2], 3))
    return Case(truth[1:], measured[1:], Gaussian(mean, P), sensor)


def b1_case(count: int, rng: np.random.Generator) -> Case:
    """Benchmark B1, two-point start."""
    runs = Runs.draw(Setting(), count, rng)
    return Case(runs.truth[2:], runs.measured[2:], runs.start(), runs.setting.radar)


def pad(start: Gaussian) -> Gaussian:
    """Add a turn rate of 0 +- 0.02 rad/s to a start."""
    B = len(start)
    P = np.zeros((B, 7, 7))
    P[:, :6, :6], P[:, 6, 6] = start.covariance, 0.02**2
    return Gaussian(np.concatenate([start.mean, np.zeros((B, 1))], axis=1), P)


def run(filter_: Filter[Any], case: Case) -> tuple[Array, Array]:
    """NEES and NIS over the second half, (K/2, runs) each; of position and velocity."""
    start = case.start if filter_.motion.dim == 6 else pad(case.start)
    state = filter_.start(start)
    all_nees, all_nis = [], []
    for k in range(len(case.truth)):
        state = filter_.predict(state, 1.0)
        done = filter_.update(state, case.measured[k], case.sensor)
        state = done.state
        if k >= len(case.truth) // 2:
            own = Gaussian(state.mean[:, :6], state.covariance[:, :6, :6])
            all_nees.append(nees(own, case.truth[k]))
            all_nis.append(done.nis)
    return np.array(all_nees), np.array(all_nis)


def filters(noise: float, radar: bool, rng: np.random.Generator) -> dict[str, Filter[Any]]:
    """Return every filter that can take the case."""
    inner = ModifiedEKF if radar else ExtendedKalmanFilter
    kinds = of_each_kind(noise, (100, 1000), rng, inner)
    others = ("Kalman",) if radar else ("modified EKF, simplified", "modified EKF")
    return {name: kind for name, kind in kinds.items() if name not in others}


EXACT = ("Kalman", "EKF", "UKF")


def experiment(quick: bool, rng: np.random.Generator) -> list[Claim]:
    """Measure NEES and NIS of all filters on both cases."""
    count = 30 if quick else 300
    claims: list[Claim] = []
    for label, case, noise in (
        ("linear", linear_case(count, rng), NOISE),
        ("B1", b1_case(count, rng), Setting().acceleration_noise),
    ):
        for name, filter_ in filters(noise, label == "B1", rng).items():
            result = run(filter_, case)
            for what, values, dim in (("NEES", result[0], 6), ("NIS", result[1], 3)):
                # in time NIS of an exact filter is independent, NEES is not
                samples = count if what == "NEES" else values.size
                last = values[-1] if what == "NEES" else values
                low, high = bounds(dim, samples, 0.999)
                exact = label == "linear" and name in EXACT
                middle = float(last.mean())
                claims.append(
                    Claim(
                        f"{label}, {name}: {what} (ideal {dim}, bounds {low:.2f} .. {high:.2f})", "", None, middle,
                        mean_interval(last if what == "NEES" else values.mean(axis=0)),
                        (low, high) if exact else None, None if exact else low <= middle <= high,
                        "bounds of chi-square",
                    )
                )  # fmt: skip
    return claims


if __name__ == "__main__":
    raise SystemExit(main("filters.consistency", experiment, __doc__))
