"""How wide the certified intervals of association probabilities are, and how good the estimates.

Widths and processor time of one thread of ``assoc.marginals``: two lists of points whose ten nearest of the other list
are candidates (distances of a unit, cost 2 d^2 - 2, one point per 0.01), position sensors and bearings of the
benchmarks. Estimates are compared with longer runs: sweeps with eight times as many states, or, where too many matter,
chains three times as long. Reliability: crowds with truth, tuples grouped by the probability they are given, and the
share of each group that is one target's detections and all of them.
"""

from argparse import Namespace
from collections.abc import Callable, Sequence

import numpy as np
from scipy.stats import beta

import assoc
from assoc._types import Array
from assoc.packing.run import Run
from assoc.problem import AssignmentProblem
from assoc.ranking.clusters import cluster_problems
from assoc.ranking.columns import price_all_columns
from assoc.ranking.estimates.sampler import estimates
from assoc.ranking.estimates.swept import swept
from assoc.ranking.marginals import Marginals
from assoc.simulation import simulate
from experiments.common.claims import Claim, with_goal
from experiments.common.command import main
from experiments.common.instances import scenes
from experiments.common.measuring import one_core, timed

NAME = "probabilities"
# of the chains compared with, times the moves; of the sweeps, times the states
_LONG, _STATES = 3.0, 8.0
# seconds on the clock, where others may use the machine, and the goal for those of a core
_CLOCK, _LIMIT = 40.0, 10.0
_SCENES = 80
_EDGES = np.linspace(0.0, 1.0, 11)


def two_lists(count: int, seed: int) -> AssignmentProblem:
    """Two lists of random points, each point of the first with its ten nearest of the second."""
    rng = np.random.default_rng(seed)
    first, second = rng.random((2, count, 2)) * np.sqrt(count)
    distance = np.linalg.norm(first[:, None] - second, axis=2)
    near = np.argsort(distance, axis=1)[:, :10]
    tuples = np.stack([np.repeat(np.arange(count), 10), near.reshape(-1)], axis=1) + 1
    costs = 2.0 * np.take_along_axis(distance, near, axis=1).reshape(-1) ** 2 - 2.0
    return AssignmentProblem(tuples, costs, (count, count))


def _scan(make: Callable[[int], assoc.Scene]) -> Callable[[int], AssignmentProblem]:
    return lambda seed: assoc.build_problem(make(seed), 0)


KINDS: dict[str, tuple[Callable[[int], AssignmentProblem], float, float]] = {
    "two lists of 200": (lambda seed: two_lists(200, seed), 0.01, 1.0),
    "two lists of 1,000": (lambda seed: two_lists(1_000, seed), 0.01, 1.0),
    "gated 3 x 300": (_scan(lambda seed: scenes.gated(3, 300, seed)), 0.01, 1.0),
    "gated 3 x 1,000": (_scan(lambda seed: scenes.gated(3, 1_000, seed)), 0.01, 1.0),
    "gated 4 x 200": (_scan(lambda seed: scenes.gated(4, 200, seed)), 0.2, _LIMIT),
    "crowd 3 x 100": (_scan(lambda seed: simulate("crowd", seed, targets=100, scans=1)), 0.2, _LIMIT),
    "crowd 3 x 300": (_scan(lambda seed: simulate("crowd", seed, targets=300, scans=1)), 0.2, _LIMIT),
    "ghosts of 20": (_scan(lambda seed: scenes.ghost(20, seed)), 0.05, _LIMIT),
    "ghosts of 40": (_scan(lambda seed: scenes.ghost(40, seed)), 0.2, _LIMIT),
}
"""What makes a problem from a seed, the mean width that is the goal, and the seconds."""


