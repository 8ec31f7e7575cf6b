"""Flights of airliners: level turns between straight legs, and slow climbs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from assoc._types import Array

STEP = 0.25
"""Seconds from point to point of a path; between them it is straight."""


class Turn(NamedTuple):
    """A turn from a start (s) on, at a rate (rad/s, left is positive), until the heading has changed by an angle."""

    start: float
    rate: float
    duration: float


@dataclass(frozen=True, eq=False)
class Flight:
    """An aircraft at constant speed, m/s: at time 0 at `position` (2,) and `height`, metres."""

    position: Array
    heading: float
    """From +x towards +y, radians."""
    speed: float
    height: float
    climb: float = 0.0
    """m/s, until `level` (metres) is reached."""
    level: float = 0.0
    turns: Sequence[Turn] = ()

    def path(self, duration: float) -> tuple[Array, Array, Array]:
        """Times (K,), positions (K, 3) and velocities (K, 3) in fine steps from 0 to a duration in seconds."""
        times = STEP * np.arange(math.ceil(duration / STEP) + 1)
        heading = np.full(len(times), self.heading)
        for turn in self.turns:
            heading += turn.rate * np.clip(times - turn.start, 0.0, turn.duration)
        flat = self.speed * np.stack([np.cos(heading), np.sin(heading)], axis=1)
        moved = np.concatenate([np.zeros((1, 2)), np.cumsum((flat[1:] + flat[:-1]) / 2 * STEP, axis=0)])
        height = self.height + self.climb * times
        if self.climb:
            bound = np.minimum if self.climb > 0 else np.maximum
            height = bound(height, self.level)
        positions = np.column_stack([self.position + moved, height])
        return times, positions, np.column_stack([flat, np.gradient(height, STEP)])


def random_flight(rng: np.random.Generator, nearest: float, farthest: float, duration: float) -> Flight:
    """Draw a flight that begins between two distances from the origin (m), uniform over the area.

    Speeds are 180 to 260 m/s. Half of the flights turn, once or twice, by 15 to 60 degrees at 0.5 to 1.5 deg/s; half
    of them climb or descend at 5 to 10 m/s from one level to another.
    """
    distance = math.sqrt(rng.uniform(nearest**2, farthest**2))
    azimuth = rng.uniform(-math.pi, math.pi)
    turns = []
    for _ in range(int(rng.choice([0, 0, 1, 2]))):
        rate = math.radians(rng.uniform(0.5, 1.5)) * rng.choice([-1.0, 1.0])
        angle = math.radians(rng.uniform(15.0, 60.0))
        turns.append(Turn(rng.uniform(0.1, 0.8) * duration, rate, angle / abs(rate)))
    height, level = 304.8 * rng.integers(15, 40, 2)
    climb = rng.uniform(5.0, 10.0) * np.sign(level - height) * rng.integers(0, 2)
    return Flight(
        position=distance * np.array([math.cos(azimuth), math.sin(azimuth)]),
        heading=rng.uniform(-math.pi, math.pi),
        speed=rng.uniform(180.0, 260.0),
        height=float(height),
        climb=float(climb),
        level=float(level),
        turns=turns,
    )
