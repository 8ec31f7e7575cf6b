"""The smallest and the largest of non-negative numbers, against numpy."""

import numpy as np
import pytest

from assoc._system.compiled import njit
from assoc.packing.simplex.dual import position_of_largest, position_of_smallest


@njit
def both(bits, count):
    """Only kernels call inner kernels."""
    return position_of_smallest(bits, count), position_of_largest(bits, count)


@pytest.mark.parametrize("count", [1, 2, 3, 7, 8, 63, 200])
def test_random_numbers_with_ties_zeros_and_infinities(count):
    rng = np.random.default_rng(count)
    for _ in range(50):
        values = rng.choice([0.0, 5e-324, 1e-300, 0.5, 2.0, 1e300, np.inf, *rng.random(5)], count + 3)
        least, most = both(values.view(np.int64), count)
        assert least == values[:count].argmin()
        assert most == (values[:count].argmax() if values[:count].any() else -1)


def test_of_nothing():
    assert both(np.ones(4).view(np.int64), 0) == (0, -1)
