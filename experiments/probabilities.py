"""Probabilities of tuples on ambiguous problems: against exact sums, and against long runs.

Two lists of points whose ten nearest of the other list are candidates (distances of a unit, cost 2 d^2 - 2, one point
per 0.01), gated scenes of three position sensors, wide gates (the same, 2.5 times as dense), ghosts of bearings. Small
ones are sampled and compared with exact sums; large ones as they are with runs ten times as long, in processor time
of one core. Errors of tuples of two measurements and more.
"""

from argparse import Namespace
from collections.abc import Callable

import numpy as np

import assoc
from assoc.problem import AssignmentProblem
from assoc.ranking.marginals import WIDEST, Marginals, weighed
from assoc.simulation import simulate
from experiments.common.claims import Claim, with_goal
from experiments.common.command import main
from experiments.common.instances import scenes
from experiments.common.measuring import one_core, timed

NAME = "probabilities"
_LONG, _SIGMAS = 10.0, 4.0


def two_lists(count: int, seed: int, near: int = 10) -> AssignmentProblem:
    """Two lists of random points, each point of the first with its nearest of the second."""
    rng = np.random.default_rng(seed)
    first, second = rng.random((2, count, 2)) * np.sqrt(count)
    distance = np.linalg.norm(first[:, None] - second, axis=2)
    nearest = np.argsort(distance, axis=1)[:, :near]
    tuples = np.stack([np.repeat(np.arange(count), near), nearest.reshape(-1)], axis=1) + 1
    costs = 2.0 * np.take_along_axis(distance, nearest, axis=1).reshape(-1) ** 2 - 2.0
    return AssignmentProblem(tuples, costs, (count, count))


def _crowd(targets: int, seed: int) -> AssignmentProblem:
    wide = 2_000.0 * np.sqrt(targets / 30.0)
    return assoc.build_problem(
        simulate("crowd", seed, targets=targets, scans=1, width=wide, height=0.5 * wide, noise=100.0), 0
    )


SMALL: dict[str, Callable[[int], AssignmentProblem]] = {
    "two lists of 14": lambda seed: two_lists(14, seed, 8),
    "gated 3 x 40": lambda seed: assoc.build_problem(scenes.gated(3, 40, seed), 0),
    "wide gates 3 x 8": lambda seed: _crowd(8, seed),
    "ghosts of 4": lambda seed: assoc.build_problem(scenes.ghost(4, seed), 0),
}
"""Kinds that can be summed."""
LARGE: dict[str, Callable[[int], AssignmentProblem]] = {
    "two lists of 200": lambda seed: two_lists(200, seed),
    "two lists of 1,000": lambda seed: two_lists(1_000, seed),
    "gated 3 x 300": lambda seed: assoc.build_problem(scenes.gated(3, 300, seed), 0),
    "wide gates 3 x 300": lambda seed: _crowd(300, seed),
    "ghosts of 20": lambda seed: assoc.build_problem(scenes.ghost(20, seed), 0),
}
"""Kinds that cannot."""


def apart(one: Marginals, other: Marginals) -> tuple[list[float], list[bool]]:
    """Differences of sampled tuples of several measurements, and which are within four told standard errors."""
    used = (np.count_nonzero(one.tuples, axis=1) > 1) & ~one.exact
    away = np.abs(one.probability - other.probability)[used]
    return away.tolist(), (away <= _SIGMAS * np.hypot(one.error, other.error)[used]).tolist()


def experiment(chosen: Namespace) -> list[Claim]:
    """Compare all kinds."""
    claims = []
    with one_core():
        assoc.marginals(two_lists(200, 0))
        for kind in chosen.names:
            away: list[float] = []
            held: list[bool] = []
            seconds = []
            make, few = {**SMALL, **LARGE}[kind], kind in SMALL
            for seed in range(1_000, 1_000 + (2 if chosen.quick else 5 if few else 1)):
                problem = make(seed)
                found, spent = timed(lambda problem=problem, few=few: weighed(problem, None, 0 if few else WIDEST))
                like = weighed(problem, length=1.0 if few else _LONG)
                assert not few or like.exact.all()
                off, within = apart(found, like)
                away, held = away + off, held + within
                seconds.append(spent)
            claims += [
                with_goal(f"{kind}: mean error", "", float(np.mean(away)), most=0.005),
                Claim(f"{kind}: largest error", "", None, float(np.max(away))),
                with_goal(f"{kind}: within four errors", "", float(np.mean(held)), least=0.99),
                with_goal(f"{kind}: seconds", "s", float(np.mean(seconds)), most=2.0),
            ]
    return claims


if __name__ == "__main__":
    raise SystemExit(main(NAME, experiment, __doc__, only={**SMALL, **LARGE}))
