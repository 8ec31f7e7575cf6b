"""What trackers can bear: three radars for long, crowds of targets, and the time of a scan.

The multi-sensor tracker on the three-radar scene (100 seeds of 100 scans: the second scan, false tracks, its error
against that of the best radar alone), with a thousand targets and over a thousand scans; `mht` with 300 targets, both
in a box of 10 x 10 x 5 km with noise of 100 m and 10 % false alarms; `mht-hypothesis` with 100 aircraft in straight
flight over 90 x 90 km, seen every 4 s. Times are CPU times.
"""

from functools import partial

import numpy as np

from assoc.tracking import HypothesisOrientedMHT, MultiSensorTracker, TrackOrientedMHT
from experiments.common.claims import Claim, with_goal
from experiments.common.command import main
from experiments.trackers.biases import flights
from experiments.trackers.goals import NEAR, crowd, three_radar
from experiments.trackers.running import through

SCAN, MHT_SCAN, REID_SCAN = 1.0, 0.5, 0.1
"""Goals for the time of a scan, seconds: a thousand targets, `mht` with 300, `mht-hypothesis` with 100."""
WITHIN = 5
"""Scans within which `mht-hypothesis` should have confirmed its aircraft."""


def long_runs(quick: bool, seed: int) -> list[Claim]:
    """Three radars, many seeds; and a thousand scans."""
    seeds, scans = (6, 30) if quick else (100, 100)
    found = [three_radar(seed + k, scans, single=k < (2 if quick else 20)) for k in range(seeds)]
    alone = [run for run in found if np.isfinite(run.best)]
    gain = float(np.sqrt(np.mean([run.best for run in alone]) / np.mean([run.multi for run in alone])))
    lost = 100.0 * sum(run.lost for run in found) / sum(run.instants for run in found)

    length = 40 if quick else 1_000
    seconds, counts, _ = crowd(MultiSensorTracker, 60, length, seed)
    first, last = seconds[length // 10 : length // 2], seconds[length // 2 :]
    slower = float(np.median(last) / np.median(first))
    return [
        _most("three radars: targets not tracked from their second scan", "", sum(run.late for run in found), 0.0),
        Claim("three radars: instants without a track", "%", ours=lost),
        _most("three radars: false confirmed tracks", "", sum(run.false for run in found), 0.0),
        Claim("three radars: position RMSE", "m", ours=float(np.sqrt(np.mean([run.multi for run in found])))),
        with_goal("goal: three radars: RMSE of the best radar alone / ours", "", gain, least=float(np.sqrt(2))),
        _most(f"60 targets, {length} scans: median time of the second half / first half", "", slower, 1.1),
        Claim(f"60 targets, {length} scans: confirmed tracks at the end", "", ours=float(counts[-1])),
    ]


def crowds(quick: bool, seed: int) -> list[Claim]:
    """Times of a scan where there are many targets."""
    for kind in (MultiSensorTracker, TrackOrientedMHT):
        # what is compiled is no time of a scan
        crowd(kind, 30, 4, seed)
    share = 10 if quick else 1
    thousand, counts, right = crowd(MultiSensorTracker, 1_000 // share, 12 if quick else 60, seed)
    settled = len(thousand) // 3
    halves = np.median(thousand[settled : 2 * settled]), np.median(thousand[2 * settled :])
    hundreds, _, followed = crowd(TrackOrientedMHT, 300 // share, 6 if quick else 10, seed)
    few = flights(seed, 10, 4)
    through(HypothesisOrientedMHT.for_scene(few), few)
    scene = flights(seed, 100 // share, 12)
    done = through(HypothesisOrientedMHT.for_scene(scene), scene)
    confirmed, truth = done.confirmed[WITHIN - 1][1], scene.scan(WITHIN - 1).truth_positions
    near = np.linalg.norm(truth[:, None] - confirmed[None], axis=2).min(axis=1, initial=np.inf) <= NEAR
    many, some, hundred = 1_000 // share, 300 // share, 100 // share
    return [
        _most(f"{many} targets, multi-sensor: time of a scan, median", "s", float(np.median(thousand[settled:])), SCAN),
        Claim(f"{many} targets, multi-sensor: time of a scan, largest", "s", ours=float(thousand.max())),
        _most(f"{many} targets: last third's time / second third's", "", float(halves[1] / halves[0]), 1.25),
        Claim(f"{many} targets: targets tracked at the end", "%", ours=100.0 * right / many),
        Claim(f"{many} targets: confirmed tracks at the end", "", ours=float(counts[-1])),
        _most(f"{some} targets, mht: time of a scan from the third on, largest", "s", hundreds[2:].max(), MHT_SCAN),
        Claim(f"{some} targets, mht: time of the first two scans, largest", "s", ours=float(hundreds[:2].max())),
        Claim(f"{some} targets, mht: targets tracked at the end", "%", ours=100.0 * followed / some),
        _most(f"{hundred} aircraft, mht-hypothesis: not confirmed after {WITHIN} scans", "", int((~near).sum()), 0.0),
        _most(f"{hundred} aircraft, mht-hypothesis: time of a scan, median", "s", np.median(done.seconds), REID_SCAN),
    ]


def _most(quantity: str, unit: str, value: float, most: float) -> Claim:
    return with_goal(f"goal: {quantity}", unit, value, most=most)


def experiment(quick: bool, rng: np.random.Generator) -> list[Claim]:
    """Run all parts."""
    seed = int(rng.integers(1_000))
    return long_runs(quick, seed) + crowds(quick, seed)


program = partial(main, "trackers.capacity", experiment, __doc__)


if __name__ == "__main__":
    raise SystemExit(program())
