"""Our trackers compared with Stone Soup's on the same detections, and with the goals for a tracker.

    python -m experiments.trackers.benchmark [--quick] [--seed N] [--json FILE] [--figure FILE]

Stone Soup's multi-frame assignment and its global nearest neighbour are given the targets at time 0, and so are ours:
a square of targets in nearly straight flight, two clutter densities, the same window of 3 scans, the same gates. Stone
Soup neither starts nor ends tracks; ours do, which may cost them accuracy. Times are CPU seconds of a scan, all in one
process. Stone Soup's trackers stop when their time is over: then both are compared on the scans that were done, and the
table says how many.

The second part measures goals: three radars (second scan, false tracks, error against one radar), a thousand targets.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from assoc._types import Array
from assoc.metrics import gospa
from assoc.tracking import MultiSensorTracker, NearestNeighbourTracker, TrackOrientedMHT
from experiments.common.claims import Claim
from experiments.common.command import main
from experiments.trackers.goals import thousand, three_radar
from experiments.trackers.plane import DETECTION, Plane, simulate
from experiments.trackers.running import in_plane

WINDOW, GATE = 3, 0.999
CUTOFF = 50.0
"""Of GOSPA (order 2), metres."""
TARGETS, CLUTTER = (3, 30, 100), (0.2, 2.0)
TIMES_FASTER = 50.0
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


def against_peers(
    targets: int, clutter: float, scans: int, seeds: Sequence[int], budget: float
) -> tuple[list[Claim], dict[str, list[Result]]]:
    """Compare on some seeds; a peer has `budget` seconds for all of them."""
    from experiments.trackers import stone_soup

    found: dict[str, list[Result]] = {name: [] for name in ("mht", "nearest", "mfa", "gnn")}
    for seed in seeds:
        plane = simulate(targets, clutter, scans, seed)
        share = budget / len(seeds)
        runs = {
            "mht": in_plane(TrackOrientedMHT, plane, depth=WINDOW, gate_probability=GATE),
            "nearest": in_plane(NearestNeighbourTracker, plane, gate_probability=GATE, rule="assignment"),
            "mfa": stone_soup.multi_frame(plane, WINDOW, GATE),
            "gnn": stone_soup.nearest(plane, GATE),
        }
        for name, one in runs.items():
            found[name].append(judged(one, plane, share))
    label = f"{targets} targets, clutter {clutter:g} a target"
    ratio, better, done = _paired(found["mht"], found["mfa"])
    claims = [
        Claim(f"{label}: scans that Stone Soup's MFA did, of {scans * len(seeds)}", "", ours=done),
        Claim(f"{label}: CPU time, ours a scan", "ms", ours=1e3 * _median(found["mht"])),
        Claim(f"{label}: CPU time, MFA / ours", "", TIMES_FASTER, ratio, band=(TIMES_FASTER, None)),
        Claim(f"{label}: mean GOSPA, MFA", "m", ours=_mean(found["mfa"])),
        Claim(f"{label}: mean GOSPA, ours - MFA", "m", 0.0, *better, band=(None, ROUNDING)),
    ]
    _, better, _ = _paired(found["mht"], found["gnn"])
    dense = clutter == max(CLUTTER)
    band = (None, ROUNDING) if dense else None
    claims.append(Claim(f"{label}: mean GOSPA, ours - GNN", "m", 0.0, *better, band=band))
    return claims, found


def _median(results: list[Result]) -> float:
    return float(np.median(np.concatenate([one.seconds for one in results])))


def _mean(results: list[Result]) -> float:
    return float(np.mean(np.concatenate([one.gospa for one in results])))


def _paired(ours: list[Result], peer: list[Result]) -> tuple[float, tuple[float, tuple[float, float] | None], int]:
    """Ratio of the median times, difference of the mean GOSPA with its interval over seeds, and scans compared."""
    mine = [Result(a.seconds[: len(b.seconds)], a.gospa[: len(b.gospa)]) for a, b in zip(ours, peer, strict=True)]
    differences = np.array([a.gospa.mean() - b.gospa.mean() for a, b in zip(mine, peer, strict=True)])
    interval = None
    if len(differences) > 1:
        half = 1.96 * float(differences.std(ddof=1)) / len(differences) ** 0.5
        interval = (float(differences.mean()) - half, float(differences.mean()) + half)
    scans = sum(len(one.seconds) for one in peer)
    return _median(peer) / _median(mine), (float(differences.mean()), interval), scans


def goals(quick: bool, seed: int) -> tuple[list[Claim], Array]:
    """Three radars, and a thousand targets."""
    seeds, scans = (6, 30) if quick else (100, 100)
    found = [three_radar(seed + k, scans, single=k < (2 if quick else 20)) for k in range(seeds)]
    alone = [one for one in found if np.isfinite(one.best)]
    gain = float(np.sqrt(np.mean([one.best for one in alone]) / np.mean([one.multi for one in alone])))
    seconds, counts, right = thousand(MultiSensorTracker, 100 if quick else 1_000, 20 if quick else 60, seed)
    settled = len(seconds) // 3
    halves = np.median(seconds[settled : 2 * settled]), np.median(seconds[2 * settled :])
    size = 100 if quick else 1_000
    return [
        Claim(f"three radars, {seeds} seeds: targets not tracked from their second scan", "", 0.0,
              sum(one.late for one in found), band=(None, 0.0)),
        Claim(f"three radars, {seeds} seeds x {scans} scans: share of instants without a track", "%", 0.0,
              100.0 * sum(one.lost for one in found) / sum(one.instants for one in found)),
        Claim(f"three radars, {seeds} seeds x {scans} scans: false confirmed tracks", "", 0.0,
              sum(one.false for one in found), band=(None, 0.0)),
        Claim("three radars: position RMSE", "m", ours=float(np.sqrt(np.mean([one.multi for one in found])))),
        Claim("three radars: RMSE of the best radar alone / ours", "", float(np.sqrt(2)), gain,
              band=(float(np.sqrt(2)), None)),
        Claim(f"{size} targets x 3 radars: CPU time of a scan after warm-up, median", "s", 1.0,
              float(np.median(seconds[settled:])), band=(None, 1.0)),
        Claim(f"{size} targets x 3 radars: the same, largest", "s", 1.0, float(seconds[settled:].max())),
        Claim(f"{size} targets x 3 radars: last third's time / second third's", "", 1.0, float(halves[1] / halves[0]),
              band=(None, 1.25)),
        Claim(f"{size} targets x 3 radars: targets tracked at the end", "%", ours=100.0 * right / size),
        Claim(f"{size} targets x 3 radars: confirmed tracks at the end", "", ours=float(counts[-1])),
    ], seconds  # fmt: skip


def endurance(scans: int, seed: int) -> list[Claim]:
    """Time per scan and size of the state over many scans, a hundred targets that stay in place on average."""
    seconds, counts, _ = thousand(MultiSensorTracker, 60, scans, seed)
    first, last = seconds[scans // 10 : scans // 2], seconds[scans // 2 :]
    return [
        Claim(f"60 targets, {scans} scans: median time of the second half / first half", "", 1.0,
              float(np.median(last) / np.median(first)), band=(None, 1.1)),
        Claim(f"60 targets, {scans} scans: confirmed tracks at the end", "", ours=float(counts[-1])),
    ]  # fmt: skip


def experiment(quick: bool, rng: np.random.Generator) -> tuple[list[Claim], Any]:
    """Run all parts."""
    seed = int(rng.integers(2**31))
    claims, shown = [], {}
    for targets in TARGETS[:2] if quick else TARGETS:
        for clutter in CLUTTER:
            scans, seeds, budget = (5, 2, 10.0) if quick else (20, 10 if targets < 30 else 3, 200.0)
            part, found = against_peers(targets, clutter, scans, [seed + k for k in range(seeds)], budget)
            claims += part
            shown[targets, clutter] = found
    part, seconds = goals(quick, seed % 1000)
    claims += part + endurance(40 if quick else 1_000, seed)
    return claims, (shown, seconds)


NAMES = {"mht": "ours, MHT", "nearest": "ours, GNN", "mfa": "Stone Soup, MFA", "gnn": "Stone Soup, GNN"}
COLOURS = {"mht": "#1f77b4", "nearest": "#7fb3d5", "mfa": "#d62728", "gnn": "#e8a0a0"}


def draw(figure: Any, shown: tuple[dict[tuple[int, float], dict[str, list[Result]]], Array]) -> None:
    """Time of a scan and GOSPA, for each setting and tracker."""
    found, _ = shown
    labels = [f"{targets} / {clutter:g}" for targets, clutter in found]
    upper, lower = figure.subplots(2, 1, sharex=True)
    x = np.arange(len(labels))
    for i, name in enumerate(NAMES):
        place = x + 0.2 * (i - 1.5)
        upper.bar(place, [1e3 * _median(one[name]) for one in found.values()], 0.18, color=COLOURS[name],
                  label=NAMES[name])  # fmt: skip
        per_target = [_mean(one[name]) / np.sqrt(targets) for (targets, _), one in found.items()]
        lower.bar(place, per_target, 0.18, color=COLOURS[name])
    upper.set_yscale("log")
    upper.set_ylabel("CPU time of a scan, ms")
    upper.legend(ncols=4, fontsize=8, loc="lower center", bbox_to_anchor=(0.5, 1.0), frameon=False)
    lower.set_ylabel("GOSPA / root of the targets, m")
    lower.set_xticks(x, labels)
    lower.set_xlabel(f"targets / false alarms a target and scan (P_d {DETECTION:g})")
    for axes in (upper, lower):
        axes.grid(axis="y", alpha=0.3)
        axes.spines[["top", "right"]].set_visible(False)


TITLE = "Our trackers compared with Stone Soup's, and goals"


def program(arguments: Sequence[str] | None = None) -> int:
    """Run the experiment as a program; returns its exit code."""
    return main("trackers.benchmark", TITLE, experiment, draw, (8, 6), arguments)


if __name__ == "__main__":
    raise SystemExit(program())
