"""Places near others, by cells."""

import numpy as np
import pytest

from assoc.tracking.records.neighbours import cells_of, near


@pytest.mark.parametrize("around", [(0.0,), (0.0, 0.0), (0.0, 7.0), (0.0, 9.0, 0.0), (2.5, 1.5, 40.0)])
def test_what_is_near_is_found_once(around):
    """Also where angles come back, and where a circle is one cell, two or three."""
    rng, around = np.random.default_rng(len(around)), np.array(around)
    low, high = np.where(around > 0.0, 0.0, -20.0), np.where(around > 0.0, around, 20.0)
    places, at = (rng.uniform(low, high, (n, len(around))) for n in (400, 60))
    found, square, count = near(cells_of(places, around, 3.0), at, 400)
    for x, row, apart, n in zip(at, found, square, count.tolist(), strict=True):
        off = np.abs(places - x)
        off = np.where(around > 0.0, np.minimum(off, around - off), off)
        expected = (off**2).sum(axis=1)
        assert np.sort(row[:n]).tolist() == np.flatnonzero(expected < 9.0).tolist()
        assert apart[:n] == pytest.approx(expected[row[:n]])
    assert (near(cells_of(places, around, 3.0), at, 2)[2] == np.minimum(count, 2)).all()
    assert not near(cells_of(places[:0], around, 3.0), at, 2)[2].any()
