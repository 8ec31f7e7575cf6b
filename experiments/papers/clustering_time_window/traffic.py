"""Scenario S1: what window, time stamps and hypotheses are each worth."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from assoc._types import Array
from assoc.metrics import CtMtIt
from assoc.recordings import Recording, Window, clustering_time_window, irregular_groups, radar_of
from assoc.simulation import simulate_recording
from assoc.tracking import HypothesisOrientedMHT, LifeCycle
from experiments.common.claims import Claim
from experiments.common.command import mean_interval
from experiments.papers.clustering_time_window.baseline import NearestNeighbourTracker, NearestSettings
from experiments.papers.clustering_time_window.hypotheses import HypothesisTracker
from experiments.papers.clustering_time_window.judging import Taken, TakesWindows, run
from experiments.papers.clustering_time_window.published import OVERALL, RATES, WITH_WINDOW, WITHOUT_WINDOW, by_tens

CHOSEN = "chosen by us"
MEAN_GROUP = 6.2
ROTATION = 9.5
DURATION = 1130.0
MISSES = 3
"""Groups without a plot after which the paper's way deletes a track; it says "n"."""

_BY_COUNT = LifeCycle(deletion="count", deletion_count=MISSES, false_probability=1e-3)


def nearest(recording: Recording, **settings: Any) -> NearestNeighbourTracker:
    """The small nearest-neighbour tracker, with the noise that the plots' steps tell."""
    noise = radar_of(recording).noise
    return NearestNeighbourTracker(float(noise[0]), float(noise[1]), NearestSettings(**settings))


def reid(
    recording: Recording, clock: float | None = None, misses: int = MISSES, taking_up: bool = False
) -> HypothesisTracker:
    """Reid's MHT; with a clock, a fixed time passes from group to group and tracks are deleted by their misses."""
    options = {} if clock is None else {"life_cycle": replace(_BY_COUNT, deletion_count=misses)}
    radar = radar_of(recording)
    return HypothesisTracker(radar, clock, kind=HypothesisOrientedMHT, taking_up=taking_up, **options)


def decided_by_reid(
    recording: Recording, windows: list[Window], clock: float | None = None, misses: int = MISSES
) -> Taken:
    """What `reid` has decided for good about every window."""
    tracker = reid(recording, clock, misses)
    run(tracker, windows)
    return tracker.decided()


METHODS: dict[str, tuple[str, Callable[[Recording], TakesWindows]]] = {
    "nearest neighbour, irregular groups": (
        "irregular",
        lambda r: nearest(r, clock=MEAN_GROUP, deletion="groups", patience=MISSES),
    ),
    "MHT, irregular groups": (
        "irregular",
        lambda r: HypothesisTracker(radar_of(r), MEAN_GROUP, life_cycle=_BY_COUNT),
    ),
    "nearest neighbour, CTW": ("window", lambda r: nearest(r, clock=ROTATION, deletion="groups", patience=MISSES)),
    "MHT, CTW": ("window", lambda r: HypothesisTracker(radar_of(r), ROTATION, life_cycle=_BY_COUNT)),
    "nearest neighbour, irregular groups, time stamps": ("irregular", nearest),
    "nearest neighbour, CTW, time stamps": ("window", nearest),
    "MHT, irregular groups, time stamps": ("irregular", lambda r: HypothesisTracker(radar_of(r))),
    "MHT, CTW, time stamps": ("window", lambda r: HypothesisTracker(radar_of(r))),
    "Reid's MHT, irregular groups": ("irregular", lambda r: reid(r, MEAN_GROUP)),
    "Reid's MHT, CTW": ("window", lambda r: reid(r, ROTATION)),
    "Reid's MHT, irregular groups, time stamps": ("irregular", lambda r: reid(r)),
    "Reid's MHT, CTW, time stamps": ("window", lambda r: reid(r)),
    "Reid's MHT, irregular groups, taking up": ("irregular", lambda r: reid(r, MEAN_GROUP, taking_up=True)),
    "Reid's MHT, CTW, taking up": ("window", lambda r: reid(r, ROTATION, taking_up=True)),
}
"""Name -> grouping and tracker. Without time stamps: a fixed time from group to group, deletion after three misses.

"MHT" is the track-oriented form, "Reid's MHT" the thesis's own: Reid's hypotheses, of which Murty's m best are kept.
It forgets lost tracks, as the thesis's does, but for "taking up"."""

STRONG = "nearest neighbour, irregular groups, time stamps"
BEST = "MHT, CTW, time stamps"
SLOW = "Reid's MHT"
"""Methods whose names begin so take several times as long, and run on the first few recordings only."""


def recordings(
    runs: int, rng: np.random.Generator, duration: float = DURATION
) -> Iterator[tuple[Recording, dict[str, list[Window]]]]:
    """Recordings of S1, each with its groups by name."""
    for _ in range(runs):
        recording = simulate_recording("rotating-radar", int(rng.integers(2**31)), duration=duration).recording
        irregular = irregular_groups(recording, rng, MEAN_GROUP)
        yield recording, {"window": clustering_time_window(recording), "irregular": irregular}


