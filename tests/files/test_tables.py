"""Tables as CSV."""

import sys

import numpy as np
import pandas as pd
import pytest

from assoc._files.tables import csv_text


@pytest.mark.parametrize("rows", [0, 1, 200])
def test_the_text_is_that_of_pandas(rows):
    rng = np.random.default_rng(rows)
    odd = np.array([0.0, -0.0, 1e-7, 1e22, 5e-324, np.inf, -np.inf, np.nan, 0.1 + 0.2, 4.0])
    frame = pd.DataFrame({
        "every": rng.normal(0.0, 1e4, rows),
        "odd": rng.choice(odd, rows),
        "few, alike": rng.choice([1.5, np.nan, 0.1], rows),
        "count": rng.integers(-5, 10**12, rows),
        "sure": rng.random(rows) < 0.5,
        "name": rng.choice(["plain", 'a "b", c', "two\nlines", ""], rows),
    })  # fmt: skip
    for header in (True, False):
        assert csv_text(frame, header=header) == frame.to_csv(index=False, header=header, lineterminator="\n")


@pytest.mark.parametrize("with_pyarrow", [True, False])
def test_numbers_have_their_shortest_text(with_pyarrow, monkeypatch):
    if with_pyarrow:
        pytest.importorskip("pyarrow")
    else:
        monkeypatch.setitem(sys.modules, "pyarrow", None)
    rng = np.random.default_rng(1)
    sizes = 10.0 ** np.arange(-12, 20)
    edges = np.concatenate([np.nextafter(sizes, 0.0), sizes, np.nextafter(sizes, np.inf)])
    every = rng.integers(0, 2**63, 2_000).view(np.float64)
    spread = sizes * rng.uniform(1.0, 10.0, (60, len(sizes)))
    values = np.concatenate([edges, every[np.isfinite(every)], *spread, *np.round(spread, 3)])
    values = np.concatenate([values, -values])
    assert csv_text(pd.DataFrame({"value": values})).split() == ["value", *map(repr, values.tolist())]


@pytest.mark.parametrize("with_pyarrow", [True, False])
def test_half_characters_are_escaped(with_pyarrow, monkeypatch):
    """As from names of files that are not UTF-8."""
    if not with_pyarrow:
        monkeypatch.setitem(sys.modules, "pyarrow", None)
    frame = pd.DataFrame({"name": pd.Series(["\udc80,x", "y"], dtype=object), "n": [1.5, 2.5]})
    assert csv_text(frame).encode("utf-8", "backslashreplace") == b'name,n\n"\\udc80,x",1.5\ny,2.5\n'
