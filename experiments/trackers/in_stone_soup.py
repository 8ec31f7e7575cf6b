"""The examples of docs/stonesoup: GOSPA and time of each way to track, beside Stone Soup's own.

The same four targets and three radars in each, other noise and false alarms in each scene. GOSPA (Stone Soup's, order
2, cutoff 500 m) is that of the tracks as they are yielded, and the first way of an example is what its others are
compared with. Six scenes.
"""

import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from assoc._types import Array
from experiments.common.claims import Claim
from experiments.common.command import main, mean_interval

FOLDER = Path(__file__).parents[2] / "docs" / "stonesoup"
EXAMPLES = ("associator", "initiator", "fusion")
"""Scripts that have `ways`, in the order of the page."""


def example(name: str) -> Any:
    """The module of a script, which finds the others beside it."""
    if str(FOLDER) not in sys.path:
        sys.path.append(str(FOLDER))
    return import_module(name)


def measured(name: str, seeds: list[int], known: dict[tuple[str, int], Any]) -> Iterator[tuple[str, Array]]:
    """Of each way: GOSPA (m) and CPU time of a scan (ms) by seed, (seeds, 2); Stone Soup's own are in several."""
    ways, score = example(name).ways, example("scene").score
    for seed in seeds:
        for way, tracker, paths in ways(seed):
            key = (way if way.startswith("Stone Soup's") else f"{name}, {way}", seed)
            known[key] = known.get(key) or score(tracker, paths)
    for way, *_ in ways(seeds[0]):
        key = way if way.startswith("Stone Soup's") else f"{name}, {way}"
        yield way, np.array([known[key, seed] for seed in seeds])


def experiment(quick: bool, rng: np.random.Generator) -> list[Claim]:
    """Run every way of every example."""
    seeds = rng.integers(2**31, size=2 if quick else 6).tolist()
    claims: list[Claim] = []
    known: dict[tuple[str, int], Any] = {}
    for name in EXAMPLES:
        first = None
        for way, values in measured(name, seeds, known):
            gospa = values[:, 0]
            first = gospa if first is None else first
            claims.append(Claim(f"{name}, {way}: GOSPA", "m", None, gospa.mean(), mean_interval(gospa)))
            if first is not gospa:
                less = gospa - first
                what = f"{name}, {way}: GOSPA less the first's"
                claims.append(Claim(what, "m", None, less.mean(), mean_interval(less)))
            claims.append(Claim(f"{name}, {way}: CPU time of a scan", "ms", None, float(np.median(values[:, 1]))))
    return claims


if __name__ == "__main__":
    raise SystemExit(main("trackers.in_stone_soup", experiment, __doc__))
