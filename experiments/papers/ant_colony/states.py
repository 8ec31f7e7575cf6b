"""The states that the ant colony paper's abstract promises: tracks of what the ants associate, against the truth.

Each scan of the paper's scene is associated by itself (mode "paper", alpha 2, beta 1, rho 0.3, 15 ants), and what is
found is given to tracks, which a filter estimates: what `assoc track scene.npz --tracker static --solver aco --mode
paper` does. Beside it the exact solver, and the positions of the scans by themselves. A confirmed track is compared
with the target nearest to it. Full size: 10 scenes of 100 scans.
"""

from typing import Any

import numpy as np

import assoc
from assoc._types import Array
from assoc.simulation import simulate
from assoc.tracking import StaticFusionTracker, track_scene
from experiments.common.claims import Claim
from experiments.common.command import main, mean_interval
from experiments.papers.ant_colony.truth import PARAMETERS

SOLVERS: dict[str, tuple[str, dict[str, Any]]] = {"mode paper": ("aco", PARAMETERS), "exact": ("exact", {})}
SOURCE = "abstract, in words"


def errors(scene: assoc.Scene, frame: Any, columns: tuple[str, ...]) -> tuple[Array, float]:
    """Distances of rows from the nearest target of their instant, and the mean of targets without a row within 1 km."""
    found, lost = [], []
    for k in range(scene.num_scans):
        scan = scene.scan(k)
        places = frame[frame["time"] == scan.time][list(columns)].to_numpy()
        off = np.linalg.norm(places[:, None] - scan.truth_positions[None], axis=2)
        found.append(off.min(axis=1))
        lost.append(int((off.min(axis=0, initial=np.inf) > 1000.0).sum()))
    return np.concatenate(found), float(np.mean(lost))


def experiment(quick: bool, rng: np.random.Generator) -> list[Claim]:
    """Errors of positions with each solver, tracked and not; --quick has fewer, shorter scenes."""
    rows: dict[str, list[tuple[float, ...]]] = {}
    for seed in rng.integers(2**31, size=2 if quick else 10).tolist():
        scene = simulate("three-radar", seed, scans=20 if quick else 100)
        for name, (solver, parameters) in SOLVERS.items():
            tracker = StaticFusionTracker.for_scene(scene, solver=solver, solver_parameters=parameters)
            tracks = track_scene(tracker, scene)[0].to_frame()
            alone = assoc.associate(scene, solver, **parameters).to_frame()
            off, lost = errors(scene, tracks, ("x", "y", "z"))
            raw, _ = errors(scene, alone.assign(time=scene.times[alone["scan"]]), ("x", "y", "z"))
            rows.setdefault(name, []).append(
                (rms(off), rms(raw[raw < 1000.0]), lost, float(tracks["track_id"].nunique()))
            )
    whats = ("RMS error of tracked positions", "m"), ("RMS error of the scans' own positions", "m"), (
        "targets without a track, mean of the scans", ""), ("confirmed tracks", "")  # fmt: skip
    return [
        Claim(f"{name}: {what}", unit, None, float(np.mean(values)), mean_interval(values), source=SOURCE)
        for name, found in rows.items()
        for (what, unit), values in zip(whats, np.array(found).T, strict=True)
    ]


def rms(values: Array) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


if __name__ == "__main__":
    raise SystemExit(main("papers.ant_colony.states", experiment, __doc__))
