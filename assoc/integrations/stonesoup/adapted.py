"""Stone Soup's sensors and measurement models as our sensors."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from stonesoup.models.measurement import MeasurementModel
from stonesoup.models.measurement.linear import LinearGaussian
from stonesoup.models.measurement.nonlinear import (
    Cartesian2DToBearing,
    CartesianToBearingRange,
    CartesianToElevationBearingRange,
)

from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.integrations.stonesoup.models import CartesianToSlantRangeBearing
from assoc.sensors import BearingSensor, PositionSensor, Radar2D, Radar3D, Sensor
from assoc.sensors.base import wrap_angle

# Stone Soup's model -> our sensor, and the indices of our components in its measurement; exact types, because
# subclasses such as the binned range-rate radar measure something else
_KNOWN: dict[type, tuple[type[Sensor], tuple[int, ...]]] = {
    CartesianToElevationBearingRange: (Radar3D, (2, 1, 0)),
    CartesianToSlantRangeBearing: (Radar2D, (1, 0)),
    CartesianToBearingRange: (Radar2D, (1, 0)),
    Cartesian2DToBearing: (BearingSensor, (0,)),
}


@dataclass(frozen=True, eq=False)
class AdaptedSensor:
    """A measurement model of Stone Soup and the corresponding sensor; made by `adapt`.

    Attributes
    ----------
    model : stonesoup.models.measurement.MeasurementModel
    sensor : Sensor
        Its azimuths are in the scene's frame.
    order : tuple of int
        Index of each of our components in Stone Soup's measurement.
    turn : float
        Added to a bearing so that it counts from +x, rad.
    mapping : tuple of int
        Indices of x, y (and z, if heights are measured) in the state.
    """

    model: MeasurementModel
    sensor: Sensor
    order: tuple[int, ...]
    turn: float
    mapping: tuple[int, ...]

    @property
    def measures_height(self) -> bool:
        """Whether it measures heights."""
        return len(self.mapping) == 3

    def measurement(self, state_vector: ArrayLike) -> Array:
        """Convert a Stone Soup measurement to ours, shape (d,)."""
        z = np.asarray(state_vector, dtype=np.float64).ravel()[list(self.order)]
        angular = list(self.sensor.angular[: len(z)])
        z[angular] = wrap_angle(z[angular] + self.turn)
        return z

    def measured(self, detection: Any) -> bool:
        """Whether a detection is of this sensor: by name if both have one, else by its model."""
        named = detection.metadata.get("sensor") if detection.metadata else None
        if named is not None and self.sensor.name:
            return bool(named == self.sensor.name)
        return model_key(detection.measurement_model) == model_key(self.model)

    def __repr__(self) -> str:
        return f"AdaptedSensor({type(self.model).__name__}: {self.sensor!r})"


def model_key(model: Any) -> tuple[Any, ...]:
    """Content of a measurement model, to compare it; sensors of Stone Soup make a new model for each scan."""

    def numbers(value: object) -> tuple[float, ...]:
        return () if value is None else tuple(np.asarray(value, dtype=np.float64).ravel().tolist())

    return (
        type(model),
        getattr(model, "ndim_state", None),
        tuple(getattr(model, "mapping", ())),
        *(numbers(getattr(model, name, None)) for name in ("translation_offset", "rotation_offset", "noise_covar")),
    )


def adapt(
    source: Any,
    *,
    detection_probability: float = 0.9,
    false_alarm_rate: float | None = None,
    max_range: float | None = None,
    field_of_view: ArrayLike | None = None,
    name: str = "",
) -> AdaptedSensor:
    """Convert a Stone Soup sensor or measurement model.

    Other properties that the costs need are given here.

    Parameters
    ----------
    source : stonesoup.sensor.sensor.Sensor or stonesoup.models.measurement.MeasurementModel
        One of ``CartesianToElevationBearingRange``, ``CartesianToBearingRange`` (in the plane),
        ``Cartesian2DToBearing``, ``LinearGaussian`` of positions, ``CartesianToSlantRangeBearing``, or a
        sensor with such a model. It may be turned about the z axis.
    detection_probability : float, default 0.9
    false_alarm_rate : float, optional
        Mean number of false alarms per scan; by default the rate of the sensor's clutter model, else 1.
    max_range : float, optional
        Metres; by default that of the sensor.
    field_of_view : array_like (d, 2), optional
        Bounds in our order (range, azimuth, elevation), azimuths counted from +x. By default all directions
        up to ``max_range``. Needed for ``LinearGaussian``: the area in which false alarms occur.
    name : str, optional
        Needed if models of sensors are equal: detections then carry it in ``metadata["sensor"]``.

    Returns
    -------
    AdaptedSensor

    Raises
    ------
    InvalidInputError
        An unsupported measurement model, a tilted sensor, or no field of view.
    """
    model = getattr(source, "measurement_model", None) or source
    if max_range is None:
        max_range = getattr(source, "max_range", None)
    if false_alarm_rate is None:
        clutter = getattr(source, "clutter_model", None)
        false_alarm_rate = 1.0 if clutter is None else float(clutter.clutter_rate)
    position, turn = _place(model)
    options: dict[str, Any] = {
        "position": position,
        "detection_probability": float(detection_probability),
        "false_alarm_rate": false_alarm_rate,
        "name": name,
    }
    mapping = tuple(int(i) for i in getattr(model, "mapping", ()))
    if type(model) is LinearGaussian:
        if len(mapping) not in (2, 3):
            raise InvalidInputError(f"LinearGaussian: expected a mapping of x, y or x, y, z, got {mapping}")
        kind: type[Sensor] = PositionSensor
        order = tuple(range(len(mapping)))
    elif type(model) in _KNOWN:
        kind, order = _KNOWN[type(model)]
        if kind is BearingSensor or type(model) is CartesianToBearingRange:
            mapping = mapping[:2]
    else:
        known = ", ".join(kind.__name__ for kind in (*_KNOWN, LinearGaussian))
        raise InvalidInputError(f"measurement model {type(model).__name__} is not known here; known: {known}")
    noise = np.asarray(model.covar(), dtype=np.float64)[np.ix_(order, order)]
    options["field_of_view"] = _full_view(kind, len(order), max_range) if field_of_view is None else field_of_view
    sensor = kind(noise=noise, **options)
    return AdaptedSensor(model, sensor, order, turn, mapping)


def _place(model: Any) -> tuple[Array, float]:
    """Position (3,) and turn about z of a model."""
    position = np.zeros(3)
    offset = np.asarray(getattr(model, "translation_offset", np.zeros(0)), dtype=np.float64).ravel()
    position[: min(len(offset), 3)] = offset[:3]
    rotation = np.asarray(getattr(model, "rotation_offset", np.zeros(3)), dtype=np.float64).ravel()
    if rotation[:2].any():
        raise InvalidInputError(
            f"{type(model).__name__}: the sensor is tilted by {rotation[:2].tolist()} rad about x and y; "
            "expected a rotation_offset about z alone"
        )
    return position, float(rotation[2])


def _full_view(kind: type[Sensor], dim: int, max_range: float | None) -> Array | None:
    if kind is BearingSensor:
        return None
    if kind is PositionSensor:
        raise InvalidInputError("field_of_view: expected bounds of x, y (and z) for a LinearGaussian model")
    if max_range is None or not math.isfinite(max_range):
        raise InvalidInputError("max_range: expected a finite range in metres (or give field_of_view)")
    view = [(0.0, float(max_range)), (-math.pi, math.pi), (-math.pi / 2, math.pi / 2)]
    return np.array(view[:dim])
