"""The paper's own weakness: a false plot where an aircraft is about to appear.

The paper (section 4.2.2.3, table 4.24) sees a plot without identity one rotation before the first plot of aircraft
958, at the very same place. It becomes a track, the aircraft's plots join that, and since a track keeps the identity
of its first plot, the aircraft is lost for good: "if one plot is wrong at the start, the track that follows is wrong".
Here one aircraft appears amid the usual false plots, and one more is put where it will first be seen, or one to two
nautical miles beside, so that a wrong velocity results.
"""

import math
from collections.abc import Callable

import numpy as np

from assoc._types import Array
from assoc.metrics import identity_after_each
from assoc.recordings import Recording, Window, clustering_time_window, radar_of
from assoc.recordings.columns import NAUTICAL_MILE
from assoc.simulation import simulate_recording
from assoc.simulation.antenna import bearings_in_steps, in_steps
from assoc.simulation.scenarios.rotating_radar import BEARING_STEP
from experiments.common.claims import Claim
from experiments.common.command import mean_interval
from experiments.papers.clustering_time_window.hypotheses import HypothesisTracker
from experiments.papers.clustering_time_window.judging import Taken, run
from experiments.papers.clustering_time_window.traffic import MISSES, ROTATION, nearest

PLOTS = 12
"""The aircraft's first plots, which are judged."""

SOURCE = "section 4.2.2.3, table 4.24, in words"
CASES = {"none": None, "at the same place": (0.0, 0.0), "1 to 2 nmi beside": (1.0, 2.0)}


def with_false_start(recording: Recording, offset: tuple[float, float] | None, rng: np.random.Generator) -> Recording:
    """Let the aircraft appear in the third rotation or later, with a false plot one rotation before.

    recording: Of one aircraft.
    offset: Least and largest distance of the false plot from the aircraft's first, nautical miles; None: no false plot.
    """
    hidden = (recording.sources >= 0) & (recording.times < 2 * ROTATION)
    kept = recording.take(~hidden)
    first = int(np.argmax(kept.sources >= 0))
    if offset is None:
        return kept
    direction = rng.uniform(-math.pi, math.pi)
    distance = NAUTICAL_MILE * rng.uniform(*offset)
    place = kept.positions[first] + distance * np.array([math.cos(direction), math.sin(direction)])
    bearing = math.atan2(place[0], place[1]) % (2 * math.pi)
    bearing = float(bearings_in_steps(np.array([bearing]), math.radians(BEARING_STEP))[0])
    # the antenna is there a rotation earlier, less or more by the difference of the bearings
    turned = math.remainder(bearing - kept.bearings[first], 2 * math.pi) / (2 * math.pi)
    added = {
        "times": kept.times[first] + (turned - 1.0) * ROTATION,
        "ranges": float(in_steps(np.linalg.norm(place), NAUTICAL_MILE)),
        "azimuths": math.pi / 2 - bearing,
        "identities": 0,
        "sources": -1,
    }
    order = np.argsort(np.append(kept.times, added["times"]), kind="stable")
    return Recording(**{name: np.append(getattr(kept, name), value)[order] for name, value in added.items()})


Follow = Callable[[Recording, list[Window]], Taken]
"""What a tracker does with the windows of a recording."""


def _nearest(recording: Recording, windows: list[Window]) -> Taken:
    return run(nearest(recording, clock=ROTATION, deletion="groups", patience=MISSES), windows)


def _hypotheses(recording: Recording, windows: list[Window]) -> Taken:
    tracker = HypothesisTracker(radar_of(recording))
    run(tracker, windows)
    return tracker.decided()


METHODS: dict[str, Follow] = {"nearest neighbour, CTW": _nearest, "MHT, CTW, time stamps": _hypotheses}


def judge(runs: int, rng: np.random.Generator, methods: dict[str, Follow] | None = None) -> list[Claim]:
    """How an aircraft's first plots fare with and without a false start; of methods whose name has "MHT", the loss."""
    methods = METHODS if methods is None else methods
    found: dict[tuple[str, str], list[tuple[float, float, float]]] = {}
    for _ in range(runs):
        plain = _appearing(rng)
        for case, offset in CASES.items():
            recording = with_false_start(plain, offset, rng)
            windows = clustering_time_window(recording, ROTATION)
            for name, follow in methods.items():
                found.setdefault((name, case), []).append(beginning(recording, follow(recording, windows)))
    measures = (
        (f"first {PLOTS} plots in the aircraft's own track", 5.0),
        ("tracks that begin with the aircraft's plot, whose identity the paper's track keeps", None),
        (f"tracks whose identity is right at plot {PLOTS}, by majority of six", 5.0),
    )
    claims = []
    for name in methods:
        usual = np.array(found[name, "none"])
        for number, (measure, allowed) in enumerate(measures):
            for case in CASES:
                values = np.array(found[name, case])[:, number]
                what = f"false start, {case}: {measure}, {name}"
                claims.append(Claim(what, "%", None, float(values.mean()), _interval(values), source=SOURCE))
                if case != "none" and "MHT" in name and allowed is not None:
                    lost = usual[:, number] - values
                    what = f"false start, {case}: lost by it, {measure}, {name}"
                    claims.append(
                        Claim(
                            what,
                            "points",
                            None,
                            float(lost.mean()),
                            _interval(lost),
                            (None, allowed),
                            source=f"{SOURCE}; {allowed:g} points chosen by us",
                        )
                    )
    return claims


def _appearing(rng: np.random.Generator) -> Recording:
    """Simulate one aircraft that stays in reach for long enough."""
    while True:
        seed = int(rng.integers(2**31))
        simulated = simulate_recording("rotating-radar", seed, aircraft=1, reach=150.0, duration=250.0)
        sources = simulated.recording.sources
        if sources is not None and (sources >= 0).sum() >= PLOTS + 4:
            return simulated.recording


def beginning(recording: Recording, taken: Taken) -> tuple[float, float, float]:
    """Judge the confirmed track that holds most of the aircraft's plots, in percent.

    own: Of the aircraft's first 12 plots, those in this track.
    first: 100 if its first plot is the aircraft's, else 0.
    identity: 100 if its identity is the aircraft's when the aircraft's 12th plot has come, else 0.
    """
    sources = recording.sources[taken.rows]
    given = np.where(np.isin(taken.tracks, taken.tracks[taken.confirmed]), taken.tracks, -1)
    names, counts = np.unique(given[(sources >= 0) & (given >= 0)], return_counts=True)
    if not len(names):
        return 0.0, 0.0, 0.0
    main = given == names[np.argmax(counts)]
    first = np.flatnonzero(sources >= 0)[:PLOTS]
    begins = sources[np.flatnonzero(main)[0]] >= 0
    known = identity_after_each(sources, np.where(main, 0, -1))[: first[-1] + 1][main[: first[-1] + 1]]
    right = len(known) > 0 and known[-1] >= 0
    return 100.0 * float(main[first].mean()), 100.0 * float(begins), 100.0 * float(right)


def _interval(values: Array) -> tuple[float, float]:
    middle = float(values.mean())
    return mean_interval(values) if len(values) > 1 else (middle, middle)
