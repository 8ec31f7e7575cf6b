"""A scene: sensors, their measurements in every scan, and the truth if known."""

from __future__ import annotations

import datetime
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from assoc._parameters import is_whole
from assoc._system.wrong_types import explains_wrong_types
from assoc._text.html import escape, table
from assoc._types import Array
from assoc.errors import InvalidInputError, warn
from assoc.scene.file import load_parts, save_parts
from assoc.scene.geodesy import Origin, checked_origin, geodetic
from assoc.scene.own_times import checked_sectors, checked_times
from assoc.scene.plausibility import implausible
from assoc.scene.scan import Scan
from assoc.scene.truth import Truth
from assoc.sensors import PositionSensor, Radar2D, Radar3D, Sensor
from assoc.sensors.arrays import finite_array
from assoc.sensors.base import ANGLES

# a planar scene still needs some height for the prior; radars see aircraft up to about here (metres)
_DEFAULT_HEIGHT = 20_000.0
# positions of a platform that the default region is made of
_STANDS = 50


@explains_wrong_types
@dataclass(frozen=True, eq=False, repr=False)
class Scene:
    """Sensors and their measurements over a number of scans.

    Parameters
    ----------
    sensors : sequence of Sensor
        At least one.
    times : array_like (K,)
        Time stamps in seconds, not decreasing; at least one scan. Several scans may be of one time, as of sensors that
        report one after the other. Dates (datetime, datetime64, pandas) become seconds since 1970-01-01 UTC.
    measurements : sequence over scans of sequences over sensors of arrays (n, d_s)
        What each sensor reported; n may be 0.
    region : array_like (3, 2), optional
        Lower and upper bounds of x, y, z in metres. It is the prior for what the measurements leave
        open (the height for range-azimuth radars). By default the box around the sensors'
        fields of view, from the lowest sensor to 20 km above it.
    truth : Truth, optional
    name : str, optional
    measurement_times : sequence over scans of sequences over sensors of arrays (n,), optional
        When each measurement was made, seconds, not after its scan's time; left out, all are of their scan's time.
        One from before the scan before is late: it arrived with this scan.
    sectors : array_like (K, S, 2), optional
        First and last azimuth (radians, from +x towards +y) that each sensor covered in each scan; the second is 0
        to 2 pi above the first, and a sector without width means that the sensor was off. Left out, all sensors
        cover all directions in every scan. Targets that were not covered are not missed.
    origin : tuple of latitude, longitude, height, optional
        Where the scene's frame stands on the earth: x east, y north, z up in the plane that touches the WGS-84
        ellipsoid there; radians, radians, metres. Tracks and reports then have latitudes and longitudes.
    notes : mapping of str to int, optional
        What was left out or corrected when the scene was made from a file, and how often.

    Raises
    ------
    InvalidInputError
        One line that names the argument and what was expected.

    Warns
    -----
    AssocWarning
        The measurements of a sensor do not fit its parameters, as with degrees or kilometres.
    """

    sensors: Sequence[Sensor]
    times: Array
    measurements: Sequence[Sequence[Array]]
    region: Array = None  # type: ignore[assignment]  # always an array once made
    truth: Truth | None = None
    name: str = ""
    measurement_times: Sequence[Sequence[Array]] | None = None
    sectors: Array | None = None
    origin: Origin | None = field(default=None, kw_only=True)
    notes: Mapping[str, int] = field(default_factory=dict, kw_only=True)

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "sensors", tuple(self.sensors))
        if not self.sensors:
            raise InvalidInputError("sensors: the scene has none, expected at least one")
        for s, sensor in enumerate(self.sensors):
            if not isinstance(sensor, Sensor):
                raise InvalidInputError(f"sensors: number {s} is a {type(sensor).__name__}, expected a Sensor")
        if not isinstance(self.name, str):
            raise InvalidInputError(f"name must be text, got {type(self.name).__name__}")
        times = finite_array(as_seconds(self.times), "times")
        if times.ndim != 1 or not times.size:
            raise InvalidInputError(f"times must have shape (K,) with K >= 1, got {times.shape}")
        if (np.diff(times) < 0).any():
            raise InvalidInputError(f"times must not decrease, scan {int(np.argmax(np.diff(times) < 0)) + 1} does")
        put(self, "times", times)
        put(self, "measurements", self._checked_measurements())
        put(self, "region", self._checked_region())
        if self.measurement_times is not None:
            put(self, "measurement_times", self._checked_measurement_times(self.measurement_times))
        if self.sectors is not None:
            shape = (self.num_scans, len(self.sensors), 2)
            given = finite_array(self.sectors, "sectors", shape)
            for k, sectors in enumerate(given):
                checked_sectors(sectors, len(self.sensors), f"sectors of scan {k}")
            put(self, "sectors", given)
        if self.origin is not None:
            put(self, "origin", checked_origin(self.origin))
        for what, count in self.notes.items():
            if not is_whole(count, -(2**63), 2**63 - 1):
                raise InvalidInputError(f"notes: expected whole numbers, got {count!r} for {what!r}")
        put(self, "notes", {str(what): int(count) for what, count in self.notes.items()})
        if self.truth is not None:
            self._check_truth(self.truth)
        for line in self._implausible:
            warn(line)

    @cached_property
    def _implausible(self) -> tuple[str, ...]:
        return implausible(self.sensors, self.measurements)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Probable mistakes in the sensors and their measurements, one line each."""
        return (*(line for sensor in self.sensors for line in sensor.warnings), *self._implausible)

    def _checked_measurement_times(self, given: Sequence[Sequence[Array]]) -> tuple[tuple[Array, ...], ...]:
        if len(given) != self.num_scans:
            raise InvalidInputError(f"measurement_times: {len(given)} scans, but times has {self.num_scans}")
        rows = zip(given, self.measurements, self.times.tolist(), strict=True)
        return tuple(
            checked_times(times, scan, end, f"measurement_times of scan {k}")
            for k, (times, scan, end) in enumerate(rows)
        )

    def _checked_measurements(self) -> tuple[tuple[Array, ...], ...]:
        if len(self.measurements) != self.num_scans:
            raise InvalidInputError(f"measurements: {len(self.measurements)} scans, but times has {self.num_scans}")
        return tuple(
            checked_measurements(scan, self.sensors, f"measurements of scan {k}")
            for k, scan in enumerate(self.measurements)
        )

    def _checked_region(self) -> Array:
        region = finite_array(default_region(self.sensors) if self.region is None else self.region, "region", (3, 2))
        if (region[:, 0] > region[:, 1]).any() or (region[:, 0] == region[:, 1]).all():
            raise InvalidInputError("region must have lower <= upper for x, y, z, and some extent")
        return region

    def _check_truth(self, truth: Truth) -> None:
        if not isinstance(truth, Truth):
            raise InvalidInputError(f"truth is a {type(truth).__name__}, expected a Truth")
        if len(truth.target_ids) != self.num_scans:
            raise InvalidInputError(f"truth has {len(truth.target_ids)} scans, expected {self.num_scans}")
        if truth.sources is None:
            return
        if len(truth.sources) != self.num_scans:
            raise InvalidInputError(f"truth: sources has {len(truth.sources)} scans, expected {self.num_scans}")
        for k, (sources, scan) in enumerate(zip(truth.sources, self.measurements, strict=True)):
            if [len(s) for s in sources] != [len(z) for z in scan]:
                raise InvalidInputError(
                    f"truth: sources of scan {k} are {[len(s) for s in sources]} per sensor, "
                    f"the measurements {[len(z) for z in scan]}"
                )

    @property
    def num_scans(self) -> int:
        """Number of scans, K."""
        return len(self.times)

    def check_platforms(self, what: str = "scene") -> None:
        """Refuse scans, and times of measurements, at which a sensor's platform has no position.

        Live, platforms send their positions meanwhile: a scene need not have them.

        Parameters
        ----------
        what : str
            What the message begins with.

        Raises
        ------
        InvalidInputError
            There is such a time.
        """
        for s, sensor in enumerate(self.sensors):
            if sensor.platform is None:
                continue
            stamps = () if self.measurement_times is None else [scan[s] for scan in self.measurement_times]
            try:
                sensor.platform.poses(np.concatenate([self.times, *stamps]))
            except InvalidInputError as error:
                raise InvalidInputError(f"{what}: {sensor.label(s)}: {error}") from None

    def scan(self, k: int) -> Scan:
        """Scan number `k`, counted from 0 (negative: from the end).

        Raises
        ------
        InvalidInputError
            There is no such scan.
        """
        if not isinstance(k, (int, np.integer)) or not -self.num_scans <= k < self.num_scans:
            raise InvalidInputError(f"scan {k!r} does not exist, the scene has scans 0 to {self.num_scans - 1}")
        k = int(k) % self.num_scans
        truth = self.truth
        return Scan(
            index=k,
            time=float(self.times[k]),
            measurements=tuple(self.measurements[k]),
            sources=None if truth is None or truth.sources is None else tuple(truth.sources[k]),
            truth_ids=None if truth is None else truth.target_ids[k],
            truth_positions=None if truth is None else truth.positions[k],
            times=None if self.measurement_times is None else tuple(self.measurement_times[k]),
            sectors=None if self.sectors is None else self.sectors[k],
        )

    def at(self, time: float) -> Scene:
        """A scene without scans of the sensors as they stand at a time (s); this one if no platform carries any."""
        if all(sensor.platform is None for sensor in self.sensors):
            return self
        sensors = [sensor.at(time) for sensor in self.sensors]
        nothing = [np.zeros((0, sensor.dim)) for sensor in sensors]
        return Scene(sensors, np.array([time]), [nothing], self.region, origin=self.origin)

    def part(self, start: int, stop: int) -> Scene:
        """Return scans ``start`` to ``stop`` - 1, with their truth, as a scene.

        Raises
        ------
        InvalidInputError
            There are no such scans.
        """
        if not (is_whole(start, 0) and is_whole(stop, start + 1, self.num_scans)):
            raise InvalidInputError(
                f"part: expected whole numbers 0 <= start < stop <= {self.num_scans}, got {start!r} and {stop!r}"
            )
        which, truth = slice(start, stop), self.truth
        return replace(
            self,
            times=self.times[which],
            measurements=self.measurements[which],
            measurement_times=None if self.measurement_times is None else self.measurement_times[which],
            sectors=None if self.sectors is None else self.sectors[which],
            truth=None if truth is None else truth.part(which),
        )

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the scene as an npz file of format "assoc.scene"; atomically."""
        # vars: the dataclass as it is, without the copies that dataclasses.asdict makes
        save_parts(path, {**vars(self), "truth": None if self.truth is None else vars(self.truth)})

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Scene:
        """Read a scene file.

        Raises
        ------
        InvalidInputError
            The file is not a sound scene; the message begins with the path and names the field.
        """
        parts = load_parts(path)
        try:
            truth = parts.pop("truth")
            return cls(**parts, truth=None if truth is None else Truth(**truth))
        except InvalidInputError as error:
            raise InvalidInputError(f"{path}: {error}") from error

    def __repr__(self) -> str:
        name = f"{self.name!r}, " if self.name else ""
        count = sum(len(z) for scan in self.measurements for z in scan)
        known = f", {self.truth!r}" if self.truth is not None else ""
        return f"Scene({name}{len(self.sensors)} sensors, {self.num_scans} scans, {count} measurements{known})"

    def _repr_html_(self) -> str:
        """HTML for notebooks and reports: one row a sensor."""
        rows, units = [], {"range rate": "m/s", "arrival time": "s"}
        for s, sensor in enumerate(self.sensors):
            counts = [len(scan[s]) for scan in self.measurements]
            position = ", ".join(f"{x:g}" for x in sensor.position)
            if self.origin is not None:
                lat, lon, _ = geodetic(sensor.position, self.origin)[0]
                position += f" ({np.degrees(lat):.5f}°, {np.degrees(lon):.5f}°)"
            sigmas = np.sqrt(np.diagonal(sensor.covariance))
            noise = ", ".join(
                f"{name} {np.degrees(sigma):.3g}°" if name in ANGLES else f"{name} {sigma:.3g} {units.get(name, 'm')}"
                for name, sigma in zip(sensor.components, sigmas, strict=False)
            )
            rows.append(
                [sensor.name or s + 1, type(sensor).__name__, position, noise, f"{sensor.detection_probability:g}"]
                + [f"{sensor.false_alarm_rate:g}", f"{np.mean(counts):.3g}"]
            )
        headers = ["sensor", "kind", "position (m)", "noise (1 σ)", "P_d"]
        headers += ["false alarms per scan", "measurements per scan"]
        return f"<p>{escape(repr(self))}</p>{table(headers, rows, numbers=(4, 5, 6))}"


