"""Compiled geometry of Dubins paths: the six words, distances from their pieces, and free edges of a graph."""

from __future__ import annotations

import math

import numpy as np

from assoc._system.compiled import njit
from assoc._types import Array

WORDS = ("LSL", "RSR", "LSR", "RSL", "RLR", "LRL")
"""The six words; kernels know them by their number."""

SENSES = np.array([[1.0, 0.0, 1.0], [-1, 0, -1], [1, 0, -1], [-1, 0, 1], [-1, 1, -1], [1, -1, 1]])
"""Curvature of each piece of each word in units of 1 / radius."""

TURN = 2.0 * math.pi
# a full turn found where none is needed is a rounding error, which a square root can have made large
_TINY = 1e-7
# circles that only just touch may seem not to
_TOUCH = 1e-11


@njit
def turn(angle: float) -> float:
    """Angle in [0, 2 pi); rounding errors around 0 become 0."""
    angle = angle % TURN
    return 0.0 if angle > TURN - _TINY else angle


@njit
def pieces(word: int, d: float, a: float, b: float) -> tuple[bool, float, float, float]:
    """Lengths of the pieces of a word in turning radii, from (0, 0, a) to (d, 0, b); False if there is none."""
    sa, ca, sb, cb, cab = math.sin(a), math.cos(a), math.sin(b), math.cos(b), math.cos(a - b)
    if word == 0:
        t = math.atan2(cb - ca, d + sa - sb)
        return True, turn(t - a), math.hypot(d + sa - sb, cb - ca), turn(b - t)
    if word == 1:
        t = math.atan2(ca - cb, d - sa + sb)
        return True, turn(a - t), math.hypot(d - sa + sb, ca - cb), turn(t - b)
    if word == 2:
        square = d * d - 2.0 + 2.0 * cab + 2.0 * d * (sa + sb)
        if square < -_TOUCH:
            return False, 0.0, 0.0, 0.0
        p = math.sqrt(max(square, 0.0))
        t = math.atan2(-ca - cb, d + sa + sb) - math.atan2(-2.0, p)
        return True, turn(t - a), p, turn(t - b)
    if word == 3:
        square = d * d - 2.0 + 2.0 * cab - 2.0 * d * (sa + sb)
        if square < -_TOUCH:
            return False, 0.0, 0.0, 0.0
        p = math.sqrt(max(square, 0.0))
        t = math.atan2(ca + cb, d - sa - sb) - math.atan2(2.0, p)
        return True, turn(a - t), p, turn(b - t)
    if word == 4:
        c = (6.0 - d * d + 2.0 * cab + 2.0 * d * (sa - sb)) / 8.0
        if abs(c) > 1.0 + _TOUCH:
            return False, 0.0, 0.0, 0.0
        p = TURN - math.acos(max(min(c, 1.0), -1.0))
        t = turn(a - math.atan2(ca - cb, d - sa + sb) + 0.5 * p)
        return True, t, p, turn(a - b - t + p)
    c = (6.0 - d * d + 2.0 * cab + 2.0 * d * (sb - sa)) / 8.0
    if abs(c) > 1.0 + _TOUCH:
        return False, 0.0, 0.0, 0.0
    p = TURN - math.acos(max(min(c, 1.0), -1.0))
    t = turn(math.atan2(cb - ca, d + sa - sb) - a + 0.5 * p)
    return True, t, p, turn(b - a - t + p)


@njit
def advance(x: float, y: float, h: float, k: float, s: float) -> tuple[float, float, float]:
    """Pose after s metres of curvature k."""
    if k == 0.0:
        return x + s * math.cos(h), y + s * math.sin(h), h
    e = h + k * s
    return x + (math.sin(e) - math.sin(h)) / k, y - (math.cos(e) - math.cos(h)) / k, e


@njit
def distance(x: float, y: float, h: float, k: float, length: float, px: float, py: float) -> float:
    """Least distance of a point from a piece that begins at x, y, h with curvature k."""
    if k == 0.0:
        cos, sin = math.cos(h), math.sin(h)
        s = min(max((px - x) * cos + (py - y) * sin, 0.0), length)
        return math.hypot(px - x - s * cos, py - y - s * sin)
    cx, cy = x - math.sin(h) / k, y + math.cos(h) / k
    dx, dy = px - cx, py - cy
    # turned so far when passing nearest to the point
    sense = 1.0 if k > 0.0 else -1.0
    turned = (sense * (math.atan2(dy, dx) - math.atan2(y - cy, x - cx))) % TURN
    if turned <= length * abs(k):
        return abs(math.hypot(dx, dy) - 1.0 / abs(k))
    ex, ey, _ = advance(x, y, h, k, length)
    return min(math.hypot(px - x, py - y), math.hypot(px - ex, py - ey))


@njit
def free_word(
    x: float, y: float, h: float, u: float, v: float, g: float, radius: float, obstacles: Array
) -> tuple[int, float]:
    """Shortest word from (x, y, h) to (u, v, g) that stays out of the obstacles, and its length; -1 if none."""
    dx, dy = u - x, v - y
    far = math.hypot(dx, dy)
    line = math.atan2(dy, dx)
    best, best_length = -1, math.inf
    for word in range(6):
        ok, t, p, q = pieces(word, far / radius, turn(h - line), turn(g - line))
        length = (t + p + q) * radius
        if not ok or length >= best_length:
            continue
        free = True
        a, b, c = x, y, h
        for i in range(3):
            size = radius * (t if i == 0 else p if i == 1 else q)
            k = SENSES[word, i] / radius
            for o in range(len(obstacles)):
                if distance(a, b, c, k, size, obstacles[o, 0], obstacles[o, 1]) < obstacles[o, 2]:
                    free = False
                    break
            if not free:
                break
            a, b, c = advance(a, b, c, k, size)
        # where rounding decides whether circles touch, a formula may miss the goal
        if free and math.hypot(a - u, b - v) <= 1e-6 * (radius + far):
            best, best_length = word, length
    return best, best_length


@njit
def free_words(poses: Array, radius: float, obstacles: Array) -> Array:
    """Lengths (N, N) of the shortest free paths between all pairs of poses (N, 3); infinite if none."""
    N = len(poses)
    lengths = np.full((N, N), np.inf)
    for i in range(N):
        for j in range(N):
            if i != j:
                _, lengths[i, j] = free_word(
                    poses[i, 0], poses[i, 1], poses[i, 2], poses[j, 0], poses[j, 1], poses[j, 2],
                    radius, obstacles,
                )  # fmt: skip
    return lengths
