"""Two boats seen by lidar, radar and cameras of a moving ferry, with their true positions (Autoferry, CC0).

FOLDER holds scenarioN_detections.json and scenarioN_groundTruth.json. One setting for all scenarios, below; the
radar's reach is 300 m. GOSPA (cutoff 50 m, order 2) at the radar's frames, beside the nearest detection within 25 m of
each boat ("oracle"). Only tracks that move are judged (`assoc.tracking.MovingTargets`: 15 m from where they began;
tracks of parts of one hull are one): the truth is the two boats, not docks and moored boats. "Left out": each scenario
with the one of six settings that is best on the mean of the others.
"""

import re
import time
from collections.abc import Mapping, Sequence
from functools import cache
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np

from assoc._types import Array
from assoc.metrics import Trajectories, gospa, identity, ospa2
from assoc.scene import Scene
from assoc.tracking import TRACKERS, Initiation, LifeCycle, MovingTargets, Tracker
from assoc.tracking.filter_choice import two_speeds
from experiments.common.claims import GOAL, Claim
from experiments.common.command import make_parser, run
from experiments.real.ferry_files import read_autoferry

CUTOFF, NEAR = 50.0, 25.0
SETS = {"radar and lidar": ("lidar", "radar"), "all sensors": ("lidar", "radar", "infrared", "colour")}
GOALS = {"radar and lidar": 24.0, "all sensors": 20.0}
LEFT_OUT_GOAL = 28.0
LEFT_OUT = "multi-sensor, left out"


class Setting(NamedTuple):
    """What a tracker is told of boats."""

    process_noise: float = 0.5
    """They change their velocity by 1 m/s in some seconds."""
    patience: float = 10.0
    """Seconds: a boat behind another is out of sight for some."""


SETTING = Setting()
"""For all scenarios."""
SETTINGS = [Setting(*values) for values in product((0.2, 0.5, 1.0), (5.0, 10.0))]
"""From which the leaving out of recordings chooses."""
# boats of up to 10 m/s
SPEED = 5.0


class Result(NamedTuple):
    """A tracker on a scenario; GOSPA in metres, false and missed in boats, means over the radar's frames."""

    gospa: float
    false: float
    missed: float
    ospa2: float
    switches: int
    begun: list[float]
    """Seconds from each boat's second detection to its first track; the whole recording if it has none."""
    seconds: float


def make(name: str, scene: Scene, setting: Setting = SETTING) -> Tracker:
    """The tracker with a setting; "adapting" also learns its sensors."""
    kind, _, adapting = name.partition(", ")
    return TRACKERS[kind](
        scene.sensors, two_speeds(setting.process_noise, 2), region=scene.region,
        initiation=Initiation(speed=SPEED), life_cycle=LifeCycle(deletion_time=setting.patience),
        adapt=bool(adapting),
    )  # fmt: skip


class Pictures(NamedTuple):
    """What a tracker showed after each frame."""

    moving: list[tuple[Array, Array]]
    """Ids and positions (n, 2) of moving targets."""
    every: list[Array]
    """Positions of all targets."""
    seconds: float
    """CPU time of it all."""


def pictures(name: str, scene: Scene, setting: Setting = SETTING) -> Pictures:
    """Take a tracker through a scenario."""
    tracker, moving, found, every = make(name, scene, setting), MovingTargets(), [], []
    begin = time.process_time()
    for k in range(scene.num_scans):
        scan = scene.scan(k)
        tracker.step(scan.time, scan.measurements, sectors=scan.sectors)
        targets = moving.of([track for track in tracker.tracks if track.confirmed])
        places = np.array([target.position[:2] for target in targets]).reshape(-1, 2)
        mask = np.array([target.moving for target in targets], dtype=np.bool_)
        ids = np.array([target.track_id for target in targets], dtype=np.int64)
        found.append((ids[mask], places[mask]))
        every.append(places)
    return Pictures(found, every, time.process_time() - begin)


def detections(scene: Scene) -> list[tuple[Array, Array]]:
    """The boats (as ids) that lidar or radar detected in each frame, and where."""
    found = []
    for k in range(scene.num_scans):
        scan = scene.scan(k).aligned(scene.sensors)
        z = np.concatenate([m for m in scan.measurements if m.shape[1] == 2])
        boats, ids = scene.truth.positions[k][:, :2], scene.truth.target_ids[k]
        apart = np.linalg.norm(boats[:, None] - z, axis=2) if len(z) else np.full((len(boats), 1), np.inf)
        seen = apart.min(axis=1, initial=np.inf) < NEAR
        found.append((ids[seen], z[apart.argmin(axis=1)[seen]] if len(z) else np.zeros((0, 2))))
    return found


def oracle(scene: Scene) -> Pictures:
    """The last detection of each boat, for as long as a turn of the radar."""
    last: dict[int, tuple[float, Array]] = {}
    result = []
    for t, (ids, places) in zip(scene.times.tolist(), detections(scene), strict=True):
        last |= {i: (t, place) for i, place in zip(ids.tolist(), places, strict=True)}
        fresh = {i: place for i, (when, place) in last.items() if t - when < 2.0}
        result.append((np.array([*fresh], dtype=np.int64), np.array([*fresh.values()]).reshape(-1, 2)))
    return Pictures(result, [places for _, places in result], 0.0)


