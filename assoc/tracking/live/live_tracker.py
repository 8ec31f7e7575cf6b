"""A tracker that takes plots one by one as they come, and goes on whatever comes."""

from __future__ import annotations

import cmath
import math
import time as clock
from collections import Counter, deque
from collections.abc import Callable, Sequence

import numpy as np

from assoc._parameters import positive
from assoc._system.door import doors
from assoc.costs.positions import single_positions
from assoc.errors import AssocError, InvalidInputError
from assoc.scene.scene import Scene
from assoc.sensors.base import LARGEST
from assoc.tracking.checking import checked
from assoc.tracking.identity_evidence import checked_identities
from assoc.tracking.live.kept_identities import KeptIdentities
from assoc.tracking.live.late_plots import HORIZON, LatePlots
from assoc.tracking.live.pictures import Picture, PlotKey, SoundPlot
from assoc.tracking.tracker import Tracker

FULL_TURN = 2.0 * math.pi
JUMP = 60.0
"""Seconds ahead of all others from which a plot's time is doubted."""
_AGREE = 10
"""So many doubtful plots in a row, of one time, are believed: the clock has jumped."""
SHORTEST = 1e-3
"""Seconds that an interval has at the least."""
SILENCE = 15.0
"""Seconds, or three turns, without a plot after which a sensor is taken not to look."""
# the antenna's phase is a mean over about this many turns, with this weight for a plot, and known after so many
_TURNS_KEPT, _WEIGHT, _KNOWN = 10.0, 0.05, 5
_MOST_TIMED = 100_000


