"""Kernels count no references to what they are given, and yet return it, keep it and free it as they should."""

import sys
from typing import Any, NamedTuple

import numpy as np
import pytest
from llvmlite import ir

from assoc._system.compiled import compiled_only, inner_njit, njit
from assoc._system.kernels.lowering import _Builder
from assoc._types import Floats


class Pair(NamedTuple):
    first: Floats
    second: Floats


class Both(NamedTuple):
    pair: Pair
    number: float


@inner_njit
def _larger(pair: Pair) -> Any:
    found = pair.first
    if pair.second.sum() > found.sum():
        found = pair.second
    return found


@njit
def _given(both: Both) -> Any:
    return both.pair.first


@njit
def _part(both: Both) -> Any:
    first, second = both.pair
    return first[1:], both.pair, second


@njit
def _chosen(both: Both) -> Any:
    return _larger(both.pair), _larger(Pair(both.pair.second, both.pair.first))


@njit
def _exchanged(both: Both) -> Any:
    # a variable that holds what is given, then what is made, then both in turns
    x = both.pair.first
    for i in range(4):
        y = both.pair.second
        if i == 2:
            x = x + y
        else:
            pair = Pair(y, x)
            x = pair.second
    return Both(Pair(x, both.pair.second), both.number)


@njit
def _overwritten(both: Both) -> Any:
    both = Both(Pair(both.pair.second.copy(), both.pair.first), 2.0 * both.number)
    first = both.pair.first
    first[0] = both.number
    return both


def _arrays(value: Any) -> list[Floats]:
    if isinstance(value, tuple):
        return [array for item in value for array in _arrays(item)]
    return [value] if isinstance(value, np.ndarray) else []


@pytest.mark.parametrize("kernel", [_given, _part, _chosen, _exchanged, _overwritten])
def test_what_is_returned_lives_as_long_as_it_is_used(kernel):
    first, second = np.arange(1000.0), np.arange(1000.0, 2000.0)
    counts = sys.getrefcount(first), sys.getrefcount(second)
    with compiled_only():
        found = [kernel(Both(Pair(first, second), 3.0)) for _ in range(50)]
    # what was freed too early would be overwritten by now
    others = [np.full(1000, np.nan) for _ in range(50)]
    expected = _arrays(kernel.py_func(Both(Pair(first, second), 3.0)))
    for one in found:
        for array, right in zip(_arrays(one), expected, strict=True):
            assert np.array_equal(array, right)
    del found, one, array, right, expected, others
    assert (sys.getrefcount(first), sys.getrefcount(second)) == counts


def test_a_part_of_a_record_that_was_put_together_is_at_hand():
    number, inner = ir.DoubleType(), ir.LiteralStructType([ir.DoubleType(), ir.DoubleType()])
    record = ir.LiteralStructType([number, inner])
    function = ir.Function(ir.Module(), ir.FunctionType(number, [number, inner, record]), "f")
    builder = _Builder(function.append_basic_block())
    x, pair, other = function.args
    whole = builder.insert_value(builder.insert_value(other, pair, 1), x, 0)
    assert builder.extract_value(whole, 0) is x
    assert builder.extract_value(whole, [1]) is pair
    taken = builder.extract_value(whole, [1, 0])
    assert taken.operands == [pair]
    assert list(taken.indices) == [0]
    # of one of whose parts only a part was put in
    mixed = builder.insert_value(other, x, [1, 1])
    assert builder.extract_value(mixed, 1).operands == [mixed]
    assert builder.extract_value(mixed, 0).operands == [other]
