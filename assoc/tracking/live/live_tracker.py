"""A tracker that takes plots one by one as they arrive, and survives bad ones."""

from __future__ import annotations

import math
import os
import time as clock
from collections import Counter, deque
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from assoc._parameters import positive
from assoc._system.wrong_types import explains_wrong_types
from assoc._text.times import moment
from assoc._types import Array
from assoc.costs.positions import positions_of_scan
from assoc.errors import AssocError, InvalidInputError
from assoc.recordings.cleaning import TWIN
from assoc.recordings.columns import DAY
from assoc.scene.plausibility import implausible
from assoc.scene.scan import Scan
from assoc.scene.scene import Scene
from assoc.sensors.arrays import LARGEST
from assoc.tracking.live import state_file
from assoc.tracking.live.kept_identities import KeptIdentities
from assoc.tracking.live.late_plots import HORIZON, LatePlots
from assoc.tracking.live.own_positions import OwnPositions
from assoc.tracking.live.pictures import Antenna, CheckedPlot, Picture, SensorState
from assoc.tracking.live.state import LiveSettings, LiveState
from assoc.tracking.quality import Qualities, TrackQuality
from assoc.tracking.records.identity_evidence import checked_identities
from assoc.tracking.records.track import Step, Track
from assoc.tracking.stages.checking import checked
from assoc.tracking.tracker import Tracker

JUMP = 60.0
"""A plot whose time is this many seconds ahead of all others is doubted."""
_AGREE = 10
"""Doubtful plots in a row, close in time, after which the clock is taken to have jumped."""
_MOST_TIMED = 100_000
# numbers of plots of a sensor after which their units are checked
_LOOKS = (1, 10, 50)


