"""The class of all trackers: settings that never change, and one state."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from assoc._parameters import checked_time_limit, whole_seed
from assoc._system.imports import removed_attribute
from assoc._system.wrong_types import explains_wrong_types
from assoc._text.times import moment
from assoc._types import Array
from assoc.costs.build import GATE_PROBABILITY
from assoc.costs.limits import MAX_TUPLES
from assoc.errors import InvalidInputError, warn
from assoc.filters.base import Filter
from assoc.filters.state import Gaussian
from assoc.scene.scene import Scene
from assoc.sensors import Sensor
from assoc.sensors.arrival_time import refuse_arrival_times
from assoc.tracking import file
from assoc.tracking.adapting.health import Health, health
from assoc.tracking.adapting.speeds import speed_of_tracks
from assoc.tracking.filter_choice import manoeuvre_noise, open_heights, pace_of, two_speeds
from assoc.tracking.method import Method
from assoc.tracking.records.extents import one_by_one
from assoc.tracking.records.identity_evidence import IdentityParameters
from assoc.tracking.records.initiation import Initiation
from assoc.tracking.records.life_cycle import LifeCycle
from assoc.tracking.records.track import Decision, Step, Track, TrackColumns
from assoc.tracking.records.track_batch import TrackBatch
from assoc.tracking.settings import TrackerSettings
from assoc.tracking.stages.checking import checked_time
from assoc.tracking.stages.starter import current, with_starter
from assoc.tracking.state import first_state
from assoc.tracking.step import advance, check
from assoc.tracking.target_kinds import target_kind


@explains_wrong_types
class Tracker:
    """A tracker: call `step` for each scan in turn; memory does not grow with the number of scans.

    Parameters
    ----------
    sensors : sequence of Sensor
    filter : Filter, optional
        Any filter of `assoc.filters`; by default interacting multiple models, quiet flight and manoeuvres
        (`assoc.tracking.filter_choice.two_speeds`).
    region : array_like (3, 2), optional
        Bounds of x, y, z of the targets, metres; see `assoc.Scene`.
    solver : str
        One of ``assoc.solvers.names()``; solves the assignment problems.
    solver_parameters : mapping, optional
    seed : int
        Seed of the solver; the same seed gives the same tracks.
    time_limit : float or None
        Seconds for each assignment problem, after which the best solution found is used; the tracks then depend on
        the machine. By default there is no time limit; unless `solver_parameters` set `nodes`, the exact solver has
        a limit of nodes, the same on every machine, so that dense scenes do not take minutes.
    life_cycle : LifeCycle, optional
    initiation : Initiation, optional
    gate_probability : float
        Share of true measurements inside the gate, above 0 and below 1.
    max_tuples : int
        The most candidate tuples in a scan.
    registration : "online", optional
        The same as `adapt`: biases of sensors are among what is estimated, and measurements are corrected by them.
    identity : IdentityParameters, optional
        How to weigh Mode 3/A codes and addresses that `step` is given. Without it they are ignored.
    adapt : bool
        Whether to estimate noise, detection probabilities, false alarms, biases and manoeuvres while tracking, and to
        use the estimates while they predict better than what was declared; see `health`.
    extended : bool
        Whether targets may return several plots of one sensor in a scan, spread over their extent, as large ships do:
        which do is found out, and how large they are. Implies `adapt`.
    **options
        Settings of this kind of tracker.

    Attributes
    ----------
    settings : TrackerSettings
        Immutable.
    state : TrackerState
        Everything the tracker knows, immutable. To go back, keep it and set it again.

    Raises
    ------
    InvalidInputError
        An argument is not as described.

    Warns
    -----
    AssocWarning
        A closed area of `initiation` lies outside of the region.
    """

    name: ClassVar[str]
    method: ClassVar[type[Method]]
    """How scans are associated; see `assoc.tracking.method`."""
    plain: ClassVar[type[Tracker]]
    """The tracker that tries kinds of targets for "auto"."""

    def __init__(
        self,
        sensors: Sequence[Sensor],
        filter: Filter[Any] | None = None,
        *,
        region: Array | None = None,
        solver: str = "exact",
        solver_parameters: Mapping[str, Any] | None = None,
        seed: int | None = 0,
        time_limit: float | None = None,
        life_cycle: LifeCycle | None = None,
        initiation: Initiation | None = None,
        gate_probability: float = GATE_PROBABILITY,
        max_tuples: int = MAX_TUPLES,
        registration: str | None = None,
        identity: IdentityParameters | None = None,
        adapt: bool = False,
        extended: bool = False,
        **options: Any,
    ) -> None:
        empty = [[np.zeros((0, sensor.dim)) for sensor in sensors if isinstance(sensor, Sensor)]]
        scene = Scene(sensors=sensors, times=np.zeros(1), measurements=empty, region=region)  # type: ignore[arg-type]
        refuse_arrival_times(scene.sensors, "a tracker")
        if registration not in (None, "online"):
            raise InvalidInputError(f"registration: expected 'online', got {registration!r}")
        settings = TrackerSettings(
            name=self.name, method=self.method(**options), scene=scene, filter=filter or two_speeds(), solver=solver,
            solver_parameters=dict(solver_parameters or {}), seed=whole_seed(seed),
            time_limit=checked_time_limit(time_limit), life_cycle=LifeCycle() if life_cycle is None else life_cycle,
            initiation=Initiation() if initiation is None else initiation, gate_probability=gate_probability,
            max_tuples=max_tuples, identity=identity,
            adapt=bool(adapt or extended) or registration is not None, extended=bool(extended),
        )  # fmt: skip
        text = settings.initiation.warning(scene.region)
        if text:
            warn(text)
        self.settings = with_starter(settings)
        self.state = first_state(self.settings)

    @classmethod
    def for_scene(cls, scene: Scene, *arguments: Any, targets: str | None = None, **options: Any) -> Self:
        """A tracker for the sensors and the region of a scene; further arguments as for the class.

        Without a `filter`, the default one's process noise suits the pace of the scans.

        Parameters
        ----------
        scene : Scene
        targets : str, optional
            What is tracked, a name of `assoc.tracking.target_kinds.TARGETS`, or "auto", which tries them: the prior of
            speeds (without an `initiation`) and the default filter's process noise suit it.
        """
        kind = None if targets is None else target_kind(targets, scene, cls.plain.for_scene)
        if kind is not None and options.get("initiation") is None:
            options["initiation"] = Initiation(speed=kind.speed)
        if not arguments and options.get("filter") is None:
            pace = pace_of(scene.times)
            noise = manoeuvre_noise(pace) if kind is None else kind.noise(pace)
            options["filter"] = two_speeds(
                noise, unscented=open_heights(scene.sensors), falls=kind is not None and kind.falls
            )
        return cls(scene.sensors, *arguments, region=scene.region, **options)

    if not TYPE_CHECKING:
        __getattr__ = removed_attribute

    @property
    def sensors(self) -> tuple[Sensor, ...]:
        """The sensors."""
        return self.settings.sensors

    @property
    def filter(self) -> Filter[Any]:
        """The filter."""
        return self.settings.filter

    @property
    def time(self) -> float | None:
        """Time of the last step, seconds; None before the first."""
        return self.state.time

    @property
    def num_steps(self) -> int:
        """Number of scans so far."""
        return self.state.scan

    @property
    def health(self) -> Health | None:
        """What was declared of sensors and targets against what was seen so far; None of a tracker without `adapt`."""
        found, echoes, extents = self.state.estimates, self.state.echoes, self.state.extents
        if found is None or echoes is None or self.state.clutter is None:
            return None
        flown = speed_of_tracks(self.settings, self.state.tracks, at_most=True)
        speed, known = self.settings.initiation.speed, (self.state.unresolved, self.state.biases)
        shown = np.unique(self.state.tracks.track_id[self.state.tracks.confirmed])
        lengths = () if extents is None else extents.of(shown).lengths.tolist()
        places = self.state.clutter.returned(self.sensors).tolist()
        return health(self.sensors, found, speed, echoes.found, flown, *known, lengths, places)

    @property
    def solver_calls(self) -> int:
        """Number of calls of the solver so far."""
        return self.state.solver_calls

    @property
    def tracks(self) -> list[Track]:
        """The living tracks, confirmed or not, sorted by id."""
        if self.state.time is None:
            return []
        return current(self.settings, self.state).tracks(self.filter, self.state.time)

    def track_columns(self) -> TrackColumns:
        """The same as columns, after the first step."""
        assert self.state.time is not None
        return current(self.settings, self.state).columns(self.filter, self.state.time)

    def begin(self, time: float, tracks: Gaussian, score: float = 20.0) -> Array:
        """Start confirmed tracks of known targets, from another system or a plan, before the first step.

        Parameters
        ----------
        time : float
            Time of the states, seconds.
        tracks : Gaussian
            Means and covariances in the order of the filter's motion model.
        score : float
            Initial track score.

        Returns
        -------
        int64 array
            Their ids.

        Raises
        ------
        InvalidInputError
            The tracker has begun already, or the states have the wrong dimension.
        """
        if self.state.time is not None:
            raise InvalidInputError("begin: the tracker has begun already")
        when, states = checked_time(time, None), self.filter.start(tracks)
        ids = np.arange(1, len(tracks) + 1)
        batch = TrackBatch.new(states, ids, np.full(len(tracks), float(score)), when).with_confirmed(True)
        begun = self.settings.method.begun(self.settings, batch)
        self.state = self.state._replace(time=when, tracks=batch, method_state=begun, next_id=len(tracks) + 1)
        return ids

    def step(
        self,
        time: float,
        measurements: Sequence[Array],
        times: Sequence[Array] | None = None,
        sectors: Array | None = None,
        identities: Sequence[Array] | None = None,
    ) -> Step:
        """Process one scan.

        Parameters
        ----------
        time : float
            Seconds, not before the last scan's. Tracks are predicted to this time.
        measurements : sequence over sensors of arrays (n_s, d_s)
            n_s may be 0.
        times : sequence over sensors of arrays (n_s,), optional
            Each measurement's own time, not before the last scan's and not after `time`; default: `time`. For older
            measurements use `assoc.tracking.LatePlots`.
        sectors : array_like (S, 2), optional
            Azimuths between which each sensor looked since the last scan, see `assoc.Scene`: a sensor misses only
            what it looked at. No sensor may have looked in a direction twice. A sector without width: it did not
            look, as one that is off or reports on its own (AIS). Default: all looked everywhere.
        identities : sequence over sensors of int arrays (n_s, 2), optional
            Mode 3/A code and ICAO address (of a ship its MMSI, `assoc.tracking.records.identity_evidence.ship`) of each
            measurement, 0 or -1 where it has none. Trackers that were made without `identity` leave them
            aside.

        Returns
        -------
        Step

        Raises
        ------
        InvalidInputError
            The time is before the last scan's, or measurements have the wrong shape, are not finite, or are outside
            the sensor's range of values. After any error the tracker is as it was before the step.

        Warns
        -----
        AssocWarning
            Once, if all sensors measure angles alone and these measurements can start no track.
        """
        scan = check(self.settings, self.state, time, measurements, times, sectors, identities)
        self.state, step = advance(self.settings, self.state, scan)
        return step

    def flush(self) -> tuple[Decision, ...]:
        """Decisions about the scans that are not final yet, oldest first; for the end of a recording."""
        decisions: tuple[Decision, ...] = self.settings.method.open_decisions(self.state)
        extents = self.state.extents
        return decisions if extents is None else tuple(one_by_one(each, extents.past) for each in decisions)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the whole state as an npz file of format "assoc.tracker"; whole or not at all."""
        file.save(path, self.settings, self.state)

    def restore(self, path: str | os.PathLike[str]) -> None:
        """Read the state of a tracker with the same settings; later results are the same, bit for bit.

        Raises
        ------
        InvalidInputError
            The file is not a saved tracker, or damaged, or that of a tracker with other settings, or of an earlier
            version. The tracker is then as it was.
        """
        self.state = file.restore(path, self.settings, self.state)

    def __repr__(self) -> str:
        state = self.state
        when = "not started" if state.time is None else f"{state.scan} scans, {moment(state.time)}"
        return f"{type(self).__name__}({len(self.sensors)} sensors, {self.settings.solver}, {when})"
