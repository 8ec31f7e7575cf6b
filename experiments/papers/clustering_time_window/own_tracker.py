"""The thesis's own tracker (Reid, constant step) beyond tables 4.25 to 4.27: false plots, the fall of MT, pairs.

    python -m experiments.papers.clustering_time_window.own_tracker [--quick] [--seed N] [--json FILE] [--publish]

IT of docs/metrics.md counts a plot in a track that is not confirmed yet as wrong, so a tracker that begins a track with
each plot it has no place for is charged for false plots that never enter a confirmed track. "Among tracks ever
confirmed" leaves out the plots of tracks that never are.
The recordings of 2.5 false plots a turn are those on which papers.clustering_time_window runs Reid's MHT. In the pairs
a switch to a track that was the other aircraft's is a swap; the others go to a track begun anew. Full size: 6
recordings of 1,130 s, 3 of each higher rate, 15 pairs of each kind (600 s, 5 nmi apart when parallel).
"""

from collections.abc import Iterable
from dataclasses import replace
from functools import partial

import numpy as np

from assoc.recordings import Recording, Window, clustering_time_window
from assoc.simulation import simulate_recording
from experiments.common.claims import Claim
from experiments.common.command import main, mean_interval
from experiments.papers.clustering_time_window import pairs, published, traffic
from experiments.papers.clustering_time_window.judging import Taken, run

CHOSEN = "chosen by us"
TRACKERS = ("nearest neighbour, CTW", "Reid's MHT, CTW")
RATES = (25.0, 100.0)
"""False plots a turn; S1 has 2.5."""
MISSES = (3, 5, 8)


def wrong(recording: Recording, taken: Taken) -> tuple[float, float, int, int]:
    """Return IT and IT among tracks ever confirmed, percent, false plots in such tracks, and all false plots."""
    assert recording.sources is not None
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


def of_pairs(runs: int, rng: np.random.Generator) -> list[Claim]:
    """Swaps and new starts of Reid's MHT in pairs."""
    ways = {f"constant step, {n} misses": (traffic.ROTATION, n) for n in MISSES} | {"time stamps": (None, 0)}
    claims = []
    for kind in pairs.TRAFFIC:
        kept: dict[str, list[tuple[bool, bool]]] = {way: [] for way in ways}
        for _ in range(runs):
            recording = simulate_recording(
                "rotating-radar", int(rng.integers(2**31)), traffic=kind, duration=pairs.DURATION
            ).recording
            windows = clustering_time_window(recording, traffic.ROTATION)
            for way, (clock, misses) in ways.items():
                tracker = traffic.reid(recording, clock, misses)
                run(tracker, windows)
                taken = tracker.decided()
                kept[way].append((pairs.switches(recording, taken) == 0, pairs.swaps(recording, taken) > 0))
        for way, rows in kept.items():
            without, swapped = ([one[axis] for one in rows] for axis in (0, 1))
            for what, some in (("without a switch", without), ("with a swap", swapped)):
                claims.append(Claim(f"{kind}: pairs {what}, Reid's MHT, {way}", "%", None, 100.0 * float(np.mean(some)),
                                    pairs.wilson(some), source=CHOSEN))  # fmt: skip
    return claims


def experiment(quick: bool, rng: np.random.Generator) -> list[Claim]:
    """Judge false plots, MT and pairs."""
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
        claims += false_plots(rate, ((one, clustering_time_window(one)) for one in more))
    method = traffic.METHODS["Reid's MHT, irregular groups"][1]
    rows = [run(method(one), groups["irregular"]).rates(one) for one, groups in first]
    # as in table 4.25; a shorter recording has fewer rows
    length = min(len(published.WITHOUT_WINDOW), 1 + max(len(one.windows) for one in rows) // 10)
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
    return claims + of_pairs(2 if quick else 15, rng)


program = partial(main, "papers.clustering_time_window.own_tracker", experiment, __doc__)


if __name__ == "__main__":
    raise SystemExit(program())
