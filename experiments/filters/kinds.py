"""The two tuned filters that the experiments compare."""

from typing import Any

import numpy as np

from assoc.filters import (
    ConstantVelocity,
    CoordinatedTurn,
    ExtendedKalmanFilter,
    FuzzyAdaptiveEKF,
    InteractingMultipleModel,
    Padded,
)


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
