"""Reports of sensors: detections with noise, misses, and false alarms."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from assoc._system.wrong_types import explains_wrong_types
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.scene.scene import Scene
from assoc.scene.truth import Truth
from assoc.sensors.arrival_time import ArrivalTimeSensor
from assoc.sensors.base import Sensor, wrap_angle
from assoc.simulation.memory import require_scene_memory


@explains_wrong_types
def observe(
    sensors: Sequence[Sensor],
    times: Array,
    target_ids: Sequence[Array],
    positions: Sequence[Array],
    rng: np.random.Generator,
    *,
    region: Array | None = None,
    name: str = "",
    velocities: Sequence[Array] | None = None,
    emission_times: Sequence[Array] | None = None,
) -> Scene:
    """Let sensors observe targets.

    A target in a sensor's field of view is detected with probability P_d and measured with Gaussian noise.
    The number of false alarms is Poisson; they are uniform over the field of view in measurement space,
    which is the clutter density r / V of the costs. The order within a scan is random.

    Parameters
    ----------
    sensors : sequence of Sensor
        Also on platforms.
    times : array (K,)
        Time stamps, seconds.
    target_ids : sequence over scans of int arrays (T_k,)
    positions : sequence over scans of arrays (T_k, 3)
        Where the targets are, metres.
    rng : numpy.random.Generator
        The only source of randomness.
    region, name
        As in `assoc.Scene`.
    velocities : sequence over scans of arrays (T_k, 3), optional
        Of the targets, m/s, for sensors that measure range rate. Left out, they are differences of a target's
        positions from scan to scan, 0 of one that is seen in a single scan.
    emission_times : sequence over scans of arrays (T_k,), optional
        When the targets emit what an `ArrivalTimeSensor` hears, seconds; left out, at 0.

    Returns
    -------
    Scene
        With truth: ids, positions, and the source of each measurement.

    Raises
    ------
    LimitExceededError
        The scene would take more memory than there is.
    """
    rate = max((float(sensor.false_alarm_rate) for sensor in sensors), default=0.0)
    present = max((len(ids) for ids in target_ids), default=0)
    require_scene_memory(len(times), len(sensors), present, rate, "scans sensors targets false_alarm_rate")
    if len(target_ids) != len(times):
        raise InvalidInputError(f"target_ids: {len(target_ids)} scans, but times has {len(times)}")
    _require_rows(positions, target_ids, "positions")
    if velocities is not None:
        _require_rows(velocities, target_ids, "velocities")
    if emission_times is not None and [len(part) for part in emission_times] != [len(ids) for ids in target_ids]:
        raise InvalidInputError("emission_times: expected one for each target of each scan")
    measurements: list[list[Array]] = []
    sources: list[list[Array]] = []
    if velocities is None and any(sensor.measures_velocity for sensor in sensors):
        velocities = velocities_from(times, target_ids, positions)
    moving = velocities if velocities is not None else [np.zeros((len(ids), 3)) for ids in target_ids]
    emitted = emission_times if emission_times is not None else [np.zeros(len(ids)) for ids in target_ids]
    stamps = np.asarray(times).tolist()
    for time, ids, points, speeds, waves in zip(stamps, target_ids, positions, moving, emitted, strict=True):
        seen = np.asarray(ids), np.asarray(points), np.asarray(speeds), np.asarray(waves)
        scan = [_on_board(sensor, time, *_report(sensor.at(time), *seen, rng)) for sensor in sensors]
        measurements.append([values for values, _ in scan])
        sources.append([source for _, source in scan])
    truth = Truth(target_ids, positions, sources)
    return Scene(sensors, times, measurements, region, truth, name)  # type: ignore[arg-type]


def _require_rows(given: Sequence[Array], target_ids: Sequence[Array], what: str) -> None:
    if len(given) != len(target_ids):
        raise InvalidInputError(f"{what}: {len(given)} scans, but target_ids has {len(target_ids)}")
    for k, (rows, ids) in enumerate(zip(given, target_ids, strict=True)):
        if (len(ids) or np.size(rows)) and np.shape(rows) != (len(ids), 3):
            raise InvalidInputError(f"{what} of scan {k} must have shape ({len(ids)}, 3), got {np.shape(rows)}")


def velocities_from(times: Array, target_ids: Sequence[Array], positions: Sequence[Array]) -> list[Array]:
    """Velocities (T_k, 3), m/s, of targets whose positions alone are known, by differences from scan to scan.

    Central differences between neighbouring scans, one-sided at the ends of a target's presence; across its absence
    only of one that is there for a single scan.
    """
    scan = np.repeat(np.arange(len(times)), [len(ids) for ids in target_ids])
    if not len(scan):
        return [np.zeros((0, 3)) for _ in times]
    target = np.concatenate([np.asarray(ids) for ids in target_ids])
    point = np.concatenate([np.reshape(part, (-1, 3)) for part in positions])
    when = np.asarray(times, dtype=np.float64)[scan]
    order = np.lexsort((scan, target))
    # of a target's rows, side by side in time, the neighbours; the row itself where there is none
    same = target[order][1:] == target[order][:-1]
    # not across a gap, but for a row with a gap on both sides
    close = same & (np.diff(scan[order]) == 1)
    lonely = ~(np.append(False, close) | np.append(close, False))
    back, on = close | (same & lonely[1:]), close | (same & lonely[:-1])
    before, after = order.copy(), order.copy()
    before[1:][back], after[:-1][on] = order[:-1][back], order[1:][on]
    apart = when[after] - when[before]
    rate = (point[after] - point[before]) / np.where(apart > 0, apart, 1.0)[:, None]
    velocity = np.zeros_like(point)
    velocity[order] = np.where(apart[:, None] > 0, rate, 0.0)
    return np.split(velocity, np.cumsum([len(ids) for ids in target_ids])[:-1])


def _on_board(sensor: Sensor, time: float, values: Array, source: Array) -> tuple[Array, Array]:
    """Measurements of a sensor as it stands, and their sources, as its platform sees them."""
    if sensor.platform is None:
        return values, source
    values = sensor.aligned(values, np.full(len(values), time), back=True)
    # the box around a turned field of view is wider
    kept = sensor.in_view(values) | (source >= 0)
    return values[kept], source[kept]


def resolved(sensor: Sensor, exact: Array, when: Array, turn: float, rng: np.random.Generator) -> tuple[Array, Array]:
    """Which of n detected targets give a measurement, and what it is moved by: of those not resolved, the strongest.

    Targets closer than the sensor's resolution to one of them in all components of `exact` (n, d), and seen less than
    half a `turn` apart, give one measurement, at their mean weighted by echoes of exponential strength.
    """
    shift, kept = np.zeros(exact.shape), np.ones(len(exact), dtype=np.bool_)
    if sensor.resolution is None:
        return kept, shift
    free = kept.copy()
    for i in range(len(exact)):
        if not free[i]:
            continue
        off = sensor.residual(exact, np.broadcast_to(exact[i], exact.shape))
        close = free & (np.abs(off) < sensor.resolution).all(axis=1) & (np.abs(when - when[i]) < 0.5 * turn)
        group = np.flatnonzero(close)
        if len(group) < 2:
            continue
        strength = rng.exponential(size=len(group))
        first = group[int(strength.argmax())]
        free[group], kept[group], kept[first] = False, False, True
        shift[first] = strength @ off[group] / strength.sum() - off[first]
    return kept, shift


def _report(
    sensor: Sensor, ids: Array, positions: Array, velocities: Array, emitted: Array, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Measurements (n, d) of one sensor in one scan, and the source (n,) of each."""
    points = positions.reshape(-1, 3)
    exact = sensor.measure(points, velocities.reshape(-1, 3)) if sensor.measures_velocity else sensor.measure(points)
    if isinstance(sensor, ArrivalTimeSensor):
        exact = exact + emitted[:, None]
    detected = (rng.random(len(ids)) < sensor.detection_probability) & sensor.sees(exact)
    factor = np.linalg.cholesky(sensor.covariance)
    hits = exact[detected] + rng.standard_normal((int(detected.sum()), sensor.dim)) @ factor.T
    kept, shift = resolved(sensor, exact[detected], np.zeros(int(detected.sum())), 1.0, rng)
    hits, ids = (hits + shift)[kept], ids[detected][kept]
    low, high = sensor.field_of_view[:, 0], sensor.field_of_view[:, 1]
    clutter = rng.uniform(low, high, size=(int(rng.poisson(sensor.false_alarm_rate)), sensor.dim))
    values = np.concatenate([hits, clutter])
    for axis in range(sensor.dim):
        if sensor.angular[axis]:
            values[:, axis] = wrap_angle(values[:, axis])
    source = np.concatenate([ids, np.full(len(clutter), -1)]).astype(np.int64)
    order = rng.permutation(len(values))
    return sensor.folded(values)[order], source[order]
