"""Settings of a tracker: checked once, never changed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from assoc._parameters import is_number, is_whole
from assoc._types import Array
from assoc.costs.tracks.scores import ScoreTerms, score_terms
from assoc.costs.views import Views
from assoc.errors import InvalidInputError
from assoc.filters.base import Filter
from assoc.filters.measurement import LinearMeasurement
from assoc.scene.scene import Scene
from assoc.sensors import BearingSensor, Sensor
from assoc.solvers.registry import make_parameters
from assoc.tracking.filter_choice import open_heights
from assoc.tracking.new_tracks import NewTracks
from assoc.tracking.records.identity_evidence import IdentityParameters
from assoc.tracking.records.initiation import Initiation
from assoc.tracking.records.life_cycle import LifeCycle

_CLIMB = 0.1
"""Usual climb of a target as a share of its usual speed."""


@dataclass(frozen=True, eq=False)
class TrackerSettings:
    """Settings of a tracker; see `assoc.tracking.Tracker` for those that users give."""

    name: str
    method: Any
    """How scans are associated, with its own settings; see `assoc.tracking.method`."""
    scene: Scene
    """Sensors and region."""
    filter: Filter[Any]
    solver: str
    solver_parameters: dict[str, Any]
    seed: int
    time_limit: float | None
    life_cycle: LifeCycle
    initiation: Initiation
    gate_probability: float
    max_tuples: int
    identity: IdentityParameters | None
    adapt: bool = False
    """Whether to estimate what is declared of the sensors, and the manoeuvres."""
    extended: bool = False
    """Whether targets may return several plots a scan."""
    by_range: Any = None
    """(S, B): see `assoc.costs.tracks.scores.ScoreTerms`."""
    starter: TrackerSettings | None = None
    """If all sensors measure angles alone; see `assoc.tracking.stages.starter`."""

    def __post_init__(self) -> None:
        if not isinstance(self.filter, Filter):
            raise InvalidInputError(f"filter must be a filter of assoc.filters, got {type(self.filter).__name__}")
        for sensor in self.sensors:
            self.filter.observe(sensor)
        if not isinstance(self.life_cycle, LifeCycle):
            raise InvalidInputError(f"life_cycle must be a LifeCycle, got {type(self.life_cycle).__name__}")
        if not isinstance(self.initiation, Initiation):
            raise InvalidInputError(f"initiation must be an Initiation, got {type(self.initiation).__name__}")
        self.initiation.prior(self.filter.motion)  # refuses what does not suit the filter
        if self.height is not None and isinstance(self.initiation.speed, float):
            # heights that are hardly observable must not drift: few targets climb as fast as they fly
            speed = self.initiation.speed
            object.__setattr__(self, "initiation", replace(self.initiation, speed=(speed, speed, _CLIMB * speed)))
        make_parameters(self.solver, self.solver_parameters)
        if not is_number(self.gate_probability) or not 0 < self.gate_probability < 1:
            raise InvalidInputError(f"gate_probability must be above 0 and below 1, got {self.gate_probability!r}")
        if not is_whole(self.max_tuples, 1):
            raise InvalidInputError(f"max_tuples must be a whole number above 0, got {self.max_tuples!r}")
        # numbers of numpy's are the same settings
        object.__setattr__(self, "gate_probability", float(self.gate_probability))
        object.__setattr__(self, "max_tuples", int(self.max_tuples))
        if not (self.identity is None or isinstance(self.identity, IdentityParameters)):
            raise InvalidInputError(f"identity must be IdentityParameters, got {type(self.identity).__name__}")

    def at(self, time: float) -> TrackerSettings:
        """The settings with the sensors as they stand at a time, seconds; themselves if no platform carries any."""
        return self.with_scene(self.scene.at(time))

    def with_scene(self, scene: Scene) -> TrackerSettings:
        """The settings with the sensors of another scene; themselves if it is the same."""
        if scene is self.scene:
            return self
        return replace(self, scene=scene, starter=None if self.starter is None else self.starter.with_scene(scene))

    @cached_property
    def angles_alone(self) -> bool:
        """Whether no sensor measures distances, so that none starts a track alone."""
        return not self.ranging.any()

    @cached_property
    def ranging(self) -> Array:
        """Whether each sensor measures distances or positions, bool (S,)."""
        angles = [isinstance(sensor, BearingSensor) or all(sensor.angular[: sensor.dim]) for sensor in self.sensors]
        return ~np.array(angles, dtype=np.bool_)

    @cached_property
    def height(self) -> LinearMeasurement | None:
        """The region's heights as a measurement of states, where slant ranges depend on heights that are not measured.

        None elsewhere, and for planar states.
        """
        motion = self.filter.motion
        if len(motion.position) < 3 or not open_heights(self.sensors):
            return None
        half = float(np.diff(self.scene.region[2])[0]) / 2.0
        return LinearMeasurement(np.eye(motion.dim)[[motion.position[2]]], np.array([[max(half, 1.0) ** 2]]))

    @cached_property
    def sensors(self) -> tuple[Sensor, ...]:
        """The sensors."""
        return tuple(self.scene.sensors)

    @cached_property
    def terms(self) -> ScoreTerms:
        """Scores of detections and misses of each sensor."""
        return score_terms(self.sensors, self.by_range)

    @cached_property
    def views(self) -> Views:
        """What the sensors can see of tracks."""
        return Views(self.sensors, self.filter.motion.position, self.by_range)

    @cached_property
    def births(self) -> NewTracks:
        """How tracks begin."""
        limits = {"gate_probability": self.gate_probability, "max_tuples": self.max_tuples}
        return NewTracks(self.scene, self.filter, self.initiation, self.terms, limits)
