"""The thesis's own tracker (Reid, constant step) beyond tables 4.25 to 4.27: clutter, MT, pairs, starts, clocks.

IT of docs/metrics.md counts a plot in a track that is not confirmed yet as wrong, so a tracker that begins a track with
each plot it has no place for is charged for false plots that never enter a confirmed track. "Among tracks ever
confirmed" leaves out the plots of tracks that never are.
The recordings of 2.5 false plots a turn are those on which papers.clustering_time_window runs Reid's MHT. In the pairs
a switch to a track that was the other aircraft's is a swap; the others go to a track begun anew; the same pairs tell
how many would end a track after 3 misses by misses alone. Of clocks: the same 6
recordings, whose antenna turns in 9.5 s, with times in whole seconds, in windows of 9.5 s or of the thesis's 10 s. Full
size: 6 recordings of 1,130 s, 3 of each higher rate, 100 pairs of each kind (600 s, 5 nmi apart when parallel), 50
false starts, 6 recordings for straightness.
"""

from collections.abc import Iterable
from dataclasses import replace
from functools import partial
from typing import Literal

import numpy as np

from assoc._types import Array
from assoc.recordings import Recording, Window, clustering_time_window, radar_of
from assoc.simulation import simulate_recording
from assoc.tracking import Tracker
from assoc.tracking.offline.plots import track_plots
from experiments.common.claims import Claim
from experiments.common.command import main, mean_interval
from experiments.papers.clustering_time_window import false_start, pairs, published, traffic
from experiments.papers.clustering_time_window.hypotheses import HypothesisTracker
from experiments.papers.clustering_time_window.judging import Taken, run

CHOSEN = "chosen by us"
TRACKERS = ("nearest neighbour, CTW", "Reid's MHT, CTW")
RATES = (25.0, 100.0)
"""False plots a turn; S1 has 2.5."""
PLOTS = 10
"""Tracks of fewer plots are not judged for straightness."""
MISSES = (3, 5, 8)


def wrong(recording: Recording, taken: Taken) -> tuple[float, float, int, int]:
    """Return IT and IT among tracks ever confirmed, percent, false plots in such tracks, and all false plots."""
    sources = recording.sources[taken.rows]
    ever = np.isin(taken.tracks, taken.tracks[taken.confirmed])
    later = replace(taken, tracks=np.where(ever, taken.tracks, -1))
    false = sources < 0
    return taken.rates(recording).it, later.rates(recording).it, int((ever & false).sum()), int(false.sum())


def false_plots(rate: float, recordings: Iterable[tuple[Recording, list[Window]]]) -> list[Claim]:
    """IT in both definitions of a nearest neighbour and of Reid's MHT with the window and a constant step."""
    found: dict[str, list[tuple[float, float, int, int]]] = {name: [] for name in TRACKERS}
    for recording, windows in recordings:
        for name in TRACKERS:
            found[name].append(wrong(recording, run(traffic.METHODS[name][1](recording), windows)))
    claims = []
    for name, rows in found.items():
        values = np.array(rows)
        for axis, what in enumerate(("IT", "IT among tracks ever confirmed")):
            what = f"{rate:g} false plots a turn: {what}, {name}"
            claims.append(
                Claim(what, "%", None, float(values[:, axis].mean()), mean_interval(values[:, axis]), source=CHOSEN)
            )
        for axis, what in ((2, "false plots in tracks ever confirmed"), (3, "false plots")):
            claims.append(Claim(f"{rate:g} false plots a turn: {what}, {name}", "", None, float(values[:, axis].sum()),
                                source=CHOSEN))  # fmt: skip
    return claims


WAYS: dict[str, tuple[float | None, int]] = {
    **{f"constant step, {n} misses": (traffic.ROTATION, n) for n in MISSES},
    "time stamps": (None, traffic.MISSES),
}
"""Clock and misses of Reid's MHT; with time stamps tracks end by time."""
STRICT, LENIENT = (f"constant step, {n} misses" for n in MISSES[:2])
UNMISSED = f"pairs in which neither aircraft is missed in {traffic.MISSES} windows running"


