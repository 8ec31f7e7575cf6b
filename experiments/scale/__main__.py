"""How time and memory grow with the work: scans, trackers, processes, an hour of air traffic.

*One scan*: from measurements to a certified answer, at a constant density of targets: position sensors, 2-D radars, two
of these and a bearing sensor. *Trackers*: the worst scan, which is one of the first, and the median of later ones.
*Processes*: scans solved by one and by two. *Hour*: three radars, 500 aircraft at a time. Each row is a process of its
own, so that peak memory is its own; processor time of all threads, kernels loaded.
"""

import math
from argparse import Namespace
from collections.abc import Callable, Sequence

from experiments.common.claims import Claim
from experiments.common.command import main
from experiments.scale import one_scan, trackers
from experiments.scale.alone import Measured, alone

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
BYTES = 64
"""Of a plot or of a row of a track: eight numbers."""
UNITS = {"peak": "MB", "tracked": "%", "seconds": "s", "build": "s", "worst": "s", "median": "s", "greedy": "s",
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
        solvers = tuple(one_scan.SOLVERS) if kind == "positions" else ("exact",)
        rows = [alone(one_scan.measure, kind, targets, solvers) for targets in sizes]
        for targets, row in zip(sizes, rows, strict=True):
            claims += _claims(f"one scan, {kind}, {targets}", row)
        claims += _exponents(f"one scan, {kind}", sizes, rows, ("build", "tuples", *solvers))
    return claims


def crowds(quick: bool) -> list[Claim]:
    """Trackers, size by size."""
    claims = []
    for kind, sizes in TARGETS.items():
        sizes = sizes[:1] if quick else sizes
        rows = [alone(trackers.measure, kind, size, 8 if size >= LONG else SCANS) for size in sizes]
        for targets, row in zip(sizes, rows, strict=True):
            claims += _claims(f"{kind}, {targets}", row)
        claims += [] if quick else _exponents(kind, sizes, rows, ("worst", "median"))
    return claims


def processes(quick: bool) -> list[Claim]:
    """The same scans by one process and by two."""
    rows = {jobs: alone(one_scan.solved, jobs, 50 if quick else 10_000) for jobs in (1, 2)}
    claims = [claim for jobs, row in rows.items() for claim in _claims(f"processes, {jobs}", row)]
    return [*claims, Claim("processes: one / two, wall", "", ours=rows[1]["wall"] / rows[2]["wall"])]


def hours(quick: bool) -> list[Claim]:
    """An hour of the day, and what follows from it."""
    if quick:
        return []
    row = alone(trackers.hour, "multi-sensor")
    return [*_claims("hour", row), *extrapolated(row)]


def extrapolated(row: Measured) -> list[Claim]:
    """The day as 24 such hours, and a plan for 1,000 radars, three over each area: rows of BYTES."""
    areas = 1_000 / 3
    plots, tracks = row["plots"] * BYTES / 1e9, trackers.HOUR["scans"] * trackers.AIRCRAFT * BYTES / 1e9
    # a mean and a covariance of six numbers for each track, from both sides
    stitch = 2 * trackers.AIRCRAFT * 8 * (6 + 36) / 1e6
    day = 24.0 * row["seconds"] / 3600.0
    return [
        Claim("a day as 24 of these hours: CPU", "h", ours=day),
        Claim("plan, an area and an hour: plots in", "MB", ours=1e3 * plots),
        Claim("plan, an area and an hour: tracks out", "MB", ours=1e3 * tracks),
        Claim("plan, an area and an hour: states of tracks at a border", "MB", ours=stitch),
        Claim("plan, 1000 radars and a day: plots", "", ours=24.0 * areas * row["plots"]),
        Claim("plan, 1000 radars and a day: plots in", "GB", ours=24.0 * areas * plots),
        Claim("plan, 1000 radars and a day: tracks out", "GB", ours=24.0 * areas * tracks),
        Claim("plan, 1000 radars and a day: CPU of tracking", "h", ours=areas * day),
    ]


PARTS: dict[str, Callable[[bool], list[Claim]]] = {
    "scans": scans, "trackers": crowds, "processes": processes, "hour": hours
}  # fmt: skip


def experiment(chosen: Namespace) -> list[Claim]:
    """Measure these parts."""
    return [claim for name in chosen.names for claim in PARTS[name](chosen.quick)]


if __name__ == "__main__":
    raise SystemExit(main("scale", experiment, __doc__, only=PARTS))
