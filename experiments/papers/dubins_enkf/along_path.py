"""The error along a Dubins path, which the paper's introduction promises: an aircraft that steers by its estimate.

The aircraft flies the paths of figures 2 and 3 at 20 m/s, the paper's airspeed there, in steps of 0.1 s. Position and
heading are disturbed in each step and measured with the noise that ensemble.py has for distance and climb angle, chosen
by us. The turn is that of the path, corrected by what the estimate is off it. "From the path" is the distance from the
line that the aircraft is planned to fly along. Full size: 50 runs.
"""

import math

import numpy as np

from assoc._types import Array
from assoc.filters import EnsembleKalmanFilter, ExtendedKalmanFilter, Gaussian, LinearMeasurement
from assoc.filters.motion.models import ForwardDifference
from assoc.simulation.dubins.obstacles import around
from assoc.simulation.dubins.paths import Path, shortest
from experiments.common.claims import Claim
from experiments.common.command import main, mean_interval
from experiments.papers.dubins_enkf.ensemble import Q_SIGMA, R_SIGMA
from experiments.papers.dubins_enkf.flight_paths import FIRST, LAST, OBSTACLE, PRINTED, RADIUS

SPEED, DT = 20.0, 0.1
Q, R = Q_SIGMA[[2, 2, 0]], R_SIGMA[[2, 2, 0]]
"""Sigmas of x and y (m) and heading (rad)."""
GAINS = 0.05, 1.4
"""Turn for a metre beside the path, and for a radian of heading, 1/s."""
FILTERS = {"EKF": None, "N 10": 10, "N 100": 100, "N 300": 300}


class Steered(ForwardDifference):
    """[x, y, heading] at constant speed; `turn` (rad/s) is the control of the step."""

    def __init__(self, disturbed: Array) -> None:
        super().__init__(np.diag(disturbed**2), 3, (0, 1))
        self.turn = 0.0

    def rates(self, states: Array) -> Array:
        """Time derivatives of states (m, 3)."""
        heading = states[:, 2]
        return np.stack([SPEED * np.cos(heading), SPEED * np.sin(heading), np.full(len(states), self.turn)], axis=1)

    def slopes(self, states: Array) -> Array:
        """Derivatives of `rates`, (m, 3, 3)."""
        J = np.zeros((len(states), 3, 3))
        J[:, 0, 2], J[:, 1, 2] = -SPEED * np.sin(states[:, 2]), SPEED * np.cos(states[:, 2])
        return J


def fly(path: Path, size: int | None, rng: np.random.Generator, *, disturbed: Array = Q, measured: Array = R) -> Array:
    """Mean squares of a flight: estimate from the path, aircraft from the path, estimate from the aircraft, m^2.

    Each step is disturbed and measured with these sigmas.
    """
    motion = Steered(disturbed)
    filter_ = ExtendedKalmanFilter(motion) if size is None else EnsembleKalmanFilter(motion, size, rng)
    sensor = LinearMeasurement(np.eye(3), np.diag(measured**2))
    first = path.segments[0].start
    truth = np.array([[first.x, first.y, first.heading]])
    state, found = filter_.start(Gaussian(truth, np.diag(disturbed**2))), []
    ends = np.cumsum([segment.length for segment in path.segments])
    for k in range(int(path.length / (SPEED * DT))):
        across, angle = beside(path, k * SPEED * DT, state.mean[0])
        piece = path.segments[min(int(np.searchsorted(ends, k * SPEED * DT)), len(ends) - 1)]
        motion.turn = SPEED * piece.curvature - GAINS[0] * across - GAINS[1] * angle
        truth = motion.propagate(truth, DT) + rng.standard_normal((1, 3)) * disturbed
        state = filter_.predict(state, DT)
        state = filter_.update(state, truth + rng.standard_normal((1, 3)) * measured, sensor).state
        now = (k + 1) * SPEED * DT
        off = np.linalg.norm(state.mean[0, :2] - truth[0, :2])
        found.append((beside(path, now, state.mean[0])[0], beside(path, now, truth[0])[0], off))
    return np.mean(np.square(found), axis=0)


def beside(path: Path, s: float, state: Array) -> tuple[float, float]:
    """How far to the left of the path a state is, and its heading less the path's, s metres along it."""
    plan = path.at(min(s, path.length))
    x, y = state[0] - plan.x, state[1] - plan.y
    across = -math.sin(plan.heading) * x + math.cos(plan.heading) * y
    return across, math.remainder(state[2] - plan.heading, 2 * math.pi)


def experiment(quick: bool, rng: np.random.Generator) -> list[Claim]:
    """Fly both paths with each filter; --quick has fewer runs."""
    flown = {
        "figure 2, RSR": shortest(FIRST, LAST, RADIUS),
        "figure 3, around the obstacle": around(*PRINTED, RADIUS, [OBSTACLE]),
    }
    whats = "estimate from the path", "aircraft from the path", "estimate from the aircraft"
    claims = []
    for name, path in flown.items():
        for label, size in FILTERS.items():
            squares = np.array([fly(path, size, rng) for _ in range(5 if quick else 50)])
            for what, values in zip(whats, squares.T, strict=True):
                low, high = mean_interval(values)
                claims.append(Claim(f"{name}, {label}: RMS, {what}", "m", None, float(values.mean()) ** 0.5,
                                    (max(low, 0.0) ** 0.5, high**0.5), source="introduction, in words"))  # fmt: skip
    return claims


if __name__ == "__main__":
    raise SystemExit(main("papers.dubins_enkf.along_path", experiment, __doc__))
