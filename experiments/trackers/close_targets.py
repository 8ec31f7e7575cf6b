"""Trackers where association is hard: formations, crossings, low P_d, many false alarms, mixed sensors.

    python -m experiments.trackers.close_targets [--quick] [--seeds N] [--seed N] [--json FILE] [--figure FILE]

Twelve targets, 40 scans, default settings; GOSPA (order 2), identity switches and CPU time of a scan, beside an oracle
that is told which measurement is whose. Seeds are --seed and the following, --seeds of them (8).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from assoc._types import Array
from assoc.metrics import Trajectories, gospa_over_time, identity
from assoc.scene import Scene
from assoc.tracking import TRACKERS, Tracker
from experiments.common.claims import Claim
from experiments.common.command import make_parser, mean_interval, run
from experiments.trackers.close_scenes import SCANS, SETTINGS, simulate
from experiments.trackers.oracle import OracleTracker
from experiments.trackers.running import through

CUTOFF = 500.0
"""Of GOSPA, metres."""
NAMES = ("oracle", "multi-sensor", "static", "mht", "GNN", "joint-probabilistic")


def make(name: str, scene: Scene) -> Tracker:
    """Make a tracker of this name, default settings."""
    if name == "oracle":
        return OracleTracker(scene)
    if name == "GNN":
        return TRACKERS["nearest-neighbour"].for_scene(scene, rule="assignment")
    return TRACKERS[name].for_scene(scene)


def judge(name: str, scene: Scene) -> tuple[float, float, float]:
    """Mean GOSPA (m), identity switches, median CPU time of a scan (ms)."""
    done, truth = through(make(name, scene), scene), Trajectories.from_scene(scene)
    times, values = gospa_over_time(truth, done.tracks, CUTOFF)
    by_time = dict(zip(times.tolist(), values, strict=True))
    distances = [by_time[t].distance if t in by_time else 0.0 for t in scene.times.tolist()]
    switches = identity(truth, done.tracks, CUTOFF).switches
    return float(np.mean(distances)), float(switches), 1e3 * float(np.median(done.seconds[1:]))


def experiment(quick: bool, seed: int, seeds: int = 8) -> tuple[list[Claim], dict[str, dict[str, Array]]]:
    """All trackers on all scenes."""
    claims, shown = [], {}
    for label, setting in list(SETTINGS.items())[: 2 if quick else None]:
        scenes = [simulate(setting, seed + k, 8 if quick else SCANS) for k in range(2 if quick else seeds)]
        found = {name: np.array([judge(name, scene) for scene in scenes]) for name in NAMES}
        shown[label] = found
        for name, values in found.items():
            gospa, switches, milliseconds = values.T
            claims += [
                Claim(f"{label}, {name}: GOSPA", "m", ours=float(gospa.mean()), interval=mean_interval(gospa)),
                Claim(f"{label}, {name}: switches", "", ours=float(switches.mean()), interval=mean_interval(switches)),
                Claim(f"{label}, {name}: CPU time of a scan", "ms", ours=float(np.median(milliseconds))),
            ]
        difference = found["mht"][:, 0] - found["multi-sensor"][:, 0]
        interval = mean_interval(difference)
        holds = interval[0] <= 0.0
        what = f"{label}: GOSPA, mht - multi-sensor"
        claims.append(Claim(what, "m", 0.0, ours=float(difference.mean()), interval=interval, holds=holds))
    return claims, shown


def draw(figure: Any, shown: dict[str, dict[str, Array]]) -> None:
    """GOSPA and identity switches of each tracker in each scene."""
    labels, width = list(shown), 0.8 / len(NAMES)
    for axes, column, title in zip(figure.subplots(1, 2, sharey=True), (0, 1), ("GOSPA, m", "switches"), strict=True):
        for i, name in enumerate(NAMES):
            values = [shown[label][name][:, column].mean() for label in labels]
            axes.barh(np.arange(len(labels)) + width * (i - (len(NAMES) - 1) / 2), values, width, label=name)
        axes.set_xlabel(title)
        axes.set_yticks(np.arange(len(labels)), labels, fontsize=8)
        axes.spines[["top", "right"]].set_visible(False)
    axes.invert_yaxis()
    axes.legend(fontsize=8, frameon=False)


NAME, TITLE = "trackers.close_targets", "Trackers where association is hard"


def program(arguments: Sequence[str] | None = None) -> int:
    """Run the experiment; returns its exit code."""
    parser = make_parser(NAME, TITLE)
    parser.add_argument("--seeds", type=int, default=8, metavar="N", help="scenes of each kind (default 8)")
    chosen = parser.parse_args(arguments)
    if chosen.seeds < 2:
        parser.error("--seeds must be at least 2")
    return run(
        parser, chosen, NAME, TITLE, lambda quick, rng: experiment(quick, chosen.seed, chosen.seeds), draw, (11, 6)
    )


if __name__ == "__main__":
    raise SystemExit(program())
