"""Our trackers compared: three radars, and recorded air traffic if a file is given.

All trackers with default settings, and an oracle that is told which measurement is whose, on the three-radar scene
(ten seeds, 100 scans) and on trajectories of a CSV file that three simulated radars see every 10 s (scenario
from-tracks, --seeds of them). Tracks count while they are reported. GOSPA and what it consists of (root mean squares),
OSPA(2), HOTA, all with a cutoff of 500 m, identity switches a scene, and CPU time of a scan.
"""

import argparse
from collections.abc import Sequence
from functools import partial

import numpy as np

from assoc import simulation
from assoc.scene import Scene
from experiments.common.claims import Claim
from experiments.common.command import add_recording, main
from experiments.trackers.judging import NAMES, beside, compare, goal

WITHIN_ORACLE = 1.02
"""Recorded traffic: GOSPA of the multi-sensor tracker, as a multiple of the oracle's."""


def all_trackers(label: str, scenes: list[Scene], names: Sequence[str]) -> list[Claim]:
    """Trackers of these names on the same scenes."""
    claims, found = compare(label, names, scenes)
    for name, runs in found.items():
        claims += [
            Claim(f"{label}, {name}: {part}", "m", ours=float(np.mean([run.parts[part] for run in runs])))
            for part in ("localisation", "missed", "false")
        ]
    claims += beside(label, "multi-sensor", "oracle", found, WITHIN_ORACLE)
    if {"multi-sensor", "oracle"} <= set(found):
        pairs = zip(found["multi-sensor"], found["oracle"], strict=True)
        switches = np.array([float(a.switches - b.switches) for a, b in pairs])
        claims.append(goal(f"{label}: switches, multi-sensor - oracle", "", switches, 0.0, surely=False))
    return claims


def experiment(chosen: argparse.Namespace) -> list[Claim]:
    """Compare on the three-radar scene, and on the file's traffic."""
    seed, names = int(np.random.default_rng(chosen.seed).integers(2**31)), chosen.names
    count, length = (2, 15) if chosen.quick else (10, 100)
    scenes = [simulation.simulate("three-radar", seed + k, scans=length) for k in range(count)]
    claims = all_trackers("three radars", scenes, names)
    if chosen.file is not None:
        runs = range(1 if chosen.quick else chosen.seeds)
        scenes = [simulation.simulate("from-tracks", seed + k, file=chosen.file) for k in runs]
        claims += all_trackers("recorded traffic", scenes, names)
    return claims


program = partial(
    main, "trackers.comparison", experiment, __doc__,
    only=NAMES, seeds=(3, "runs on recorded trajectories", 1), options=[add_recording],
    said=" {seeds} runs on recorded trajectories.",
)  # fmt: skip


if __name__ == "__main__":
    raise SystemExit(program())