def judge(scene: Scene, shown: Pictures) -> Result:
    """Compare pictures with the boats."""
    found = shown.moving
    radar = [sensor.name for sensor in scene.sensors].index("radar")
    frames = np.flatnonzero(scene.sectors[:, radar, 1] > scene.sectors[:, radar, 0])
    values = [gospa(scene.truth.positions[k][:, :2], found[k][1], CUTOFF) for k in frames]
    share = np.array([[value.distance, value.false, value.missed] for value in values]).mean(axis=0)
    truth, tracks = (
        Trajectories(
            np.repeat(scene.times[frames], [len(ids) for ids, _ in rows]),
            np.concatenate([ids for ids, _ in rows]),
            np.concatenate([places[:, :2] for _, places in rows]),
        )
        for rows in (
            [(scene.truth.target_ids[k], scene.truth.positions[k]) for k in frames],
            [found[k] for k in frames],
        )
    )
    windows = ospa2(truth, tracks, CUTOFF)[1]
    return Result(
        float(share[0]), float(share[1]) / (CUTOFF**2 / 2), float(share[2]) / (CUTOFF**2 / 2),
        float(np.mean([window.distance for window in windows])), identity(truth, tracks, CUTOFF).switches,
        [_begun(scene, shown.every, boat) for boat in np.unique(np.concatenate(scene.truth.target_ids)).tolist()],
        shown.seconds,
    )  # fmt: skip


def _begun(scene: Scene, every: list[Array], boat: int) -> float:
    """Seconds from a boat's second detection to its first track."""
    seen = [k for k, (ids, _) in enumerate(detections(scene)) if boat in ids]
    for k, places in enumerate(every):
        there = scene.truth.positions[k][scene.truth.target_ids[k] == boat][:, :2]
        if len(there) and len(places) and np.linalg.norm(places - there, axis=1).min() < CUTOFF:
            return max(0.0, float(scene.times[k] - scene.times[seen[1]]))
    return float(np.ptp(scene.times))


def scenarios(folder: Path) -> list[int]:
    """Numbers of the scenarios in a folder."""
    names = (re.fullmatch(r"scenario(\d+)_detections\.json", path.name) for path in folder.iterdir())
    return sorted(int(name[1]) for name in names if name)


def load(folder: Path, number: int, sensors: Sequence[str]) -> Scene:
    """Read a scenario."""
    names = (folder / f"scenario{number}_{part}.json" for part in ("detections", "groundTruth"))
    return read_autoferry(*names, sensors=tuple(sensors))


def left_out(scenes: Mapping[int, Scene]) -> dict[int, tuple[Setting, Result]]:
    """By scenario the setting that is best on all others, and its result on this one."""

    @cache
    def tried(setting: Setting, number: int) -> Result:
        return judge(scenes[number], pictures("multi-sensor", scenes[number], setting))

    def best(number: int) -> Setting:
        return min(SETTINGS, key=lambda setting: sum(tried(setting, n).gospa for n in scenes if n != number))

    return {number: (setting, tried(setting, number)) for number in scenes for setting in [best(number)]}


def experiment(folder: Path, quick: bool, names: Sequence[str], sets: Sequence[str]) -> list[Claim]:
    """All trackers on all scenarios, first with radar and lidar, then with the cameras."""
    claims: list[Claim] = []
    numbers = scenarios(folder)[: 1 if quick else None]
    for which in sets:
        scenes = {number: load(folder, number, SETS[which]) for number in numbers}
        for name in names:
            chosen: dict[int, tuple[Setting, Result]] = {}
            if name == LEFT_OUT:
                chosen = left_out(scenes)
            results = {number: result for number, (_, result) in chosen.items()} or {
                number: judge(scene, oracle(scene) if name == "oracle" else pictures(name, scene))
                for number, scene in scenes.items()
            }
            label = f"{which}, {name}"
            for number, j in results.items():
                text = ", ".join(f"{seconds:.0f}" for seconds in j.begun)
                what = f"{j.false:.2f} false, {j.missed:.2f} missed, {j.switches} new ids, begun after {text} s"
                source = f"{what}, OSPA(2) {j.ospa2:.1f} m, CPU {j.seconds:.1f} s"
                if number in chosen:
                    noise, patience = chosen[number][0]
                    source += f"; process noise {noise:g}, patience {patience:g} s"
                claims.append(Claim(f"{label}, scenario {number}: GOSPA", "m", ours=j.gospa, source=source))
            mean = float(np.mean([j.gospa for j in results.values()]))
            goal = {"multi-sensor": GOALS[which], LEFT_OUT: LEFT_OUT_GOAL}.get(name)
            band = None if goal is None else (None, goal)
            claims.append(Claim(f"{label}, mean: GOSPA", "m", ours=mean, band=band, source=GOAL))
    return claims


def program(arguments: Sequence[str] | None = None) -> int:
    """Run the experiment; returns its exit code."""
    names = ("oracle", *TRACKERS, "multi-sensor, adapting", LEFT_OUT)
    parser = make_parser("real.autoferry", __doc__)
    parser.add_argument("folder", metavar="FOLDER", type=Path, help="folder of the scenarios' files")
    parser.add_argument("--only", nargs="+", choices=names, metavar="NAME", help="these trackers alone")
    parser.add_argument("--sensors", nargs="+", choices=SETS, metavar="NAME", help="these sets of sensors alone")
    chosen = parser.parse_args(arguments)
    if not chosen.folder.is_dir() or not scenarios(chosen.folder):
        parser.error(f"{chosen.folder}: expected a folder with scenarioN_detections.json")
    return run(
        parser, chosen,
        lambda quick, rng: experiment(chosen.folder, quick, chosen.only or names, chosen.sensors or [*SETS]), __doc__,
    )  # fmt: skip


if __name__ == "__main__":
    raise SystemExit(program())
