"""The ten best associations of scenes full of ghosts, and the probabilities of tuples, each proved.

``kbest`` ranks ten solutions of scenes of three bearing-only sensors (the seeds of the benchmarks), also of those whose
linear program is far below the optimum; ``marginals`` gives the probability of every tuple from as many. Rankings are
cut after the last rank that is proved: one of ten is proved. On scenes of 20 targets HiGHS (scipy) then looks for
something better with the ten forbidden: it must not find any. Processor time of one thread, pinned to a core, kernels
compiled, from the candidate tuples on: building them counts, too.
"""

from argparse import Namespace
from typing import NamedTuple

import numpy as np

import assoc
from assoc.costs import build_problem
from assoc.problem import AssignmentProblem
from assoc.solution import Solution
from experiments.benchmarks.families import WIDE_GAPS
from experiments.common.claims import Claim, with_goal
from experiments.common.command import main
from experiments.common.instances import FIRST_SEED, scenes
from experiments.common.measuring import one_core, timed
from experiments.common.peers import by_milp

NAME = "ghost_rankings"
K = 10
# what a ranking may take before it is cut, and what HiGHS may take, seconds
_LIMIT, _CHECK = 60.0, 30.0


class Kind(NamedTuple):
    """Scenes that are alike.

    goal: Seconds that a ranking may take.
    checked: Whether HiGHS looks for something better.
    """

    targets: int
    seeds: tuple[int, ...]
    goal: float
    checked: bool = False


_PLAIN = tuple(range(FIRST_SEED, FIRST_SEED + 10))
KINDS = {
    "20 targets": Kind(20, _PLAIN, 5.0, checked=True),
    "20 targets, linear program 1 % off": Kind(20, WIDE_GAPS[20], 5.0, checked=True),
    "40 targets": Kind(40, _PLAIN, 60.0),
    "40 targets, linear program 1 % off": Kind(40, WIDE_GAPS[40], 60.0),
}


def nothing_better(problem: AssignmentProblem, ranking: list[Solution], limit: float) -> bool:
    """Whether HiGHS ends, with these solutions forbidden.

    Raises AssertionError: It found something better than the last of them.
    """
    found = by_milp(problem, limit, [solution.indices for solution in ranking])
    if found.status not in (0, 2):
        return False
    last = ranking[-1].cost
    if found.status == 0 and found.fun < last - 1e-6 * max(1.0, abs(last)):
        raise AssertionError(f"kbest left out a solution of cost {found.fun!r}; the last one of {K} costs {last!r}")
    return True


def claims_of(name: str, kind: Kind, seeds: tuple[int, ...]) -> list[Claim]:
    """Rank scenes of one kind."""
    seconds, spent, unseen, proved, checked = [], [], [], 0, 0
    for seed in seeds:
        scene = scenes.ghost(kind.targets, seed)
        ranking, taken = timed(lambda scene=scene: assoc.kbest(build_problem(scene, 0), K, time_limit=_LIMIT))
        seconds.append(taken)
        proved += len(ranking) == K
        marginals, taken = timed(
            lambda scene=scene: assoc.marginals(build_problem(scene, 0), K, time_limit=_LIMIT, method="certified")
        )
        spent.append(taken)
        unseen.append(marginals.unseen)
        if kind.checked and len(ranking) == K:
            checked += nothing_better(build_problem(scene, 0), ranking, _CHECK)
    claims = [
        Claim(f"{name}: scenes", "", None, len(seeds)),
        with_goal(f"{name}: proved", "", proved, least=len(seeds)),
        Claim(f"{name}: kbest, median", "s", None, float(np.median(seconds))),
        with_goal(f"{name}: kbest, longest", "s", max(seconds), most=kind.goal),
        Claim(f"{name}: marginals, median", "s", None, float(np.median(spent))),
        Claim(f"{name}: marginals, longest", "s", None, max(spent)),
        Claim(f"{name}: widest interval, median", "", None, float(np.median(unseen))),
    ]
    if kind.checked:
        claims.append(Claim(f"{name}: HiGHS ended and found nothing better", "", None, checked))
    return claims


def experiment(chosen: Namespace) -> list[Claim]:
    """Rank scenes of these kinds."""
    claims = []
    with one_core():
        # a scene that is not measured
        scene = scenes.ghost(20, 0)
        assoc.kbest(build_problem(scene, 0), K)
        assoc.marginals(build_problem(scene, 0), K, method="certified")
        for name in chosen.names:
            claims += claims_of(name, KINDS[name], KINDS[name].seeds[: 2 if chosen.quick else None])
    return claims


if __name__ == "__main__":
    raise SystemExit(main(NAME, experiment, __doc__, only=KINDS))
