"""Covariances of every filter through 10^5 predictions and corrections: symmetric, positive definite, bounded?

A target that stands still is measured by a radar (by a position sensor for the Kalman filter), corrections come in
bursts of three for each prediction, which is the hardest case for a covariance. Checked every 100 steps: the least
eigenvalue of the correlation matrix (above 0: positive definite, whatever the units), and the largest asymmetry, in
units of the standard deviations.
"""

from typing import Any

import numpy as np

from assoc._types import Array
from assoc.filters import ExtendedKalmanFilter, Gaussian, KalmanFilter
from assoc.filters.base import Filter
from experiments.common.claims import Claim
from experiments.common.command import main
from experiments.filters.benchmark import PLACE, RADAR
from experiments.filters.kinds import of_each_kind

EVERY = 100
BURST = 3
PLACE_OF_TARGET = (30e3, 20e3, 5e3)


def filters(rng: np.random.Generator) -> dict[str, Filter[Any]]:
    """Return one filter of each kind."""
    kinds = of_each_kind(2.0, (20,), rng, ExtendedKalmanFilter)
    return {name: kind for name, kind in kinds.items() if "simplified" not in name}


def endure(filter_: Filter[Any], steps: int, rng: np.random.Generator) -> Array:
    """Least eigenvalue, largest asymmetry and position's deviation (m) every EVERY steps, (steps / EVERY, 3)."""
    n = filter_.motion.dim
    sensor: Any = PLACE if isinstance(filter_, KalmanFilter) else RADAR
    mean = np.zeros(n)
    mean[:3] = PLACE_OF_TARGET
    state = filter_.start(Gaussian(mean, np.diag([1e8, 1e8, 1e8, 1e6, 1e6, 1e6, 1.0][:n])))
    exact = sensor.measure(mean[None, :3])
    watched = []
    for k in range(steps):
        if k % BURST == 0:
            state = filter_.predict(state, 0.1)
        state = filter_.update(state, exact + rng.standard_normal((1, 3)) * sensor.noise, sensor).state
        if k % EVERY == EVERY - 1:
            P = state.covariance[0]
            scale = np.sqrt(np.diag(P))
            unit = P / np.outer(scale, scale)
            watched.append((np.linalg.eigvalsh(unit).min(), np.abs(unit - unit.T).max(), np.sqrt(np.trace(P[:3, :3]))))
    return np.array(watched)


def experiment(quick: bool, rng: np.random.Generator) -> list[Claim]:
    """Watch every filter."""
    steps = 2_000 if quick else 100_000
    claims = []
    for name, filter_ in filters(rng).items():
        least, asymmetry, deviation = endure(filter_, steps, rng).T
        claims += [
            Claim(f"{name}: least eigenvalue of the correlation in {steps} steps", "", None, least.min(), None,
                  (1e-12, None), source="chosen by us"),
            Claim(f"{name}: largest asymmetry", "", None, asymmetry.max(), None, (None, 1e-12), source="chosen by us"),
            Claim(f"{name}: largest deviation of the position after {EVERY} steps", "m", None, deviation.max(), None,
                  (None, 300.0), source="chosen by us"),
        ]  # fmt: skip
    return claims


if __name__ == "__main__":
    raise SystemExit(main("filters.endurance", experiment, __doc__))
