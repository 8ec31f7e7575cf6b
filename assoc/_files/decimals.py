"""The shortest decimal texts that are read as given numbers, those of Python's `repr`, for arrays.

References
----------
R. Giulietti, The Schubfach way to render doubles, 2020: figure 7 with the table of chapter 9.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from assoc._system.compiled import inner_njit, njit
from assoc._types import Array

# powers of ten in the table
_LEAST, _MOST = -292, 324
# characters of the longest text, and the end of its line
_WIDTH = 26
_ZERO, _ONE, _TWO, _FOUR, _TEN, _HALF = (np.uint64(number) for number in (0, 1, 2, 4, 10, 32))
_LOW = np.uint64(2**32 - 1)
_HIDDEN = np.uint64(2**52)


def _powers() -> Array:
    """Powers of ten, the upper and lower half of their first 128 bits, rounded up; uint64 (617, 2)."""
    table = np.zeros((_MOST - _LEAST + 1, 2), dtype=np.uint64)
    for row, power in enumerate(range(_LEAST, _MOST + 1)):
        bits = 127 - ((power * 1741647) >> 19)
        above, below = 10 ** max(power, 0) << max(bits, 0), 10 ** max(-power, 0) << max(-bits, 0)
        number = -(-above // below)
        table[row] = number >> 64, number & (2**64 - 1)
    return table


_POWERS = _powers()


def texts_of(values: Array) -> list[str]:
    """The text of each number (n,), as `repr` writes it; empty for NaN."""
    if not len(values):
        return []
    content = _lines(np.ascontiguousarray(values, dtype=np.float64), _POWERS)
    return content.tobytes().decode("ascii").split("\n")[:-1]


def _by_repr(values: Array, powers: Array) -> Array:
    texts = ["" if text == "nan" else text for text in map(repr, values.tolist())]
    return np.frombuffer("\n".join([*texts, ""]).encode(), dtype=np.uint8)


# Python's own texts serve until the kernel is compiled
@partial(njit, small=2_000_000, stand_in=_by_repr)
def _lines(values: Array, powers: Array) -> Array:
    """The texts, each with an end of line, as bytes."""
    text = np.empty(_WIDTH * len(values), dtype=np.uint8)
    bits = values.view(np.uint64)
    digits = np.empty(20, dtype=np.uint8)
    at = 0
    for row in range(len(values)):
        value = values[row]
        if not np.isnan(value):
            if bits[row] >> np.uint64(63):
                text[at] = 45
                at += 1
            if np.isinf(value):
                text[at], text[at + 1], text[at + 2] = 105, 110, 102
                at += 3
            else:
                number, exponent = _shortest(bits[row], powers)
                at = _put(text, at, digits, number, exponent)
        text[at] = 10
        at += 1
    return text[:at].copy()


@inner_njit
def _put(text: Array, at: int, digits: Array, number: Any, exponent: int) -> int:
    """Write number * 10**exponent at a place; returns the place after it."""
    count = 0
    while number != _ZERO or count == 0:
        rest = number // _TEN
        digit = np.uint8(number - rest * _TEN)
        number = rest
        if digit != 0 or count > 0 or number == _ZERO:
            digits[count] = 48 + digit
            count += 1
        else:
            exponent += 1
    # digits are in the order from the last to the first; the point is behind so many of them
    point = count + exponent
    scientific = point <= -4 or point > 16
    if point <= 0 and not scientific:
        text[at], text[at + 1] = 48, 46
        at += 2
        for _ in range(-point):
            text[at] = 48
            at += 1
    whole = 1 if scientific else point
    for index in range(count):
        if index == whole and index > 0:
            text[at] = 46
            at += 1
        text[at] = digits[count - 1 - index]
        at += 1
    if scientific:
        return _put_exponent(text, at, point - 1)
    if point >= count:
        for _ in range(point - count):
            text[at] = 48
            at += 1
        text[at], text[at + 1] = 46, 48
        at += 2
    return at


@inner_njit
def _put_exponent(text: Array, at: int, power: int) -> int:
    text[at], text[at + 1] = 101, 45 if power < 0 else 43
    at += 2
    size = abs(power)
    if size >= 100:
        text[at] = 48 + size // 100
        at += 1
    text[at], text[at + 1] = 48 + size // 10 % 10, 48 + size % 10
    return at + 2


@inner_njit
def _shortest(bits: Any, powers: Array) -> Any:
    """Number and exponent of ten of a finite double, given its bits."""
    fraction, biased = bits & (_HIDDEN - _ONE), np.int64((bits >> np.uint64(52)) & np.uint64(2047))
    if fraction == _ZERO and biased == 0:
        return _ZERO, 0
    c, q = (fraction | _HIDDEN, biased - 1075) if biased > 0 else (fraction, np.int64(-1074))
    if -53 < q <= 0 and (c & ((_ONE << np.uint64(-q)) - _ONE)) == _ZERO:
        return c >> np.uint64(-q), 0
    closer = fraction == _ZERO and biased > 1
    k = (q * 1262611 - (524031 if closer else 0)) >> 22
    shift = np.uint64(q + ((-k * 1741647) >> 19) + 1)
    high, low = powers[-k - _LEAST, 0], powers[-k - _LEAST, 1]
    middle = _FOUR * c
    v = _scaled(high, low, middle << shift)
    lower = _scaled(high, low, (middle - (_ONE if closer else _TWO)) << shift)
    upper = _scaled(high, low, (middle + _TWO) << shift)
    if c & _ONE:
        # the borders themselves are read as the neighbours
        lower, upper = lower + _ONE, upper - _ONE
    s = v // _FOUR
    if s >= _TEN:
        tens = s // _TEN
        down, up = lower <= np.uint64(40) * tens, np.uint64(40) * tens + np.uint64(40) <= upper
        if down != up:
            return (tens + _ONE if up else tens), k + 1
    down, up = lower <= _FOUR * s, _FOUR * s + _FOUR <= upper
    if down != up:
        return (s + _ONE if up else s), k
    half = _FOUR * s + _TWO
    return (s + _ONE if v > half or (v == half and s & _ONE) else s), k


@inner_njit
def _scaled(high: Any, low: Any, c: Any) -> Any:
    """The upper 64 of 192 bits of a product, odd where it is not whole."""
    below, above = high * c, _upper(high, c)
    carried = _upper(low, c)
    below += carried
    if below < carried:
        above += _ONE
    return above | _ONE if below > _ONE else above


@inner_njit
def _upper(a: Any, b: Any) -> Any:
    """The upper 64 bits of a product of two numbers of 64."""
    a0, a1, b0, b1 = a & _LOW, a >> _HALF, b & _LOW, b >> _HALF
    cross = a0 * b1
    middle = a1 * b0 + ((a0 * b0) >> _HALF) + (cross & _LOW)
    return a1 * b1 + (middle >> _HALF) + (cross >> _HALF)