def checked_measurements(scan: Sequence[Array], sensors: Sequence[Sensor], where: str) -> tuple[Array, ...]:
    """Measurements of a scan as read-only float64 arrays (n_s, d_s); errors begin with `where`."""
    if len(scan) != len(sensors):
        raise InvalidInputError(f"{where}: {len(scan)} sensors, expected {len(sensors)}")
    found = []
    for s, (z, sensor) in enumerate(zip(scan, sensors, strict=True)):
        array = finite_array(np.zeros((0, sensor.dim)) if np.size(z) == 0 else z, f"{where}, sensor {s}")
        if array.ndim != 2 or array.shape[1] != sensor.dim:
            raise InvalidInputError(f"{where}, sensor {s} must have shape (n, {sensor.dim}), got {array.shape}")
        found.append(array)
    return tuple(found)


def default_region(sensors: Sequence[Sensor]) -> Array:
    """Box of x, y, z around the fields of view, shape (3, 2), metres; see `Scene`."""
    boxes = []
    stands = [stand for sensor in sensors for stand in _stands(sensor)]
    for sensor in stands:
        if isinstance(sensor, (Radar3D, Radar2D)):
            reach = max(float(sensor.field_of_view[0, 1]), 1.0)
            boxes.append(np.stack([sensor.position[:2] - reach, sensor.position[:2] + reach], axis=1))
        elif isinstance(sensor, PositionSensor):
            boxes.append(sensor.field_of_view[:2])
    positions = np.array([sensor.position for sensor in stands])
    if not boxes:
        # bearings contain no distance: take the surroundings of the sensors, at least 100 km
        reach = max(100_000.0, float(np.ptp(positions[:, :2], axis=0).max()))
        boxes.append(np.stack([positions[:, :2].min(axis=0) - reach, positions[:, :2].max(axis=0) + reach], axis=1))
    floor = float(positions[:, 2].min())
    heights = [(floor, floor + _DEFAULT_HEIGHT)]
    heights += [tuple(s.field_of_view[2]) for s in stands if isinstance(s, PositionSensor) and s.dim == 3]
    plane = np.stack([np.min(boxes, axis=0)[:, 0], np.max(boxes, axis=0)[:, 1]], axis=1)
    return np.vstack([plane, [[min(h[0] for h in heights), max(h[1] for h in heights)]]])


