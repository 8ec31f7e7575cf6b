"""Queries on one column."""

import numpy as np

from assoc.packing.kernels.columns import first_row, fits

COLS = np.array([[0, 3, -1], [-1, 2, 5], [-1, -1, 4], [-1, -1, -1]], dtype=np.int32)


def test_first_row_is_that_of_the_first_sensor_that_has_one():
    assert [first_row(COLS, j) for j in range(4)] == [0, 2, 4, -1]


def test_a_column_fits_where_all_its_rows_are_free():
    owner = np.full(6, -1, dtype=np.int32)
    owner[5] = 7
    assert [fits(COLS, owner, j) for j in range(4)] == [True, False, True, True]
    owner[3] = 0
    assert not fits(COLS, owner, 0)
