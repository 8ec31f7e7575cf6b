"""What a live tracker knows: its settings, and its state since its tracks last started anew."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property

from assoc.errors import InvalidInputError
from assoc.recordings.several import NO_HEIGHT
from assoc.scene.scene import Scene
from assoc.tracking.live.late_plots import LatePlots
from assoc.tracking.live.own_positions import OwnPositions
from assoc.tracking.live.pictures import Antenna, CheckedPlot, PlotKey
from assoc.tracking.tracker import Tracker

SHORTEST = 1e-3
"""Shortest interval, seconds."""


@dataclass(frozen=True, eq=False)
class LiveSettings:
    """Settings of a live tracker; see `LiveTracker`."""

    scene: Scene
    make: Callable[[], Tracker]
    interval: float
    turns: Sequence[float] | None
    horizon: float
    wait: float
    tell: Callable[[str], object]
    quality: bool = False

    def __post_init__(self) -> None:
        if self.interval < SHORTEST:
            raise InvalidInputError(f"interval: expected at least {SHORTEST:g} s, got {self.interval:g}")
        count = len(self.scene.sensors)
        if self.turns is not None and len(self.turns) != count:
            raise InvalidInputError(f"turns: expected one for each of {count} sensors, got {len(self.turns)}")
        if self.turns is not None and min(self.turns) < self.interval:
            raise InvalidInputError(f"turns: must not be shorter than the interval, {self.interval:g} s")

    def name_of(self, s: int) -> object:
        """Name of a sensor, or its number from 1."""
        return self.scene.sensors[s].name.removesuffix(NO_HEIGHT) or s + 1

    @cached_property
    def parts(self) -> list[tuple[int, ...]]:
        """For each sensor those that share its antenna: plots of one radar with heights and without."""
        names = [sensor.name for sensor in self.scene.sensors]
        stems = [name.removesuffix(NO_HEIGHT) for name in names]
        same = range(len(names))
        return [tuple(r for r in same if r == s or (stems[r] == stems[s] and names[r] != names[s])) for s in same]

    @cached_property
    def reporting(self) -> list[bool]:
        """For each sensor whether it never looks by the scene's sectors, as AIS: what it does not report is no miss."""
        sectors = self.scene.sectors
        if sectors is None:
            return [False] * len(self.scene.sensors)
        return [bool(never) for never in (sectors[..., 0] == sectors[..., 1]).all(axis=0)]

    def turn_of(self, s: int) -> float | None:
        """Seconds for a turn of a sensor's antenna; None where it does not turn."""
        turns = "azimuth" in self.scene.sensors[s].components
        return self.turns[s] if self.turns is not None and turns else None


@dataclass
class LiveState:
    """State of a live tracker since its tracks last started anew."""

    tracker: LatePlots
    antennas: list[Antenna]
    own_positions: OwnPositions
    """Positions that the sensors' platforms have sent."""
    end: float = math.nan
    """End of the open interval, seconds."""
    newest: float = -math.inf
    """Time of the newest plot, seconds."""
    pending: list[CheckedPlot] = field(default_factory=list)
    """Plots of the open interval, and later ones."""
    ahead: list[CheckedPlot] = field(default_factory=list)
    """Plots whose times are doubted."""
    behind: set[PlotKey] = field(default_factory=set)
    """Consecutive plots that were too old."""
    recent: dict[PlotKey, None] = field(default_factory=dict)
    """Plots so recent that a repetition must be recognised."""
    placed: dict[tuple[int, bytes], float] = field(init=False)
    """Sensor and values of these -> time of the last one."""

    def __post_init__(self) -> None:
        self.forget(-math.inf)

    def forget(self, before: float) -> None:
        """Keep as recent the plots since a time, seconds."""
        self.recent = {key: None for key in self.recent if key[1] >= before}
        self.placed = {(s, values): time for s, time, values in self.recent}

    @contextmanager
    def under_way(self, settings: LiveSettings) -> Iterator[Scene]:
        """The sensors with their platforms until the open interval ends; those of the tracker, too, for so long."""
        tracker, scene = self.tracker.tracker, settings.scene
        moved = self.own_positions.moved(scene, self.end - settings.horizon - 2.0 * settings.interval, self.end)
        plain = tracker.settings
        if moved is not scene:
            tracker.settings = plain.with_scene(moved)
        try:
            yield moved
        finally:
            tracker.settings = plain
