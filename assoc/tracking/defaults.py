"""The filter that trackers take where none is given."""

from __future__ import annotations

from typing import Any

import numpy as np

from assoc.filters import ConstantVelocity, ExtendedKalmanFilter, InteractingMultipleModel
from assoc.filters.base import Filter

PROCESS_NOISE = 30.0
"""Process noise of filters with one motion model: root of the acceleration's spectral density, m/s^1.5."""

MANOEUVRE_NOISE = 50.0
"""Process noise of the manoeuvring model of `two_speeds`: turns of 5 g at a scan a second."""

MOST_SCANS = 1000
"""The most scans that a decision may be put off: every branch carries its history with it."""

_QUIET = 0.1
_CHANGE = 0.1


def two_speeds(noise: float = MANOEUVRE_NOISE, dimensions: int = 3) -> Filter[Any]:
    """Interacting multiple models: nearly constant velocity, and manoeuvres.

    A target that flies straight is tracked with a tenth of the process noise; either model gives way to the
    other every ten scans on average.

    Parameters
    ----------
    noise : float
        Process noise of the manoeuvring model, m/s^1.5.
    dimensions : int
        2 or 3.
    """
    modes: list[Any] = [
        ExtendedKalmanFilter(ConstantVelocity(share * noise, dimensions=dimensions, kind="continuous"))
        for share in (_QUIET, 1.0)
    ]
    return InteractingMultipleModel(modes, np.array([[1 - _CHANGE, _CHANGE], [_CHANGE, 1 - _CHANGE]]))
