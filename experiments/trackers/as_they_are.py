"""Sensors as they are: trackers where views are limited, parameters wrong, or targets and clutter not as declared.

Each row of `experiments.trackers.real_scenes` (40 scans of 4 s) runs through an oracle that is told which measurement
is whose (same filter), through `multi-sensor` by what is declared, and through `multi-sensor` and `mht` as the programs
run them: they estimate what is not known ("adapting"). "If known" is `multi-sensor` that is told the truth about the
sensors. GOSPA with a cutoff of 500 m and its 95 % interval; false tracks and missed targets at an instant; identity
switches and ids of reported tracks in a scene.

Ablation, each of six parts off, alone, where a row needs it. Without views: sensors are said to see everything, always.
Without heights: states in the plane. Without estimates: a tracker that forgets, before each scan, what it has learnt of
sensors and targets. Without map: false alarms are as dense everywhere. Without life: lost tracks are forgotten, and no
track is shown while it probably does not exist. All permutations: a joint probabilistic tracker by all joint events.
"""

import argparse
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from assoc._types import Array
from assoc.metrics import Trajectories, gospa_over_time, identity
from assoc.scene import Scene
from assoc.tracking import TRACKERS, Track, Tracker
from assoc.tracking.records.clutter import ClutterMap
from assoc.tracking.records.estimates import Estimates
from experiments.common.claims import Claim
from experiments.common.command import main, whole
from experiments.trackers.judging import CUTOFF, OracleTracker, Sites, goal, mean_claim, through
from experiments.trackers.real_scenes import ADAPTING, ROWS, SCANS, SITES, Case, Row, flat_states, untold_views

USUAL = ("oracle", "multi-sensor", ADAPTING, "mht, adapting")


class Judged(NamedTuple):
    """A tracker's way through a scene."""

    gospa: float
    false: float
    missed: float
    switches: int
    ids: int
    gap: float
    """Of two targets: distance of the tracks over that of the targets, a mean; NaN for more targets."""


class NoMap(ClutterMap):
    """A map that never shows clutter."""

    def used_and_found(self, sensors: Any, scan: Any) -> tuple[tuple[Array, ...], tuple[Array, ...]]:
        """As dense as declared."""
        nothing = tuple(np.zeros(len(z)) for z in scan.measurements)
        return nothing, nothing


class Forgetful:
    """A tracker that has parts of its state as they are given before each scan.

    sure: Whether a track that probably does not exist is not shown.
    """

    def __init__(self, tracker: Tracker, parts: Mapping[str, Any], sure: bool = False) -> None:
        self.tracker, self.parts, self.sure, self.filter = tracker, parts, sure, tracker.filter

    def step(self, *scan: Any) -> None:
        """Step without what was learnt."""
        self.tracker.state = self.tracker.state._replace(**self.parts)
        self.tracker.step(*scan)

    @property
    def tracks(self) -> list[Track]:
        """The tracks to be shown."""
        return [track for track in self.tracker.tracks if track.existence >= 0.5 or not self.sure]


def make(name: str, scene: Scene, options: Mapping[str, Any]) -> Any:
    """Make a tracker of this name; after ", " stands what is different from the default."""
    kind, _, how = name.partition(", ")
    if kind == "oracle":
        return OracleTracker(scene, **options)
    if kind == SITES:
        return Sites(scene, **options)
    if kind == "GNN":
        return TRACKERS["nearest-neighbour"].for_scene(scene, rule="assignment", **options)
    own: dict[str, Any] = {"": {}, "all permutations": {"permutations": "all"}}.get(how, {"adapt": True})
    if how == "without heights":
        options = flat_states(options)
    tracker = TRACKERS[kind].for_scene(scene, **options, **own)
    if how == "without estimates":
        return Forgetful(tracker, {"estimates": tracker.state.estimates})
    if how == "without map":
        return Forgetful(tracker, {"clutter": NoMap(*ClutterMap.empty(scene.sensors))})
    if how == "without life":
        return Forgetful(tracker, {"lost": tracker.state.lost}, sure=True)
    return tracker