def of_pairs(runs: int, rng: np.random.Generator) -> list[Claim]:
    """Swaps and new starts of Reid's MHT in pairs, and whether misses alone explain them."""
    claims = []
    for kind in pairs.TRAFFIC:
        found: dict[tuple[str, str], list[bool]] = {}
        seen: list[bool] = []
        for _ in range(runs):
            recording = simulate_recording(
                "rotating-radar", int(rng.integers(2**31)), traffic=kind, duration=pairs.DURATION
            ).recording
            windows = clustering_time_window(recording, traffic.ROTATION)
            seen.append(longest_gap(recording, windows) < traffic.MISSES)
            for way, (clock, misses) in WAYS.items():
                taken = traffic.decided_by_reid(recording, windows, clock, misses)
                found.setdefault(("without a switch", way), []).append(pairs.switches(recording, taken) == 0)
                found.setdefault(("with a swap", way), []).append(pairs.swaps(recording, taken) > 0)
        claims.append(Claim(f"{kind}: {UNMISSED}", "%", None, 100.0 * float(np.mean(seen)), pairs.wilson(seen),
                            source=CHOSEN))  # fmt: skip
        for name, among in (("these", seen), ("the others", [not one for one in seen])):
            good = [one for one, counts in zip(found["without a switch", STRICT], among, strict=True) if counts]
            if good:
                claims.append(Claim(f"{kind}: of {name} without a switch, Reid's MHT, {STRICT}", "%", None,
                                    100.0 * float(np.mean(good)), pairs.wilson(good), source=CHOSEN))  # fmt: skip
        for (what, way), some in found.items():
            band = (pairs.GOAL, None) if (what, way) == ("without a switch", LENIENT) else None
            claims.append(Claim(f"{kind}: pairs {what}, Reid's MHT, {way}", "%", None, 100.0 * float(np.mean(some)),
                                pairs.wilson(some), band, source="95 % and the rest chosen by us"))  # fmt: skip
    return claims


def longest_gap(recording: Recording, windows: list[Window]) -> int:
    """Most windows running in which an aircraft has no plot, between its first and its last."""
    gaps = [0]
    for aircraft in np.unique(recording.sources[recording.sources >= 0]):
        seen = np.flatnonzero([(recording.sources[window.rows] == aircraft).any() for window in windows])
        gaps += (np.diff(seen) - 1).tolist()
    return max(gaps)


def of_false_starts(runs: int, rng: np.random.Generator) -> list[Claim]:
    """A false plot where an aircraft appears, for Reid's MHT."""
    methods: dict[str, false_start.Follow] = {
        f"Reid's MHT, {way}": partial(traffic.decided_by_reid, clock=clock, misses=misses)
        for way, (clock, misses) in WAYS.items()
    }
    return false_start.judge(runs, rng, methods)


CLOCKS: dict[str, tuple[bool, float, Literal["antenna", "time"]]] = {
    "exact times, windows of 9.5 s": (False, 9.5, "time"),
    "exact times, windows of 10 s": (False, 10.0, "time"),
    "whole seconds, windows of 9.5 s": (True, 9.5, "time"),
    "whole seconds, windows of 10 s": (True, 10.0, "time"),
    "whole seconds, windows by the antenna's angle": (True, 9.5, "antenna"),
    "whole seconds, windows by the antenna's angle, 10 s": (True, 10.0, "antenna"),
}
"""Whether times are cut to whole seconds, the turn that is assumed (the true one is 9.5 s), how plots are grouped."""


def of_clocks(recordings: Iterable[Recording]) -> list[Claim]:
    """What coarse times and a wrong turn do to the window and to Reid's MHT."""
    found: dict[tuple[str, str], list[float]] = {}
    for exact in recordings:
        for name, (whole, turn, by) in CLOCKS.items():
            recording = replace(exact, times=np.floor(exact.times)) if whole else exact
            windows = clustering_time_window(recording, turn, by=by)
            twice = sum(_repeats(recording.sources[window.rows]) for window in windows)
            found.setdefault((name, "plots of aircraft that the window has already"), []).append(
                100.0 * twice / float((recording.sources >= 0).sum())
            )
            for way, clock in (("constant step", turn), ("time stamps", None)):
                ct = run(traffic.reid(recording, clock), windows).rates(recording).ct
                found.setdefault((name, f"CT, Reid's MHT, {way}"), []).append(ct)
    return [
        Claim(f"{name}: {what}", "%", None, float(np.mean(values)), mean_interval(np.array(values)), source=CHOSEN)
        for (name, what), values in found.items()
    ]


def bends(times: Array, places: Array) -> float:
    """Mean change of direction from leg to leg of a path, degrees; places (n, 2 or more)."""
    legs = np.diff(places[np.argsort(times, kind="stable")], axis=0)
    legs = legs[np.linalg.norm(legs[:, :2], axis=1) > 0]
    turns = np.degrees(np.diff(np.arctan2(legs[:, 1], legs[:, 0])))
    return float(np.abs((turns + 180.0) % 360.0 - 180.0).mean())


