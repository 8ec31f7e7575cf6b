"""Running trackers and judging them, beside an oracle: GOSPA, OSPA(2), HOTA, identity switches, CPU time of a scan."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from assoc._types import Array
from assoc.metrics import Trajectories, gospa_over_time, hota, identity, ospa2
from assoc.scene import Scene
from assoc.tracking import TRACKERS, Tracker, TrackTable
from assoc.tracking.associate.all_sensors import whole_scan
from assoc.tracking.associate.mht import TrackTrees
from assoc.tracking.filter_choice import manoeuvre_noise, open_heights, pace_of, two_speeds
from assoc.tracking.method import Method
from assoc.tracking.progress import Association, Progress
from assoc.tracking.records.track_batch import TrackBatch
from assoc.tracking.settings import TrackerSettings
from experiments.common.claims import GOAL, Claim
from experiments.common.command import mean_interval
from experiments.common.measuring import processor_time


@dataclass(frozen=True)
class Run:
    """A tracker's way through a scene.

    tracks: The confirmed tracks.
    confirmed: list over scans of (ids (n,), positions (n, 3)).
    seconds: array (K,). CPU time of each scan.
    """

    tracks: Trajectories
    confirmed: list[tuple[Array, Array]]
    seconds: Array


def through(tracker: Tracker, scene: Scene) -> Run:
    """Take a scene in, scan by scan."""
    table, confirmed, seconds = TrackTable(), [], []
    for k in range(scene.num_scans):
        scan = scene.scan(k)
        # CPU time: what else the machine does is not the tracker's
        seconds.append(processor_time(tracker.step, scan.time, scan.measurements, scan.times, scan.sectors)[1])
        tracks = [track for track in tracker.tracks if track.reported]
        table.add(tracks, tracker.filter.motion.position)
        places = np.array([track.position for track in tracks]).reshape(-1, 3)
        confirmed.append((np.array([track.track_id for track in tracks], dtype=np.int64), places))
    return Run(Trajectories(*table.arrays()), confirmed, np.array(seconds))


@dataclass(frozen=True)
class Oracle(Method):
    """The targets of all measurements, scan by scan; its own part of a state is the target of each track."""

    starter = TrackTrees()

    sources: Any

    def begun(self, settings: TrackerSettings, tracks: TrackBatch) -> dict[int, int]:
        """No track has a target."""
        return {}

    def associate(self, progress: Progress) -> Association:
        """Correct each track by its target's measurements."""
        rows, fresh = self._true_rows(progress)
        scan = whole_scan(progress)
        return self._noted(progress, scan.associated(scan.follow(np.arange(len(rows)), rows), rows, fresh))

    def _true_rows(self, progress: Progress) -> tuple[Array, Array]:
        """Measurements of each track, and of the targets without one."""
        sources = self.sources[progress.scan.index]
        known = [progress.state.method_state[i] for i in progress.state.tracks.track_id.tolist()]
        fresh = sorted({t for source in sources for t in source.tolist() if t >= 0} - set(known))
        return _rows(sources, known), _rows(sources, fresh)

    def _noted(self, progress: Progress, found: Association) -> Association:
        """Take note of which target each track has."""
        target_of = dict(progress.state.method_state)
        for source, ids in zip(self.sources[progress.scan.index], found.assigned, strict=True):
            target_of |= {i: t for i, t in zip(ids.tolist(), source.tolist(), strict=True) if i}
        return found._replace(method_state=target_of)


class OracleTracker(Tracker):
    """Tracks by the sources of the measurements, with the filter and the life of tracks of any other tracker.

    scene: With truth.
    **options: As for `Tracker`.
    """

    name = "oracle"
    method = Oracle

    def __init__(self, scene: Scene, **options: Any) -> None:
        noise = manoeuvre_noise(pace_of(scene.times))
        filter = two_speeds(noise, unscented=open_heights(scene.sensors))
        options = {"filter": filter, "region": scene.region} | options
        super().__init__(scene.sensors, sources=scene.truth.sources, **options)


