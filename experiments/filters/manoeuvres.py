"""Manoeuvring targets seen by one radar: scenarios C to H, and random ones for tuning."""

import math
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from assoc._types import Array
from assoc.filters import FixedLagSmoother, Gaussian
from assoc.filters.base import Filter
from assoc.sensors import Radar3D
from experiments.filters.b1 import converted, radar_of

GRAVITY = 9.81
RANGE_NOISE = 50.0
RAW_RMSE = 89.7
"""Of the measured positions, metres; the angles' noise follows from it."""


@dataclass(frozen=True)
class Turn:
    """A horizontal turn from `start` to `end` (s) at `g` times gravity, positive to the left, and a climb."""

    start: float
    end: float
    g: float
    climb: float = 0.0


@dataclass(frozen=True)
class Flight:
    """A flight at constant horizontal speed with turns; the defaults are those of scenarios C and D."""

    turns: tuple[Turn, ...]
    position: tuple[float, float, float] = (30_000.0, 20_000.0, 3_000.0)
    speed: float = 250.0
    heading: float = math.radians(215.0)
    steps: int = 100

    def positions(self) -> Array:
        """Positions at each second, (steps + 1, 3), exact to the sum of arcs of 0.01 s."""
        fine = 100
        t = np.arange(self.steps * fine) / fine
        rate, climb = np.zeros(len(t)), np.zeros(len(t))
        for turn in self.turns:
            inside = (t >= turn.start) & (t < turn.end)
            rate[inside] = turn.g * GRAVITY / self.speed
            climb[inside] = turn.climb
        dt = 1.0 / fine
        middle = self.heading + np.cumsum(rate) * dt - 0.5 * rate * dt
        velocity = np.stack([self.speed * np.cos(middle), self.speed * np.sin(middle), climb], axis=1)
        path = np.concatenate([np.zeros((1, 3)), np.cumsum(velocity * dt, axis=0)])
        return np.array(self.position) + path[::fine]


SCENARIOS: dict[str, Flight] = {
    "C": Flight((Turn(40, 55, 1.0),)),
    "D": Flight((Turn(25, 40, 2.0), Turn(60, 75, -2.0, 30.0))),
    "E": Flight((Turn(20, 32, 4.0), Turn(45, 57, -4.0), Turn(70, 80, 4.0)), speed=350.0),
}
"""Chosen by us. The tuning never sees them; but the structure of the tuned filter was chosen while looking at them."""

NEW_SCENARIOS: dict[str, Flight] = {
    "F": Flight(
        (Turn(10.1, 27.9, 2.65, -32.5), Turn(48.5, 61.8, 1.41, 28.6)),
        (-26_440.0, 11_090.0, 2_210.0), 217.0, math.radians(14.0),
    ),
    "G": Flight((Turn(33.7, 44.9, 0.67),), (23_240.0, 23_470.0, 4_080.0), 305.0, math.radians(278.0)),
    "H": Flight(
        (Turn(15.8, 24.7, -3.38), Turn(33.7, 47.2, 3.4)),
        (25_240.0, 18_070.0, 6_370.0), 376.0, math.radians(226.0),
    ),
}  # fmt: skip
EVERY_SCENARIO = {**SCENARIOS, **NEW_SCENARIOS}
"""Drawn once (`random_flights(3, np.random.default_rng(20_261_122))`, rounded) and written down when everything else
was settled: nothing was tuned or chosen on them."""


def random_flights(count: int, rng: np.random.Generator) -> list[Flight]:
    """Draw flights for tuning: other places, speeds, headings, and one to three turns of 0.5 to 4.5 g."""
    flights = []
    for _ in range(count):
        turns, t = [], rng.uniform(10, 35)
        for _ in range(rng.integers(1, 4)):
            length = rng.uniform(8, 18)
            g = rng.uniform(0.5, 4.5) * rng.choice([-1, 1])
            turns.append(Turn(t, t + length, float(g), float(rng.choice([0.0, rng.uniform(-40, 40)]))))
            t += length + rng.uniform(8, 25)
        bearing, distance = rng.uniform(-math.pi, math.pi), rng.uniform(25_000, 45_000)
        flights.append(
            Flight(
                tuple(turns),
                (distance * math.cos(bearing), distance * math.sin(bearing), rng.uniform(2_000, 8_000)),
                float(rng.uniform(200, 380)),
                float(bearing + math.pi + rng.uniform(-1.2, 1.2)),
            )
        )
    return flights


