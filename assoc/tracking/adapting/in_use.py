"""The settings of a tracker with what it has learnt in place of what was declared."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from assoc.filters import ExtendedKalmanFilter, InteractingMultipleModel, KalmanFilter, ModifiedEKF
from assoc.filters.base import Filter
from assoc.scene.scene import Scene
from assoc.sensors import Sensor
from assoc.tracking.adapting.estimates import Estimates
from assoc.tracking.settings import TrackerSettings

_SCALABLE = (ExtendedKalmanFilter, KalmanFilter, ModifiedEKF)


def in_use(settings: TrackerSettings, estimates: Estimates) -> TrackerSettings:
    """The settings by the estimates in use; the same object while nothing has changed."""
    declared = Estimates.declared(settings.sensors)
    if estimates.manoeuvres == 1.0 and np.array_equal(estimates.used, declared.used):
        return settings
    return _with(settings, tuple(estimates.used.ravel().tolist()), estimates.manoeuvres)


@lru_cache(maxsize=16)
def _with(settings: TrackerSettings, used: tuple[float, ...], manoeuvres: float) -> TrackerSettings:
    sensors = [_seen(*both) for both in zip(settings.sensors, np.reshape(used, (-1, 3)).tolist(), strict=True)]
    nursery = settings.nursery
    changed: dict[str, Any] = {"place": _place(sensors, settings.place), "filter": noisier(settings.filter, manoeuvres)}
    if nursery is not None:
        nursery = replace(nursery, **changed)
    # registration goes on with the sensors as declared
    return replace(settings, **changed, nursery=nursery, registration=None)


def _seen(sensor: Sensor, used: Sequence[float]) -> Sensor:
    factor, probability, rate = used
    noise = sensor.noise * (factor**0.5 if sensor.noise.ndim == 1 else factor)
    return replace(sensor, noise=noise, detection_probability=probability, false_alarm_rate=rate)


def _place(sensors: Sequence[Sensor], place: Scene) -> Scene:
    empty = [[np.zeros((0, sensor.dim)) for sensor in sensors]]
    return Scene(sensors=sensors, times=np.zeros(1), measurements=empty, region=place.region)


def noisier(filter: Filter[Any], factor: float) -> Filter[Any]:
    """A filter like this one with `factor` times the process noise's variance.

    Of several models only the one that manoeuvres most: the others are for quiet flight. Filters of sigma points,
    ensembles and fuzzy rules stay as they are.
    """
    if factor == 1.0:
        return filter
    if type(filter) in _SCALABLE:
        return type(filter)(filter.motion.noisier(factor))
    if type(filter) is InteractingMultipleModel:
        models: list[Any] = list(filter.filters)
        origin = np.zeros((1, filter.motion.dim))
        most = int(np.argmax([np.trace(model.motion.noise(origin, 1.0)[0]) for model in models]))
        models[most] = noisier(models[most], factor)
        made = copy.copy(filter)
        made.filters = tuple(models)
        return made
    return filter
