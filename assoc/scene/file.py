"""The layout of a scene file: flat arrays in an npz, documented in docs/formats.md."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from assoc._files.npz import FLOOR, Field, load_npz, save_npz
from assoc._files.reading import check_unpacked
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.sensors import KINDS, Platform, Sensor

FORMAT = "assoc.scene"
VERSION = 6
# bytes, a quarter of its memory: its content counts as well
_OF_A_SCAN = 120
# a resolution that was not said; components that part no targets
_UNSAID, _NEVER = -1.0, -2.0
# fields of later versions, latest first; a scene without them is written as version 1
_LATER = {
    "sensor_wave_speed": 6, "sensor_resolution": 5, "sensor_folding": 4, "sensor_notch": 4, "sensor_platform": 3,
    "measurement_times": 2, "sectors": 2,
}  # fmt: skip

_METADATA = {
    "origin": Field("float", 1, required=False),
    "note_texts": Field("str", 1, required=False),
    "note_counts": Field("int", 1, required=False),
    "truth_named_ids": Field("int", 1, required=False),
    "truth_names": Field("str", 1, required=False),
}
"""Readers that do not know them leave them out."""

_FIELDS = {
    "name": Field("str", 0, required=False),
    "times": Field("float", 1),
    "region": Field("float", 2, required=False),
    "sensor_kind": Field("str", 1),
    "sensor_name": Field("str", 1),
    "sensor_position": Field("float", 2),
    "sensor_dim": Field("int", 1),
    "sensor_covariance": Field("float", 1),
    "sensor_field_of_view": Field("float", 2),
    "sensor_detection_probability": Field("float", 1),
    "sensor_false_alarm_rate": Field("float", 1),
    "sensor_folding": Field("float", 1, required=False),
    "sensor_notch": Field("float", 1, required=False),
    "sensor_resolution": Field("float", 1, required=False),
    "sensor_wave_speed": Field("float", 1, required=False),
    "measurement_values": Field("float", 1),
    "measurement_offsets": Field("int", 2),
    "measurement_sources": Field("int", 1, required=False),
    "measurement_times": Field("float", 1, required=False),
    "sectors": Field("float", 3, required=False),
    "sensor_platform": Field("int", 1, required=False),
    "platform_turns": Field("bool", 1, required=False),
    "platform_offsets": Field("int", 1, required=False),
    "platform_times": Field("float", 1, required=False),
    "platform_positions": Field("float", 2, required=False),
    "platform_headings": Field("float", 1, required=False),
    "truth_offsets": Field("int", 1, required=False),
    "truth_ids": Field("int", 1, required=False),
    "truth_positions": Field("float", 2, required=False),
    **_METADATA,
}


def save_parts(path: str | os.PathLike[str], parts: Mapping[str, Any]) -> None:
    """Write the attributes of an `assoc.scene.Scene`; "truth" holds those of its `assoc.scene.Truth`, or None."""
    arrays = _to_arrays(parts)
    save_npz(path, FORMAT, next((version for name, version in _LATER.items() if name in arrays), 1), arrays)


def load_parts(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Read the fields of `save_parts`, as arguments of `assoc.scene.Scene` and `assoc.scene.Truth`."""
    arrays = load_npz(path, FORMAT, VERSION, _FIELDS)
    # each scan of each sensor becomes an array of its own, also where it is empty
    check_unpacked(path, _OF_A_SCAN * arrays["measurement_offsets"].size, os.path.getsize(path), FLOOR)
    try:
        return _from_arrays(arrays)
    except InvalidInputError as error:
        raise InvalidInputError(f"{path}: {error}") from error