@dataclass(frozen=True)
class Batch:
    """Runs of one or several flights: truth (K, runs, 3), measured (K, runs, 3), one radar noise for each."""

    truth: Array
    measured: Array
    radar: Radar3D

    @classmethod
    def draw(cls, flights: list[Flight], runs: int, rng: np.random.Generator) -> Self:
        """Draw `runs` runs of each flight; the angle noise makes the raw RMSE 89.7 m on average."""
        truth = np.repeat(np.stack([f.positions() for f in flights], axis=1), runs, axis=1)
        flat2 = (truth[..., :2] ** 2).sum(axis=-1)
        spread = flat2 + (truth**2).sum(axis=-1)
        angle = math.sqrt((RAW_RMSE**2 - RANGE_NOISE**2) / spread.mean())
        radar = radar_of([RANGE_NOISE, angle, angle])
        exact = radar.measure(truth.reshape(-1, 3)).reshape(truth.shape)
        return cls(truth, exact + rng.standard_normal(exact.shape) * radar.noise, radar)

    def start(self, dim: int) -> Gaussian:
        """Two-point start; all else is 0: accelerations +- 20 m/s^2, jerks +- 10 m/s^3, a turn rate +- 0.1 rad/s."""
        R = self.radar.covariance
        (p0, s0), (p1, s1) = (converted(z, R) for z in self.measured[:2])
        B = len(p0)
        mean, P = np.zeros((B, dim)), np.zeros((B, dim, dim))
        mean[:, :3], mean[:, 3:6] = p1, p1 - p0
        P[:, :3, :3] = s1
        P[:, :3, 3:6] = P[:, 3:6, :3] = s1
        P[:, 3:6, 3:6] = s0 + s1 + 100.0 * np.eye(3)
        extra = {6: (), 7: (0.1**2,), 9: (400.0,) * 3, 12: (400.0,) * 3 + (100.0,) * 3}[dim]
        for i, variance in enumerate(extra):
            P[:, 6 + i, 6 + i] = variance
        return Gaussian(mean, P)

    @property
    def raw(self) -> float:
        """RMSE of the measured positions, m."""
        error = converted(self.measured.reshape(-1, 3), self.radar.covariance)[0] - self.truth.reshape(-1, 3)
        return float(np.sqrt((error**2).sum(axis=1).mean()))


def errors(filter_: Filter[Any], batch: Batch) -> Array:
    """Squared position errors (K - 2, runs), m^2."""
    state = filter_.start(batch.start(filter_.motion.dim))
    result = []
    for k in range(2, len(batch.truth)):
        state = filter_.predict(state, 1.0)
        state = filter_.update(state, batch.measured[k], batch.radar).state
        result.append(((state.mean[:, :3] - batch.truth[k]) ** 2).sum(axis=1))
    return np.array(result)


def smoothed_errors(filter_: Filter[Any], batch: Batch, lag: int) -> Array:
    """Squared position errors (K - 2, runs) of estimates that wait for `lag` further measurements, m^2."""
    smoother = FixedLagSmoother(filter_, lag)
    window = smoother.start(batch.start(filter_.motion.dim))
    result = []
    for k in range(2, len(batch.truth)):
        window = smoother.predict(window, 1.0)
        window, _ = smoother.update(window, batch.measured[k], batch.radar)
        old = window.smoothed()
        last = k == len(batch.truth) - 1
        first = k - len(old) + 1
        ready = old if last else old[:1] if len(old) == lag + 1 else []
        for i, state in enumerate(ready):
            if first + i >= 2:
                result.append(((state.mean[:, :3] - batch.truth[first + i]) ** 2).sum(axis=1))
    return np.array(result)
