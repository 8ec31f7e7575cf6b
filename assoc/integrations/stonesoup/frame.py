"""Sensors of Stone Soup that observe one state space together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from stonesoup.models.measurement.nonlinear import CartesianToBearingRange

from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.integrations.stonesoup.adapted import AdaptedSensor, model_key
from assoc.sensors import Sensor


@dataclass(frozen=True, eq=False)
class Frame:
    """Sensors that measure the same state space, and the position's indices in it."""

    adapted: tuple[AdaptedSensor, ...]
    sensors: tuple[Sensor, ...]
    """As a scene takes them: in the plane if none of them measures heights."""
    ndim_state: int
    mapping: tuple[int, ...]
    """Indices of x, y or x, y, z in the state."""

    @property
    def planar(self) -> bool:
        """Whether heights are not measured."""
        return len(self.mapping) == 2

    def split(self, detections: Sequence[Any]) -> list[list[Any]]:
        """Group detections by sensor, keeping their order; one of none of the sensors is refused."""
        parts: list[list[Any]] = [[] for _ in self.adapted]
        for detection in detections:
            home = next((s for s, sensor in enumerate(self.adapted) if sensor.measured(detection)), None)
            if home is None:
                raise InvalidInputError(
                    f"a detection at {detection.timestamp} is of none of the {len(parts)} sensors: its "
                    f"{type(detection.measurement_model).__name__} differs in position, rotation, noise or mapping "
                    "(sensors that move are not supported)"
                )
            parts[home].append(detection)
        return parts

    def measurements(self, parts: Sequence[Sequence[Any]]) -> tuple[Array, ...]:
        """Measurements of a scan as in a scene, one array (n, d) for each sensor."""
        return tuple(
            np.array([item.measurement(d.state_vector) for d in part]).reshape(len(part), item.sensor.dim)
            for item, part in zip(self.adapted, parts, strict=True)
        )


def make_frame(adapted: Sequence[AdaptedSensor]) -> Frame:
    """Check that sensors are compatible, and join them.

    Refused are no sensor, two equal ones without names, different state spaces, and ground ranges together with
    heights.
    """
    if not adapted:
        raise InvalidInputError("sensors: expected at least one")
    for s, item in enumerate(adapted):
        if not isinstance(item, AdaptedSensor):
            raise InvalidInputError(f"sensors: number {s} is a {type(item).__name__}, expected adapt(sensor, ...)")
        for other in adapted[:s]:
            alike = model_key(item.model) == model_key(other.model)
            if alike and (not item.sensor.name or item.sensor.name == other.sensor.name):
                raise InvalidInputError(
                    f"sensors: number {s} has the same measurement model as another; give each a name of its own "
                    'and set it as metadata["sensor"] of the detections'
                )
    states = {(sensor.model.ndim_state, sensor.mapping[:2]) for sensor in adapted}
    heights = {sensor.mapping[2] for sensor in adapted if sensor.measures_height}
    if len(states) > 1 or len(heights) > 1:
        raise InvalidInputError("sensors: their measurement models differ in ndim_state or in the mapping of x, y, z")
    sensors = [sensor.sensor for sensor in adapted]
    if heights and any(type(sensor.model) is CartesianToBearingRange for sensor in adapted):
        raise InvalidInputError(
            "sensors: CartesianToBearingRange measures the range on the ground and cannot be combined with "
            "sensors that measure heights; use CartesianToSlantRangeBearing"
        )
    if not heights:
        sensors = [replace(sensor, position=sensor.position * (1.0, 1.0, 0.0)) for sensor in sensors]
    (ndim_state, plane) = states.pop()
    return Frame(tuple(adapted), tuple(sensors), ndim_state, (*plane, *heights))
