"""Paths with a turning radius around circular obstacles.

The shortest free path touches obstacles; so the search runs over poses that touch them: points around each
obstacle, with the heading of the tangent, in both senses. Between two such poses the shortest free Dubins
path is taken, along an obstacle no smaller than the turning circle also the arc itself. Dijkstra's path in
this graph is then drawn tight by moving the touching points.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from assoc._types import Array
from assoc.errors import InfeasibleError, InvalidInputError, LimitExceededError
from assoc.sensors.arrays import finite_array
from assoc.simulation.dubins.kernels import SENSES, TURN, WORDS, distance, free_word, free_words, pieces, turn
from assoc.simulation.dubins.paths import Path, Pose, Segment, positive_radius

# touching points lie outside the obstacle by this share of its radius, so that rounding does not count
_SKIN = 1e-7
_MOST = 2_000


@dataclass(frozen=True)
class _Touch:
    """A pose on the path; on an obstacle if `obstacle` is one, at an angle, turning left (1) or right (-1)."""

    pose: Pose
    obstacle: int = -1
    sense: float = 0.0
    angle: float = 0.0


def around(
    start: Pose,
    goal: Pose,
    radius: float,
    obstacles: Sequence[tuple[float, float, float]],
    *,
    margin: float = 0.0,
    points: int = 24,
) -> Path:
    """Return a short path between two poses that turns no tighter than `radius` and clears all obstacles.

    Obstacles are circles (x, y, radius), metres, which may overlap; `margin`, m, is kept from them, and `points`
    touching points are tried on each and sense before they are moved. The path is the shortest within the graph of
    touching points, drawn tight; a better one through another gap can exist only where `points` are too few to find
    that gap.

    InvalidInputError where start or goal lie within an obstacle, InfeasibleError where no path was found,
    LimitExceededError for more touching points than the search is made for.
    """
    radius = positive_radius(radius)
    circles = finite_array(obstacles if len(obstacles) else np.zeros((0, 3)), "obstacles").copy()
    if circles.ndim != 2 or circles.shape[1] != 3:
        raise InvalidInputError(f"obstacles must have shape (n, 3), x, y and radius each, got {circles.shape}")
    if not (math.isfinite(margin) and margin >= 0):
        raise InvalidInputError(f"margin must be a number of at least 0, got {margin!r}")
    if isinstance(points, bool) or not isinstance(points, int) or points < 4:
        raise InvalidInputError(f"points must be a whole number of at least 4, got {points!r}")
    if not (circles[:, 2] > 0).all():
        raise InvalidInputError("obstacles must have radii above 0")
    if 2 * points * len(circles) > _MOST:
        raise LimitExceededError(
            f"{2 * points * len(circles)} touching points, at most {_MOST}: fewer obstacles or points"
        )
    circles[:, 2] += margin
    for name, pose in (("start", start), ("goal", goal)):
        inside = np.hypot(circles[:, 0] - pose.x, circles[:, 1] - pose.y) < circles[:, 2]
        if inside.any():
            raise InvalidInputError(f"{name} lies within obstacle {int(np.argmax(inside))}")
    touches = [_Touch(start), _Touch(goal), *_touching(circles, points)]
    route = _shortest_route(touches, radius, circles)
    if route is None:
        raise InfeasibleError(
            f"no path from ({start.x:g}, {start.y:g}) to ({goal.x:g}, {goal.y:g}) with turning radius "
            f"{radius:g} clears the {len(circles)} obstacles"
        )
    return _as_path(_tighten(route, radius, circles, TURN / points), radius, circles)


def _touch(circles: Array, obstacle: int, sense: float, angle: float) -> _Touch:
    x, y, r = circles[obstacle]
    r *= 1 + _SKIN
    pose = Pose(x + r * math.cos(angle), y + r * math.sin(angle), angle + sense * math.pi / 2)
    return _Touch(pose, obstacle, sense, angle)


def _touching(circles: Array, points: int) -> list[_Touch]:
    """Touching poses that lie in no other obstacle."""
    found = []
    for o in range(len(circles)):
        for step in range(points):
            for sense in (1.0, -1.0):
                touch = _touch(circles, o, sense, step * TURN / points)
                away = np.hypot(circles[:, 0] - touch.pose.x, circles[:, 1] - touch.pose.y)
                if (away >= circles[:, 2]).all():
                    found.append(touch)
    return found


def _arc(a: _Touch, b: _Touch, radius: float, circles: Array) -> tuple[float, float]:
    """Length and curvature of the arc along an obstacle; infinite if there is none or it is blocked."""
    if a.obstacle < 0 or a.obstacle != b.obstacle or a.sense != b.sense:
        return math.inf, 0.0
    r = circles[a.obstacle, 2] * (1 + _SKIN)
    if r < radius:
        return math.inf, 0.0
    length, k = r * turn(a.sense * (b.angle - a.angle)), a.sense / r
    p = a.pose
    for o, (x, y, size) in enumerate(circles):
        if o != a.obstacle and distance(p.x, p.y, p.heading, k, length, x, y) < size:
            return math.inf, 0.0
    return length, k


def _link(a: _Touch, b: _Touch, radius: float, circles: Array) -> float:
    """Length of the shortest free link, an arc or a Dubins path."""
    p, q = a.pose, b.pose
    _, length = free_word(p.x, p.y, p.heading, q.x, q.y, q.heading, radius, circles)
    return min(float(length), _arc(a, b, radius, circles)[0])


def _shortest_route(touches: list[_Touch], radius: float, circles: Array) -> list[_Touch] | None:
    from scipy.sparse import csr_matrix
    from scipy.sparse.csgraph import dijkstra

    poses = np.array([[t.pose.x, t.pose.y, t.pose.heading] for t in touches])
    lengths = free_words(poses, radius, circles)
    for o in range(len(circles)):
        for sense in (1.0, -1.0):
            ring = [i for i, t in enumerate(touches) if t.obstacle == o and t.sense == sense]
            for i in ring:
                for j in ring:
                    if i != j:
                        lengths[i, j] = min(lengths[i, j], _arc(touches[i], touches[j], radius, circles)[0])
    lengths[~np.isfinite(lengths)] = 0.0
    # one source as an array: the stubs know no scalar
    distances, predecessors = dijkstra(csr_matrix(lengths), True, np.array([0]), return_predecessors=True)
    far, before = distances[0], predecessors[0]
    if not np.isfinite(far[1]):
        return None
    order = [1]
    while order[-1] != 0:
        order.append(int(before[order[-1]]))
    return [touches[i] for i in reversed(order)]


def _tighten(route: list[_Touch], radius: float, circles: Array, reach: float) -> list[_Touch]:
    """Move the touching points, one after the other, to where the links on both sides are shortest."""
    total = math.inf
    for _ in range(60):
        for i in range(1, len(route) - 1):
            a, now, b = route[i - 1 : i + 2]

            def cost(angle: float, a: _Touch = a, now: _Touch = now, b: _Touch = b) -> float:
                moved = _touch(circles, now.obstacle, now.sense, angle)
                return _link(a, moved, radius, circles) + _link(moved, b, radius, circles)

            angle = _least(cost, now.angle, reach)
            if cost(angle) < cost(now.angle):
                route[i] = _touch(circles, now.obstacle, now.sense, angle)
        # a point that the path no longer needs is taken out
        i = 1
        while i < len(route) - 1:
            direct = _link(route[i - 1], route[i + 1], radius, circles)
            both = _link(route[i - 1], route[i], radius, circles) + _link(route[i], route[i + 1], radius, circles)
            if direct <= both:
                del route[i]
            else:
                i += 1
        length = sum(_link(a, b, radius, circles) for a, b in zip(route[:-1], route[1:], strict=True))
        if total - length < 1e-9 * length:
            break
        total = length
    return route


def _least(cost: Callable[[float], float], middle: float, reach: float) -> float:
    """Least of a function near a point: a coarse grid, then golden sections; infinite values are allowed."""
    grid = middle + reach * np.linspace(-1, 1, 17)
    values = [cost(float(a)) for a in grid]
    k = int(np.argmin(values))
    low, high = grid[max(k - 1, 0)], grid[min(k + 1, 16)]
    golden = (math.sqrt(5) - 1) / 2
    a, b = high - golden * (high - low), low + golden * (high - low)
    fa, fb = cost(float(a)), cost(float(b))
    for _ in range(45):
        if fa <= fb:
            high, b, fb = b, a, fa
            a = high - golden * (high - low)
            fa = cost(float(a))
        else:
            low, a, fa = a, b, fb
            b = low + golden * (high - low)
            fb = cost(float(b))
    best = float(a if fa <= fb else b)
    return best if cost(best) <= min(values) else float(grid[k])


def _as_path(route: list[_Touch], radius: float, circles: Array) -> Path:
    segments: list[Segment] = []
    word = ""
    for a, b in zip(route[:-1], route[1:], strict=True):
        p, q = a.pose, b.pose
        number, length = free_word(p.x, p.y, p.heading, q.x, q.y, q.heading, radius, circles)
        arc, k = _arc(a, b, radius, circles)
        if arc <= length:
            parts, letters = [(arc, k)], "L" if k > 0 else "R"
        else:
            line, far = math.atan2(q.y - p.y, q.x - p.x), math.hypot(q.x - p.x, q.y - p.y)
            _, *sizes = pieces(int(number), far / radius, turn(p.heading - line), turn(q.heading - line))
            letters = WORDS[int(number)]
            parts = [(s * radius, float(e / radius)) for s, e in zip(sizes, SENSES[int(number)], strict=True)]
        at = p
        for letter, (size, curvature) in zip(letters, parts, strict=True):
            if size <= 1e-9 * radius and len(letters) > 1:
                continue
            piece = Segment(at, curvature, float(size))
            at = piece.end
            if segments and word[-1] == letter and segments[-1].curvature == curvature:
                segments[-1] = replace(segments[-1], length=segments[-1].length + piece.length)
            else:
                segments.append(piece)
                word += letter
    return Path(tuple(segments), word)
