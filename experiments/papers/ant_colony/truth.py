"""The paper's conclusion against the truth: false alarms told apart, missed detections coped with; its figure 3."""

from typing import Any

import numpy as np

import assoc
from assoc.simulation import simulate
from experiments.common.claims import Claim

PARAMETERS = {"mode": "paper", "ants": 15, "alpha": 2.0, "beta": 1.0, "rho": 0.3}
LEAST = 95.0
"""Percent from which on the paper's words "is able to" count as true; chosen by us."""


def shares(scene: assoc.Scene, association: assoc.Association) -> dict[str, tuple[int, int]]:
    """How many of how many: false alarms left alone, targets found whole by the number of radars that saw them."""
    found = {"false alarms left alone": [0, 0], "tuples of one target alone": [0, 0]}
    found |= {f"targets seen by {n} radars, found with just these": [0, 0] for n in (3, 2)}
    for k, solution in enumerate(association.solutions):
        sources = scene.scan(k).sources
        members = [
            [int(sources[s][i - 1]) for s, i in enumerate(row) if i > 0] for row in np.asarray(solution.tuples).tolist()
        ]
        joined = [m for m in members if len(m) > 1]
        alone = sum(m == [-1] for m in members)
        false = sum(int((source < 0).sum()) for source in sources)
        _count(found["false alarms left alone"], alone, false)
        _count(found["tuples of one target alone"], sum(len(set(m)) == 1 and m[0] >= 0 for m in joined), len(joined))
        seen = np.concatenate(sources)
        names, radars = np.unique(seen[seen >= 0], return_counts=True)
        for name, n in zip(names.tolist(), radars.tolist(), strict=True):
            if n > 1:
                _count(found[f"targets seen by {n} radars, found with just these"], [name] * n in joined, 1)
    return {what: (good, every) for what, (good, every) in found.items()}


def _count(pair: list[int], good: int, every: int) -> None:
    pair[0] += int(good)
    pair[1] += every


def judge(scans: int, seed: int) -> tuple[list[Claim], Any]:
    """Claims on the paper's scene with its algorithm, beside greedy and the optimum."""
    scene = simulate("three-radar", seed, scans=scans)
    claims = []
    by_name = {
        "mode paper": assoc.associate(scene, "aco", seed=seed, **PARAMETERS),
        "greedy": assoc.associate(scene, "greedy", seed=seed),
        "optimum": assoc.associate(scene, "exact", seed=seed),
    }
    best = np.array([solution.cost for solution in by_name["optimum"].solutions])
    for name, association in by_name.items():
        for what, (good, every) in shares(scene, association).items():
            claims.append(
                Claim(f"truth, {name}: {what}, of {every}", "%", None, 100.0 * good / every, None, (LEAST, None),
                      source=f"figure 3 and conclusion, in words; {LEAST:g} % chosen by us")
            )  # fmt: skip
        costs = np.array([solution.cost for solution in association.solutions])
        solved = int((costs <= best + 1e-6 * np.maximum(1.0, np.abs(best))).sum())
        claims.append(Claim(f"truth, {name}: scans of {scans} solved to the optimum", "", None, solved, None,
                            (scans, scans), source="chosen by us"))  # fmt: skip
    return claims, (scene, by_name["mode paper"])


def draw(figure: Any, shown: Any) -> None:
    """Figures 1 to 3 of the paper: targets, measurements, and what the ants selected."""
    scene, association = shown
    panels = figure.subplots(1, 3, sharex=True, sharey=True)
    truth = np.concatenate([scene.scan(k).truth_positions for k in range(scene.num_scans)]) / 1e3
    panels[0].plot(*truth[:, :2].T, ".", markersize=2)
    panels[0].set_title("figure 1: targets")
    frame = association.to_frame()
    places = []
    for k in range(scene.num_scans):
        scan = scene.scan(k)
        for s, sensor in enumerate(scene.sensors):
            r, a, e = scan.measurements[s].T
            ground = r * np.cos(e)
            places.append(np.stack([ground * np.cos(a), ground * np.sin(a)], axis=1) + sensor.position[:2])
    measured = np.concatenate(places) / 1e3
    panels[1].plot(*measured.T, ".", markersize=2, color="0.4")
    panels[1].set_title("figure 2: measurements")
    panels[2].plot(frame["x"] / 1e3, frame["y"] / 1e3, ".", markersize=2, color="C2")
    panels[2].set_title("figure 3: targets that the ants selected")
    for panel in panels:
        panel.set(xlabel="x (km)", ylabel="y (km)")
