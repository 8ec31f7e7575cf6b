"""Point targets in a plane, with clutter: what our trackers and Stone Soup's are given alike."""

from dataclasses import dataclass

import numpy as np

from assoc._types import Array
from assoc.sensors import PositionSensor

SPACING = 150.0
"""Side of the square that a target has to itself on average, metres."""
NOISE, SPEED, ACCELERATION = 10.0, 10.0, 1.0
"""Measurement noise (m), speed along an axis (m/s), process noise (m/s^1.5)."""
DETECTION = 0.9
FAR = 2_000.0
"""Farther beyond the clutter than any target flies, metres."""


@dataclass(frozen=True)
class Plane:
    """One scenario.

    truth: array (K, T, 4). [x, y, vx, vy] at times 0, 1, ..., K - 1 seconds; the trackers know the first with some
        error.
    start: array (T, 4). What they are told of time 0.
    measurements: list over times 1 .. K - 1 of arrays (n, 2).
    """

    sensor: PositionSensor
    truth: Array
    start: Array
    measurements: list[Array]


START_DEVIATION = np.array([NOISE, NOISE, 2.0, 2.0])


def simulate(targets: int, clutter: float, scans: int, seed: int) -> Plane:
    """Simulate a plane; `clutter` is the mean number of false alarms in a scan for each target."""
    rng = np.random.default_rng(seed)
    side = SPACING * np.sqrt(targets)
    field = np.array([[-0.2 * side, 1.2 * side]] * 2)
    state = np.concatenate([rng.uniform(0, side, (targets, 2)), rng.normal(0, SPEED, (targets, 2))], axis=1)
    F = np.kron([[1.0, 1.0], [0.0, 1.0]], np.eye(2))
    root = np.linalg.cholesky(ACCELERATION**2 * np.kron([[1 / 3, 1 / 2], [1 / 2, 1.0]], np.eye(2)))
    # clutter is uniform, the targets' own square has its share
    rate = clutter * targets * 1.4**2
    truth, measurements = [state], []
    for _ in range(scans):
        state = state @ F.T + rng.standard_normal(state.shape) @ root.T
        truth.append(state)
        seen = state[rng.random(targets) < DETECTION, :2]
        false = rng.uniform(field[:, 0], field[:, 1], (rng.poisson(rate), 2))
        z = np.concatenate([seen + rng.normal(0, NOISE, seen.shape), false])
        measurements.append(rng.permutation(z))
    # targets are detected where they have flown out of the clutter, too: our trackers expect no measurement where their
    # sensor does not see, and the others know of no field of view
    seen_field = field + [-FAR, FAR]
    share = np.prod(np.diff(seen_field)) / np.prod(np.diff(field))
    sensor = PositionSensor(
        position=np.zeros(3),
        noise=[NOISE, NOISE],
        detection_probability=DETECTION,
        false_alarm_rate=rate * share,
        field_of_view=seen_field,
    )
    start = truth[0] + rng.standard_normal(truth[0].shape) * START_DEVIATION
    return Plane(sensor, np.stack(truth), start, measurements)