def widths(name: str, seeds: Sequence[int]) -> list[Claim]:
    """Certified intervals and estimates of one kind."""
    make, goal, limit = KINDS[name]
    mean, seconds, taken, apart, furthest = [], [], [], [], []
    for seed in seeds:
        found, spent = timed(lambda seed=seed: assoc.marginals(make(seed), method="certified", time_limit=_CLOCK))
        mean.append(float((found.upper - found.lower).mean()))
        seconds.append(spent)
        if name.startswith("two"):
            continue
        found, spent = timed(lambda seed=seed: assoc.marginals(make(seed), method="estimate"))
        taken.append(spent)
        if seed == seeds[0]:
            away = np.abs(found.probability - _long(make(seed), found))
            apart.append(float(away.mean()))
            furthest.append(float(away.max()))
    claims = [
        with_goal(f"{name}: mean width", "", float(np.mean(mean)), most=goal),
        with_goal(f"{name}: seconds", "s", float(np.mean(seconds)), most=limit),
    ]
    if taken:
        claims += [
            with_goal(f"{name}: estimate, seconds", "s", float(np.mean(taken)), most=2.0),
            with_goal(f"{name}: estimate, mean off longer runs", "", apart[0], most=0.02),
            Claim(f"{name}: estimate, furthest off longer runs", "", None, furthest[0]),
        ]
    return claims


def _long(problem: AssignmentProblem, like: Marginals) -> Array:
    """Probabilities of the same tuples from sweeps with more states, or longer chains from two solutions."""
    of: dict[tuple[int, ...], float] = {}
    for cluster, which in cluster_problems(problem):
        columns = price_all_columns(cluster, Run(0))
        share = swept(columns, np.inf, _STATES)
        if share is None:
            number = {tuple(cluster.tuples[i].tolist()): j for j, i in enumerate(columns.origin.tolist())}
            answers = [assoc.assign(cluster, solver).tuples.tolist() for solver in ("exact", "greedy")]
            starts = [np.array([number[key] for key in map(tuple, answer) if key in number]) for answer in answers]
            share = estimates(columns, starts, Run(0), length=_LONG)
            share = share.mean(axis=0, keepdims=True)
        of.update(zip(map(tuple, problem.tuples[which[columns.origin]].tolist()), share[0].tolist(), strict=True))
    # false alarms are as good as the tuples they exclude
    keys = list(map(tuple, like.tuples.tolist()))
    return np.array([of.get(key, p) for key, p in zip(keys, like.probability, strict=True)])


def reliability(count: int) -> list[Claim]:
    """Share of tuples that are true among those of about one probability: crowds with truth."""
    said, right = [], []
    for seed in range(count):
        scene = simulate("crowd", seed, targets=12, scans=1, width=2_000.0, height=1_000.0, noise=100.0)
        found = assoc.marginals(assoc.build_problem(scene, 0), method="estimate")
        sources = scene.truth.sources[0]
        true: dict[int, list[int]] = {}
        for s, of in enumerate(sources):
            for i, target in enumerate(of.tolist()):
                if target >= 0:
                    true.setdefault(target, [0] * len(sources))[s] = i + 1
        keys = set(map(tuple, true.values()))
        several = np.count_nonzero(found.tuples, axis=1) > 1
        said.append(found.probability[several])
        right.append(np.array([key in keys for key in map(tuple, found.tuples[several].tolist())]))
    p, hit = np.concatenate(said), np.concatenate(right)
    claims = []
    for low, high in zip(_EDGES[:-1], _EDGES[1:], strict=True):
        own = (p > low if low else p > 0.01) & (p <= high)
        n, good = int(own.sum()), int(hit[own].sum())
        if not n:
            continue
        ends = (float(beta.ppf(0.025, good, n - good + 1)) if good else 0.0,
                float(beta.ppf(0.975, good + 1, n - good)) if good < n else 1.0)  # fmt: skip
        name, mean = f"reliability, {low:.1f} to {high:.1f}", float(p[own].mean())
        claims.append(Claim(f"{name}: said", "", None, mean))
        claims.append(Claim(f"{name}: true", "", None, good / n, ends, holds=ends[0] <= mean <= ends[1]))
    return claims


def experiment(chosen: Namespace) -> list[Claim]:
    """Measure these kinds, and reliability."""
    claims = []
    with one_core():
        # kernels are compiled before anything is timed
        for name in ("two lists of 200", "ghosts of 20"):
            assoc.marginals(KINDS[name][0](0))
        for name in chosen.names:
            claims += widths(name, range(1_000, 1_001 if chosen.quick else 1_002))
        return claims + reliability(_SCENES // 10 if chosen.quick else _SCENES)


if __name__ == "__main__":
    raise SystemExit(main(NAME, experiment, __doc__, only=KINDS))
