"""Points of 60 frames linked by `assoc.link`, trackpy and laptrack: links found, links that are right, and time.

Random walks with steps of 0.5 to 2 along an axis in a square with one particle for each 8 x 8, of whose points up to a
tenth is missing and to which up to a twentieth is added anywhere. All three get the same points, search range and
memory. Recall is the share of true links that are found, precision that of found links that are true; a link over
missing frames counts if both its ends are right. Processor time of one core, after a first call. trackpy refuses some
ranges ("subnets"). laptrack, with its defaults, takes many seconds, and gets 500 particles alone.
"""

import importlib.util
import warnings
from functools import partial
from typing import Any

import numpy as np

import assoc
from assoc._types import Array
from experiments.common.claims import Claim
from experiments.common.command import main
from experiments.common.measuring import one_core, processor_time

FRAMES, SPACING = 60, 8.0
# particles, step, share missing, share of false points, range in steps, memory
CASES = (
    (500, 0.5, 0.0, 0.0, 3.0, 3), (500, 1.0, 0.0, 0.0, 3.0, 3), (500, 1.0, 0.1, 0.05, 3.0, 0),
    (500, 1.0, 0.1, 0.05, 3.0, 3), (500, 1.0, 0.1, 0.05, 4.0, 3), (500, 2.0, 0.1, 0.05, 2.5, 3),
    (2_000, 1.0, 0.05, 0.02, 3.0, 3), (2_000, 1.0, 0.0, 0.05, 3.0, 3), (5_000, 0.5, 0.1, 0.05, 3.0, 3),
    (5_000, 1.0, 0.1, 0.05, 3.0, 3),
)  # fmt: skip
MOST = {"laptrack": 500}
"""Particles that a peer gets."""


def walks(case: tuple[Any, ...], seed: int) -> tuple[list[Array], list[Array]]:
    """Points of each frame, and the particle of each, -1 for false points."""
    count, step, missing, false = case[:4]
    rng = np.random.default_rng(seed)
    side = SPACING * count**0.5
    places, points, truth = rng.uniform(0, side, (count, 2)), [], []
    for _ in range(FRAMES):
        places = places + rng.normal(0, step, places.shape)
        seen = np.flatnonzero(rng.random(count) >= missing)
        stray = rng.uniform(0, side, (rng.binomial(count, false), 2))
        order = rng.permutation(len(seen) + len(stray))
        points.append(np.concatenate([places[seen], stray])[order])
        truth.append(np.concatenate([seen, np.full(len(stray), -1)])[order])
    return points, truth


def links_of(ids: list[Array]) -> set[tuple[int, int]]:
    """Pairs of points, numbered through all frames, that follow each other in a particle; -1 is none."""
    every = np.concatenate(ids)
    known = np.flatnonzero(every >= 0)
    order = known[np.argsort(every[known], kind="stable")]
    same = every[order[1:]] == every[order[:-1]]
    return set(zip(order[:-1][same].tolist(), order[1:][same].tolist(), strict=True))


def judged(ids: list[Array], truth: list[Array]) -> tuple[float, float]:
    """Recall and precision."""
    found, true = links_of(ids), links_of(truth)
    return len(found & true) / len(true), len(found & true) / max(len(found), 1)


def ours(points: list[Array], reach: float, memory: int) -> list[Array]:
    """Particles of each frame by `assoc.link`."""
    return assoc.link(points, reach, memory=memory).ids


def _table(points: list[Array]) -> Any:
    import pandas as pd

    table = pd.DataFrame(np.concatenate(points), columns=["x", "y"])
    return table.assign(frame=np.repeat(np.arange(len(points)), [len(one) for one in points]))


def trackpy(points: list[Array], reach: float, memory: int) -> list[Array]:
    """The same by trackpy."""
    import trackpy as tp

    tp.quiet()
    found = tp.link(_table(points), reach, memory=memory)["particle"].to_numpy()
    return np.split(found, np.cumsum([len(one) for one in points])[:-1])


def laptrack(points: list[Array], reach: float, memory: int) -> list[Array]:
    """The same by laptrack."""
    from laptrack import LapTrack

    tracker = LapTrack(
        cutoff=reach**2, gap_closing_cutoff=reach**2 if memory else False, gap_closing_max_frame_count=memory,
        splitting_cutoff=False, merging_cutoff=False,
    )  # fmt: skip
    nodes = tracker.predict_dataframe(_table(points), ["x", "y"], frame_col="frame", only_coordinate_cols=False)[0]
    nodes = nodes.reset_index().sort_values(["frame", "index"], kind="stable")
    return np.split(nodes["track_id"].to_numpy(), np.cumsum([len(one) for one in points])[:-1])


def experiment(quick: bool, rng: np.random.Generator) -> list[Claim]:
    """Link all cases by all that are installed."""
    ways = {"assoc": ours, "trackpy": trackpy, "laptrack": laptrack}
    ways = {name: way for name, way in ways.items() if name == "assoc" or importlib.util.find_spec(name)}
    seeds = [int(seed) for seed in rng.integers(0, 2**31, 1 if quick else 2)]
    claims = []
    with warnings.catch_warnings(), one_core():
        warnings.simplefilter("ignore")
        for case in CASES[: 2 if quick else None]:
            label = "{:,} particles, step {:g}, {:.0%} missing, {:.0%} false, range {:g} steps, memory {}".format(*case)
            found: dict[str, list[tuple[float, ...]]] = {}
            for name, way in ways.items():
                if case[0] > MOST.get(name, case[0]):
                    continue
                try:
                    way(walks((100, *case[1:]), 0)[0], case[4] * case[1], case[5])
                    for seed in seeds:
                        points, truth = walks(case, seed)
                        ids, spent = processor_time(partial(way, points, case[4] * case[1], case[5]))
                        found.setdefault(name, []).append((*judged(ids, truth), spent))
                except Exception as error:
                    # of trackpy's own kind, that a subnet is too large
                    if name == "assoc":
                        raise
                    print(f"{label}: {name} refuses: {str(error)[:60]}")
                    found.pop(name, None)
            means = {name: np.mean(rows, axis=0) for name, rows in found.items()}
            for k, what in enumerate(("recall", "precision", "seconds")):
                for name, mean in means.items():
                    others = [float(other[k]) for peer, other in means.items() if peer != "assoc"]
                    band = (None, min(others)) if what == "seconds" else (max(others, default=0.0) - 1e-9, None)
                    claims.append(Claim(
                        f"{label}: {what}, {name}", "s" if what == "seconds" else "", None, float(mean[k]), None,
                        band if name == "assoc" and others else None, source="chosen by us: no peer is ahead",
                    ))  # fmt: skip
    return claims


if __name__ == "__main__":
    raise SystemExit(main("linking", experiment, __doc__))