def _gap(truth: Trajectories, tracks: Trajectories) -> float:
    """See `Judged.gap`; of the second half, along the line through the targets."""
    if len(np.unique(truth.ids)) != 2:
        return float("nan")
    found = []
    for time in np.unique(truth.times)[SCANS // 2 :]:
        (a, b), places = truth.positions[truth.times == time], tracks.positions[tracks.times == time]
        near = places[np.linalg.norm(places - (a + b) / 2, axis=1) < CUTOFF]
        if len(near) == 2:
            found.append(abs((near[0] - near[1]) @ (a - b)) / ((a - b) @ (a - b)))
    return float(np.mean(found)) if found else float("nan")


def judge(name: str, case: Case, scene: Scene) -> Judged:
    """Run a tracker, or the oracle, over the scene of a case, as declared or as known."""
    if name.endswith("without views"):
        scene = untold_views(scene)
    if case.bands is not None and scene is case.known:
        told = Estimates.declared(scene.sensors)._replace(bands=case.bands)
        tracker: Any = Forgetful(make(ADAPTING, scene, case.options), {"estimates": told})
    else:
        tracker = make(name, scene, case.options)
    truth, tracks = Trajectories.from_scene(scene), through(tracker, scene).tracks
    if case.level:
        truth, tracks = (Trajectories(paths.times, paths.ids, paths.positions * [1, 1, 0]) for paths in (truth, tracks))
    values, unit = gospa_over_time(truth, tracks, CUTOFF)[1], CUTOFF**2 / 2
    return Judged(
        float(np.mean([value.distance for value in values])),
        float(np.mean([value.false for value in values])) / unit,
        float(np.mean([value.missed for value in values])) / unit,
        identity(truth, tracks, CUTOFF).switches,
        len(np.unique(tracks.ids)),
        _gap(truth, tracks),
    )


WHAT = {
    "gospa": "GOSPA", "false": "false tracks", "missed": "missed targets", "switches": "switches", "ids": "ids",
    "gap": "gap of the tracks / true gap",
}  # fmt: skip


def claims_of(label: str, runs: Sequence[Judged], ids: bool = True) -> list[Claim]:
    """What a tracker did on the scenes of a row; `ids`: also how many it gave."""
    claims = []
    for field, values in zip(Judged._fields, np.array(runs, dtype=np.float64).T, strict=True):
        if np.isfinite(values).any() and (ids or field != "ids"):
            what, values = f"{label}: {WHAT[field]}", values[np.isfinite(values)]
            # counts are small: their intervals say little
            claims.append(mean_claim(what, "m", values) if field == "gospa" else Claim(what, ours=float(values.mean())))
    print(f"{label:60} {'  '.join(f'{claim.ours:7.2f}' for claim in claims)}", flush=True)
    return claims


def _goals(label: str, row: Row, runs: Mapping[str, Sequence[Judged]]) -> list[Claim]:
    """The goals of a row that was run through the trackers they are for."""
    claims = []
    for which, most in row.goals.items():
        name, _, field = which.rpartition(": ")
        name = name or ADAPTING
        if name in runs:
            values = np.array([getattr(run, field) for run in runs[name]], dtype=np.float64)
            what, unit = f"{label}, {name}: {WHAT[field]}", "m" if field == "gospa" else ""
            claims.append(goal(what, unit, values, most))
    if row.harmless and {"oracle", ADAPTING} <= set(runs):
        ours, best = (np.array([run.gospa for run in runs[name]]) for name in (ADAPTING, "oracle"))
        claims.append(goal(f"{label}, {ADAPTING}: GOSPA / the oracle's", "", ours / best, NEARLY))
    return claims


NEARLY = 1.1
"""GOSPA of trackers that are as good as the oracle, nearly, as a multiple of its."""


def experiment(chosen: argparse.Namespace) -> list[Claim]:
    """Run trackers over rows of the table, those without a goal of their own on fewer scenes."""
    claims = []
    seeds = 2 if chosen.quick else chosen.seeds
    for label in chosen.names:
        row = ROWS[label]
        cases = [row.make(chosen.seed + k) for k in range(seeds if row.goals else min(seeds, chosen.others))]
        own = [*USUAL, *row.also, *(f"multi-sensor, without {part}" for part in row.without)]
        taken = [name for name in own if name in chosen.trackers or not chosen.trackers]
        runs = {name: [judge(name, case, case.declared) for case in cases] for name in taken}
        if all(case.known for case in cases) and ADAPTING in runs:
            known = "multi-sensor if known"
            runs[known] = [judge("multi-sensor", case, case.known) for case in cases if case.known is not None]
        for name, found in runs.items():
            claims += claims_of(f"{label}, {name}", found, row.ids)
        claims += _goals(label, row, runs)
    return claims


def _add_options(parser: argparse.ArgumentParser) -> None:
    text = "scenes at the most of a row that has no goal of its own (default 10)"
    parser.add_argument("--others", type=whole(1), default=10, metavar="N", help=text)
    every = dict.fromkeys([*USUAL, *(name for row in ROWS.values() for name in row.also)])
    parser.add_argument("--trackers", nargs="+", choices=every, default=[], metavar="NAME", help="these alone")


program = partial(
    main, "trackers.as_they_are", experiment, __doc__, only=ROWS, seeds=(20, "scenes of each row", 1),
    options=[_add_options], said=" {seeds} scenes of each row with a goal of its own, {others} of the others.",
)  # fmt: skip


if __name__ == "__main__":
    raise SystemExit(program())
