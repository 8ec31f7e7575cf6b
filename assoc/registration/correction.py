"""Biases taken off measurements, or added: of one sensor, of a scene."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from assoc._parameters import is_number
from assoc._system.wrong_types import explains_wrong_types
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.registration.terms import AXES, Term, owners
from assoc.scene.scene import Scene
from assoc.sensors import BearingSensor, PositionSensor, Radar2D, Sensor
from assoc.sensors.base import wrap_angle


def biases_of_sensors(sensors: Sequence[Sensor], terms: Sequence[Term], biases: Array) -> list[dict[str, float]]:
    """Biases of each sensor by component."""
    found: list[dict[str, float]] = [{} for _ in sensors]
    for term, value in zip(terms, biases.tolist(), strict=True):
        found[term.sensor][term.component] = value
    return [found[owner] for owner in owners(sensors)]


def corrected_sensor(sensor: Sensor, biases: Mapping[str, float]) -> Sensor:
    """The sensor, or its platform, at its true position; a `PositionSensor` that stands stays unchanged."""
    offset, platform = np.array([biases.get(axis, 0.0) for axis in AXES]), sensor.platform
    if not offset.any() or (platform is None and isinstance(sensor, PositionSensor)):
        return sensor
    if platform is not None:
        return replace(sensor, platform=replace(platform, positions=platform.positions - offset))
    return replace(sensor, position=sensor.position - offset)


def corrected_measurements(
    sensor: Sensor,
    measured: Array,
    biases: Mapping[str, float],
    velocities: Array | None = None,
    late: Array | float = 0.0,
    positions: Array | None = None,
) -> Array:
    """Measurements (n, d) without the sensor's biases, moved to the time wanted.

    Biases are in metres, radians, seconds; of a gain, metres per metre of the stated range. ``velocities`` (n, 3), m/s,
    are NaN where unknown: the clock's bias then stays. ``late`` is the time wanted less that of each measurement,
    seconds; ``positions`` (n, 3) of the targets are those at that time; without them bearings are not moved.
    """
    z = np.array(measured, dtype=np.float64)
    carried = isinstance(sensor, PositionSensor) and sensor.platform is not None
    for i, component in enumerate(sensor.components[: sensor.dim]):
        # the offset of a position that is measured from a platform is the platform's
        gain = biases.get("gain", 0.0) * z[:, i] if component == "range" else 0.0
        z[:, i] -= gain + (0.0 if carried else biases.get(component, 0.0))
        if sensor.angular[i]:
            z[:, i] = wrap_angle(z[:, i])
    shift = np.broadcast_to(np.asarray(late, dtype=np.float64) + biases.get("time", 0.0), (len(z),))
    blind = isinstance(sensor, BearingSensor)
    if velocities is None or not len(z) or not shift.any() or (blind and positions is None):
        return z
    known = ~np.isnan(velocities[:, 0]) & (shift != 0.0)
    if known.any():
        located = corrected_sensor(sensor, biases).position_part
        d = located.dim
        path = shift[known, None] * velocities[known]
        if blind and positions is not None:
            there = positions[known]
            here = there - path
        else:
            here = pointed_at(located, z[known, :d])
            there = here + path
        moved = z[known]
        moved[:, :d] += located.residual(located.measure(there), located.measure(here))
        z[known] = moved
        for i in range(d):
            if sensor.angular[i]:
                z[:, i] = wrap_angle(z[:, i])
    return z


def pointed_at(sensor: Sensor, z: Array) -> Array:
    """Positions (n, 3) that measurements point at; at the sensor's height where they leave it open."""
    if isinstance(sensor, PositionSensor):
        heights = z[:, 2] if sensor.dim == 3 else np.zeros(len(z))
        return np.stack([z[:, 0], z[:, 1], heights], axis=1)
    elevation = z[:, 2] if sensor.dim >= 3 else np.zeros(len(z))
    if isinstance(sensor, Radar2D):
        above = z[:, 2] - sensor.position[2] if sensor.dim == 3 else 0.0
        elevation = np.arcsin(np.clip(above / np.maximum(z[:, 0], 1.0), -1.0, 1.0))
    ground = z[:, 0] * np.cos(elevation)
    along = [ground * np.cos(z[:, 1]), ground * np.sin(z[:, 1]), z[:, 0] * np.sin(elevation)]
    return sensor.position + np.stack(along, axis=1)


@explains_wrong_types
def with_biases(scene: Scene, biases: Sequence[Mapping[str, float]]) -> Scene:
    """Add biases to the measurements of a scene, for experiments and tests; clocks have none here.

    Parameters
    ----------
    scene : Scene
    biases : sequence over sensors of mappings of component to value
        range, azimuth, elevation, gain, and x, y, z of the stated position; metres, radians, metres per metre.

    Returns
    -------
    Scene

    Raises
    ------
    InvalidInputError
        The number of mappings is wrong, or one names what its sensor does not measure.
    """
    count = len(scene.sensors)
    if len(biases) != count:
        raise InvalidInputError(f"biases: expected one mapping for each of {count} sensors, got {len(biases)}")
    for s, (sensor, values) in enumerate(zip(scene.sensors, biases, strict=True)):
        known = (*AXES, *sensor.components[: sensor.dim], *(["gain"] if "range" in sensor.components else []))
        for name, value in values.items():
            if name not in known or not is_number(value):
                raise InvalidInputError(
                    f"biases of sensor {s}: expected numbers for any of {', '.join(dict.fromkeys(known))}, "
                    f"got {name!r}: {value!r}"
                )
    return without_biases(scene, [{name: -value for name, value in values.items()} for values in biases])


def without_biases(
    scene: Scene, biases: Sequence[Mapping[str, float]], velocities: Sequence[Sequence[Array]] | None = None
) -> Scene:
    """Take biases off the measurements of a scene; see `with_biases`."""
    sensors = [corrected_sensor(sensor, values) for sensor, values in zip(scene.sensors, biases, strict=True)]
    measurements = [
        [
            corrected_measurements(sensor, z, values, None if velocities is None else velocities[k][s])
            for s, (sensor, z, values) in enumerate(zip(scene.sensors, scan, biases, strict=True))
        ]
        for k, scan in enumerate(scene.measurements)
    ]
    return replace(scene, sensors=sensors, measurements=measurements)