def _rows(sources: Any, targets: list[int]) -> Array:
    """1-based measurements (T, S) of these targets, 0 where missed."""
    rows = np.zeros((len(targets), len(sources)), dtype=np.int32)
    for s, source in enumerate(sources):
        number = {t: m + 1 for m, t in enumerate(source.tolist()) if t >= 0}
        rows[:, s] = [number.get(t, 0) for t in targets]
    return rows


CUTOFF = 500.0
"""Of GOSPA (order 2), OSPA(2) and HOTA, metres."""
NAMES = ("oracle", *TRACKERS, "GNN")


class Judged(NamedTuple):
    """One tracker on one scene."""

    distances: Array
    """GOSPA of each scan, metres."""
    ospa2: float
    hota: float
    switches: int
    milliseconds: float
    """CPU time of a scan, the median of all but the first."""


def make(name: str, scene: Scene) -> Tracker:
    """Make a tracker of this name, default settings."""
    if name == "oracle":
        return OracleTracker(scene)
    if name == "GNN":
        return TRACKERS["nearest-neighbour"].for_scene(scene, rule="assignment")
    return TRACKERS[name].for_scene(scene)


def judge(name: str, scene: Scene) -> Judged:
    """Run a tracker over a scene."""
    done, truth = through(make(name, scene), scene), Trajectories.from_scene(scene)
    _, windows = ospa2(truth, done.tracks, CUTOFF)
    return Judged(
        distances(scene, done.tracks),
        float(np.mean([window.distance for window in windows])) if windows else 0.0,
        hota(truth, done.tracks, CUTOFF).hota,
        identity(truth, done.tracks, CUTOFF).switches,
        1e3 * float(np.median(done.seconds[1:])),
    )


def distances(scene: Scene, tracks: Trajectories, cutoff: float = CUTOFF) -> Array:
    """GOSPA of each scan, metres; 0 where neither a target nor a track is."""
    times, values = gospa_over_time(Trajectories.from_scene(scene), tracks, cutoff)
    by_time = dict(zip(times.tolist(), values, strict=True))
    return np.array([by_time[t].distance if t in by_time else 0.0 for t in scene.times.tolist()])


def means(runs: Sequence[Judged]) -> Array:
    """Mean GOSPA of each run, metres."""
    return np.array([run.distances.mean() for run in runs])


def compare(label: str, names: Sequence[str], scenes: Sequence[Scene]) -> list[Claim]:
    """What trackers of these names did on the same scenes."""
    return [claim for name in names for claim in claims_of(label, name, [judge(name, scene) for scene in scenes])]


def claims_of(label: str, name: str, runs: Sequence[Judged]) -> list[Claim]:
    """What a tracker did on the scenes of one kind."""
    return [
        mean_claim(f"{label}, {name}: GOSPA", "m", means(runs)),
        mean_claim(f"{label}, {name}: OSPA(2)", "m", np.array([run.ospa2 for run in runs])),
        mean_claim(f"{label}, {name}: HOTA", "", np.array([run.hota for run in runs])),
        mean_claim(f"{label}, {name}: switches", "", np.array([float(run.switches) for run in runs])),
        Claim(f"{label}, {name}: CPU time of a scan", "ms", ours=float(np.median([run.milliseconds for run in runs]))),
    ]


def mean_claim(quantity: str, unit: str, values: Array) -> Claim:
    """The mean over scenes, with its interval where there are several."""
    interval = mean_interval(values) if len(values) > 1 else None
    return Claim(quantity, unit, ours=float(values.mean()), interval=interval)


def goal(quantity: str, unit: str, values: Array, most: float) -> Claim:
    """A goal for a mean over scenes: at most so much, with the whole interval."""
    claim = mean_claim(f"goal: {quantity}", unit, values)
    _, high = claim.interval or (claim.ours, claim.ours)
    return replace(claim, band=(None, most), holds=high <= most, source=GOAL)