def judge(runs: int, slow_runs: int, rng: np.random.Generator, duration: float = DURATION) -> dict[str, list[CtMtIt]]:
    """Rates of every method on the same recordings; Reid's MHT, which is slower, only on the first few."""
    results: dict[str, list[CtMtIt]] = {name: [] for name in METHODS}
    for number, (recording, groups) in enumerate(recordings(runs, rng, duration)):
        for name, (grouping, tracker) in METHODS.items():
            if not name.startswith(SLOW) or number < slow_runs:
                results[name].append(run(tracker(recording), groups[grouping]).rates(recording))
    return results


def overall(results: dict[str, list[CtMtIt]]) -> dict[str, Array]:
    """CT, MT, IT of every run, (runs, 3), by method."""
    return {name: np.array([(rates.ct, rates.mt, rates.it) for rates in every]) for name, every in results.items()}


def claims(results: dict[str, list[CtMtIt]]) -> list[Claim]:
    """Tables 4.25 to 4.27 beside ours, and the goals."""
    rates = overall(results)
    papers = {f"{SLOW}, irregular groups": OVERALL["without"], f"{SLOW}, CTW": OVERALL["with"]}
    goal = ((88.0, None), (85.0, None), (None, 30.0))
    goals = dict.fromkeys(("nearest neighbour, CTW", "MHT, CTW", BEST), goal)
    made = []
    for name, values in rates.items():
        for axis, rate in enumerate(RATES):
            paper = papers[name][axis] if name in papers else None
            band = goals[name][axis] if name in goals else None
            source = "table 4.27; its own recording" if paper is not None else CHOSEN
            made.append(_claim(f"{rate}, {name}", values[:, axis], band, paper, source))
    made += [
        Claim("recordings of 1,130 s", "", None, len(rates[BEST]), source=CHOSEN),
        Claim("recordings for Reid's MHT, the first of these", "", None, len(rates[f"{SLOW}, CTW"]), source=CHOSEN),
    ]
    for kind in ("nearest neighbour", "MHT", SLOW):
        for words, stamps in (("constant step", ""), ("time stamps", ", time stamps")):
            gain = rates[f"{kind}, CTW{stamps}"] - rates[f"{kind}, irregular groups{stamps}"]
            paper = OVERALL["with"][0] - OVERALL["without"][0] if kind == SLOW and not stamps else None
            what = f"CT gained by the window with {words}, {kind}"
            source = "difference in table 4.27; 20 points chosen by us"
            made.append(_claim(what, gain[:, 0], None if stamps else (20.0, None), paper, source))
    for name in (f"{SLOW}, CTW", f"{SLOW}, CTW, time stamps"):
        rival = name.replace(SLOW, "nearest neighbour")
        n = len(rates[name])
        for axis, rate in enumerate(RATES):
            band = (None, 0.0) if rate == "IT" else (0.0, None)
            made.append(_claim(f"{rate}: {name}, less {rival}", (rates[name] - rates[rival][:n])[:, axis], band))
    better = rates[BEST] - rates[STRONG]
    for axis, rate in enumerate(RATES):
        band = (None, 0.0) if rate == "IT" else (0.0, None)
        made.append(_claim(f"{rate}: {BEST}, less the strong baseline ({STRONG})", better[:, axis], band))
    cells = (25, WITHOUT_WINDOW, f"{SLOW}, irregular groups"), (26, WITH_WINDOW, f"{SLOW}, CTW")
    for number, paper_table, name in cells:
        ours = tens(results[name], len(paper_table))
        # shorter recordings have fewer tens than the paper's
        for k, row in enumerate(paper_table[: int((~np.isnan(ours).any(axis=(0, 2))).sum())]):
            for axis, rate in enumerate(RATES):
                what = f"{rate}, groups {10 * k + 1} to {10 * k + 10}, {name}"
                source = f"table 4.{number}, row {k + 1} (figure 4.{number - 9})"
                made.append(_claim(what, ours[:, k, axis], None, float(row[axis]), source))
        # a recording shorter than the thesis's has no last rows
        if number == 25 and not np.isnan(ours[:, -3:, 1]).all(axis=1).any():
            late = change_of_mt(ours)
            paper = float(paper_table[-3:, 1].mean() - paper_table[:3, 1].mean())
            what = f"MT of the last three rows less that of the first three, {name}"
            made.append(_claim(what, late, (None, -20.0), round(paper, 1), "table 4.25; 20 points chosen by us"))
    return made


def change_of_mt(rows: Array) -> Array:
    """Mean MT of the last three rows of ten windows less that of the first three, (runs,), of rates (runs, K, 3)."""
    late: Array = np.nanmean(rows[:, -3:, 1], axis=1) - np.nanmean(rows[:, :3, 1], axis=1)
    return late


def tens(every: list[CtMtIt], length: int) -> Array:
    """Means of ten windows each, (runs, length, 3)."""
    return np.array([by_tens(rates.per_window, length) for rates in every])


def _claim(
    what: str,
    values: Array,
    band: tuple[float | None, float | None] | None,
    paper: float | None = None,
    source: str = CHOSEN,
) -> Claim:
    interval = mean_interval(values) if len(values) > 1 else None
    return Claim(what, "%", paper, float(values.mean()), interval, band, source=source)
