"""What all trackers have in common: sensors, filter, settings, checked input."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Self

import numpy as np

from assoc._parameters import checked_time_limit, is_whole, whole_seed
from assoc._system.door import doors
from assoc._system.interrupts import interruptible
from assoc._types import Array
from assoc.costs.build import GATE_PROBABILITY
from assoc.costs.limits import MAX_TUPLES
from assoc.costs.tracks.own_times import PairEvidence, TimedScan
from assoc.costs.tracks.scores import score_terms
from assoc.errors import InvalidInputError, warn
from assoc.filters.base import Filter, predict_each
from assoc.filters.state import Gaussian
from assoc.problem import AssignmentProblem
from assoc.registration.online import OnlineRegistration
from assoc.scene.own_times import FULL_TURN, checked_sectors, checked_times, looked_at
from assoc.scene.scan import Scan
from assoc.scene.scene import Scene
from assoc.sensors import Sensor
from assoc.solution import Solution
from assoc.solvers.assign import assign
from assoc.solvers.registry import make_parameters
from assoc.tracking.births.initiation import Initiation
from assoc.tracking.births.joint_starts import Crossings, angles_alone
from assoc.tracking.births.new_tracks import NewTracks
from assoc.tracking.checking import checked_measurements
from assoc.tracking.checkpoint import Checkpoint, Memory
from assoc.tracking.filter_choice import manoeuvre_noise, pace_of, two_speeds
from assoc.tracking.identity_evidence import Identities, IdentityParameters, checked_identities
from assoc.tracking.life_cycle import LifeCycle
from assoc.tracking.track import Decision, Step, Track
from assoc.tracking.track_batch import TrackBatch, empty_batch

# what the exact solver may do on one scan where the user says nothing of it: visits of tuples in branch and bound,
# and nodes at the least; counted, so that the answer does not depend on the machine
_VISITS, _LEAST_NODES = 500_000, 10
_FORGETTING = 0.05
# of a turn in a scan; where no sensor looks any more, tracks wait
_LEAST_TURN = 1e-3


@doors
class Tracker(Checkpoint):
    """A tracker: call `step` for each scan in turn; memory does not grow with the number of scans.

    Parameters
    ----------
    sensors : sequence of Sensor
    filter : Filter, optional
        Any filter of `assoc.filters`; by default interacting multiple models, quiet flight and manoeuvres
        (`assoc.tracking.filter_choice.two_speeds`).
    region : array_like (3, 2), optional
        Bounds of x, y, z in metres, where targets are; see `assoc.Scene`.
    solver : str
        One of ``assoc.solvers.names()``; solves the assignment problems.
    solver_parameters : mapping, optional
    seed : int
        Of the solver's randomness; the same seed gives the same tracks.
    time_limit : float or None
        Seconds for each assignment problem; when they are over the best solution found is taken, which then
        depends on the machine. By default there is no clock; where `solver_parameters` say nothing of `nodes` the
        exact solver stops after so many that dense scenes do not take minutes, the same on every machine.
    life_cycle : LifeCycle, optional
    initiation : Initiation, optional
    gate_probability : float
        Share of true measurements that a gate lets through, above 0 and below 1.
    max_tuples : int
        The most candidate tuples in a scan.
    registration : "online" or OnlineRegistration, optional
        Estimates the sensors' biases from the measurements that come in and corrects these by them; all measurements of
        a scan must then be of one instant. Without it measurements are taken as they are.
    identity : IdentityParameters, optional
        How far Mode 3/A codes and addresses of measurements, which `step` may be given, tell to which track these
        belong. Without it they are not looked at.

    Raises
    ------
    InvalidInputError
        An argument is not as described.
    """

    name: ClassVar[str]

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
        registration: str | OnlineRegistration | None = None,
        identity: IdentityParameters | None = None,
    ) -> None:
        empty = [[np.zeros((0, sensor.dim)) for sensor in sensors if isinstance(sensor, Sensor)]]
        self._place = Scene(sensors=sensors, times=np.zeros(1), measurements=empty, region=region)  # type: ignore[arg-type]
        self.sensors = tuple(self._place.sensors)
        self.filter = filter or two_speeds()
        if not isinstance(self.filter, Filter):
            raise InvalidInputError(f"filter must be a filter of assoc.filters, got {type(filter).__name__}")
        for sensor in self.sensors:
            self.filter.observe(sensor)
        self.life_cycle = LifeCycle() if life_cycle is None else life_cycle
        if not isinstance(self.life_cycle, LifeCycle):
            raise InvalidInputError(f"life_cycle must be a LifeCycle, got {type(life_cycle).__name__}")
        self.initiation = Initiation() if initiation is None else initiation
        if not isinstance(self.initiation, Initiation):
            raise InvalidInputError(f"initiation must be an Initiation, got {type(initiation).__name__}")
        self.solver = solver
        self.solver_parameters = dict(solver_parameters or {})
        make_parameters(solver, self.solver_parameters)
        self.seed = whole_seed(seed)
        self.time_limit = checked_time_limit(time_limit)
        good = isinstance(gate_probability, (int, float, np.floating)) and not isinstance(gate_probability, bool)
        if not good or not 0 < gate_probability < 1:
            raise InvalidInputError(f"gate_probability must be above 0 and below 1, got {gate_probability!r}")
        self.gate_probability = float(gate_probability)
        if not is_whole(max_tuples, 1):
            raise InvalidInputError(f"max_tuples must be a whole number above 0, got {max_tuples!r}")
        self.max_tuples = int(max_tuples)
        if registration == "online":
            registration = OnlineRegistration(self.sensors, self._place.region)
        if not (registration is None or isinstance(registration, OnlineRegistration)):
            raise InvalidInputError(f"registration: expected 'online' or an OnlineRegistration, got {registration!r}")
        if registration is not None and registration.sensors != self.sensors:
            raise InvalidInputError("registration: its sensors are not those of the tracker")
        self.registration = registration
        self.identities = None if identity is None else Identities(identity)
        self.terms = score_terms(self.sensors)
        self._new_tracks = NewTracks(self._place, self.filter, self.initiation, self.terms)
        self._can_start = True
        """Whether no measurements have come that can start no track; of the first ones it is told."""
        self._time: float | None = None
        self._pace = 0.0
        self._turns = np.ones(len(self.sensors))
        """Turns that each sensor does in a scan, on average."""
        self._scan = 0
        self._next_id = 1
        self._batch = empty_batch(self.filter)
        self.solver_calls = 0
        """Problems that the solver was given so far."""

    @classmethod
    def for_scene(cls, scene: Scene, *arguments: Any, **options: Any) -> Self:
        """A tracker for the sensors and the region of a scene; further arguments as for the class.

        Without a `filter`, the default one's process noise suits the pace of the scans.
        """
        if not arguments and options.get("filter") is None:
            options["filter"] = two_speeds(manoeuvre_noise(pace_of(scene.times)))
        return cls(scene.sensors, *arguments, region=scene.region, **options)

    @property
    def time(self) -> float | None:
        """Time of the last step, seconds; None before the first."""
        return self._time

    @property
    def num_steps(self) -> int:
        """Number of scans so far."""
        return self._scan

    @property
    def tracks(self) -> list[Track]:
        """The tracks that live now, confirmed or not, by their ids."""
        if self._time is None:
            return []
        return self._current().tracks(self.filter, self._time)

    def _current(self) -> TrackBatch:
        return self._batch

    def begin(self, time: float, tracks: Gaussian, score: float = 20.0) -> Array:
        """Take over targets that are known, from another system or a plan, before the first step.

        Parameters
        ----------
        time : float
            To which the states belong, seconds.
        tracks : Gaussian
            Means and covariances in the order of the filter's motion model.
        score : float
            What their track scores start with; they are confirmed.

        Returns
        -------
        int64 array
            Their ids.

        Raises
        ------
        InvalidInputError
            The tracker has begun already, or the states have the wrong dimension.
        """
        if self._time is not None:
            raise InvalidInputError("begin: the tracker has begun already")
        when, states = self._checked_time(time), self.filter.start(tracks)
        batch = TrackBatch.new(states, self._new_ids(len(tracks)), np.full(len(tracks), float(score)), when)
        self._time = when
        self._adopt(batch.with_confirmed(True))
        return batch.track_id

    def _adopt(self, batch: TrackBatch) -> None:
        self._batch = batch

    def step(
        self,
        time: float,
        measurements: Sequence[Array],
        times: Sequence[Array] | None = None,
        sectors: Array | None = None,
        identities: Sequence[Array] | None = None,
    ) -> Step:
        """Take one scan in.

        Parameters
        ----------
        time : float
            Seconds, not before that of the last scan. Tracks are given for this time.
        measurements : sequence over sensors of arrays (n_s, d_s)
            n_s may be 0.
        times : sequence over sensors of arrays (n_s,), optional
            Each measurement's own time, not before the last scan's and not after `time`; left out, all are of `time`.
            What is older belongs into `assoc.tracking.LatePlots`.
        sectors : array_like (S, 2), optional
            From which to which azimuth each sensor looked since the last scan, see `assoc.Scene`: what a sensor did
            not look at it has not missed. No sensor may have looked at anything twice. Left out, all looked
            everywhere.
        identities : sequence over sensors of int arrays (n_s, 2), optional
            Mode 3/A code and ICAO address of each measurement, 0 where it has none. Used by trackers that were made
            with `identity`, others do not look at them.

        Returns
        -------
        Step

        Raises
        ------
        InvalidInputError
            The time runs backwards, or measurements have the wrong shape, are not finite, or are none that the
            sensor can have made. Whatever the error, the tracker is as it was before the step.

        Warns
        -----
        AssocWarning
            Once, where all sensors measure angles alone and these measurements can start no track.
        """
        when = self._checked_time(time)
        checked = checked_measurements(measurements, self.sensors)
        stamps = None if times is None else self._checked_stamps(times, checked, when)
        looks = None if sectors is None else checked_sectors(sectors, len(self.sensors), "sectors")
        if self.registration is not None and stamps is not None:
            raise InvalidInputError("times: registration needs measurements of one instant; register a scene before")
        codes = None
        if self.identities is not None and identities is not None:
            codes = tuple(checked_identities(identities, [len(z) for z in checked]))
        if codes is not None and stamps is None:
            # identities are weighed where measurements are followed one by one, at their own times
            stamps = tuple(np.full(len(z), when) for z in checked)
        self._tell_of_no_starts(checked, stamps is None and looks is None)
        before, dt = self.remember(), self._elapsed(when)
        try:
            if self.registration is not None:
                self.registration = self.registration.after(when, checked)
                checked = self.registration.correct(checked)
            scan = Scan(self._scan, when, tuple(checked), times=stamps, sectors=looks, identities=codes)
            if dt > 0:
                # a running mean that forgets: scans may change their pace
                share = max(1.0 / max(self._scan, 1), _FORGETTING)
                self._pace += (dt - self._pace) * share
                if looks is not None:
                    turns = (looks[:, 1] - looks[:, 0]) / FULL_TURN
                    self._turns = self._turns + (turns - self._turns) * share
            self._batch = self._batch.survived(dt / self.life_cycle.lifetime)
            with interruptible():
                step = self._step(scan)
        except (ArithmeticError, np.linalg.LinAlgError) as error:
            self.go_back(before)
            raise InvalidInputError(
                f"the scan at {when:g} s, {dt:g} s after the last, leads to numbers out of range ({error}); expected "
                "seconds, metres and radians"
            ) from error
        except BaseException:
            self.go_back(before)
            raise
        if codes is not None and self.identities is not None:
            self.identities = self.identities.after(step.assigned, codes, self._batch.track_id)
        overlooked: Array = (self._out_of_view() & self._looked(looks)) @ self.terms.miss
        self._batch = self._batch.not_overlooked(-overlooked)
        self._time = when
        self._scan += 1
        return step

    def _tell_of_no_starts(self, measurements: list[Array], at_once: bool) -> None:
        """Warn once where angles alone can start no track, and there is none."""
        if not self._can_start or not any(map(len, measurements)) or not angles_alone(self.sensors):
            return
        if at_once and len(self.sensors) > 1 or len(self._current()) or self._new_tracks.any_alone(measurements):
            return
        self._can_start = False
        if len(self.sensors) == 1:
            warn("the only sensor measures angles alone: no track starts, for bearings do not cross")
        else:
            what = "measurements with times, sectors or identities start no tracks"
            warn(f"all sensors measure angles alone: {what}, only those of one instant without do")

    def remember(self) -> Memory:
        """What a step may change, for `go_back`; costs next to nothing."""
        return Memory.of(self)

    def go_back(self, memory: Memory) -> None:
        """Be again as when `remember` was called; the memory stays good for another time."""
        memory.restore(self)

    @abstractmethod
    def _step(self, scan: Scan) -> Step:
        """Take a checked scan in."""

    def flush(self) -> tuple[Decision, ...]:
        """What the tracker says of the scans that are not final yet, oldest first; for the end of a recording."""
        return ()

    def _checked_time(self, time: object) -> float:
        good = isinstance(time, (int, float, np.floating, np.integer)) and not isinstance(time, bool)
        if not good or not math.isfinite(float(time)):  # type: ignore[arg-type]
            raise InvalidInputError(f"time must be a finite number of seconds, got {time!r}")
        when = float(time)  # type: ignore[arg-type]
        if self._time is not None and when < self._time:
            raise InvalidInputError(f"time must not run backwards: got {when:g} s after {self._time:g} s")
        return when

    def _checked_stamps(self, times: Sequence[Array], measurements: list[Array], when: float) -> tuple[Array, ...]:
        checked = checked_times(times, measurements, when, "times")
        early = -math.inf if self._time is None else self._time
        for s, array in enumerate(checked):
            if len(array) and array.min() < early:
                raise InvalidInputError(
                    f"times of sensor {s} must lie from the last step's time, {early:g} s, to {when:g} s, "
                    f"got {array.min():g}"
                )
        return checked

    def _timed(self, scan: Scan) -> TimedScan:
        """The tracks and a scan whose measurements have times of their own."""

        def start(where: Array, spread: Array, lag: Array) -> Any:
            return self.initiation.start(self.filter, where, spread, lag)

        before = scan.time if self._time is None else self._time
        return TimedScan(
            self.filter, self._batch.states, before, scan.measurements, scan.own_times(), self.sensors,
            self._new_tracks.places(scan.measurements), start, scan.sectors, self.gate_probability,
            scan.time, self._evidence(scan),
        )  # fmt: skip

    def _evidence(self, scan: Scan) -> PairEvidence | None:
        """What identities say of pairs of a row of the batch and a measurement."""
        known, codes, batch = self.identities, scan.identities, self._batch
        if known is None or codes is None:
            return None
        return lambda track, s, measurement: known.evidence(batch.track_id[track], codes[s][measurement])

    def _out_of_view(self) -> Array:
        """Which sensors cannot see which tracks: they have not missed them; bool (T, S)."""
        where, views = self._where(), [sensor.position_part for sensor in self.sensors]
        return ~np.stack([one.in_view(one.measure(where)) for one in views], axis=1)

    def _looked(self, sectors: Array | None) -> Array:
        """Which sensors looked where the tracks are; bool (T, S)."""
        if sectors is None:
            return np.ones((len(self._batch), len(self.sensors)), dtype=np.bool_)
        away = self._where()[:, None] - np.array([sensor.position for sensor in self.sensors])
        azimuths = np.arctan2(away[..., 1], away[..., 0])
        return np.stack([looked_at(one, own) for one, own in zip(sectors, azimuths.T, strict=True)], axis=1)

    def _where(self) -> Array:
        """Positions of the tracks, (T, 3)."""
        position = list(self.filter.motion.position)
        where = np.zeros((len(self._batch), 3))
        where[:, : len(position)] = self._batch.states.mean[:, position]
        return where

    def _seed(self) -> np.random.SeedSequence:
        """Source of the randomness of this step alone, so that a restored tracker goes on alike."""
        return np.random.SeedSequence((self.seed, self._scan))

    def _assign(self, problem: AssignmentProblem) -> Solution:
        self.solver_calls += 1
        parameters = self.solver_parameters
        if self.solver == "exact" and self.time_limit is None:
            nodes = max(_LEAST_NODES, _VISITS // max(problem.num_tuples, 1))
            parameters = {"nodes": nodes, "patience": 0} | parameters
        return assign(problem, self.solver, seed=self._seed(), time_limit=self.time_limit, advise=False, **parameters)

    def _elapsed(self, time: float) -> float:
        return 0.0 if self._time is None else time - self._time

    def _predicted(self, batch: TrackBatch, dt: float) -> TrackBatch:
        if dt == 0.0 or not len(batch):
            return batch
        return batch.moved(predict_each(self.filter, batch.states, np.full(len(batch), dt)))

    def _new_ids(self, count: int) -> Array:
        ids = np.arange(self._next_id, self._next_id + count)
        self._next_id += count
        return ids

    def _to_delete(self, batch: TrackBatch, time: float) -> Array:
        # a look is a scan of which a sensor sees a part, the quickest sensor most
        most = float(self._turns.max())
        if most < _LEAST_TURN:
            return np.zeros(len(batch), dtype=np.bool_)
        patience = self.life_cycle.patience(self.terms.miss * (self._turns / most), self._pace / most)
        return batch.to_delete(self.life_cycle, time, patience)

    def __repr__(self) -> str:
        when = "not started" if self._time is None else f"{self._scan} scans, {self._time:g} s"
        return f"{type(self).__name__}({len(self.sensors)} sensors, {self.solver}, {when})"

    def _crossings(self, scan: Scan, free: Sequence[Array]) -> tuple[Crossings, Array] | None:
        options = {"gate_probability": self.gate_probability, "max_tuples": self.max_tuples}
        return self._new_tracks.crossings(scan, free, **options)