def _to_arrays(parts: Mapping[str, Any]) -> dict[str, Array | str | int]:
    sensors, scans = parts["sensors"], parts["measurements"]
    blocks = [[scan[s] for scan in scans] for s in range(len(sensors))]
    counts = np.array([[len(z) for z in block] for block in blocks], dtype=np.int64)
    arrays: dict[str, Array | str | int] = {
        "name": parts["name"],
        "times": parts["times"],
        "region": parts["region"],
        "sensor_kind": np.array([sensor.kind for sensor in sensors]),
        "sensor_name": np.array([sensor.name for sensor in sensors]),
        "sensor_position": np.array([sensor.position for sensor in sensors]),
        "sensor_dim": np.array([sensor.dim for sensor in sensors], dtype=np.int64),
        "sensor_covariance": np.concatenate([sensor.covariance.ravel() for sensor in sensors]),
        "sensor_field_of_view": np.concatenate([sensor.field_of_view for sensor in sensors]),
        "sensor_detection_probability": np.array([sensor.detection_probability for sensor in sensors]),
        "sensor_false_alarm_rate": np.array([sensor.false_alarm_rate for sensor in sensors]),
        "measurement_values": np.concatenate([z.ravel() for block in blocks for z in block]),
        "measurement_offsets": np.concatenate([np.zeros((len(sensors), 1), np.int64), counts.cumsum(axis=1)], axis=1),
    }
    for name in ("folding", "notch", "wave_speed"):
        values = [getattr(sensor, name, None) or 0.0 for sensor in sensors]
        values = [value if math.isfinite(value) else -1.0 for value in values]
        if any(values):
            arrays[f"sensor_{name}"] = np.array(values)
    if any(sensor.resolution is not None for sensor in sensors):
        parted = [np.full(s.dim, _UNSAID) if s.resolution is None else s.resolution for s in sensors]
        flat = np.concatenate(parted)
        arrays["sensor_resolution"] = np.where(np.isinf(flat), _NEVER, flat)
    arrays |= _platform_arrays(sensors)
    if parts["sectors"] is not None:
        arrays["sectors"] = parts["sectors"]
    if parts["measurement_times"] is not None:
        arrays["measurement_times"] = _flat(parts["measurement_times"], len(sensors))
    arrays |= metadata_arrays(parts)
    truth = parts["truth"]
    if truth is not None:
        arrays["truth_offsets"] = np.cumsum([0, *(len(ids) for ids in truth["target_ids"])], dtype=np.int64)
        arrays["truth_ids"] = np.concatenate(truth["target_ids"])
        arrays["truth_positions"] = np.concatenate(truth["positions"])
        if truth["sources"] is not None:
            arrays["measurement_sources"] = _flat(truth["sources"], len(sensors))
    return arrays


def _platform_arrays(sensors: Sequence[Sensor]) -> dict[str, Array | str | int]:
    """The sensors' platforms, each once, one after the other; nothing if there is none."""
    found: list[Platform] = []
    for sensor in sensors:
        if sensor.platform is not None and sensor.platform not in found:
            found.append(sensor.platform)
    if not found:
        return {}
    number = [-1 if sensor.platform is None else found.index(sensor.platform) for sensor in sensors]
    headings = [np.zeros(len(platform.times)) if platform.headings is None else platform.headings for platform in found]
    return {
        "sensor_platform": np.array(number, dtype=np.int64),
        "platform_turns": np.array([platform.headings is not None for platform in found]),
        "platform_offsets": np.cumsum([0, *(len(platform.times) for platform in found)], dtype=np.int64),
        "platform_times": np.concatenate([platform.times for platform in found]),
        "platform_positions": np.concatenate([platform.positions for platform in found]),
        "platform_headings": np.concatenate(headings),
    }


def _platforms(arrays: dict[str, Array], count: int) -> list[Platform | None]:
    """The platform of each sensor, None where nothing carries it."""
    if "sensor_platform" not in arrays:
        return [None] * count
    names = [name for name in _FIELDS if name.startswith("platform_")]
    for name in names:
        if name not in arrays:
            raise InvalidInputError(f"the field {name!r} is missing, it belongs to 'sensor_platform'")
    turns, offsets, times, positions, headings = (arrays[name] for name in names)
    _check_shape(arrays, "platform_offsets", (len(turns) + 1,))
    _check_offsets(offsets, "platform_offsets")
    for name, shape in (("times", ()), ("positions", (3,)), ("headings", ())):
        _check_shape(arrays, f"platform_{name}", (int(offsets[-1]), *shape))
    _check_shape(arrays, "sensor_platform", (count,))
    number = arrays["sensor_platform"]
    if number.min() < -1 or number.max() >= len(turns):
        raise InvalidInputError(f"the field 'sensor_platform' must hold -1 to {len(turns) - 1}")
    found = [
        Platform(times[a:b], positions[a:b], headings[a:b] if turning else None)
        for a, b, turning in zip(offsets[:-1].tolist(), offsets[1:].tolist(), turns.tolist(), strict=True)
    ]
    return [None if i < 0 else found[i] for i in number.tolist()]


