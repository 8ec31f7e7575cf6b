"""A batch of Gaussians, and checks of arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.filters.kernels.linear_algebra import all_factors
from assoc.sensors.arrays import numbers, require_finite


def finite(value: object, what: str, *dimensions: int) -> Array:
    """Return a finite float64 C-ordered copy with one of these numbers of axes; errors name it `what`."""
    array = np.atleast_1d(numbers(value, what))
    if dimensions and array.ndim not in dimensions:
        wanted = " or ".join(str(d) for d in dimensions)
        raise InvalidInputError(f"{what} must have {wanted} axes, got shape {array.shape}")
    return require_finite(array, what)


def checked_covariance(value: object, shape: tuple[int, ...]) -> Array:
    """Return a checked stack (B, n, n) of symmetric positive definite matrices, a copy."""
    array = finite(value, "covariance", 2, 3)
    if array.ndim == 2:
        array = array[None]
    if array.shape != shape:
        raise InvalidInputError(f"covariance must have shape {shape}, got {array.shape}")
    size = np.sqrt(np.abs(np.einsum("bii->bi", array)))
    if not (np.abs(array - array.transpose(0, 2, 1)) <= 1e-9 * size[:, :, None] * size[:, None, :]).all():
        raise InvalidInputError("covariance must be symmetric")
    bad, _ = all_factors(array)
    if bad >= 0:
        raise InvalidInputError(f"covariance must be positive definite, number {bad} is not")
    return array


@dataclass(frozen=True, eq=False, repr=False)
class Gaussian:
    """Means and covariances of B targets (or Monte Carlo runs); one target is a batch of one.

    Parameters
    ----------
    mean : array_like (B, n) or (n,)
        In the order of the motion model, metres and seconds.
    covariance : array_like (B, n, n) or (n, n)
        Symmetric and positive definite.

    Raises
    ------
    InvalidInputError
        NaN or infinite numbers, wrong shapes, or a covariance that is not positive definite.
    """

    mean: Array
    covariance: Array

    def __post_init__(self) -> None:
        mean = np.atleast_2d(finite(self.mean, "mean", 1, 2))
        shape = (len(mean), mean.shape[1], mean.shape[1])
        covariance = np.asarray(self.covariance)
        if covariance.ndim == 2 and covariance.shape == shape[1:]:
            covariance = np.broadcast_to(covariance, shape)
        object.__setattr__(self, "mean", mean)
        object.__setattr__(self, "covariance", checked_covariance(covariance, shape))

    def __len__(self) -> int:
        return len(self.mean)

    def __getitem__(self, rows: Any) -> Gaussian:
        """Return the targets that an index array, mask or slice selects."""
        return gaussian(np.ascontiguousarray(self.mean[rows]), np.ascontiguousarray(self.covariance[rows]))

    def __repr__(self) -> str:
        return f"{type(self).__name__}({len(self.mean)} x {self.mean.shape[1]})"

    @staticmethod
    def concatenate(parts: Sequence[Gaussian]) -> Gaussian:
        """Return one batch with the targets of several."""
        return gaussian(
            np.concatenate([part.mean for part in parts]),
            np.concatenate([part.covariance for part in parts]),
        )


def gaussian(mean: Array, covariance: Array) -> Gaussian:
    """Make a Gaussian of a kernel's results, without checking them again."""
    made = object.__new__(Gaussian)
    # a frozen dataclass refuses assignments, its dictionary does not
    made.__dict__["mean"] = mean
    made.__dict__["covariance"] = covariance
    return made


def symmetric(covariance: Array) -> Array:
    """Covariances (..., n, n) symmetric to the last bit: products of matrices round the two halves differently."""
    return np.asarray(0.5 * (covariance + covariance.swapaxes(-1, -2)))
