"""Whether a filter's covariances fit its errors: NEES and NIS with their chi-square bounds."""

from __future__ import annotations

import numpy as np

from assoc._system.wrong_types import explains_wrong_types
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.filters.base import State
from assoc.filters.state import finite


@explains_wrong_types
def nees(state: State, truth: Array) -> Array:
    """Normalised estimation error squared of each target, (B,); its mean is n if the filter is right.

    Parameters
    ----------
    state
        B targets.
    truth : array (B, n)

    Raises
    ------
    InvalidInputError
        Another shape, or a covariance that is singular.
    """
    truth = finite(truth, "truth", 2)
    if truth.shape != state.mean.shape:
        raise InvalidInputError(f"truth must have shape {state.mean.shape}, got {truth.shape}")
    error = truth - state.mean
    size = np.sqrt(np.maximum(np.einsum("bii->bi", state.covariance), 1e-300))
    # in units of standard deviations rounding errors are small
    unit, error = state.covariance / size[:, :, None] / size[:, None, :], error / size
    flat = np.linalg.matrix_rank(unit, hermitian=True) < unit.shape[1]
    if flat.any():
        raise InvalidInputError(
            f"state: covariance of target {int(np.argmax(flat))} is singular, as of an ensemble with few members"
        )
    return np.einsum("bi,bi->b", error, np.linalg.solve(unit, error[..., None])[..., 0])


@explains_wrong_types
def bounds(dim: int, runs: int, probability: float = 0.95) -> tuple[float, float]:
    """Interval that the mean of `runs` chi-square variables of `dim` degrees of freedom hits."""
    from scipy.stats import chi2

    if not (dim >= 1 and runs >= 1 and 0 < probability < 1):
        raise InvalidInputError(
            f"dim and runs must be above 0, probability between 0 and 1, got {dim}, {runs}, {probability}"
        )
    tail = (1 - probability) / 2
    return float(chi2.ppf(tail, dim * runs)) / runs, float(chi2.ppf(1 - tail, dim * runs)) / runs
