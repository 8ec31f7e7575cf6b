"""Orders that depend on content, not on memory addresses.

Stone Soup passes sets of objects that hash by identity: their iteration order changes from run to run.
"""

from __future__ import annotations

from collections.abc import Iterable
from datetime import datetime
from typing import Any

import numpy as np


def _numbers(vector: object) -> tuple[float, ...]:
    return tuple(np.asarray(vector, dtype=np.float64).ravel().tolist())


def _time(timestamp: datetime | None) -> tuple[bool, datetime]:
    return timestamp is not None, timestamp or datetime.min


def _detection_key(detection: Any) -> tuple[Any, ...]:
    model = detection.measurement_model
    offset = getattr(model, "translation_offset", None)
    return (
        type(model).__name__,
        () if offset is None else _numbers(offset),
        _numbers(detection.state_vector),
        _time(detection.timestamp),
        type(detection).__name__,
    )


def sorted_detections(detections: Iterable[Any]) -> list[Any]:
    """Detections sorted by measurement model, sensor position, measurement and time."""
    return sorted(detections, key=_detection_key)


def _path_key(path: Any) -> tuple[Any, ...]:
    first, last = path[0], path[-1]
    return (
        _time(first.timestamp),
        _numbers(first.state_vector),
        len(path),
        _time(last.timestamp),
        _numbers(last.state_vector),
    )


def sorted_paths(paths: Iterable[Any]) -> list[Any]:
    """Tracks or ground truth paths sorted by their first and last states."""
    return sorted(paths, key=_path_key)
