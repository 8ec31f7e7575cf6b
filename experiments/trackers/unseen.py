"""Trackers on scenes and recordings that nobody tuned for, adapting and not, beside an oracle and other trackers.

PATH is a file of Python outside of the project, or a recording (`experiments.trackers.recorded`): a CSV file of ships'
reports, a folder of Autoferry scenarios. A file of Python defines ``make(name, seed)`` and ``CASES``, names of kinds of
scenes; a case has a ``scene`` with its truth, a ``cutoff`` (m), ``plane`` (heights do not count), ``targets`` (what a
user would name, or None), ``opts`` (speed and process noise, if a user would give them) and ``oracle`` (a scene with
what nobody told the tracker put right, or None). GOSPA (order 2) averaged over instants, false tracks and missed
targets at an instant, and changes of track in 100 instants of a target. The oracle is told which measurement is whose
and has the same filter; the plain tracker is a global nearest neighbour with one process noise and three detections of
four scans, and so is Stone Soup's, which is run on --peer-seeds alone. --ablation runs `multi-sensor` with each part of
what adapts taken out. A long run can be cut: with --kinds, --trackers or --ablation, --publish replaces these figures
of the result file. Seeds are --seed and those that follow.
"""

import importlib.util
import sys
import warnings
from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import cache, partial
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from assoc._system.engine import parallel_map
from assoc._types import Array
from assoc.metrics import Trajectories, gospa_over_time, identity
from assoc.scene import Scene
from assoc.tracking import TRACKERS, Initiation, Tracker
from assoc.tracking.filter_choice import make_filter, pace_of
from assoc.tracking.records.clutter import ClutterMap
from assoc.tracking.records.estimates import ALARMS, DETECTION, NOISE, Estimates, declared_values
from assoc.tracking.target_kinds import TARGETS
from experiments.common.claims import Claim
from experiments.common.command import main, mean_interval, whole
from experiments.trackers import recorded
from experiments.trackers.judging import OracleTracker
from experiments.trackers.plain_gnn import PlainGNN

SEEDS, PEER_SEEDS = 20, 3
CHOSEN = ("multi-sensor", "mht", "joint-probabilistic")
WHOLE, STONE_SOUP = "multi-sensor, adapting", "Stone Soup GNN"
NAMES = ("oracle", "plain GNN", STONE_SOUP, *(name for one in CHOSEN for name in (f"{one}, adapting", one)))
WHAT = {"GOSPA": "m", "false": "", "missed": "", "changes": ""}
"""What is measured, and its unit."""


def as_declared(*columns: int) -> Callable[..., Any]:
    """`Estimates.settled` that leaves these columns of what is used as they were declared."""
    settled = Estimates.settled

    def kept(self: Estimates, sensors: Any) -> Estimates:
        found = settled(self, sensors)
        used, bands = found.used.copy(), found.bands
        for column in columns:
            used[:, column] = declared_values(sensors)[:, column]
        if DETECTION in columns:
            bands = np.repeat(used[:, DETECTION, None], bands.shape[1], axis=1)
        manoeuvres = 1.0 if NOISE in columns else found.manoeuvres
        return found._replace(used=used, bands=bands, manoeuvres=manoeuvres)

    return kept


def _no_places(self: ClutterMap, sensors: Any, scan: Any, elsewhere: Any = None) -> Any:
    nothing = tuple(np.zeros(len(z)) for z in (scan.measurements if elsewhere is None else elsewhere))
    return nothing, nothing


def _same(progress: Any) -> Any:
    return progress