def _stands(sensor: Sensor) -> list[Sensor]:
    """The sensor at some of its platform's times; itself if no platform carries it."""
    if sensor.platform is None:
        return [sensor]
    times = sensor.platform.times
    return [sensor.at(time) for time in times[:: -(-len(times) // _STANDS)].tolist()] + [sensor.at(float(times[-1]))]


__all__ = ["Scan", "Scene", "Truth", "default_region"]


def as_seconds(times: Any) -> Any:
    """Turn dates into seconds since 1970-01-01 UTC, and durations into seconds; anything else is returned unchanged.

    Taken are arrays of numpy's datetime64 and timedelta64, Python's datetimes and timedeltas, and what pandas makes of
    them. A date without a time zone is one of UTC. A missing date (NaT), or dates mixed with numbers, are refused.
    """
    array = np.asarray(times)
    if array.dtype == object and array.size:
        first = array.flat[0]
        if not isinstance(first, (datetime.datetime, datetime.timedelta, np.datetime64, np.timedelta64)):
            return times
        try:
            array = np.array([_plain(date) for date in array.flat]).reshape(array.shape)
        except (TypeError, ValueError) as error:
            raise InvalidInputError("times must be all dates or all seconds, got both") from error
    if array.dtype.kind not in "mM":
        return times
    if np.isnat(array).any():
        raise InvalidInputError("times must be complete, got a date that is missing (NaT)")
    unit = np.datetime64(0, "s") if array.dtype.kind == "M" else np.timedelta64(0, "s")
    whole = array.astype("datetime64[us]" if array.dtype.kind == "M" else "timedelta64[us]") - unit
    return whole.astype(np.int64) / 1e6


def _plain(date: Any) -> np.datetime64 | np.timedelta64:
    if isinstance(date, datetime.datetime):
        return np.datetime64(date if date.tzinfo is None else date.astimezone(datetime.UTC).replace(tzinfo=None), "us")
    if isinstance(date, datetime.timedelta):
        return np.timedelta64(date, "us")
    if isinstance(date, (np.datetime64, np.timedelta64)):
        return date
    raise TypeError(type(date).__name__)