@doors
class LiveTracker:
    """Plots in, one by one and in nearly any order; pictures out, one for each interval.

    What cannot be used is told in one line, the first of its kind at once, and counted: plots from unknown sensors, of
    other components, repeated ones, ones that are too old. A plot that is far ahead of all others in time waits until
    others agree with it; a sensor that says nothing for long is taken not to look, so that its silence is no miss.

    Parameters
    ----------
    scene : Scene
        Sensors and region; its measurements are not used.
    make : callable () -> Tracker
        A new tracker for them.
    interval : float
        Seconds of plots that are taken in together, at least a millisecond.
    turns : sequence of float, optional
        Seconds for a turn of each sensor's antenna (clockwise), at least `interval`: misses are charged where it
        pointed, by the azimuths and times of its plots. Left out, a sensor looks everywhere in an interval in which it
        sends a plot, and nowhere in others.
    horizon : float
        Seconds that plots may be late; see `LatePlots`.
    wait : float
        Seconds for which an interval stays open for plots of other sensors: what comes in them is not late.
    tell : callable (str)
        Takes the lines.
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
    ) -> None:
        self._scene, self._make, self._tell = scene, make, tell
        self.interval, self.horizon = positive(interval, "interval"), positive(horizon, "horizon")
        if self.interval < SHORTEST:
            raise InvalidInputError(f"interval: expected at least {SHORTEST:g} s, got {self.interval:g}")
        self.wait = positive(wait, "wait", zero=True)
        count = len(scene.sensors)
        self.turns = None if turns is None else [positive(one, "turns") for one in turns]
        if self.turns is not None and len(self.turns) != count:
            raise InvalidInputError(f"turns: expected one for each of {count} sensors, got {len(self.turns)}")
        if self.turns is not None and min(self.turns) < self.interval:
            raise InvalidInputError(f"turns: must not be shorter than the interval, {self.interval:g} s")
        self._names = {one.name: s for s, one in enumerate(scene.sensors) if one.name}
        self._tracker = LatePlots(make(), self.horizon)
        self._end = math.nan
        self._newest = -math.inf
        self._pending: list[SoundPlot] = []
        self._ahead: list[SoundPlot] = []
        self._behind: set[PlotKey] = set()
        self._last = [-math.inf] * count
        self._silent = [False] * count
        self._phase = [0j] * count
        self._heard = [0] * count
        self._recent: dict[PlotKey, None] = {}
        self._confirmed: set[int] = set()
        self._kept = KeptIdentities()
        self.counts: Counter[str] = Counter()
        """Plots taken, late, and those that could not be used, by what was wrong."""
        self.seconds: deque[float] = deque(maxlen=_MOST_TIMED)
        """Wall time of each of the last steps."""

    @property
    def positions(self) -> tuple[int, ...]:
        """Where x, y (and z) stand in a track's state."""
        return self._tracker.tracker.filter.motion.position

    def sensor(self, name: object) -> int | None:
        """Number of a sensor, by its name or by its number from 1; None if there is none."""
        if isinstance(name, str) and name in self._names:
            return self._names[name]
        text = str(name).strip()
        number = int(text) - 1 if text.isascii() and text.isdigit() and len(text) < 10 else -1
        return number if 0 <= number < len(self._scene.sensors) else self._names.get(text)

    def leave_out(self, kind: str, line: str) -> None:
        """Count what cannot be used; the first of its kind is told."""
        self.counts[kind] += 1
        if self.counts[kind] == 1:
            self._tell(f"{line}; further ones are only counted")

    def warm_up(self) -> None:
        """Have compiled what a first step would wait for."""
        spare, place = self._make(), self._scene.region.mean(axis=1)[None]
        for k in range(3):
            z = [
                one.measure(place, np.zeros((1, 3))) if one.measures_velocity else one.measure(place)
                for one in self._scene.sensors
            ]
            spare.step(float(k), z, [np.array([k - 0.5 / (s + 1)]) for s in range(len(z))] if k else None)

    def take(
        self, sensor: object, time: float, values: Sequence[float], identity: tuple[int, int] = (0, 0)
    ) -> list[Picture]:
        """Take in one plot.

        Parameters
        ----------
        sensor : str or int
            Name, or number from 1.
        time : float
            Seconds.
        values : sequence of float
            The components of the measurement, metres and radians.
        identity : (int, int)
            Mode 3/A code and ICAO address, 0 where there is none. A tracker that was made with `identity` associates
            by them, too; in any case `summary` says how many tracks kept one.

        Returns
        -------
        list of Picture
            Of the intervals that ended with it; mostly none.
        """
        s = self.sensor(sensor)
        if s is None:
            self.leave_out("unknown sensor", f"plot of the unknown sensor {str(sensor)[:40]!r} left out")
            return []
        where = self._scene.sensors[s].name or s + 1
        try:
            if not np.size(values):
                raise InvalidInputError(f"measurements of sensor {s} must have {self._scene.sensors[s].dim} values")
            z = checked(np.array([values], dtype=np.float64), s, self._scene.sensors[s])[0]
            known = checked_identities([np.array([identity])], [1])[0][0]
        except (AssocError, TypeError, ValueError) as error:
            self.leave_out("unusable", f"plot of {where} left out: {error}")
            return []
        if not abs(time) <= LARGEST:
            self.leave_out("unusable", f"plot of {where} left out: its time is {time:g}, expected seconds")
            return []
        plot = SoundPlot(s, time, z, known)
        # a plot that is repeated while its time is doubted does not agree with itself
        if plot.key in self._recent or plot.key in self._behind or plot.key in [one.key for one in self._ahead]:
            self.leave_out("repeated", f"{where} repeats a plot of {time:g} s: left out")
            return []
        return self._timed(plot)

    def _timed(self, plot: SoundPlot) -> list[Picture]:
        """Take in a plot that is sound, if its time is."""
        time = plot.time
        if math.isnan(self._end):
            self._begin(time)
        if time > self._newest + JUMP and self._newest > -math.inf:
            if self._ahead and abs(time - self._ahead[-1].time) > JUMP:
                self._drop_ahead()
            self._ahead.append(plot)
            if len(self._ahead) < _AGREE:
                return []
            return self._jump()
        if time < self._end - self.interval - self.horizon:
            self.leave_out("too old", f"plot of {time:g} s is more than {self.horizon:g} s late: left out")
            self._behind.add(plot.key)
            if len(self._behind) >= _AGREE:
                self._tell(f"the clock went back from {self._newest:g} s to {time:g} s: tracks begin anew")
                pictures = self.finish()
                self._restart()
                return [*pictures, *self._timed(plot)]
            return []
        if self._ahead:
            self._drop_ahead()
        self._behind.clear()
        self._recent[plot.key] = None
        self.counts["plots"] += 1
        self._hear(plot)
        pictures = self._close_before(time) if time > self._newest else []
        self._pending.append(plot)
        return pictures

    def finish(self) -> list[Picture]:
        """Take in what still waits; for the end of the plots."""
        if self._ahead:
            self._drop_ahead()
        return self._rest()

    def _rest(self) -> list[Picture]:
        """Take in the plots that are there; an interval that waits for others may have some of later ones."""
        pictures = []
        while self._pending:
            pictures.append(self._step())
        return pictures

    def _begin(self, time: float) -> None:
        self._end = self.interval * (math.floor(time / self.interval) + 1)

    def _restart(self) -> None:
        self._kept.settle(set(), math.inf)
        first = self._tracker.next_id
        self._tracker = LatePlots(self._make(), self.horizon, first_id=first)
        self._end, self._newest, self._behind = math.nan, -math.inf, set()
        self._pending, self._ahead, self._recent = [], [], {}
        self._last, self._phase = [-math.inf] * len(self._last), [0j] * len(self._last)
        self._heard = [0] * len(self._last)

    def _drop_ahead(self) -> None:
        for plot in self._ahead:
            where = self._scene.sensors[plot.sensor].name or plot.sensor + 1
            self.leave_out("ahead", f"plot of {where} is {plot.time - self._newest:g} s ahead of all others: left out")
        self._ahead = []

    def _jump(self) -> list[Picture]:
        """Believe the plots that were ahead."""
        plots, self._ahead = self._ahead, []
        first = min(plot.time for plot in plots)
        self._tell(f"the clock jumped from {self._newest:g} s to {first:g} s: tracks begin anew")
        pictures = self._rest()
        self._restart()
        for plot in sorted(plots, key=lambda one: one.time):
            pictures += self._timed(plot)
        return pictures

    def _hear(self, plot: SoundPlot) -> None:
        """Learn of a sensor that it lives, and where its antenna is."""
        s, time, z, _ = plot
        sensor = self._scene.sensors[s]
        if self._silent[s]:
            self._silent[s] = False
            self._tell(f"{sensor.name or s + 1} is back at {time:g} s")
        if self.turns is not None and "azimuth" in sensor.components:
            turn = self.turns[s]
            angle = float(z[sensor.components.index("azimuth")]) + FULL_TURN * ((time / turn) % 1.0)
            elapsed = max(time - self._last[s], 0.0) if self._heard[s] else 0.0
            held = self._phase[s] * math.exp(-elapsed / (_TURNS_KEPT * turn))
            self._phase[s] = held + _WEIGHT * cmath.exp(1j * angle)
        self._heard[s] += 1
        self._last[s] = max(self._last[s], time)

    def _close_before(self, time: float) -> list[Picture]:
        """End the intervals that a plot of this time leaves behind."""
        self._newest = time
        pictures = []
        while time > self._end + self.wait:
            pictures.append(self._step())
        return pictures

    def _step(self) -> Picture:
        """Take in the interval that ends."""
        end, count = self._end, len(self._scene.sensors)
        self._end += self.interval
        self._listen(end)
        now = [[one for one in self._pending if one.time <= end and one.sensor == s] for s in range(count)]
        self._pending = [one for one in self._pending if one.time > end]
        z = [
            np.reshape(np.array([one.z for one in own]), (-1, sensor.dim))
            for own, sensor in zip(now, self._scene.sensors, strict=True)
        ]
        times = [np.array([one.time for one in own]) for own in now]
        identities = [np.reshape(np.array([one.identity for one in own], dtype=np.int64), (-1, 2)) for own in now]
        sectors = np.array([self._sector(s, end, len(times[s]) > 0) for s in range(count)])
        begin = clock.perf_counter()
        try:
            step = self._tracker.step(end, z, times, sectors, identities)
            for known in zip(step.assigned, step.confirmed, times, identities, strict=True):
                self._kept.take(*known)
            self.counts["late"] += step.late
            if step.refused:
                self.counts["too old"] += step.refused
        except AssocError as error:
            self.leave_out("steps failed", f"the plots up to {end:g} s could not be taken in: {error}")
        self.seconds.append(clock.perf_counter() - begin)
        for key in [key for key in self._recent if key[1] < end - self.horizon - self.interval]:
            del self._recent[key]
        living = self._tracker.tracks
        # what is gone may come back with late plots
        self._kept.settle({track.track_id for track in living}, end - self.interval - self.horizon)
        tracks = [track for track in living if track.confirmed]
        ids = {track.track_id for track in tracks}
        ended, self._confirmed = sorted(self._confirmed - ids), ids
        found = [single_positions(self._scene, s, one)[0] for s, one in enumerate(z)]
        owner = np.repeat(np.arange(count), [len(one) for one in z])
        return Picture(end, tracks, ended, np.concatenate(found), owner)

    def _listen(self, end: float) -> None:
        """Say which sensors have fallen silent."""
        for s, last in enumerate(self._last):
            patience = max(SILENCE, 3.0 * self.turns[s] if self.turns is not None else 0.0)
            if self._heard[s] and not self._silent[s] and end - last > patience:
                self._silent[s] = True
                where = self._scene.sensors[s].name or s + 1
                self._tell(f"{where} says nothing since {last:g} s: it is taken not to look")

    def _sector(self, s: int, end: float, spoke: bool) -> tuple[float, float]:
        """Where a sensor looked in the interval that ends."""
        if self._silent[s]:
            return 0.0, 0.0
        if self.turns is None or "azimuth" not in self._scene.sensors[s].components:
            return 0.0, FULL_TURN if spoke else 0.0
        if self._heard[s] < _KNOWN:
            return 0.0, 0.0
        turn = self.turns[s]
        low = cmath.phase(self._phase[s]) - FULL_TURN * ((end / turn) % 1.0)
        return low, low + min(FULL_TURN * self.interval / turn, FULL_TURN)

    def summary(self) -> str:
        """One line: plots, steps and their times, what was left out, and how many tracks kept an identity."""
        steps = np.array(self.seconds) if self.seconds else np.zeros(1)
        middle, high = 1e3 * np.quantile(steps, [0.5, 0.99])
        odd = ", ".join(f"{count} {kind}" for kind, count in self.counts.items() if count and kind != "plots")
        kept, known = self._kept.counts()
        told = ""
        if known:
            # what was used says nothing of how good the result is
            used = " (identities were used to make them)" if self._tracker.tracker.settings.identity is not None else ""
            told = f"; {kept} of {known} tracks with an identity kept one{used}"
        return (
            f"{self.counts['plots']} plots in {len(self.seconds)} steps; a step takes {middle:.3g} ms, "
            f"p99 {high:.3g} ms{'; ' if odd else ''}{odd}{told}"
        )
