"""What a certified optimum of ambiguous bearings is worth: equation 5, and positions integrated out.

Three bearing sensors see the targets of the scenario `bearing-only`, one scan a scene. Each scan is solved twice, to a
proven optimum where five seconds will do: with the costs of equation 5, and with a prior of the targets' density
(`target_density="auto"`). Counted are the targets found and the true tuples among them.
"""

from typing import Any, NamedTuple

import numpy as np

import assoc
from assoc.simulation import simulate
from experiments.common.claims import Claim
from experiments.common.command import main, mean_interval

COSTS = {"equation 5": None, "with a prior": "auto"}
TARGETS = (5, 20)
SECONDS = 5.0


class Answer(NamedTuple):
    """One scan solved once."""

    found: int
    """Tuples of two or more measurements that were chosen."""
    correct: int
    """Those of them that are true."""
    true: int
    """Targets that two sensors or more detected."""
    optimal: bool


def answer(targets: int, seed: int, target_density: str | None) -> Answer:
    """Associate one scan of a scene of its own."""
    scene = simulate("bearing-only", seed, targets=targets, scans=1)
    problem = assoc.build_problem(scene, 0, target_density=target_density)
    solution = assoc.assign(problem, time_limit=SECONDS)
    several = solution.tuples[np.count_nonzero(solution.tuples, axis=1) > 1]
    truth = {tuple(row) for row in scene.scan(0).true_tuples().tolist()}
    correct = len(truth & {tuple(row) for row in several.tolist()})
    return Answer(len(several), correct, len(truth), solution.status == "optimal")


def experiment(quick: bool, rng: np.random.Generator) -> list[Claim]:
    """Solve the scans of all scenes with both costs."""
    seeds = rng.integers(2**31, size=6 if quick else 40).tolist()
    claims = []
    for targets in TARGETS:
        answers = {name: [answer(targets, seed, density) for seed in seeds] for name, density in COSTS.items()}
        for name, ones in answers.items():
            found, correct, true = (np.array([scan[i] for scan in ones], dtype=float) for i in range(3))
            words = f"{targets} targets, {name}"
            claims += [
                Claim(f"{words}: targets found of each 100 there", "", None, *_ratio(found, true)),
                Claim(f"{words}: true tuples found", "%", None, *_ratio(correct, true)),
                Claim(f"{words}: chosen tuples that are true", "%", None, *_ratio(correct, found)),
                Claim(f"{words}: proven optima", "%", None, 100.0 * np.mean([scan.optimal for scan in ones])),
            ]
        more = [b.correct - a.correct for a, b in zip(*answers.values(), strict=True)]
        gain = mean_interval(np.array(more, dtype=float))
        words = f"{targets} targets: more true tuples a scan with the prior"
        claims.append(Claim(words, "", None, np.mean(more), gain))
    return claims


def _ratio(part: Any, whole: Any) -> tuple[float, tuple[float, float]]:
    """Percentage of a whole over all scenes, and its 95 % interval by the spread between scenes."""
    share = part.sum() / whole.sum()
    # of a ratio of sums: the spread of what each scene has above the common ratio
    off = (part - share * whole) / whole.mean()
    low, high = mean_interval(off)
    return 100.0 * share, (100.0 * (share + low), 100.0 * (share + high))


if __name__ == "__main__":
    raise SystemExit(main("ambiguous_bearings", experiment, __doc__))
