"""Bearings alone: which trackers find the targets among the ghosts, and how soon.

Four targets and three sensors that measure bearings alone (scenario `bearing-only`, 40 scans of 10 s, default
settings). A target has a track where a reported one is within 2 km of it on the ground (a bearing says nothing of
heights); a reported track that is further than that from every target is false. Seeds are --seed (200) and those that
follow, --seeds of them (20).
"""

from argparse import Namespace
from typing import NamedTuple

import numpy as np

from assoc import simulation
from assoc._types import Array
from assoc.scene import Scene
from assoc.tracking import TRACKERS
from experiments.common.claims import Claim
from experiments.common.command import main
from experiments.trackers.judging import goal, make, mean_claim, through

TARGETS, SCANS, SEEDS, FIRST = 4, 40, 20, 200
NEAR = 2_000.0
"""A track within this distance of a target on the ground is that target's, metres."""
STARTED, SETTLED = 10, 20
"""All tracks should have begun after so many scans, and false ones have gone."""
NAMES = (*TRACKERS, "GNN")


class Found(NamedTuple):
    """One tracker on one scene."""

    late: int
    """Targets that were there for ten scans and had no track in any of them."""
    false: Array
    """False tracks reported after each scan, (K,)."""
    tracked: Array
    """Share of the targets that have a track after each scan, (K,)."""
    milliseconds: float


def judge(name: str, scene: Scene) -> Found:
    """Run a tracker over a scene."""
    done = through(make(name, scene), scene)
    false, tracked, had = [], [], set()
    for k in range(scene.num_scans):
        truth, places = scene.truth.positions[k][:, :2], done.confirmed[k][1][:, :2]
        near = np.linalg.norm(truth[:, None] - places[None], axis=2) <= NEAR
        false.append(int((~near.any(axis=0)).sum()))
        tracked.append(float(near.any(axis=1).mean()) if len(truth) else 1.0)
        if k < STARTED:
            had |= set(scene.truth.target_ids[k][near.any(axis=1)].tolist())
    last = min(STARTED, scene.num_scans) - 1
    late = len(set(scene.truth.target_ids[last].tolist()) - had)
    return Found(late, np.array(false), np.array(tracked), 1e3 * float(np.median(done.seconds[1:])))


def experiment(chosen: Namespace) -> list[Claim]:
    """Trackers of these names on the same scenes."""
    count, scans = (2, 22) if chosen.quick else (chosen.seeds, SCANS)
    seeds = range(chosen.seed, chosen.seed + count)
    scenes = [simulation.simulate("bearing-only", seed, targets=TARGETS, scans=scans) for seed in seeds]
    claims: list[Claim] = []
    for name in chosen.names:
        runs = [judge(name, scene) for scene in scenes]
        late = np.array([float(run.late) for run in runs])
        false = np.array([run.false[SETTLED:].mean() for run in runs])
        tracked = np.array([100.0 * run.tracked[SETTLED:].mean() for run in runs])
        claims += [
            goal(f"{name}: targets without a track in {STARTED} scans", "", late, 0.0),
            goal(f"{name}: false tracks at a time after {SETTLED} scans", "", false, 0.0),
            mean_claim(f"{name}: targets with a track after {SETTLED} scans", "%", tracked),
            Claim(f"{name}: CPU time of a scan", "ms", ours=float(np.median([run.milliseconds for run in runs]))),
        ]
    return claims


if __name__ == "__main__":
    raise SystemExit(main(
        "trackers.bearings", experiment, __doc__, only=NAMES, seeds=(SEEDS, "scenes"), said=" {seeds} scenes.",
        seed=FIRST,
    ))  # fmt: skip
