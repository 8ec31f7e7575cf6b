"""Dubins paths: the shortest paths between two positions with headings that a vehicle with a turning radius has.

Six words of three pieces, L and R for turns and S for straight: LSL RSR LSR RSL RLR LRL. Headings are radians
from +x towards +y, lengths metres.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from assoc._system import memory
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.sensors.arrays import finite_array
from assoc.simulation.dubins.kernels import SENSES, WORDS, advance, distance, pieces, turn

# bytes of a sample, measured
_SAMPLE = 500


@dataclass(frozen=True)
class Pose:
    """A position in the plane (m) and a heading (rad from +x towards +y)."""

    x: float
    y: float
    heading: float

    def __post_init__(self) -> None:
        values = finite_array([self.x, self.y, self.heading], "pose", (3,))
        # whole numbers would have kernels compiled of their own
        for name, value in zip(("x", "y", "heading"), values.tolist(), strict=True):
            object.__setattr__(self, name, value)


@dataclass(frozen=True)
class Segment:
    """A piece of a path: straight (curvature 0) or an arc (1/m, positive to the left)."""

    start: Pose
    curvature: float
    length: float

    def at(self, s: float) -> Pose:
        """Return the pose s metres along the piece."""
        p = self.start
        return Pose(*advance(p.x, p.y, p.heading, self.curvature, float(s)))

    @property
    def end(self) -> Pose:
        """Where the piece ends."""
        return self.at(self.length)

    def distance(self, x: float, y: float) -> float:
        """Least distance of a point from the piece, m."""
        p = self.start
        return float(distance(p.x, p.y, p.heading, self.curvature, self.length, float(x), float(y)))


@dataclass(frozen=True)
class Path:
    """A path of pieces that join without kinks; `word` has L, S and R in the order of the pieces."""

    segments: tuple[Segment, ...]
    word: str

    @property
    def length(self) -> float:
        """Length, m."""
        return sum(segment.length for segment in self.segments)

    def at(self, s: float) -> Pose:
        """Return the pose s metres along the path."""
        for segment in self.segments[:-1]:
            if s <= segment.length:
                return segment.at(s)
            s -= segment.length
        return self.segments[-1].at(s)

    def sample(self, speed: float, interval: float) -> tuple[Array, Array]:
        """Sample at constant speed (m/s): times (K,) in s, and x, y, heading (K, 3); the end is the last sample."""
        for name, value in (("speed", speed), ("interval", interval)):
            if not (math.isfinite(value) and value > 0):
                raise InvalidInputError(f"{name} must be a number above 0, got {value!r}")
        duration = self.length / speed
        memory.require(
            _SAMPLE * duration / interval, f"{duration / interval:.3g} samples of a path", "lengthen the interval"
        )
        times = np.arange(0.0, duration, interval)
        if not len(times) or duration - times[-1] > 1e-9 * duration:
            times = np.append(times, duration)
        poses = [self.at(min(t * speed, self.length)) for t in times]
        return times, np.array([[p.x, p.y, p.heading] for p in poses])

    def clearance(self, obstacles: Sequence[tuple[float, float, float]]) -> float:
        """Least distance from circular obstacles (x, y, radius), m; negative inside one."""
        return min(
            (segment.distance(x, y) - r for x, y, r in obstacles for segment in self.segments),
            default=math.inf,
        )


def positive_radius(radius: float) -> float:
    """Return a turning radius above 0."""
    if isinstance(radius, bool) or not (math.isfinite(radius) and radius > 0):
        raise InvalidInputError(f"radius must be a number above 0, got {radius!r}")
    return float(radius)


def path(start: Pose, goal: Pose, radius: float, word: str) -> Path | None:
    """Return the path of one of the `WORDS`, or None where the word has none; the turning radius is in m.

    A. M. Shkel and V. Lumelsky, Classification of the Dubins set, 2001.
    """
    if word not in WORDS:
        raise InvalidInputError(f"word must be one of {', '.join(WORDS)}, got {word!r}")
    radius = positive_radius(radius)
    dx, dy = goal.x - start.x, goal.y - start.y
    line = math.atan2(dy, dx)
    number = WORDS.index(word)
    far = math.hypot(dx, dy)
    known, *sizes = pieces(number, far / radius, turn(start.heading - line), turn(goal.heading - line))
    if not known:
        return None
    segments, at = [], start
    for sense, size in zip(SENSES[number], sizes, strict=True):
        segments.append(Segment(at, float(sense / radius), float(size * radius)))
        at = segments[-1].end
    # where rounding decides whether circles touch, a formula may miss the goal
    if math.hypot(at.x - goal.x, at.y - goal.y) > 1e-6 * (radius + far):
        return None
    return Path(tuple(segments), word)


def paths(start: Pose, goal: Pose, radius: float) -> list[Path]:
    """Return the paths of all words that have one, shortest first."""
    found = [known for word in WORDS if (known := path(start, goal, radius, word)) is not None]
    return sorted(found, key=lambda known: known.length)


def shortest(start: Pose, goal: Pose, radius: float) -> Path:
    """Return the shortest path between two poses with a turning radius (m)."""
    return paths(start, goal, radius)[0]
