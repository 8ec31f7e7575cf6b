"""Arrays that users give: copied, checked, named in errors."""

from __future__ import annotations

import numpy as np

from assoc._types import Array
from assoc.errors import InvalidInputError

LARGEST = 1e12
"""Lengths beyond this (metres) are refused: their squares would leave no digits for the residuals."""


def numbers(value: object, what: str) -> Array:
    """Return a C-ordered float64 copy; errors name it `what`."""
    try:
        if np.asarray(value).dtype.kind in "mM":
            raise TypeError  # numpy would count their days or nanoseconds
        return np.array(value, dtype=np.float64, order="C")
    except (TypeError, ValueError) as error:
        kind = value.dtype if isinstance(value, np.ndarray) else type(value).__name__
        raise InvalidInputError(f"{what} must be numbers, got {kind}") from error


def require_finite(array: Array, what: str) -> Array:
    """Return an array of finite numbers; errors name it `what`."""
    if not np.isfinite(array).all():
        raise InvalidInputError(f"{what} must be finite, got {array[~np.isfinite(array)][0]}")
    return array


def finite_array(value: object, what: str, shape: tuple[int, ...] | None = None) -> Array:
    """Return a read-only float64 copy of finite numbers of usual size; errors name it `what`."""
    array = numbers(value, what)
    if shape is not None and array.shape != shape:
        raise InvalidInputError(f"{what} must have shape {shape}, got {array.shape}")
    require_finite(array, what)
    if array.size and np.abs(array).max() > LARGEST:
        raise InvalidInputError(f"{what} must be within +-{LARGEST:g}, got {np.abs(array).max():g}")
    array.setflags(write=False)
    return array
