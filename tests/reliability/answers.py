"""Answers of solvers, costs, filters and trackers, small enough to be had without the compiler too.

    python -m tests.reliability.answers [--only PART,PART]

prints them as JSON, every float to its last bit: for comparisons with other processes (test_modes.py, cold_cache.py).
"""

import argparse
import json
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np

from assoc.errors import AssocWarning
from tests.tracking.stepping import stepped

SOLVERS = ("exact", "greedy", "aco", "genetic", "tabu", "lagrangian")


def solutions() -> list[Any]:
    """Solutions of small problems by all solvers that have kernels."""
    from assoc.solvers.assign import assign
    from tests.oracles import small_problems

    found = []
    for number, problem in enumerate(small_problems(5, seed=21, dummy=True)):
        for name in SOLVERS:
            more = {"iterations": 5} if name in ("aco", "genetic", "tabu") else {}
            with warnings.catch_warnings():  # costs of random problems may all be positive, and assign says so
                warnings.simplefilter("ignore", AssocWarning)
                one = assign(problem, name, seed=number, **more)
            found.append([name, one.indices.tolist(), one.cost, one.lower_bound])
    return found


def rankings() -> list[Any]:
    """Ranked solutions, and probabilities."""
    from assoc.ranking.kbest import kbest
    from assoc.ranking.marginals import marginals
    from tests.oracles import small_problems

    found = []
    for number, problem in enumerate(small_problems(3, seed=22, dummy=True)):
        found.append([[one.indices.tolist(), one.cost, one.lower_bound] for one in kbest(problem, 3)])
        if number == 0:
            found.append(marginals(problem).probability.tolist())
    return found


def costs() -> list[Any]:
    """Candidate tuples and their costs, of radars and of bearings."""
    from assoc.costs import build_problem
    from assoc.simulation import simulate

    found = []
    for name in ("three-radar", "bearing-only"):
        scene = simulate(name, 3, scans=2)
        for k in range(2):
            problem = build_problem(scene, scene.scan(k))
            found.append([problem.tuples.tolist(), problem.costs.tolist()])
    return found


def tracks() -> list[Any]:
    """Tracks of two trackers with several filters."""
    from assoc.simulation import simulate
    from assoc.tracking import TRACKERS
    from assoc.tracking.filter_choice import make_filter

    found = []
    scene = simulate("three-radar", 4, scans=6)
    for kind, filter_name in (("multi-sensor", "ekf"), ("nearest-neighbour", "ukf"), ("mht", "imm")):
        filter_ = make_filter(filter_name, scene.sensors, 20.0, 0)
        tracker = TRACKERS[kind](scene.sensors, filter_, region=scene.region, time_limit=None)
        stepped(tracker, scene)
        found.append([[one.track_id, one.mean.tolist(), one.covariance.tolist()] for one in tracker.tracks])
    return found


PARTS: dict[str, Callable[[], list[Any]]] = {
    "solutions": solutions,
    "rankings": rankings,
    "costs": costs,
    "tracks": tracks,
}


def answers(parts: list[str]) -> str:
    """Answers of some parts as JSON."""
    return json.dumps({name: PARTS[name]() for name in parts})


def leaves(value: Any) -> tuple[list[Any], list[float]]:
    """What must be the same (structure, whole numbers, names), and the floats."""
    if isinstance(value, float):
        return [], [value]
    if isinstance(value, (list, dict)):
        pairs = [leaves(one) for one in (value.values() if isinstance(value, dict) else value)]
        return [len(value), *(one for same, _ in pairs for one in same)], [one for _, own in pairs for one in own]
    return [value], []


def differences(one: str, other: str, rtol: float) -> list[str]:
    """Parts of two sets of answers that differ by more than rounding."""
    first, second = json.loads(one), json.loads(other)
    found = [] if first.keys() == second.keys() else ["other parts"]
    for name in first.keys() & second.keys():
        (same, floats), (same_too, floats_too) = leaves(first[name]), leaves(second[name])
        if same != same_too:
            found.append(f"{name}: other choices")
        elif not np.allclose(floats, floats_too, rtol=rtol, atol=rtol):
            worst = np.abs(np.subtract(floats, floats_too)).max()
            found.append(f"{name}: numbers differ by up to {worst:.3g}")
    return found


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--only", default=",".join(PARTS))
    print(answers(parser.parse_args().only.split(",")))
