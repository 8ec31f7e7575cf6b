"""The filters that the experiments compare: the two tuned ones, and one of each kind."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from assoc.filters import (
    ConstantVelocity,
    CoordinatedTurn,
    EnsembleKalmanFilter,
    ExtendedKalmanFilter,
    FuzzyAdaptiveEKF,
    InteractingMultipleModel,
    KalmanFilter,
    ModifiedEKF,
    Padded,
    UnscentedKalmanFilter,
    tuned_data,
)
from assoc.filters.base import Filter


def fuzzy_filter(data: dict[str, Any]) -> FuzzyAdaptiveEKF:
    """Return the fuzzy filter of these parameters, on a coordinated turn."""
    return FuzzyAdaptiveEKF.from_data(CoordinatedTurn(data["acceleration_noise"], data["rate_noise"]), data)


def imm(data: dict[str, float]) -> InteractingMultipleModel:
    """Return the IMM of these parameters: constant velocity and coordinated turn."""
    straight = Padded(ConstantVelocity(data["straight_noise"]), data["rate_spread"])
    turn = CoordinatedTurn(data["turn_noise"], data["rate_noise"])
    a, b = data["stay_straight"], data["stay_turning"]
    return InteractingMultipleModel(
        [ExtendedKalmanFilter(straight), ExtendedKalmanFilter(turn)], np.array([[a, 1 - a], [1 - b, b]])
    )


def of_each_kind(
    noise: float, sizes: Sequence[int], rng: np.random.Generator, inner: type[ExtendedKalmanFilter] | type[ModifiedEKF]
) -> dict[str, Filter[Any]]:
    """Return a filter of each kind for nearly constant velocity.

    noise: Of the acceleration, m/s^2.
    sizes: Members of ensembles, a filter for each.
    rng: Of the ensembles.
    inner: Filters of the IMM.
    """
    motion = ConstantVelocity(noise)
    return {
        "Kalman": KalmanFilter(motion),
        "EKF": ExtendedKalmanFilter(motion),
        "modified EKF, simplified": ModifiedEKF(motion, simplified=True),
        "modified EKF": ModifiedEKF(motion),
        "UKF": UnscentedKalmanFilter(motion),
        **{f"EnKF, N {size}": EnsembleKalmanFilter(motion, size, rng) for size in sizes},
        "fuzzy-adaptive EKF": fuzzy_filter(tuned_data()),
        "IMM": InteractingMultipleModel(
            [inner(Padded(motion, 0.01)), inner(CoordinatedTurn(noise, 0.001))], np.array([[0.98, 0.02], [0.1, 0.9]])
        ),
    }