def _flat(scans: Any, sensors: int) -> Array:
    """One number for each measurement, sensor after sensor."""
    return np.concatenate([scan[s] for s in range(sensors) for scan in scans])


def _split(flat: Array, rows: Array, scans: int) -> list[list[Array]]:
    """Undo `_flat`, given the offsets (S, K + 1) of the measurements."""
    blocks = np.split(flat, np.cumsum(rows[:, -1])[:-1])
    return [[block[row[k] : row[k + 1]] for block, row in zip(blocks, rows, strict=True)] for k in range(scans)]


def _check_shape(arrays: dict[str, Array], name: str, shape: tuple[int, ...]) -> None:
    if arrays[name].shape != shape:
        raise InvalidInputError(f"the field {name!r} has shape {arrays[name].shape}, expected {shape}")


def _check_offsets(offsets: Array, name: str) -> None:
    if (offsets[..., 0] != 0).any() or (np.diff(offsets, axis=-1) < 0).any():
        raise InvalidInputError(f"the field {name!r} must begin with 0 and not decrease")


def _from_arrays(arrays: dict[str, Array]) -> dict[str, Any]:
    count, scans = len(arrays["sensor_kind"]), len(arrays["times"])
    if not count:
        raise InvalidInputError("the field 'sensor_kind' is empty, expected at least one sensor")
    for name in ("sensor_name", "sensor_dim", "sensor_detection_probability", "sensor_false_alarm_rate"):
        _check_shape(arrays, name, (count,))
    for name in ("sensor_folding", "sensor_notch", "sensor_wave_speed"):
        if name in arrays:
            _check_shape(arrays, name, (count,))
    _check_shape(arrays, "sensor_position", (count, 3))
    dims = arrays["sensor_dim"]
    if dims.min() < 1 or dims.max() > 4:
        raise InvalidInputError(f"the field 'sensor_dim' must hold 1 to 4, got {dims.min()} to {dims.max()}")
    _check_shape(arrays, "sensor_covariance", (int((dims**2).sum()),))
    _check_shape(arrays, "sensor_field_of_view", (int(dims.sum()), 2))
    parted = arrays.get("sensor_resolution", np.full(int(dims.sum()), _UNSAID))
    _check_shape({"sensor_resolution": parted}, "sensor_resolution", (int(dims.sum()),))
    sensors = []
    platforms = _platforms(arrays, count)
    square, row = 0, 0
    for s, dim in enumerate(int(d) for d in dims):
        kind = str(arrays["sensor_kind"][s])
        if kind not in KINDS:
            raise InvalidInputError(
                f"the field 'sensor_kind' has {kind[:40]!r} for sensor {s}, expected one of {', '.join(KINDS)}"
            )
        known = [name for name in ("folding", "notch", "wave_speed") if f"sensor_{name}" in arrays]
        rates = {name: float(arrays[f"sensor_{name}"][s]) for name in known if arrays[f"sensor_{name}"][s] != 0.0}
        if rates.get("folding") == -1.0:
            rates["folding"] = math.inf
        own = parted[row : row + dim]
        resolution = None if (own == _UNSAID).all() else np.where(own == _NEVER, math.inf, own)
        covariance = arrays["sensor_covariance"][square : square + dim * dim].reshape(dim, dim)
        try:
            sensors.append(
                KINDS[kind](
                    name=str(arrays["sensor_name"][s]),
                    position=arrays["sensor_position"][s],
                    noise=covariance,
                    detection_probability=float(arrays["sensor_detection_probability"][s]),
                    false_alarm_rate=float(arrays["sensor_false_alarm_rate"][s]),
                    field_of_view=arrays["sensor_field_of_view"][row : row + dim],
                    platform=platforms[s],
                    resolution=resolution,
                    **rates,
                )
            )
        except InvalidInputError as error:
            raise InvalidInputError(f"sensor {s}: {error}") from error
        square, row = square + dim * dim, row + dim
    measurements, rows = _split_measurements(arrays, dims, scans)
    times = None
    if "measurement_times" in arrays:
        _check_shape(arrays, "measurement_times", (sum(int(n) for n in rows[:, -1]),))
        times = _split(arrays["measurement_times"], rows, scans)
    metadata = metadata_parts(arrays)
    truth = _read_truth(arrays, scans, rows)
    if truth is not None:
        truth["names"] = metadata["names"]
    return {
        "origin": metadata["origin"],
        "notes": metadata["notes"],
        "sensors": sensors,
        "times": arrays["times"],
        "measurements": measurements,
        "region": arrays.get("region"),
        "truth": truth,
        "name": str(arrays["name"][()]) if "name" in arrays else "",
        "measurement_times": times,
        "sectors": arrays.get("sectors"),
    }


