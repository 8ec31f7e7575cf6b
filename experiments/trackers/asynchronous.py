"""Turning radars, each at its own pace: measurements with times of their own, and late ones.

Three radars with 4, 5 and 5.5 seconds for a turn see thirty airliners, and with a file recorded traffic. GOSPA (order
2), identity switches and CPU time of a scan, beside an oracle that is told which measurement is whose and when it was
made; and what comes of it when the plots of four seconds are taken to be of one instant. Then a fifth of the plots
arrives up to 30 s late: the tracks as they are once everything is there, beside the tracks of plots in order. Seeds are
--seed and those that follow, --seeds of them (8), half as many for recorded traffic and late plots.
"""

from argparse import Namespace
from functools import partial
from typing import Any

import numpy as np

from assoc import simulation
from assoc._types import Array
from assoc.metrics import Trajectories
from assoc.scene import Scene
from assoc.tracking import TRACKERS, LatePlots, TrackTable
from experiments.common.claims import Claim
from experiments.common.command import add_recording, main
from experiments.trackers.judging import Judged, beside, compare, distances, goal, judge, mean_claim, through

TURNS, INTERVAL = "4,5,5.5", 4.0
INSTANT = "multi-sensor, as one instant"
NAMES = (
    "oracle", "multi-sensor", "static", "mht", "mht-hypothesis", "nearest-neighbour", "joint-probabilistic", INSTANT,
)  # fmt: skip
NEAR_ORACLE = ("multi-sensor", "joint-probabilistic")
"""Trackers that are to come within a share of the oracle."""
WITHIN_ORACLE, WITHIN_ORDER = 1.10, 1.02
SEEDS = 8
"""Scenes of airliners; of recorded traffic, and of late plots, there are half as many."""
LATE_SHARE, MOST_LATE = 0.2, 30.0
LATE_NAMES = ("in order", "late, once all is there")
_SETTLED = 5
"""Scans at the beginning that are left out where ways to treat late plots are compared."""


def judge_own_times(name: str, scene: Scene) -> Judged:
    """Run a tracker over a scene of turning radars; "..., as one instant" is not told the measurements' own times."""
    if name == INSTANT:
        scene = Scene(scene.sensors, scene.times, scene.measurements, scene.region, scene.truth)
        name = "multi-sensor"
    return judge(name, scene)


def arrivals(scene: Scene, rng: np.random.Generator) -> list[tuple[list[Array], list[Array]]]:
    """Measurements and their times by the scan in which they arrive; what comes after the last scan is lost."""
    count = len(scene.sensors)
    z: list[list[list[Array]]] = [[[] for _ in range(count)] for _ in range(scene.num_scans)]
    times: list[list[list[float]]] = [[[] for _ in range(count)] for _ in range(scene.num_scans)]
    for scan, stamps in zip(scene.measurements, scene.measurement_times, strict=True):
        for s in range(count):
            late = rng.uniform(0.0, MOST_LATE, len(stamps[s])) * (rng.random(len(stamps[s])) < LATE_SHARE)
            arrive = np.searchsorted(scene.times, stamps[s] + late)
            for k, plot, when in zip(arrive.tolist(), scan[s], stamps[s].tolist(), strict=True):
                if k < scene.num_scans:
                    z[k][s].append(plot)
                    times[k][s].append(when)
    return [
        (
            [np.reshape(np.array(rows), (-1, sensor.dim)) for rows, sensor in zip(z[k], scene.sensors, strict=True)],
            [np.array(stamps, dtype=np.float64) for stamps in times[k]],
        )
        for k in range(scene.num_scans)
    ]


def late_plots(scene: Scene, rng: np.random.Generator) -> tuple[float, float]:
    """GOSPA of plots in order, and of late ones once all is there; metres."""
    behind = int(np.ceil(MOST_LATE / INTERVAL)) + 1
    judged = slice(_SETTLED, scene.num_scans - behind)
    tracker = LatePlots(TRACKERS["multi-sensor"].for_scene(scene), MOST_LATE + INTERVAL)
    settled = TrackTable()
    for k, (z, times) in enumerate(arrivals(scene, rng)):
        scan = scene.scan(k)
        tracker.step(scan.time, z, times, scan.sectors)
        if k >= behind - 1:
            settled.add(track for track in tracker.past_tracks(-behind) if track.confirmed)
    ordered = through(TRACKERS["multi-sensor"].for_scene(scene), scene).tracks
    first, second = (
        float(distances(scene, tracks)[judged].mean()) for tracks in (ordered, Trajectories(*settled.arrays()))
    )
    return first, second


def experiment(chosen: Namespace) -> list[Claim]:
    """Trackers of these names on all scenes, then late plots if the multi-sensor tracker is one of them."""
    file, quick, seed, seeds, names = chosen.file, chosen.quick, chosen.seed, chosen.seeds, chosen.names
    claims: list[Claim] = []
    settings: dict[str, dict[str, Any]] = {
        "thirty airliners": {"name": "rotating-radars", "duration": 60.0 if quick else 240.0}
    }
    if file is not None:
        settings["recorded traffic"] = {"name": "from-tracks", "file": file, "scans": 15 if quick else 75}
    for label, setting in settings.items():
        count = 2 if quick else (seeds if setting["name"] == "rotating-radars" else max(2, seeds // 2))
        scenes = [simulation.simulate(seed=seed + k, turns=TURNS, interval=INTERVAL, **setting) for k in range(count)]
        told, found = compare(label, names, scenes, judge_own_times)
        claims += told
        for name in NEAR_ORACLE:
            claims += beside(label, name, "oracle", found, WITHIN_ORACLE)
    if "multi-sensor" not in names:
        return claims
    setting = settings["thirty airliners"] | {"duration": 100.0 if quick else 200.0}
    scenes = [
        simulation.simulate(seed=seed + k, turns=TURNS, interval=INTERVAL, **setting)
        for k in range(2 if quick else max(2, seeds // 2))
    ]
    late = np.array([late_plots(scene, np.random.default_rng(seed + k)) for k, scene in enumerate(scenes)])
    claims += [
        mean_claim(f"late plots, {name}: GOSPA", "m", column) for name, column in zip(LATE_NAMES, late.T, strict=True)
    ]
    claims.append(goal("late plots, once all is there: GOSPA / in order", "", late[:, 1] / late[:, 0], WITHIN_ORDER))
    return claims


program = partial(
    main, "trackers.asynchronous", experiment, __doc__, only=NAMES, seeds=(SEEDS, "scenes of airliners"),
    options=[add_recording],
    said=" {seeds} scenes of airliners (240 s), half as many (at least 2) of recorded traffic (300 s).",
)  # fmt: skip


if __name__ == "__main__":
    raise SystemExit(program())
