"""Turning radars, each at its own pace: measurements with times of their own, and late ones.

    python -m experiments.trackers.asynchronous [FILE.csv] [--quick] [--seed N] [--json FILE] [--figure FILE]

Three radars with 4, 5 and 5.5 seconds for a turn see thirty airliners, and with a file recorded traffic. GOSPA (order
2), identity switches and CPU time of a scan, beside an oracle that is told which measurement is whose and when it was
made; and what comes of it when the plots of four seconds are taken to be of one instant. Then a fifth of the plots
arrives up to 30 s late: the tracks as they are once everything is there, as they are shown at once, and with the late
plots refused, beside the tracks of plots in order. Seeds are --seed and those that follow.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from assoc import simulation
from assoc._types import Array
from assoc.metrics import Trajectories, gospa_over_time, identity
from assoc.scene import Scene
from assoc.tracking import TRACKERS, LatePlots, TrackTable
from experiments.common.claims import Claim
from experiments.common.command import make_parser, mean_interval, run
from experiments.trackers.oracle import OracleTracker
from experiments.trackers.running import through

CUTOFF = 500.0
"""Of GOSPA, metres."""
TURNS, INTERVAL = "4,5,5.5", 4.0
NAMES = ("oracle", "multi-sensor", "static", "mht", "nearest-neighbour")
WITHIN_ORACLE, WITHIN_ORDER = 1.10, 1.02
LATE_SHARE, MOST_LATE = 0.2, 30.0
LATE_NAMES = ("in order", "late, once all is there", "late, at once", "late refused")
_SETTLED = 5
"""Scans at the beginning that are left out where ways to treat late plots are compared."""


class Judged(NamedTuple):
    """One tracker on one scene."""

    gospa: float
    switches: float
    milliseconds: float


def at_one_instant(scene: Scene) -> Scene:
    """The scene as one sees it who takes all plots of a scan to be of its end."""
    return Scene(scene.sensors, scene.times, scene.measurements, scene.region, scene.truth)


def mean_gospa(scene: Scene, tracks: Trajectories, scans: slice = slice(None)) -> float:
    """Mean GOSPA over some of the scans, metres."""
    times, values = gospa_over_time(Trajectories.from_scene(scene), tracks, CUTOFF)
    by_time = dict(zip(times.tolist(), values, strict=True))
    return float(np.mean([by_time[t].distance if t in by_time else 0.0 for t in scene.times[scans].tolist()]))


def judge(name: str, scene: Scene) -> Judged:
    """Run a tracker with default settings over a scene."""
    if name == "multi-sensor, as one instant":
        scene, name = at_one_instant(scene), "multi-sensor"
    tracker = OracleTracker(scene) if name == "oracle" else TRACKERS[name].for_scene(scene)
    done = through(tracker, scene)
    switches = identity(Trajectories.from_scene(scene), done.tracks, CUTOFF).switches
    return Judged(mean_gospa(scene, done.tracks), float(switches), 1e3 * float(np.median(done.seconds[1:])))


def arrivals(scene: Scene, rng: np.random.Generator) -> list[tuple[list[Array], list[Array]]]:
    """Measurements and their times by the scan in which they arrive; what comes after the last scan is lost."""
    assert scene.measurement_times is not None
    count = len(scene.sensors)
    z: list[list[list[Array]]] = [[[] for _ in range(count)] for _ in range(scene.num_scans)]
    times: list[list[list[float]]] = [[[] for _ in range(count)] for _ in range(scene.num_scans)]
    for scan, stamps in zip(scene.measurements, scene.measurement_times, strict=True):
        for s in range(count):
            late = rng.uniform(0.0, MOST_LATE, len(stamps[s])) * (rng.random(len(stamps[s])) < LATE_SHARE)
            arrive = np.searchsorted(scene.times, stamps[s] + late)
            for k, one, when in zip(arrive.tolist(), scan[s], stamps[s].tolist(), strict=True):
                if k < scene.num_scans:
                    z[k][s].append(one)
                    times[k][s].append(when)
    return [
        (
            [np.reshape(np.array(rows), (-1, one.dim)) for rows, one in zip(z[k], scene.sensors, strict=True)],
            [np.array(one, dtype=np.float64) for one in times[k]],
        )
        for k in range(scene.num_scans)
    ]


def late_plots(scene: Scene, rng: np.random.Generator) -> tuple[list[float], float]:
    """GOSPA of each way to treat late plots (`LATE_NAMES`), and the median CPU time of a scan with late ones, ms."""
    behind = int(np.ceil(MOST_LATE / INTERVAL)) + 1
    judged = slice(_SETTLED, scene.num_scans - behind)
    ordered = through(TRACKERS["multi-sensor"].for_scene(scene), scene).tracks
    given = arrivals(scene, rng)
    tracker = LatePlots(TRACKERS["multi-sensor"].for_scene(scene), MOST_LATE + INTERVAL)
    strict = LatePlots(TRACKERS["multi-sensor"].for_scene(scene), 1e-6)
    settled, shown, refused = TrackTable(), TrackTable(), TrackTable()
    seconds = []
    for k, (z, times) in enumerate(given):
        scan = scene.scan(k)
        begin = time.process_time()
        tracker.step(scan.time, z, times, scan.sectors)
        seconds.append(time.process_time() - begin)
        shown.add(one for one in tracker.tracks if one.confirmed)
        if k >= behind - 1:
            settled.add(one for one in tracker.past_tracks(-behind) if one.confirmed)
        strict.step(scan.time, z, times, scan.sectors)
        refused.add(one for one in strict.tracks if one.confirmed)
    tables = [Trajectories(*one.arrays()) for one in (settled, shown, refused)]
    return [mean_gospa(scene, one, judged) for one in (ordered, *tables)], 1e3 * float(np.median(seconds))


def experiment(file: str | None, quick: bool, seed: int) -> tuple[list[Claim], dict[str, dict[str, Array]]]:
    """All trackers on all scenes, then late plots."""
    claims, shown = [], {}
    settings: dict[str, dict[str, Any]] = {
        "thirty airliners": {"name": "rotating-radars", "duration": 60.0 if quick else 240.0}
    }
    if file is not None:
        settings["recorded traffic"] = {"name": "from-tracks", "file": file, "scans": 15 if quick else 75}
    for label, setting in settings.items():
        count = 2 if quick else (8 if setting["name"] == "rotating-radars" else 4)
        scenes = [simulation.simulate(seed=seed + k, turns=TURNS, interval=INTERVAL, **setting) for k in range(count)]
        names = (*NAMES, "multi-sensor, as one instant")
        found = {name: np.array([judge(name, scene) for scene in scenes]) for name in names}
        shown[label] = found
        for name, values in found.items():
            gospa, switches, milliseconds = values.T
            claims += [
                Claim(f"{label}, {name}: GOSPA", "m", ours=float(gospa.mean()), interval=mean_interval(gospa)),
                Claim(f"{label}, {name}: switches", "", ours=float(switches.mean()), interval=mean_interval(switches)),
                Claim(f"{label}, {name}: CPU time of a scan", "ms", ours=float(np.median(milliseconds))),
            ]
        ratio = found["multi-sensor"][:, 0] / found["oracle"][:, 0]
        what, interval = f"{label}: GOSPA, multi-sensor / oracle", mean_interval(ratio)
        holds = interval[1] <= WITHIN_ORACLE
        claims.append(Claim(what, "", WITHIN_ORACLE, ours=float(ratio.mean()), interval=interval, holds=holds))
    setting = settings["thirty airliners"] | {"duration": 100.0 if quick else 200.0}
    scenes = [
        simulation.simulate(seed=seed + k, turns=TURNS, interval=INTERVAL, **setting) for k in range(2 if quick else 4)
    ]
    runs = [late_plots(scene, np.random.default_rng(seed + k)) for k, scene in enumerate(scenes)]
    values = np.array([gospa for gospa, _ in runs])
    for name, column in zip(LATE_NAMES, values.T, strict=True):
        what, ratio = f"late plots, {name}: GOSPA / in order", column / values[:, 0]
        claims.append(
            Claim(f"late plots, {name}: GOSPA", "m", ours=float(column.mean()), interval=mean_interval(column))
        )
        if name == LATE_NAMES[1]:
            interval = mean_interval(ratio)
            holds = interval[1] <= WITHIN_ORDER
            claims.append(Claim(what, "", WITHIN_ORDER, ours=float(ratio.mean()), interval=interval, holds=holds))
    claims.append(Claim("late plots: CPU time of a scan", "ms", ours=float(np.median([one for _, one in runs]))))
    return claims, shown


def draw(figure: Any, shown: dict[str, dict[str, Array]]) -> None:
    """GOSPA of each tracker on each kind of scene."""
    for axes, (label, found) in zip(np.atleast_1d(figure.subplots(1, len(shown))), shown.items(), strict=True):
        names = list(found)
        axes.barh(np.arange(len(names)), [found[name][:, 0].mean() for name in names])
        axes.set_yticks(np.arange(len(names)), names, fontsize=8)
        axes.set_title(label, fontsize=10)
        axes.set_xlabel("GOSPA, m")
        axes.invert_yaxis()
        axes.spines[["top", "right"]].set_visible(False)


NAME, TITLE = "trackers.asynchronous", "Turning radars: measurements with times of their own"


def program(arguments: Sequence[str] | None = None) -> int:
    """Run the experiment; returns its exit code."""
    parser = make_parser(NAME, TITLE)
    parser.add_argument("file", nargs="?", metavar="FILE", help="recorded trajectories (.csv), as for from-tracks")
    chosen = parser.parse_args(arguments)
    return run(
        parser, chosen, NAME, TITLE, lambda quick, rng: experiment(chosen.file, quick, chosen.seed), draw, (11, 4)
    )


if __name__ == "__main__":
    raise SystemExit(program())
