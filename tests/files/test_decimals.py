"""Texts of numbers are those of Python's `repr`."""

import numpy as np

from assoc._files.decimals import texts_of
from assoc._system.interpreted import compiled_only
from tests.sizes import few_or_all


def numbers(count):
    rng = np.random.default_rng(3)
    powers = 2.0 ** np.arange(-1074, 1024)
    return np.concatenate([
        [0.0, -0.0, np.inf, -np.inf, np.nan, 1e15, 9999999999999998.0, 1e16, 1e17, 1e-4, 1e-5, 123456789012345680.0],
        [5e-324, 2.2250738585072014e-308, 1.7976931348623157e308, 9007199254740993.0, 2e-323],
        powers, np.nextafter(powers, 0.0), np.nextafter(powers, np.inf), 10.0 ** np.arange(-323, 309),
        100.0 * np.arange(1000), rng.normal(0.0, 1e5, count), np.round(rng.normal(0.0, 1e5, count), 3),
        np.frombuffer(rng.bytes(8 * count)),
    ])  # fmt: skip


@few_or_all("count", 2_000, 200_000)
def test_texts_are_those_of_python(count):
    values = numbers(count)
    expected = ["" if value != value else repr(value) for value in values.tolist()]
    with compiled_only():
        assert texts_of(values) == expected
    assert texts_of(values[:100]) == expected[:100]
    assert texts_of(values[:0]) == []
