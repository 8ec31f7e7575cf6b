"""Our trackers compared: three radars, and recorded air traffic if a file is given.

    python -m experiments.trackers.comparison [FILE.csv] [--scans N] [--seeds N] [--quick] [--seed N] [--json FILE]
                                              [--figure FILE] [--only NAME ...] [--publish]

All trackers with default settings, and an oracle that is told which measurement is whose, on the three-radar scene
(ten seeds, 100 scans) and on trajectories of a CSV file that three simulated radars see every 10 s (scenario
from-tracks, --seeds of them). Tracks count while they are reported. GOSPA and what it consists of (root mean squares),
OSPA(2), HOTA, all with a cutoff of 500 m, identity switches a scene, and CPU time of a scan.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from assoc import simulation
from assoc._types import Array
from assoc.scene import Scene
from experiments.common.claims import Claim
from experiments.common.command import add_only, make_parser, run
from experiments.trackers.judging import NAMES, claims_of, goal, judge, mean_claim, means

WITHIN_ORACLE = 1.02
"""Recorded traffic: GOSPA of the multi-sensor tracker, as a multiple of the oracle's."""


def compare(label: str, scenes: list[Scene], names: Sequence[str]) -> tuple[list[Claim], dict[str, Array]]:
    """Trackers of these names on the same scenes."""
    found = {name: [judge(name, scene) for scene in scenes] for name in names}
    claims = []
    for name, runs in found.items():
        claims += claims_of(label, name, runs)
        claims += [
            Claim(f"{label}, {name}: {part}", "m", ours=float(np.mean([one.parts[part] for one in runs])))
            for part in ("localisation", "missed", "false")
        ]
    others = {"multi-sensor": "nearest-neighbour", "mht": "nearest-neighbour", "static": "multi-sensor"}
    for name, other in others.items():
        if {name, other} <= set(found):
            difference = means(found[name]) - means(found[other])
            claims.append(mean_claim(f"{label}: GOSPA, {name} - {other}", "m", difference))
    if {"multi-sensor", "oracle"} <= set(found):
        best, oracle = found["multi-sensor"], found["oracle"]
        ratio = means(best) / means(oracle)
        claims.append(goal(f"{label}: GOSPA, multi-sensor / oracle", "", ratio, WITHIN_ORACLE))
        switches = np.array([float(a.switches - b.switches) for a, b in zip(best, oracle, strict=True)])
        claims.append(goal(f"{label}: switches, multi-sensor - oracle", "", switches, 0.0, surely=False))
    return claims, {name: np.mean([one.distances for one in runs], axis=0) for name, runs in found.items()}


def experiment(
    file: str | None, scans: int | None, seeds: int, names: Sequence[str], quick: bool, rng: np.random.Generator
) -> tuple[list[Claim], Any]:
    """Compare on the three-radar scene, and on the file's traffic."""
    seed = int(rng.integers(2**31))
    count, length = (2, 15) if quick else (10, 100)
    scenes = [simulation.simulate("three-radar", seed + k, scans=length) for k in range(count)]
    claims, curves = compare("three radars", scenes, names)
    shown = {"three radars": (scenes[0].times, curves)}
    if file is not None:
        values = {} if scans is None else {"scans": scans}
        runs = range(1 if quick else seeds)
        traffic = [simulation.simulate("from-tracks", seed + k, file=file, **values) for k in runs]
        more, curves = compare("recorded traffic", traffic, names)
        claims += more
        shown["recorded traffic"] = (traffic[0].times, curves)
    return claims, shown


_SHADES = ("#000000", "#1f77b4", "#ff7f0e", "#2ca02c", "#9467bd", "#8c8c8c", "#d62728", "#17becf")
COLOURS = dict(zip(NAMES, _SHADES, strict=True))


def draw(figure: Any, shown: dict[str, tuple[Array, dict[str, Array]]]) -> None:
    """GOSPA over time, one panel for each kind of scene."""
    for axes, (label, (times, curves)) in zip(
        np.atleast_1d(figure.subplots(len(shown), 1)), shown.items(), strict=True
    ):
        for name, curve in curves.items():
            axes.plot(times - times[0], curve, color=COLOURS[name], label=name, lw=1.4)
        axes.set_title(label, fontsize=10, loc="left")
        axes.set_ylabel("GOSPA, m")
        axes.set_ylim(bottom=0)
        axes.grid(alpha=0.3)
        axes.spines[["top", "right"]].set_visible(False)
    axes.set_xlabel("time, s")
    axes.legend(ncols=4, fontsize=8, frameon=False, loc="upper center", bbox_to_anchor=(0.5, -0.18))


def program(arguments: Sequence[str] | None = None) -> int:
    """Run the experiment; returns its exit code."""
    parser = make_parser(NAME, TITLE)
    parser.add_argument("file", nargs="?", metavar="FILE.csv", help="recorded trajectories (default: simulated only)")
    parser.add_argument("--scans", type=int, metavar="N", help="scans of the recorded trajectories (default: all)")
    parser.add_argument("--seeds", type=int, default=3, metavar="N", help="runs on recorded trajectories (default 3)")
    add_only(parser, NAMES)
    chosen = parser.parse_args(arguments)
    if chosen.seeds < 1:
        parser.error("--seeds must be at least 1")
    return run(
        parser,
        chosen,
        NAME,
        TITLE,
        lambda quick, rng: experiment(chosen.file, chosen.scans, chosen.seeds, chosen.only or NAMES, quick, rng),
        draw,
        (8, 4.0 if chosen.file is None else 7.0),
        f"{__doc__} {chosen.seeds} runs on recorded trajectories.",
    )


NAME, TITLE = "trackers.comparison", "Our trackers compared"


if __name__ == "__main__":
    raise SystemExit(program())
