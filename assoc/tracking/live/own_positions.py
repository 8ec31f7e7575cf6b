"""Own positions of platforms as they come: where the sensors that they carry stand during a step.

Between two messages a platform moves as `assoc.sensors.Platform` says; before the first and after the last it goes on
as between the nearest two.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.scene.scene import Scene
from assoc.sensors.arrays import LARGEST, finite_array
from assoc.sensors.base import wrap_angle
from assoc.sensors.platform import FAST, FASTER, Platform, checked_headings

OLD, SILENCE = 60.0, 15.0
"""Seconds: a message so much older than the last one says that the clock went back; a position so old is reported."""


class Pose(NamedTuple):
    """Where a platform is at a time."""

    time: float
    position: Array
    heading: float
    """NaN where the platform's headings are not known."""


class OwnPath(NamedTuple):
    """The last own positions of a platform, in order of time."""

    poses: tuple[Pose, ...] = ()
    doubted: Pose | None = None
    """One that the platform cannot have reached, if the last message was such."""

    def after(self, pose: Pose) -> OwnPath:
        """The path with one more position, which is refused if it does not follow on the others; `args[0]` says why.

        A jump is believed when the next position confirms it.
        """
        if not self.poses or pose.time < self.poses[-1].time - OLD:
            return OwnPath((pose,))
        if pose.time <= self.poses[-1].time:
            raise InvalidInputError(f"is not newer than that of {self.poses[-1].time:.10g} s")
        speed = _speed(self.poses[-1], pose)
        if speed <= self._fastest():
            return OwnPath((*self.poses, pose))
        if self.doubted is not None and pose.time > self.doubted.time:
            if _speed(self.doubted, pose) <= self._fastest():
                return OwnPath((self.doubted, pose))
        raise InvalidInputError(f"jumps, with {speed:.4g} m/s")

    def _fastest(self) -> float:
        """The speed above which a step is a jump, m/s."""
        speeds = [_speed(*pair) for pair in zip(self.poses, self.poses[1:], strict=False)]
        return max(FAST, FASTER * float(np.quantile(speeds, 0.9))) if len(speeds) > 1 else math.inf

    def since(self, time: float) -> OwnPath:
        """The path without positions that are not needed from this time on."""
        first = sum(pose.time <= time for pose in self.poses)
        return self._replace(poses=self.poses[max(min(first - 1, len(self.poses) - 2), 0) :])

    def platform(self, begin: float, end: float) -> Platform:
        """The platform from `begin` to `end`, seconds."""
        poses = list(self.poses)
        if begin < poses[0].time:
            poses.insert(0, _continued(self.poses[:2][::-1], begin))
        if end > poses[-1].time:
            poses.append(_continued(self.poses[-2:], end))
        headings = np.array([pose.heading for pose in poses])
        return Platform(
            np.array([pose.time for pose in poses]), np.array([pose.position for pose in poses]),
            None if np.isnan(headings).any() else headings,
        )  # fmt: skip


def _path_of(platform: Platform) -> OwnPath:
    """What is known of a platform of the scene."""
    headings = np.full(len(platform.times), math.nan) if platform.headings is None else platform.headings
    rows = zip(platform.times.tolist(), platform.positions, headings.tolist(), strict=True)
    return OwnPath(tuple(Pose(*row) for row in rows))


def _speed(before: Pose, after: Pose) -> float:
    return float(np.linalg.norm(after.position - before.position)) / (after.time - before.time)


def _continued(poses: Sequence[Pose], time: float) -> Pose:
    """The last of one or two poses, moved on to a time as between them."""
    last = poses[-1]
    if len(poses) == 1:
        return last._replace(time=time)
    share = (time - last.time) / (last.time - poses[0].time)
    turn = float(wrap_angle(np.array(last.heading - poses[0].heading)))
    heading = float(wrap_angle(np.array(last.heading + share * turn)))
    return Pose(time, last.position + share * (last.position - poses[0].position), heading)


class OwnPositions:
    """Own positions of all platforms of a scene."""

    def __init__(self, scene: Scene) -> None:
        self.platforms: list[Platform] = []
        """Those of the scene, each once."""
        for sensor in scene.sensors:
            if sensor.platform is not None and sensor.platform not in self.platforms:
                self.platforms.append(sensor.platform)
        self.paths: dict[int, OwnPath] = {}
        """By the number of the platform; only of those that have sent a position."""
        self._reported: set[int] = set()

    def take(self, platform: Platform, time: float, position: Sequence[float], heading: float | None) -> None:
        """Take a position in; InvalidInputError, in one line, says why one cannot be used."""
        if not abs(time) <= LARGEST:
            raise InvalidInputError(f"has the time {time:g}, expected seconds")
        place, known = finite_array(position, "position", (3,)), math.nan
        if platform.headings is not None:
            if heading is None:
                raise InvalidInputError("has no heading, and its sensors measure from it")
            known = float(checked_headings(np.array([heading]))[0])
        number = self.platforms.index(platform)
        path, pose = self.paths.get(number, OwnPath()), Pose(float(time), place, known)
        try:
            self.paths[number] = path.after(pose)
            self._reported.discard(number)
        except InvalidInputError:
            self.paths[number] = path._replace(doubted=pose)
            raise

    def moved(self, scene: Scene, begin: float, end: float) -> Scene:
        """The scene of the sensors with their platforms' own positions from `begin` to `end`; itself without any.

        A platform that has sent none and whose positions in the scene have ended goes on as at their end.
        """
        self.paths = {number: path.since(begin) for number, path in self.paths.items()}
        ended = {k: _path_of(platform) for k, platform in enumerate(self.platforms) if end > platform.times[-1]}
        known = {number: path.platform(begin, end) for number, path in (ended | self.paths).items()}
        if not known:
            return scene
        sensors = []
        for sensor in scene.sensors:
            number = -1 if sensor.platform is None else self.platforms.index(sensor.platform)
            sensors.append(replace(sensor, platform=known[number]) if number in known else sensor)
        empty = [np.zeros((0, sensor.dim)) for sensor in sensors]
        return Scene(sensors, np.array([end]), [empty], scene.region, origin=scene.origin)

    def silent(self, scene: Scene, end: float) -> list[tuple[int, float]]:
        """Sensors (the first of each platform) whose own position has become old, with its time; each once."""
        found = []
        for number, path in self.paths.items():
            if end - path.poses[-1].time > SILENCE and number not in self._reported:
                self._reported.add(number)
                first = next(s for s, sensor in enumerate(scene.sensors) if sensor.platform == self.platforms[number])
                found.append((first, path.poses[-1].time))
        return found

    def rows(self) -> Array:
        """Everything as rows of platform, time, x, y, z and heading."""
        rows = [[k, p.time, *p.position.tolist(), p.heading] for k, path in self.paths.items() for p in path.poses]
        return np.array(rows, dtype=np.float64).reshape(-1, 6)

    def restore(self, rows: Array) -> None:
        """Take over the `rows` of another."""
        for row in rows.tolist():
            number, pose = int(row[0]), Pose(row[1], np.array(row[2:5]), row[5])
            if number not in range(len(self.platforms)):
                raise ValueError(f"there is no platform {number}")
            self.paths[number] = OwnPath((*self.paths.get(number, OwnPath()).poses, pose))