@explains_wrong_types
class LiveTracker:
    """Takes plots one by one, in nearly any order; gives a picture for each interval.

    Plots that cannot be used are counted, and the first of each kind is reported in one line: unknown sensors, wrong
    components, repeated plots (of antennas that turn also those some ms later), plots that are too old. A plot far
    ahead of all others in time waits until others agree with it. A sensor that sends nothing for long is treated as
    switched off: its silence does not count as misses.

    Parameters
    ----------
    scene : Scene
        Sensors and region; its measurements are not used. A sensor that never looks by its `sectors` (all without
        width), as AIS, does not look here either: it misses nothing.
    make : callable () -> Tracker
        Makes a new tracker for them.
    interval : float
        Seconds of plots that are processed together, at least a millisecond.
    turns : sequence of float, optional
        Seconds for a turn of each sensor's antenna (clockwise), at least `interval`: misses are charged where it
        pointed, by the azimuths and times of its plots. Left out, a sensor looks everywhere in an interval in which it
        sends a plot, and nowhere in others.
    horizon : float
        Seconds that plots may be late; see `LatePlots`.
    wait : float
        Seconds for which an interval stays open for delayed plots, which then are not late.
    tell : callable (str)
        Receives the lines.
    quality : bool
        Whether pictures say how well tracks agree with their measurements, and which sensors feed them.
    """

    def __init__(
        self,
        scene: Scene,
        make: Callable[[], Tracker],
        *,
        interval: float = 1.0,
        turns: Sequence[float] | None = None,
        horizon: float = HORIZON,
        wait: float = 0.0,
        tell: Callable[[str], object] = print,
        quality: bool = False,
    ) -> None:
        spans = positive(interval, "interval"), None if turns is None else [positive(turn, "turns") for turn in turns]
        late = positive(horizon, "horizon"), positive(wait, "wait", zero=True)
        self.settings = LiveSettings(scene, make, *spans, *late, tell, quality)
        self.state = LiveState(self._begun(), [Antenna() for _ in scene.sensors], OwnPositions(scene))
        self.confirmed: set[int] = set()
        """Ids of the tracks that were confirmed after the last step."""
        self._kept = KeptIdentities()
        self._qualities = Qualities(len(scene.sensors))
        self._refused = [0] * len(scene.sensors)
        self._first: list[list[Array]] = [[] for _ in scene.sensors]
        self.counts: Counter[str] = Counter()
        """Plots used, late plots, and those that could not be used, by reason."""
        self.seconds: deque[float] = deque(maxlen=_MOST_TIMED)
        """Wall time of each of the last steps."""

    def _begun(self, **ids: int) -> LatePlots:
        return LatePlots(self.settings.make(), self.settings.horizon, **ids)

    @property
    def positions(self) -> tuple[int, ...]:
        """Indices of x, y (and z) in a track's state."""
        return self.state.tracker.tracker.filter.motion.position

    def sensor(self, name: object) -> int | None:
        """Index of a sensor, by its name or by its number from 1; None if there is none."""
        names = {sensor.name: s for s, sensor in enumerate(self.settings.scene.sensors) if sensor.name}
        if isinstance(name, str) and name in names:
            return names[name]
        text = str(name).strip()
        number = int(text) - 1 if text.isascii() and text.isdigit() and len(text) < 10 else -1
        return number if 0 <= number < len(self.settings.scene.sensors) else names.get(text)

    def save(self, path: str | os.PathLike[str], *, reserve: int = 0) -> None:
        """Write the whole state: a tracker that restores it and takes the same plots gives the same tracks.

        Parameters
        ----------
        path : path-like
            Written whole or not at all.
        reserve : int
            Number of ids that new tracks will not get, since they may be used before the next `save`.
        """
        state_file.save(path, self.settings, self.state, self.confirmed, self.counts, reserve)

    def restore(self, path: str | os.PathLike[str]) -> None:
        """Read the state of a tracker with the same scene and settings; plots that it has are taken for repeated.

        Raises
        ------
        InvalidInputError
            The file is not such a state.
        """
        self.state, self.confirmed, self.counts = state_file.restore(path, self.settings)

    @property
    def heard(self) -> list[SensorState]:
        """What is known of each sensor."""
        found = []
        for s, antenna in enumerate(self.state.antennas):
            parts = self.settings.parts[s]
            if s == parts[0]:
                refused = sum(self._refused[part] for part in parts)
                name = str(self.settings.name_of(s))
                found.append(SensorState(name, antenna.last, antenna.plots, refused, antenna.silent, parts))
        return found

    def leave_out(self, kind: str, line: str, sensor: int | None = None) -> None:
        """Count a plot (of a sensor, by its index) that cannot be used; report the first of its kind."""
        self.counts[kind] += 1
        if sensor is not None:
            self._refused[sensor] += 1
        if self.counts[kind] == 1:
            self.settings.tell(f"{line}; further ones are only counted")

    def warm_up(self) -> None:
        """Compile what the first step needs."""
        spare, centre = self.settings.make(), self.settings.scene.region.mean(axis=1)[None]
        carriers = [sensor.platform.times for sensor in self.settings.scene.sensors if sensor.platform is not None]
        begin = max((float(times[0]) for times in carriers), default=0.0)
        pace = min([1.0, *((float(times[-1]) - begin) / 3 for times in carriers)])
        for k in range(3):
            z = [
                sensor.measure(centre, np.zeros((1, 3))) if sensor.measures_velocity else sensor.measure(centre)
                for sensor in self.settings.scene.sensors
            ]
            spare.step(
                begin + pace * k,
                z,
                [np.array([begin + pace * (k - 0.5 / (s + 1))]) for s in range(len(z))] if k else None,
            )

    def take(
        self, sensor: object, time: float, values: Sequence[float], identity: tuple[int, int] = (0, 0)
    ) -> list[Picture]:
        """Process one plot.

        Parameters
        ----------
        sensor : str or int
            Name, or number from 1.
        time : float
            Seconds; seconds of the day go on over midnight.
        values : sequence of float
            The components of the measurement, metres and radians.
        identity : (int, int)
            Mode 3/A code and ICAO address, 0 where there is none. Trackers made with `identity` also use them to
            associate; in any case `summary` says how many tracks kept one.

        Returns
        -------
        list of Picture
            One for each interval that ended with it; mostly empty.
        """
        s = self.sensor(sensor)
        if s is None:
            self.leave_out("unknown sensor", f"plot of the unknown sensor {str(sensor)[:40]!r} left out")
            return []
        where, sensor = self.settings.name_of(s), self.settings.scene.sensors[s]
        try:
            if not np.size(values):
                raise InvalidInputError(f"measurements of sensor {s} must have {sensor.dim} values")
            z = checked(np.array([values], dtype=np.float64), s, sensor)[0]
            known = checked_identities([np.array([identity])], [1])[0][0]
        except (AssocError, TypeError, ValueError) as error:
            self.leave_out("unusable", f"plot of {where} left out: {error}", s)
            return []
        if not abs(time) <= LARGEST:
            self.leave_out("unusable", f"plot of {where} left out: its time is {time:g}, expected seconds", s)
            return []
        time = self._running(time)
        plot, state = CheckedPlot(s, time, z, known), self.state
        # a repetition of a doubted plot does not confirm its time
        if plot.key in state.recent or plot.key in state.behind or plot.key in [plot.key for plot in state.ahead]:
            self.leave_out("repeated", f"{where} repeats a plot of {moment(time)}: left out", s)
            return []
        turn, twin = self.settings.turn_of(s), state.placed.get((s, plot.key[2]), math.inf)
        if turn is not None and abs(time - twin) <= min(TWIN, 0.5 * turn):
            # the same plot over another line of the feed
            later = f"{1e3 * abs(time - twin):.0f} ms from it"
            self.leave_out("repeated", f"{where} repeats a plot of {moment(twin)}, {later}: left out", s)
            return []
        return self._timed(plot)

    def take_own_position(
        self, sensor: object, time: float, position: Sequence[float], heading: float | None = None
    ) -> None:
        """Take in where a platform is: the sensors that it carries stand there, and between two of them in between.

        A position that the platform cannot have reached is left out, unless the next one confirms it.

        Parameters
        ----------
        sensor : str or int
            Any sensor that the platform carries, by its name, or number from 1.
        time : float
            Seconds; later than the last one's.
        position : sequence of float
            x, y, z in the scene's frame, metres.
        heading : float, optional
            Azimuth of the forward direction, radians from +x towards +y; needed where the scene's platform has
            headings, and not used elsewhere.
        """
        s = self.sensor(sensor)
        carrier = None if s is None else self.settings.scene.sensors[s].platform
        if s is None or carrier is None:
            what = "unknown" if s is None else "on no platform"
            self.leave_out("own positions", f"own position for {str(sensor)[:40]!r} left out: the sensor is {what}", s)
            return
        time = self._running(time)
        try:
            self.state.own_positions.take(carrier, time, position, heading)
        except AssocError as error:
            where = self.settings.name_of(s)
            self.leave_out("own positions", f"own position of {where} at {moment(time)} left out: it {error}", s)

    def _running(self, time: float) -> float:
        """A time, or seconds of the day on the day on which they are near the plots before."""
        newest = self.state.newest
        if not -JUMP <= time < DAY + JUMP or not abs(newest) <= LARGEST:
            return time
        day = time + DAY * round((newest - time) / DAY)
        return day if -self.settings.horizon <= day - newest <= JUMP else time

    def _timed(self, plot: CheckedPlot) -> list[Picture]:
        """Process a sound plot, unless its time is doubted or too old."""
        time, state, settings = plot.time, self.state, self.settings
        if math.isnan(state.end):
            state.end = settings.interval * (math.floor(time / settings.interval) + 1)
        if time > state.newest + JUMP and state.newest > -math.inf:
            if state.ahead and abs(time - state.ahead[-1].time) > JUMP:
                self._drop_ahead()
            state.ahead.append(plot)
            return self._jump() if len(state.ahead) >= _AGREE else []
        if time < state.end - settings.interval - settings.horizon:
            self.leave_out(
                "too old", f"plot of {moment(time)} is more than {settings.horizon:g} s late: left out", plot.sensor
            )
            state.behind.add(plot.key)
            if len(state.behind) < _AGREE:
                return []
            settings.tell(f"the clock went back from {moment(state.newest)} to {moment(time)}: tracks begin anew")
            pictures = self.finish()
            self._restart()
            return [*pictures, *self._timed(plot)]
        self._drop_ahead()
        state.behind.clear()
        state.recent[plot.key] = None
        state.placed[plot.sensor, plot.key[2]] = time
        self.counts["plots"] += 1
        self._note_antenna(plot)
        pictures = []
        if time > state.newest:
            state.newest = time
            while time > state.end + settings.wait:
                pictures.append(self._step())
        state.pending.append(plot)
        return pictures

    def finish(self) -> list[Picture]:
        """Process the plots that still wait; for the end of the plots."""
        self._drop_ahead()
        return self._rest()

    def _rest(self) -> list[Picture]:
        """Process all pending plots; some may belong to later intervals than the open one."""
        pictures = []
        while self.state.pending:
            pictures.append(self._step())
        return pictures

    def _restart(self) -> None:
        """Start tracks anew, with unused ids."""
        self._kept.settle(set(), math.inf)
        self._qualities.keep(())
        late = self._begun(first_id=self.state.tracker.next_id)
        antennas = [Antenna(silent=antenna.silent) for antenna in self.state.antennas]
        self.state = LiveState(late, antennas, self.state.own_positions)

    def _drop_ahead(self) -> None:
        for plot in self.state.ahead:
            where, ahead = self.settings.name_of(plot.sensor), plot.time - self.state.newest
            self.leave_out("ahead", f"plot of {where} is {ahead:g} s ahead of all others: left out", plot.sensor)
        self.state.ahead = []

    def _jump(self) -> list[Picture]:
        """Accept the plots that were ahead: the clock has jumped."""
        plots, self.state.ahead = self.state.ahead, []
        first = min(plot.time for plot in plots)
        self.settings.tell(f"the clock jumped from {moment(self.state.newest)} to {moment(first)}: tracks begin anew")
        pictures = self._rest()
        self._restart()
        for plot in sorted(plots, key=lambda plot: plot.time):
            pictures += self._timed(plot)
        return pictures

    def _note_antenna(self, plot: CheckedPlot) -> None:
        """Update the sensor's antenna by a plot."""
        s, time, z, _ = plot
        turn, sensor = self.settings.turn_of(s), self.settings.scene.sensors[s]
        if self.state.antennas[s].silent:
            self.settings.tell(f"{self.settings.name_of(s)} is back at {moment(time)}")
        self._doubt_units(s, z)
        azimuth = 0.0 if turn is None else float(z[sensor.components.index("azimuth")])
        for part in self.settings.parts[s]:
            self.state.antennas[part] = self.state.antennas[part].after(time, azimuth, turn)

    def _doubt_units(self, s: int, z: Array) -> None:
        """Tell once if the first plots of a sensor are hardly in metres and radians."""
        first, sensor = self._first[s], self.settings.scene.sensors[s]
        if len(first) >= _LOOKS[-1]:
            return
        first.append(z)
        odd = implausible([sensor], [[np.array(first)]]) if len(first) in _LOOKS else ()
        if odd:
            self.settings.tell(f"warning: {'; '.join(odd)}")
            self._first[s] = [z] * _LOOKS[-1]

    def _step(self) -> Picture:
        """Take in the interval that ends, with sensors where their platforms are."""
        with self.state.under_way(self.settings) as scene:
            return self._step_at(scene)

    def _step_at(self, scene: Scene) -> Picture:
        settings, state, end = self.settings, self.state, self.state.end
        for s, last in state.own_positions.silent(settings.scene, end):
            settings.tell(f"{settings.name_of(s)} has had no own position since {moment(last)}: it goes on as then")
        sensors, interval = scene.sensors, settings.interval
        state.end += interval
        sectors = np.zeros((len(sensors), 2))
        z, times, identities = [], [], []
        for s, sensor in enumerate(sensors):
            now = [plot for plot in state.pending if plot.time <= end and plot.sensor == s]
            z.append(np.reshape(np.array([plot.z for plot in now]), (-1, sensor.dim)))
            times.append(np.array([plot.time for plot in now]))
            identities.append(np.reshape(np.array([plot.identity for plot in now], dtype=np.int64), (-1, 2)))
            antenna, turn = state.antennas[s], settings.turn_of(s)
            if antenna.falls_silent(end, None if settings.turns is None else settings.turns[s]):
                state.antennas[s] = antenna = antenna._replace(silent=True)
                if s == settings.parts[s][0]:
                    settings.tell(
                        f"{settings.name_of(s)} has sent nothing since {moment(antenna.last)}: it is treated as "
                        "switched off"
                    )
            sent = any(plot.time <= end and plot.sensor in settings.parts[s] for plot in state.pending)
            heading = 0.0 if sensor.platform is None else float(sensor.platform.poses(np.array([end]))[1][0])
            if not settings.reporting[s]:
                sectors[s] = np.add(antenna.sector(end, interval, turn, sent), heading)
        state.pending = [plot for plot in state.pending if plot.time > end]
        begin, step = clock.perf_counter(), None
        try:
            step = state.tracker.step(end, z, times, sectors, identities)
            for of_sensor in zip(step.assigned, step.confirmed, times, identities, strict=True):
                self._kept.take(*of_sensor)
            self.counts["late"] += step.late
            if step.refused:
                self.counts["too old"] += step.refused
        except AssocError as error:
            self.leave_out("steps failed", f"the plots up to {moment(end)} could not be processed: {error}")
        self.seconds.append(clock.perf_counter() - begin)
        too_old = end - settings.horizon - interval
        state.forget(too_old)
        living = state.tracker.tracks
        # late plots may bring tracks back until then
        self._kept.settle({track.track_id for track in living}, too_old)
        tracks = [track for track in living if track.confirmed]
        ids = {track.track_id for track in tracks}
        ended, self.confirmed = sorted(self.confirmed - ids), ids
        scan = Scan(0, end, tuple(z), times=tuple(times)).aligned(sensors)
        found = [positions_of_scan(scene.at(end), scan, s)[0] for s in range(len(sensors))]
        owner = np.repeat(np.arange(len(sensors)), [len(measured) for measured in z])
        begin = clock.perf_counter()
        agreements = self._agreements(step, tracks)
        self.seconds[-1] += clock.perf_counter() - begin
        names = {number: name for number in ids if (name := self._kept.name_of(number))}
        return Picture(end, tracks, ended, np.concatenate(found), owner, agreements, names)

    def _agreements(self, step: Step | None, tracks: Sequence[Track]) -> dict[int, TrackQuality]:
        """How well the tracks agree with their measurements after a step, None if it failed."""
        if not self.settings.quality:
            return {}
        late = self.state.tracker
        if step is not None:
            # plots that came late feed a track, too; they are not compared with its predictions
            self._qualities.count(step.assigned)
            last = late.past[-1]
            on_time = replace(step, assigned=last.assigned)
            self._qualities.compare(late.tracker, last.before, on_time, last.measurements, last.times, late.names)
        self._qualities.keep(track.track_id for track in late.tracks)
        return {track.track_id: self._qualities.of_track(track.track_id) for track in tracks}

    def summary(self) -> str:
        """One line: plots, steps and their times, plots left out, and how many tracks kept one identity."""
        steps = np.array(self.seconds) if self.seconds else np.zeros(1)
        middle, high = 1e3 * np.quantile(steps, [0.5, 0.99])
        odd = ", ".join(f"{count} {kind}" for kind, count in self.counts.items() if count and kind != "plots")
        kept, known = self._kept.counts()
        judged = ""
        if known:
            # identities that were used to associate cannot judge the result
            use = self.state.tracker.tracker.settings.identity is not None
            used = " (identities were used to make them)" if use else ""
            judged = f"; {kept} of {known} tracks with an identity kept one{used}"
        return (
            f"{self.counts['plots']} plots in {len(self.seconds)} steps; a step takes {middle:.3g} ms, "
            f"p99 {high:.3g} ms{'; ' if odd else ''}{odd}{judged}"
        )