_ROOM = "assoc.tracking"
SETTLED = f"{_ROOM}.records.estimates.Estimates.settled"
PARTS: dict[str, dict[str, Any]] = {
    "places and rates of false alarms": {
        f"{_ROOM}.records.clutter.ClutterMap.used_and_found": _no_places, SETTLED: as_declared(ALARMS),
    },
    "noise and manoeuvres": {SETTLED: as_declared(NOISE)},
    "P_d": {SETTLED: as_declared(DETECTION)},
    "unresolved": {f"{_ROOM}.step.share": _same},
    "echoes": {f"{_ROOM}.step.hide_echoes": _same},
    "folded rates": {f"{_ROOM}.adapting.in_use.with_folding": _same},
    "speeds and free flight": {f"{_ROOM}.step.use_speeds": _same},
    "biases and clocks": {f"{_ROOM}.records.biases.Biases.after": lambda self, *_: self},
}  # fmt: skip
"""Parts of what adapts, and what takes their place when they are taken out."""
ALL = f"{WHOLE}, all parts"
ABLATION = {f"{WHOLE}, without {part}": changes for part, changes in PARTS.items()}


@contextmanager
def without(changes: dict[str, Any]) -> Iterator[None]:
    """Trackers without a part."""
    with ExitStack() as stack:
        for name, other in changes.items():
            stack.enter_context(patch(name, other))
        yield


@cache
def cases(file: Path) -> Any:
    """The module of a file of scenes.

    Raises ValueError: It has no ``make`` or no ``CASES``.
    """
    spec = importlib.util.spec_from_file_location("unseen_scenes", file)
    if spec is None or spec.loader is None:
        raise ValueError(f"{file}: expected a file of Python")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    if not hasattr(module, "make") or not hasattr(module, "CASES"):
        raise ValueError(f"{file}: expected a function make(name, seed) and CASES")
    return module


def options(case: Any) -> dict[str, Any]:
    """What ``assoc track`` makes of a scene and of what a user says of its targets."""
    scene, kind, pace = case.scene, case.targets, pace_of(case.scene.times)
    noise = case.opts.get("process_noise", TARGETS[kind].noise(pace) if kind else None)
    speed = case.opts.get("speed", TARGETS[kind].speed if kind else None)
    falls = bool(kind and TARGETS[kind].falls)
    made = {"filter": make_filter("imm-cv", scene.sensors, noise, 0, pace, scene.region, falls), "region": scene.region}
    return made | ({"initiation": Initiation(speed=speed)} if speed else {})


def tracked(tracker: Tracker | PlainGNN, scene: Scene) -> Trajectories:
    """The reported tracks of all scans."""
    rows = []
    for k in range(scene.num_scans):
        scan = scene.scan(k)
        tracker.step(scan.time, scan.measurements, scan.times, scan.sectors)
        rows += [(scan.time, track.track_id, *track.position) for track in tracker.tracks if track.reported]
    table = np.array(rows).reshape(-1, 5)
    return Trajectories(table[:, 0], table[:, 1].astype(np.int64), table[:, 2:])


def _moved(tracks: Trajectories, away: float) -> Trajectories:
    """Tracks from when they have been so far from where they began, metres."""
    order = np.lexsort((tracks.times, tracks.ids))
    ids, places = tracks.ids[order], tracks.positions[order]
    far = np.zeros(len(ids), dtype=bool)
    for one in np.unique(ids).tolist():
        rows = np.flatnonzero(ids == one)
        far[rows] = np.logical_or.accumulate(np.linalg.norm(places[rows] - places[rows[0]], axis=1) > away)
    return Trajectories(tracks.times[order][far], ids[far], places[far])


def judged(case: Any, tracks: Trajectories) -> Array:
    """The figures of `WHAT`."""
    truth = Trajectories.from_scene(case.scene)
    if case.plane:
        truth, tracks = (Trajectories(t.times, t.ids, t.positions * [1.0, 1.0, 0.0]) for t in (truth, tracks))
    if getattr(case, "away", 0.0):
        tracks = _moved(tracks, case.away)
    values = gospa_over_time(truth, tracks, case.cutoff)[1]
    total, unit = case.scene.num_scans, 0.5 * case.cutoff**2
    # squared parts of a scan's GOSPA: each false track and missed target adds half of the squared cutoff
    false, missed = (sum(getattr(one, part) for one in values) / (total * unit) for part in ("false", "missed"))
    changes = 100.0 * identity(truth, tracks, case.cutoff).switches / max(len(truth.times), 1)
    return np.array([sum(one.distance for one in values) / total, false, missed, changes])


