"""How time and memory grow with the work: scans and trackers.

*One scan*: from measurements to a certified answer, at a constant density of targets: position sensors, 2-D radars, two
of these and a bearing sensor. *Trackers*: the worst scan, which is one of the first, and the median of later ones.
Each row is a process of its own, so that peak memory is its own; processor time of all threads, kernels loaded.
"""

import math
from argparse import Namespace
from collections.abc import Callable, Sequence

from experiments.common.claims import Claim
from experiments.common.command import main
from experiments.scale import sizes as of
from experiments.scale.sizes import SOLVERS, Measured, alone

SIZES = {
    "positions": (1_000, 10_000, 100_000, 340_000, 400_000),
    "2-D radars": (1_000, 10_000, 30_000),
    "2-D radars and a bearing": (1_000, 3_000),
}
TARGETS = {
    "nearest-neighbour": (1_000, 3_000, 10_000),
    "multi-sensor": (1_000, 3_000, 10_000),
    "joint-probabilistic": (1_000, 3_000, 10_000),
    "mht": (1_000, 3_000, 10_000),
}
SCANS, LONG = 12, 10_000
"""Scans of a tracker; fewer of them where there are so many targets."""
UNITS = {"peak": "MB", "tracked": "%", "build": "s", "worst": "s", "median": "s", "greedy": "s",
         "exact": "s", "lagrangian": "s"}  # fmt: skip


def _claims(row: str, found: Measured) -> list[Claim]:
    print(f"{row}: " + ", ".join(f"{name} {value:.4g}" for name, value in found.items()), flush=True)
    return [Claim(f"{row}: {name}", UNITS.get(name, ""), ours=value) for name, value in found.items()]


def _exponents(row: str, sizes: Sequence[int], rows: Sequence[Measured], names: Sequence[str]) -> list[Claim]:
    """By what power of the size times grow, between the second size and the last."""
    first, last = min(1, len(sizes) - 2), -1
    ratio = math.log(sizes[last] / sizes[first])
    return [Claim(f"{row}: exponent of {name}", "", ours=math.log(rows[last][name] / rows[first][name]) / ratio)
            for name in names]  # fmt: skip


def scans(quick: bool) -> list[Claim]:
    """One scan, kind by kind and size by size."""
    claims = []
    for kind, sizes in SIZES.items():
        sizes = sizes[:2] if quick else sizes
        solvers = tuple(SOLVERS) if kind == "positions" else ("exact",)
        rows = [alone(of.scan, kind, targets, solvers) for targets in sizes]
        for targets, row in zip(sizes, rows, strict=True):
            claims += _claims(f"one scan, {kind}, {targets}", row)
        claims += _exponents(f"one scan, {kind}", sizes, rows, ("build", "tuples", *solvers))
    return claims


def crowds(quick: bool) -> list[Claim]:
    """Trackers, size by size."""
    claims = []
    for kind, sizes in TARGETS.items():
        sizes = sizes[:1] if quick else sizes
        rows = [alone(of.tracker, kind, size, 8 if size >= LONG else SCANS) for size in sizes]
        for targets, row in zip(sizes, rows, strict=True):
            claims += _claims(f"{kind}, {targets}", row)
        claims += [] if quick else _exponents(kind, sizes, rows, ("worst", "median"))
    return claims


PARTS: dict[str, Callable[[bool], list[Claim]]] = {"scans": scans, "trackers": crowds}


def experiment(chosen: Namespace) -> list[Claim]:
    """Measure these parts."""
    return [claim for name in chosen.names for claim in PARTS[name](chosen.quick)]


if __name__ == "__main__":
    raise SystemExit(main("scale", experiment, __doc__, only=PARTS))