def _split_measurements(arrays: dict[str, Array], dims: Array, scans: int) -> tuple[list[list[Array]], Array]:
    offsets, values = arrays["measurement_offsets"], arrays["measurement_values"]
    _check_shape(arrays, "measurement_offsets", (len(dims), scans + 1))
    _check_offsets(offsets, "measurement_offsets")
    # Python integers: hostile offsets must not wrap around
    total = sum(int(n) * int(d) for n, d in zip(offsets[:, -1], dims, strict=True))
    _check_shape(arrays, "measurement_values", (total,))
    measurements: list[list[Array]] = [[] for _ in range(scans)]
    start = 0
    for dim, bounds in zip(dims, offsets, strict=True):
        block = values[start : start + int(bounds[-1] * dim)].reshape(-1, int(dim))
        start += block.size
        for k in range(scans):
            measurements[k].append(block[bounds[k] : bounds[k + 1]])
    return measurements, offsets


def _read_truth(arrays: dict[str, Array], scans: int, rows: Array) -> dict[str, Any] | None:
    names = ("truth_offsets", "truth_ids", "truth_positions")
    present = [name for name in names if name in arrays]
    if not present:
        if "measurement_sources" in arrays:
            raise InvalidInputError("the field 'measurement_sources' needs the fields 'truth_...'")
        return None
    if len(present) < len(names):
        missing = next(name for name in names if name not in arrays)
        raise InvalidInputError(f"the field {missing!r} is missing")
    bounds = arrays["truth_offsets"]
    _check_shape(arrays, "truth_offsets", (scans + 1,))
    _check_offsets(bounds, "truth_offsets")
    _check_shape(arrays, "truth_ids", (int(bounds[-1]),))
    _check_shape(arrays, "truth_positions", (int(bounds[-1]), 3))
    sources = None
    if "measurement_sources" in arrays:
        _check_shape(arrays, "measurement_sources", (sum(int(n) for n in rows[:, -1]),))
        sources = _split(arrays["measurement_sources"], rows, scans)
    return {
        "target_ids": [arrays["truth_ids"][bounds[k] : bounds[k + 1]] for k in range(scans)],
        "positions": [arrays["truth_positions"][bounds[k] : bounds[k + 1]] for k in range(scans)],
        "sources": sources,
    }


def metadata_arrays(parts: Mapping[str, Any]) -> dict[str, Array]:
    """Return the fields of a scene's attributes; only those that are not empty."""
    arrays: dict[str, Array] = {}
    if parts["origin"] is not None:
        arrays["origin"] = np.array(parts["origin"])
    if parts["notes"]:
        arrays["note_texts"] = np.array(list(parts["notes"]))
        arrays["note_counts"] = np.array(list(parts["notes"].values()), dtype=np.int64)
    names = parts["truth"]["names"] if parts["truth"] is not None else {}
    if names:
        arrays["truth_named_ids"] = np.array(list(names), dtype=np.int64)
        arrays["truth_names"] = np.array(list(names.values()))
    return arrays


def metadata_parts(arrays: Mapping[str, Array]) -> dict[str, Any]:
    """Return "origin" and "notes" of a scene, and "names" of its truth."""
    origin = tuple(arrays["origin"].tolist()) if "origin" in arrays else None
    return {
        "origin": origin,
        "notes": _pairs(arrays, "note_texts", "note_counts"),
        "names": _pairs(arrays, "truth_named_ids", "truth_names"),
    }


def _pairs(arrays: Mapping[str, Array], keys: str, values: str) -> dict[Any, Any]:
    if (keys in arrays) != (values in arrays):
        raise InvalidInputError(f"the field {values if keys in arrays else keys!r} is missing")
    if keys not in arrays:
        return {}
    if len(arrays[keys]) != len(arrays[values]):
        raise InvalidInputError(
            f"the field {values!r} has {len(arrays[values])} values, expected {len(arrays[keys])} as {keys!r} has"
        )
    return dict(zip(arrays[keys].tolist(), arrays[values].tolist(), strict=True))