def run(case: Any, name: str) -> Array:
    """A tracker of this name on a case."""
    told, scene = options(case), case.scene
    if name == "oracle":
        scene = scene if case.oracle is None else case.oracle
        return judged(case, tracked(OracleTracker(scene, filter=told["filter"]), scene))
    if name == "plain GNN":
        return judged(case, tracked(PlainGNN(scene, told.get("initiation", Initiation())), scene))
    if name == STONE_SOUP:
        from experiments.trackers.stone_soup_scenes import stone_soup

        return judged(case, stone_soup(scene, told.get("initiation", Initiation()).speed))
    kind, _, adapting = name.partition(", ")
    with without(ABLATION.get(name, {})):
        return judged(case, tracked(TRACKERS[kind](scene.sensors, **told, adapt=bool(adapting)), scene))


def runs(unit: tuple[Path, str, int, tuple[str, ...]]) -> dict[str, Array]:
    """Trackers of these names on one scene or recording: path, kind, seed, names."""
    path, kind, seed, names = unit
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        case = cases(path).make(kind, seed) if path.suffix == ".py" else recorded.case(path, kind)
        return {name: run(case, name) for name in names}


def experiment(chosen: Namespace) -> list[Claim]:
    """All kinds of the files and folders, or those named."""
    # what is published may replace a part of a file
    chosen.only = chosen.kinds or chosen.trackers or chosen.ablation
    names = tuple(chosen.trackers or ([ALL, *ABLATION] if chosen.ablation else NAMES))
    units = []
    for path in chosen.paths:
        scenes = path.suffix == ".py"
        for kind in cases(path).CASES if scenes else recorded.kinds(path):
            for n in range((1 if chosen.quick else chosen.seeds) if scenes else 1):
                own = tuple(name for name in names if name != STONE_SOUP or n < chosen.peer_seeds)
                if kind in (chosen.kinds or [kind]) and own:
                    units.append((path, kind, chosen.seed + n, own))
    found: dict[tuple[str, str], list[Array]] = {}
    for unit, values in zip(units, parallel_map(runs, units, jobs=chosen.processes), strict=True):
        print(f"{unit[1]}, seed {unit[2]}", *(f"{name} {row[0]:.4g}" for name, row in values.items()),
              sep="; ", file=sys.stderr, flush=True)  # fmt: skip
        for name, row in values.items():
            found.setdefault((unit[1], name), []).append(row)
    claims: list[Claim] = []
    for (kind, name), rows in found.items():
        for (what, unit_of), values in zip(WHAT.items(), np.array(rows).T, strict=True):
            interval = mean_interval(values) if len(values) > 1 else None
            value, source = float(values.mean()), f"seeds: {len(values)}"
            claims.append(Claim(f"{kind}, {name}: {what}", unit_of, None, value, interval, source=source))
    return claims


def add_options(parser: ArgumentParser) -> None:
    """Add the files of scenes and recordings, and what is wanted of them."""
    add = parser.add_argument
    add("paths", metavar="PATH", nargs="+", type=Path, help="scenes: make(name, seed) and CASES; or a recording")
    add("--kinds", nargs="+", metavar="NAME", help="these kinds alone")
    add(
        "--trackers",
        nargs="+",
        choices=[*NAMES, ALL, *ABLATION],
        metavar="NAME",
        help=f"these alone: {', '.join(NAMES)}",
    )
    add("--ablation", action="store_true", help="multi-sensor without each part of what adapts")
    add("--peer-seeds", type=whole(0), default=PEER_SEEDS, metavar="N", help="scenes for Stone Soup (%(default)s)")
    add("--processes", type=whole(1), default=1, metavar="N", help="so many scenes at once")


program = partial(
    main, "trackers.unseen", experiment, __doc__, seeds=(SEEDS, "scenes of each kind", 1), options=(add_options,)
)


if __name__ == "__main__":
    # by its name, for other processes look for what they run there
    from experiments.trackers import unseen

    raise SystemExit(unseen.program())
