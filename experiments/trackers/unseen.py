"""Trackers on scenes that nobody tuned for: of a file outside of the project, adapting and not, beside an oracle.

FILE defines ``make(name, seed)`` and ``CASES``, names of kinds of scenes; a case has a ``scene`` with its truth, a
``cutoff`` (m), ``plane`` (heights do not count), ``targets`` (what a user would name, or None), ``opts`` (speed and
process noise, if a user would give them) and ``oracle`` (a scene with what nobody told the tracker put right, or None).
GOSPA (order 2) averaged over instants, and false tracks and missed targets at an instant. The oracle is told which
measurement is whose and has the same filter; the plain tracker is a global nearest neighbour with one process noise and
three detections of four scans. Seeds are --seed and those that follow, --seeds of them (5).
"""

import importlib.util
import sys
import warnings
from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import Any

import numpy as np

from assoc._types import Array
from assoc.metrics import Trajectories, gospa_over_time
from assoc.scene import Scene
from assoc.tracking import TRACKERS, Initiation, Tracker
from assoc.tracking.filter_choice import make_filter, pace_of
from assoc.tracking.target_kinds import TARGETS
from experiments.common.claims import Claim
from experiments.common.command import main, mean_interval
from experiments.trackers.judging import OracleTracker
from experiments.trackers.plain_gnn import PlainGNN

SEEDS = 5
CHOSEN = ("multi-sensor", "mht", "joint-probabilistic")


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


def judged(case: Any, tracks: Trajectories) -> Array:
    """Mean GOSPA (m), false tracks and missed targets at an instant."""
    truth = Trajectories.from_scene(case.scene)
    if case.plane:
        truth, tracks = (Trajectories(t.times, t.ids, t.positions * [1.0, 1.0, 0.0]) for t in (truth, tracks))
    values = gospa_over_time(truth, tracks, case.cutoff)[1]
    total, unit = case.scene.num_scans, 0.5 * case.cutoff**2
    # squared parts of a scan's GOSPA: each false track and missed target adds half of the squared cutoff
    false, missed = (sum(getattr(one, part) for one in values) / (total * unit) for part in ("false", "missed"))
    return np.array([sum(one.distance for one in values) / total, false, missed])


def runs(case: Any) -> dict[str, Array]:
    """Every tracker on a case."""
    told = options(case)
    scene = case.scene
    known = scene if case.oracle is None else case.oracle
    made: dict[str, Any] = {
        "oracle": OracleTracker(known, **({"filter": told["filter"]} if "filter" in told else {})),
        "plain GNN": PlainGNN(scene, told.get("initiation", Initiation())),
    }
    for name in CHOSEN:
        for adapt in (True, False):
            made[f"{name}{', adapting' if adapt else ''}"] = TRACKERS[name](scene.sensors, **options(case), adapt=adapt)
    return {name: judged(case, tracked(one, known if name == "oracle" else scene)) for name, one in made.items()}


def experiment(chosen: Namespace) -> list[Claim]:
    """All kinds of the file, or those named."""
    module = cases(chosen.file)
    claims: list[Claim] = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for kind in chosen.kinds or module.CASES:
            found: dict[str, list[Array]] = {}
            for seed in range(chosen.seed, chosen.seed + (1 if chosen.quick else chosen.seeds)):
                for name, values in runs(module.make(kind, seed)).items():
                    found.setdefault(name, []).append(values)
            for name, rows in found.items():
                for what, unit, values in zip(
                    ("GOSPA", "false", "missed"), ("m", "", ""), np.array(rows).T, strict=True
                ):
                    interval = mean_interval(values) if len(values) > 1 else None
                    claims.append(Claim(f"{kind}, {name}: {what}", unit, None, float(values.mean()), interval))
    return claims


def add_file(parser: ArgumentParser) -> None:
    """Add the file of scenes, and the kinds that are wanted."""
    parser.add_argument("file", metavar="FILE.py", type=Path, help="scenes: make(name, seed) and CASES")
    parser.add_argument("--kinds", nargs="+", metavar="NAME", help="these kinds alone")


if __name__ == "__main__":
    raise SystemExit(
        main("trackers.unseen", experiment, __doc__, seeds=(SEEDS, "scenes of each kind", 1), options=(add_file,))
    )
