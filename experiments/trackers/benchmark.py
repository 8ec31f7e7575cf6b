"""Our trackers compared with Stone Soup's, and with a labelled multi-Bernoulli filter, on the same detections.

Stone Soup's multi-frame assignment (MFA), its global nearest neighbour (GNN) and its JPDA (by loopy belief propagation)
are given the targets at time 0, and so are ours: a square of targets in nearly straight flight, two clutter densities,
the same window of 3 scans, the same gates of 0.999. Stone Soup neither starts nor ends tracks; ours do, which may cost
them accuracy. Where the package multisensor-lmb-filters-rs is installed (it needs Python 3.12), its LMB filter is a
peer, too. GOSPA has a cutoff of 50 m; times are CPU times of a scan, the median, all in one process. Peers stop when
their time is over (--budget, 30 s of CPU for a setting): then both are compared on the scans that were done.
"""

import argparse
import time
from collections.abc import Iterator, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from assoc._types import Array
from assoc.metrics import gospa
from assoc.tracking import JointProbabilisticTracker, NearestNeighbourTracker, TrackOrientedMHT
from experiments.common.claims import GOAL, Claim, with_goal
from experiments.common.command import above_zero, main, mean_interval
from experiments.trackers.plane import AVAILABLE, Plane, in_plane, labelled, simulate

WINDOW, GATE = 3, 0.999
CUTOFF = 50.0
"""Of GOSPA (order 2), metres."""
TARGETS, CLUTTER = (3, 30), (0.2, 2.0)
SCANS, SEEDS, BUDGET = 20, {3: 10, 30: 3}, 30.0
"""The budget is that of one peer for all seeds of a setting, CPU seconds."""
TIMES_FASTER = 50.0
PEERS = {"mfa": "mht", "gnn": "nearest", "jpda": "joint", **({"lmb": "joint"} if AVAILABLE else {})}
"""A peer, and ours of the same kind."""
ROUNDING = 1e-6
"""Metres of mean GOSPA that are no difference."""


class Result(NamedTuple):
    """One tracker on one plane."""

    seconds: Array
    gospa: Array


def judged(runs: Iterator[tuple[float, Array]], plane: Plane, budget: float) -> Result:
    """Time and GOSPA of each scan, as many as the time (seconds) allows."""
    seconds, values = [], []
    started = time.process_time()
    for k, (elapsed, places) in enumerate(runs, start=1):
        seconds.append(elapsed)
        values.append(gospa(plane.truth[k, :, :2], places, CUTOFF).distance)
        if time.process_time() - started > budget:
            break
    return Result(np.array(seconds), np.array(values))


def against_peers(targets: int, clutter: float, scans: int, seeds: Sequence[int], budget: float) -> list[Claim]:
    """Compare on some seeds; a peer has `budget` seconds for all of them."""
    from experiments.trackers import stone_soup

    found: dict[str, list[Result]] = {name: [] for name in (*PEERS, *PEERS.values())}
    for seed in seeds:
        plane = simulate(targets, clutter, scans, seed)
        share = budget / len(seeds)
        runs = {
            "mht": in_plane(TrackOrientedMHT, plane, depth=WINDOW, gate_probability=GATE),
            "nearest": in_plane(NearestNeighbourTracker, plane, gate_probability=GATE, rule="assignment"),
            "joint": in_plane(JointProbabilisticTracker, plane, gate_probability=GATE),
            "mfa": stone_soup.multi_frame(plane, WINDOW, GATE),
            "gnn": stone_soup.nearest(plane, GATE),
            "jpda": stone_soup.probabilistic(plane, GATE),
        }
        if AVAILABLE:
            runs["lmb"] = labelled(plane)
        for name, run in runs.items():
            found[name].append(judged(run, plane, share))
    label = f"{targets} targets, clutter {clutter:g} a target"
    claims = []
    for peer, ours in PEERS.items():
        ratio, better, done = _paired(found[ours], found[peer])
        claims += [
            Claim(f"{label}, {peer}: scans done, of {scans * len(seeds)}", "", ours=done),
            Claim(f"{label}, {ours}: CPU time of a scan", "ms", ours=1e3 * _median(found[ours])),
            Claim(f"{label}, {peer}: CPU time / ours", "", ours=ratio),
            Claim(f"{label}, {peer}: mean GOSPA", "m", ours=_mean(found[peer])),
            Claim(f"{label}, {peer}: mean GOSPA, ours - theirs", "m", None, *better),
        ]
    ratio, (worse, interval), _ = _paired(found["mht"], found["mfa"])
    low, _ = interval or (worse, worse)
    claims += [
        with_goal(f"goal: {label}: CPU time, MFA / ours", "", ratio, least=TIMES_FASTER),
        Claim(f"goal: {label}: mean GOSPA, ours - MFA", "m", None, worse, interval, (None, 0.0), low <= ROUNDING, GOAL),
    ]
    _, (worse, interval), _ = _paired(found["mht"], found["gnn"])
    if clutter == max(CLUTTER):
        low, _ = interval or (worse, worse)
        what = f"goal: {label}: mean GOSPA, ours - GNN"
        claims.append(Claim(what, "m", None, worse, interval, (None, 0.0), low <= ROUNDING, GOAL))
    return claims


def _median(results: list[Result]) -> float:
    return float(np.median(np.concatenate([result.seconds for result in results])))


def _mean(results: list[Result]) -> float:
    return float(np.mean(np.concatenate([result.gospa for result in results])))


def _paired(ours: list[Result], peer: list[Result]) -> tuple[float, tuple[float, tuple[float, float] | None], int]:
    """Ratio of the median times, difference of the mean GOSPA with its interval over seeds, and scans compared."""
    mine = [Result(a.seconds[: len(b.seconds)], a.gospa[: len(b.gospa)]) for a, b in zip(ours, peer, strict=True)]
    differences = np.array([a.gospa.mean() - b.gospa.mean() for a, b in zip(mine, peer, strict=True)])
    interval = mean_interval(differences) if len(differences) > 1 else None
    scans = sum(len(result.seconds) for result in peer)
    return _median(peer) / _median(mine), (float(differences.mean()), interval), scans


def experiment(chosen: argparse.Namespace) -> list[Claim]:
    """All settings."""
    seed = int(np.random.default_rng(chosen.seed).integers(2**31))
    claims = []
    for targets in TARGETS:
        for clutter in CLUTTER:
            scans, seeds, budget = (5, 2, 10.0) if chosen.quick else (SCANS, SEEDS[targets], chosen.budget)
            claims += against_peers(targets, clutter, scans, [seed + k for k in range(seeds)], budget)
    return claims


def _add_budget(parser: argparse.ArgumentParser) -> None:
    text = f"CPU seconds of each peer for a setting (default {BUDGET:g})"
    parser.add_argument("--budget", type=above_zero, default=BUDGET, metavar="S", help=text)


program = partial(main, "trackers.benchmark", experiment, __doc__, options=[_add_budget], said=" Budget {budget:g} s.")


if __name__ == "__main__":
    raise SystemExit(program())
