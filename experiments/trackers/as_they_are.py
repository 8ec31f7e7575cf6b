"""Sensors as they are: trackers where views are limited, parameters wrong, or targets and clutter not as declared.

Each row of `experiments.trackers.real_scenes` (40 scans of 4 s) runs through an oracle that is told which measurement
is whose (same filter), through `multi-sensor` by what is declared, and through `multi-sensor` and `mht` as the programs
run them: they estimate what is not known ("adapting"). "If known" is `multi-sensor` that is told the truth about the
sensors. GOSPA with a cutoff of 500 m and its 95 % interval; false tracks and missed targets at an instant; identity
switches of reported tracks in a scene.
"""

import argparse
from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from assoc.metrics import Trajectories, gospa_over_time, identity
from assoc.scene import Scene
from assoc.tracking import TRACKERS
from experiments.common.claims import Claim
from experiments.common.command import main
from experiments.trackers.judging import CUTOFF, OracleTracker, mean_claim, through
from experiments.trackers.real_scenes import ADAPTING, ROWS, Case

USUAL = ("oracle", "multi-sensor", ADAPTING, "mht, adapting")


class Judged(NamedTuple):
    """A tracker's way through a scene."""

    gospa: float
    false: float
    missed: float
    switches: int


def judge(name: str, case: Case, scene: Scene) -> Judged:
    """Run a tracker, or the oracle, over the scene of a case, as declared or as known."""
    kind, _, adapting = name.partition(", ")
    tracker = (
        OracleTracker(scene, **case.options)
        if kind == "oracle"
        else TRACKERS[kind].for_scene(scene, **case.options, adapt=bool(adapting))
    )
    truth, tracks = Trajectories.from_scene(scene), through(tracker, scene).tracks
    if case.level:
        truth, tracks = (Trajectories(paths.times, paths.ids, paths.positions * [1, 1, 0]) for paths in (truth, tracks))
    values, unit = gospa_over_time(truth, tracks, CUTOFF)[1], CUTOFF**2 / 2
    return Judged(
        float(np.mean([value.distance for value in values])),
        float(np.mean([value.false for value in values])) / unit,
        float(np.mean([value.missed for value in values])) / unit,
        identity(truth, tracks, CUTOFF).switches,
    )


WHAT = {"gospa": "GOSPA", "false": "false tracks", "missed": "missed targets", "switches": "switches"}


def claims_of(label: str, runs: Sequence[Judged]) -> list[Claim]:
    """What a tracker did on the scenes of a row."""
    # counts are small: their intervals say little
    claims = [
        mean_claim(f"{label}: {WHAT[field]}", "m", values)
        if field == "gospa"
        else Claim(f"{label}: {WHAT[field]}", ours=float(values.mean()))
        for field, values in zip(Judged._fields, np.array(runs, dtype=np.float64).T, strict=True)
    ]
    print(f"{label:60} {'  '.join(f'{claim.ours:7.2f}' for claim in claims)}", flush=True)
    return claims


def experiment(chosen: argparse.Namespace) -> list[Claim]:
    """Run trackers over rows of the table."""
    claims = []
    for label in chosen.names:
        cases = [ROWS[label](chosen.seed + k) for k in range(2 if chosen.quick else chosen.seeds)]
        runs = {name: [judge(name, case, case.declared) for case in cases] for name in chosen.trackers or USUAL}
        if all(case.known for case in cases) and ADAPTING in runs:
            known = "multi-sensor if known"
            runs[known] = [judge("multi-sensor", case, case.known) for case in cases if case.known is not None]
        for name, found in runs.items():
            claims += claims_of(f"{label}, {name}", found)
    return claims


def _add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--trackers", nargs="+", choices=USUAL, default=[], metavar="NAME", help="these alone")


program = partial(
    main, "trackers.as_they_are", experiment, __doc__, only=ROWS, seeds=(20, "scenes of each row", 1),
    options=[_add_options], said=" {seeds} scenes of each row.",
)  # fmt: skip


if __name__ == "__main__":
    raise SystemExit(program())
