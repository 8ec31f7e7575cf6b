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
from assoc.tracking.adapting.folding import with_folding
from assoc.tracking.adapting.residuals import scales
from assoc.tracking.records.estimates import DETECTION, Estimates
from assoc.tracking.settings import TrackerSettings

# a band detects at least this share of what the best one does: tracks of false alarms wait long where misses say little
_LEAST = 0.25
_SCALABLE = (ExtendedKalmanFilter, KalmanFilter, ModifiedEKF)


def in_use(settings: TrackerSettings, estimates: Estimates) -> TrackerSettings:
    """The settings by the estimates in use; the same object while nothing has changed."""
    settings = with_folding(settings)
    declared = Estimates.declared(settings.sensors)
    used, bands = estimates.used, estimates.bands
    alike = np.array_equal(bands, np.broadcast_to(used[:, DETECTION, None], bands.shape))
    if estimates.manoeuvres == 1.0 and alike and np.array_equal(used, declared.used):
        return settings
    return _with(settings, used.tobytes(), None if alike else bands.tobytes(), estimates.manoeuvres)


@lru_cache(maxsize=16)
def _with(settings: TrackerSettings, used: bytes, bands: bytes | None, manoeuvres: float) -> TrackerSettings:
    values, by_range = np.frombuffer(used).reshape(-1, 3).copy(), None
    if bands is not None:
        by_range = np.frombuffer(bands).reshape(len(values), -1)
        # the sensor's is the largest, so that each band detects a share of it
        values[:, DETECTION] = by_range.max(axis=1)
        by_range = np.maximum(by_range / values[:, DETECTION, None], _LEAST)
    sensors = [_seen(*both) for both in zip(settings.sensors, values.tolist(), strict=True)]
    starter = settings.starter
    changed: dict[str, Any] = {"scene": _scene(sensors, settings.scene), "filter": noisier(settings.filter, manoeuvres)}
    changed["by_range"] = by_range
    if starter is not None:
        starter = replace(starter, **changed)
    return replace(settings, **changed, starter=starter)


def _seen(sensor: Sensor, used: Sequence[float]) -> Sensor:
    factor, probability, rate = used
    noise = sensor.noise * (factor**0.5 if sensor.noise.ndim == 1 else factor)
    return replace(sensor, noise=noise, detection_probability=probability, false_alarm_rate=rate)


def _scene(sensors: Sequence[Sensor], scene: Scene) -> Scene:
    empty = [[np.zeros((0, sensor.dim)) for sensor in sensors]]
    return Scene(sensors=sensors, times=np.zeros(1), measurements=empty, region=scene.region)


def noisier(filter: Filter[Any], factor: float) -> Filter[Any]:
    """A filter like this one with `factor` times the process noise's variance.

    Of several models only some, see `scales`. Filters of sigma points, ensembles and fuzzy rules stay as they are.
    """
    if factor == 1.0:
        return filter
    if type(filter) in _SCALABLE:
        return type(filter)(filter.motion.noisier(max(factor, 1.0)))
    if type(filter) is InteractingMultipleModel:
        models: list[Any] = list(filter.filters)
        sizes = np.array([np.trace(model.motion.noise(np.zeros((1, filter.motion.dim)), 1.0)[0]) for model in models])
        made = copy.copy(filter)
        own = scales(np.array([factor]), sizes).tolist()
        made.filters = tuple(
            type(model)(model.motion.noisier(change)) if type(model) in _SCALABLE else model
            for model, change in zip(models, own, strict=True)
        )
        return made
    return filter
