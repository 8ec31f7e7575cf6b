"""Recorded flights under three simulated radars: how many aircraft have one track each.

    python -m experiments.real.flights FILE [--raw] [--interval S] [--seeds N] [--only NAME ...] [--quick] [--json FILE]

FILE holds trajectories as the scenario from-tracks reads them; all else is that scenario's default, for the trackers,
too. A recording jumps where reports were missing, and `--raw` leaves it so. A track follows the aircraft nearest to it,
within 1 km. Means over the scenes: aircraft with one track for their whole time, ids on all aircraft, pairs of
confirmed tracks on one aircraft at once and the scans they were there together, tracks without an aircraft.
"""

from collections import Counter
from collections.abc import Sequence
from itertools import combinations
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from assoc.exports.maps import FOLLOWED_WITHIN
from assoc.scene import Scene
from assoc.simulation import simulate
from assoc.tracking import TRACKERS
from experiments.common.claims import Claim
from experiments.common.command import add_only, add_seeds, make_parser, run
from experiments.trackers.judging import mean_claim
from experiments.trackers.running import through

ADAPTING = ", adapting"
NAMES = (*TRACKERS, *(name + ADAPTING for name in TRACKERS))


class Judged(NamedTuple):
    """A tracker on a scene."""

    one_track: float
    ids: float
    pairs: float
    together: float
    """Scans, the pair that was together longest."""
    false: float
    """Tracks without an aircraft at an instant."""


def judge(scene: Scene, name: str) -> Judged:
    """Run a tracker over a scene, and find which tracks followed each aircraft."""
    assert scene.truth is not None
    tracker = TRACKERS[name.removesuffix(ADAPTING)].for_scene(scene, adapt=name.endswith(ADAPTING))
    ids: dict[int, set[int]] = {}
    pairs: Counter[tuple[int, ...]] = Counter()
    false = 0
    shown = through(tracker, scene).confirmed
    for (tracks, places), targets, at in zip(shown, scene.truth.target_ids, scene.truth.positions, strict=True):
        apart = np.linalg.norm(places[:, None] - at[None], axis=2)
        near = apart.min(axis=1, initial=np.inf) < FOLLOWED_WITHIN
        false += np.count_nonzero(~near)
        owner = targets[apart[near].argmin(axis=1)] if near.any() else targets[:0]
        for target in np.unique(owner).tolist():
            there = sorted(tracks[near][owner == target].tolist())
            ids.setdefault(target, set()).update(there)
            pairs.update(combinations(there, 2))
    return Judged(
        sum(len(found) == 1 for found in ids.values()), sum(map(len, ids.values())), len(pairs),
        max(pairs.values(), default=0), false / scene.num_scans,
    )  # fmt: skip


def experiment(scenes: Sequence[Scene], names: Sequence[str]) -> list[Claim]:
    """All trackers on the recording, once for each scene of radars' noise."""
    claims: list[Claim] = []
    counts = [len(np.unique(np.concatenate(scene.truth.target_ids))) for scene in scenes if scene.truth is not None]
    for name in names:
        runs = np.array([judge(scene, name) for scene in scenes], dtype=np.float64)
        what = (
            f"aircraft of {max(counts)} with one track", "ids on all aircraft", "pairs of tracks on one aircraft",
            "scans, longest pair", "tracks without an aircraft",
        )  # fmt: skip
        claims += [mean_claim(f"{name}: {text}", "", column) for text, column in zip(what, runs.T, strict=True)]
        print(f"{name:32}", *(f"{value:8.2f}" for value in runs.mean(axis=0)), flush=True)
    return claims


def program(arguments: Sequence[str] | None = None) -> int:
    """Run the experiment; returns its exit code."""
    parser = make_parser("real.flights", __doc__)
    parser.add_argument("file", metavar="FILE", help="recorded trajectories (.csv, .parquet), as for from-tracks")
    parser.add_argument("--raw", action="store_true", help="do not clean the recording")
    parser.add_argument("--interval", type=float, default=10.0, metavar="S", help="seconds from scan to scan")
    add_only(parser, NAMES)
    add_seeds(parser, 3, "scenes: noise, misses and false alarms anew", least=1)
    chosen = parser.parse_args(arguments)
    if not Path(chosen.file).is_file():
        parser.error(f"{chosen.file}: expected a file of recorded trajectories")

    def table(quick: bool, rng: np.random.Generator) -> list[Claim]:
        values: dict[str, Any] = {"file": chosen.file, "clean": not chosen.raw, "interval": chosen.interval}
        values |= {"scans": 40} if quick else {}
        seeds = range(chosen.seed, chosen.seed + (1 if quick else chosen.seeds))
        names = chosen.only or [one + more for one in ("multi-sensor", "mht") for more in ("", ADAPTING)]
        return experiment([simulate("from-tracks", seed, **values) for seed in seeds], names)

    return run(parser, chosen, table, __doc__)


if __name__ == "__main__":
    raise SystemExit(program())
