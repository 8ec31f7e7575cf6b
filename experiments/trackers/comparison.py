"""Our trackers compared: three radars, and recorded air traffic if a file is given.

    python -m experiments.trackers.comparison [FILE.csv] [--scans N] [--quick] [--seed N] [--json FILE] [--figure FILE]

Multi-sensor S-D, static fusion, MHT in both forms and nearest neighbour, with one filter and one life cycle, on the
three-radar scene (several seeds) and on trajectories of a CSV file that simulated radars see (scenario from-tracks).
GOSPA (order 2), identity switches, and CPU time per scan.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from assoc import simulation
from assoc._types import Array
from assoc.metrics import Trajectories, gospa_over_time, identity, mean_gospa
from assoc.scene import Scene
from assoc.tracking import TRACKERS
from assoc.tracking.filter_choice import make_filter
from experiments.common.claims import Claim
from experiments.common.command import make_parser, run
from experiments.trackers.running import through

CUTOFF = 500.0
"""Of GOSPA, metres."""
THREE_RADAR_NOISE, TRAFFIC_NOISE = 20.0, 5.0
"""Process noise, m/s^1.5: the paper's second target turns with 50 m/s^2, airliners do not."""
OPTIONS: dict[str, dict[str, Any]] = {"mht": {"depth": 2}, "mht-hypothesis": {"depth": 2}}
"""Windows of two scans of three radars: six frames."""
NAMES = tuple(TRACKERS)


class Judged(NamedTuple):
    """One tracker on one scene."""

    distances: Array
    """GOSPA of each scan, metres."""
    parts: dict[str, float]
    switches: int
    seconds: Array


def judge(name: str, scene: Scene, noise: float) -> Judged:
    """Run a tracker over a scene."""
    tracker = TRACKERS[name].for_scene(scene, make_filter("ekf", scene.sensors, noise), **OPTIONS.get(name, {}))
    run = through(tracker, scene)
    truth = Trajectories.from_scene(scene)
    times, values = gospa_over_time(truth, run.tracks, CUTOFF)
    by_time = dict(zip(times.tolist(), values, strict=True))
    distances = [by_time[t].distance if t in by_time else 0.0 for t in scene.times.tolist()]
    switches = identity(truth, run.tracks, CUTOFF).switches
    return Judged(np.array(distances), mean_gospa(values), switches, run.seconds)


def compare(label: str, scenes: list[Scene], noise: float) -> tuple[list[Claim], dict[str, Array]]:
    """All trackers on the same scenes."""
    found = {name: [judge(name, scene, noise) for scene in scenes] for name in NAMES}
    means = {name: np.array([one.distances.mean() for one in runs]) for name, runs in found.items()}
    claims = []
    for name, runs in found.items():
        claims += [
            Claim(f"{label}, {name}: mean GOSPA", "m", ours=float(means[name].mean()), interval=_interval(means[name])),
            *(
                Claim(f"{label}, {name}: {part}", "m", ours=float(np.mean([one.parts[part] for one in runs])))
                for part in ("localisation", "missed", "false")
            ),
            Claim(
                f"{label}, {name}: identity switches a scene", "", ours=float(np.mean([one.switches for one in runs]))
            ),
            Claim(
                f"{label}, {name}: CPU time of a scan, median",
                "ms",
                ours=1e3 * float(np.median(np.concatenate([one.seconds[1:] for one in runs]))),
            ),
        ]
    others = {"multi-sensor": "nearest-neighbour", "mht": "nearest-neighbour", "static": "multi-sensor"}
    for name, other in others.items():
        difference = means[name] - means[other]
        # what is to be expected: more information, no worse; the static variant gives some away
        band = (0.0, None) if name == "static" else (None, 0.0)
        claims.append(
            Claim(
                f"{label}: mean GOSPA, {name} - {other}",
                "m",
                ours=float(difference.mean()),
                interval=_interval(difference),
                band=band,
            )
        )
    return claims, {name: np.mean([one.distances for one in runs], axis=0) for name, runs in found.items()}


def _interval(values: Array) -> tuple[float, float] | None:
    """95 % interval of a mean over scenes."""
    if len(values) < 2:
        return None
    half = 1.96 * float(values.std(ddof=1)) / len(values) ** 0.5
    return float(values.mean()) - half, float(values.mean()) + half


def experiment(file: str | None, scans: int | None, quick: bool, rng: np.random.Generator) -> tuple[list[Claim], Any]:
    """Compare on the three-radar scene, and on the file's traffic."""
    seed = int(rng.integers(2**31))
    count, length = (2, 15) if quick else (10, 100)
    scenes = [simulation.simulate("three-radar", seed + k, scans=length) for k in range(count)]
    claims, curves = compare("three radars", scenes, THREE_RADAR_NOISE)
    shown = {"three radars": (scenes[0].times, curves)}
    if file is not None:
        values = {} if scans is None else {"scans": scans}
        traffic = [simulation.simulate("from-tracks", seed, file=file, **values)]
        more, curves = compare("recorded traffic", traffic, TRAFFIC_NOISE)
        claims += more
        shown["recorded traffic"] = (traffic[0].times, curves)
    return claims, shown


COLOURS = dict(zip(NAMES, ("#1f77b4", "#ff7f0e", "#2ca02c", "#9467bd", "#8c8c8c"), strict=True))


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
    axes.legend(ncols=len(NAMES), fontsize=8, frameon=False, loc="upper center", bbox_to_anchor=(0.5, -0.18))


def program(arguments: Sequence[str] | None = None) -> int:
    """Run the experiment; returns its exit code."""
    parser = make_parser(NAME, TITLE)
    parser.add_argument("file", nargs="?", metavar="FILE.csv", help="recorded trajectories (default: simulated only)")
    parser.add_argument("--scans", type=int, metavar="N", help="scans of the recorded trajectories (default: all)")
    chosen = parser.parse_args(arguments)
    return run(
        parser,
        chosen,
        NAME,
        TITLE,
        lambda quick, rng: experiment(chosen.file, chosen.scans, quick, rng),
        draw,
        (8, 4.0 if chosen.file is None else 7.0),
    )


NAME, TITLE = "trackers.comparison", "Our trackers compared"


if __name__ == "__main__":
    raise SystemExit(program())
