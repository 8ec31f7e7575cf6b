"""Two aircraft that cross, fly in parallel or meet head-on: do their tracks stay theirs?"""

from collections.abc import Sequence

import numpy as np

from assoc._types import Array
from assoc.metrics import identity_after_each, label_switches, plot_identity_switches
from assoc.recordings import Recording, clustering_time_window, radar_of
from assoc.simulation import simulate_recording
from experiments.common.claims import Claim
from experiments.papers.clustering_time_window.hypotheses import HypothesisTracker
from experiments.papers.clustering_time_window.judging import Taken, run
from experiments.papers.clustering_time_window.traffic import MISSES, ROTATION, nearest

TRAFFIC = ("crossing", "parallel", "head-on")
DURATION = 600.0
GOAL = 95.0
FIGURES = {"crossing": "4.18", "parallel": "4.20", "head-on": "4.22"}
SOURCE = "figure {}: no switch in its one pair; 95 % chosen by us"


def judge(
    runs: int, rng: np.random.Generator, *, kinds: Sequence[str] = TRAFFIC, duration: float = DURATION
) -> list[Claim]:
    """Identity switches over seeds, of recordings of so many seconds."""
    claims = []
    for traffic in kinds:
        without: dict[str, list[bool]] = {}
        astray: list[int] = []
        for _ in range(runs):
            seed = int(rng.integers(2**31))
            recording = simulate_recording("rotating-radar", seed, traffic=traffic, duration=duration).recording
            windows = clustering_time_window(recording, ROTATION)
            hypotheses = HypothesisTracker(radar_of(recording))
            run(hypotheses, windows)
            decided = hypotheses.decided()
            by_method = {
                "MHT, CTW, time stamps": decided,
                "nearest neighbour, CTW, time stamps": run(nearest(recording), windows),
                "nearest neighbour, CTW": run(
                    nearest(recording, clock=ROTATION, deletion="groups", patience=MISSES), windows
                ),
            }
            for name, taken in by_method.items():
                without.setdefault(name, []).append(switches(recording, taken) == 0)
            astray.append(label_switches(_sources(recording, decided), np.where(decided.confirmed, decided.tracks, -1)))
        for number, (name, good) in enumerate(without.items()):
            what = f"{traffic}: pairs without an identity switch, {name}"
            share = 100.0 * float(np.mean(good))
            band = (GOAL, None) if number == 0 else None
            claims.append(Claim(what, "%", None, share, wilson(good), band, source=SOURCE.format(FIGURES[traffic])))
        what = f"{traffic}: changes of track from plot to plot, single plots gone astray included, MHT"
        claims.append(Claim(what, "a pair", None, float(np.mean(astray)), source="chosen by us"))
    return claims


def _sources(recording: Recording, taken: Taken) -> Array:
    return recording.sources[taken.rows]


def switches(recording: Recording, taken: Taken) -> int:
    """How often an aircraft goes over to another confirmed track."""
    return plot_identity_switches(_sources(recording, taken), taken.tracks, taken.confirmed)


def swaps(recording: Recording, taken: Taken) -> int:
    """How many of the switches go to a track that was the other aircraft's; the rest to tracks begun anew."""
    sources = _sources(recording, taken)
    held = taken.confirmed & (sources >= 0) & (identity_after_each(sources, taken.tracks) == sources)
    owner: dict[int, int] = {}
    known: dict[int, int] = {}
    count = 0
    for aircraft, track in zip(sources[held].tolist(), taken.tracks[held].tolist(), strict=True):
        count += owner.get(aircraft, track) != track and known.get(track, aircraft) != aircraft
        owner[aircraft], known[track] = track, aircraft
    return count


def wilson(good: list[bool]) -> tuple[float, float]:
    """95 % interval of a share, percent (Wilson's score interval)."""
    n, p, z = len(good), float(np.mean(good)), 1.96
    middle = (p + z * z / (2 * n)) / (1 + z * z / n)
    half = z / (1 + z * z / n) * (p * (1 - p) / n + z * z / (4 * n * n)) ** 0.5
    return 100.0 * max(middle - half, 0.0), 100.0 * min(middle + half, 1.0)