def of_straightness(runs: int, rng: np.random.Generator, duration: float) -> list[Claim]:
    """How straight tracks are: their plots, as in the thesis's tables, the filter's positions, smoothed ones."""
    found: dict[str, list[float]] = {}
    for _ in range(runs):
        simulated = simulate_recording("rotating-radar", int(rng.integers(2**31)), duration=duration)
        recording, truth, sources = simulated.recording, simulated.truth, simulated.recording.sources
        windows = clustering_time_window(recording)
        follow = partial(track_plots, recording=recording, windows=windows)
        filtered, later = (follow(_tracker(recording), smooth=smooth) for smooth in (False, True))
        tables = {"filtered": filtered.table.to_frame(), "smoothed": later.table.to_frame()}
        rows = np.concatenate([window.rows for window in windows])
        for track in tables["smoothed"].track_id.unique().tolist():
            own = rows[filtered.tracks == track]
            aircraft = np.bincount(sources[own] + 1).argmax() - 1
            if len(own) < PLOTS or aircraft < 0:
                continue
            flown = truth.ids == aircraft
            path = np.stack([np.interp(recording.times[own], truth.times[flown], truth.positions[flown, axis])
                             for axis in (0, 1)], axis=1)  # fmt: skip
            for name, places in (("plots", recording.positions[own]), ("the aircraft itself", path)):
                found.setdefault(name, []).append(bends(recording.times[own], places))
            for name, table in tables.items():
                part = table[table.track_id == track]
                found.setdefault(name, []).append(bends(part.time.to_numpy(), part[["x", "y"]].to_numpy()))
    claims = [Claim("straightness: tracks judged", "", None, len(found["plots"]), source=CHOSEN)]
    for name, values in found.items():
        what = f"straightness: mean change of direction from position to position, {name}"
        claims.append(Claim(what, "deg", None, float(np.mean(values)), mean_interval(np.array(values)),
                            source=f"suggestion 2, in words; {CHOSEN}"))  # fmt: skip
    return claims


def _tracker(recording: Recording) -> Tracker:
    return HypothesisTracker(radar_of(recording)).tracker


def _repeats(sources: Array) -> int:
    known = sources[sources >= 0]
    return len(known) - len(np.unique(known))


def experiment(quick: bool, rng: np.random.Generator) -> list[Claim]:
    """Judge false plots, MT, pairs, false starts, straightness and clocks."""
    duration = 300.0 if quick else traffic.DURATION
    first = list(traffic.recordings(2 if quick else 6, rng, duration))
    claims = false_plots(2.5, ((recording, groups["window"]) for recording, groups in first))
    for rate in RATES:
        more = [
            simulate_recording(
                "rotating-radar", int(rng.integers(2**31)), duration=duration, false_plots=rate
            ).recording
            for _ in range(2 if quick else 3)
        ]
        claims += false_plots(rate, ((recording, clustering_time_window(recording)) for recording in more))
    method = traffic.METHODS["Reid's MHT, irregular groups"][1]
    rows = [run(method(recording), groups["irregular"]).rates(recording) for recording, groups in first]
    # as in table 4.25; a shorter recording has fewer rows
    length = min(len(published.WITHOUT_WINDOW), 1 + max(len(row.windows) for row in rows) // 10)
    changes = traffic.change_of_mt(traffic.tens(rows, length))
    for number, change in enumerate(changes, 1):
        what = f"recording {number}: MT of the last three rows less that of the first three"
        claims.append(Claim(what, "points", None, float(change), source="table 4.25; " + CHOSEN))
    claims += [
        Claim("largest fall of MT from the first three rows to the last three", "points", None, float(-changes.min()),
              source="table 4.25; " + CHOSEN),
        Claim("recordings in which MT falls by 20 points or more", "", None, float((changes <= -20.0).sum()),
              source="table 4.25; 20 points chosen by us"),
        Claim("recordings judged", "", None, len(changes), source=CHOSEN),
    ]  # fmt: skip
    claims += of_pairs(2 if quick else 100, rng)
    claims += of_false_starts(3 if quick else 50, rng)
    claims += of_straightness(1 if quick else 6, rng, duration)
    return claims + of_clocks(recording for recording, _ in first)


program = partial(main, "papers.clustering_time_window.own_tracker", experiment, __doc__)


if __name__ == "__main__":
    raise SystemExit(program())
