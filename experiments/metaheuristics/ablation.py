"""What each part of `aco`, `genetic` and `tabu` contributes.

Each solver runs with one part taken out (parts.py) on the same problems as the whole, with the same seeds and the
same processor time. A figure is the mean over the problems of the cost with the part out, less the cost of the whole,
in percent of it: above 0, the part helps. Parts that one solver alone has are also taken out of it without refinement
("alone"), where they can be seen. Intervals are 95 %, from resampling problems. The first row gives how far the whole
is above the best cost that any of these runs found.

--publish with --only replaces the rows that were measured, so that the whole table can be measured in several runs.
"""

import argparse
from collections.abc import Sequence
from functools import partial

import numpy as np

import assoc
from assoc._types import Floats
from assoc.sweeps.summary import mean_interval
from experiments.common.claims import Claim
from experiments.common.command import above_zero, main, whole
from experiments.metaheuristics import parts
from experiments.metaheuristics.problems import PROBLEMS, problem
from experiments.metaheuristics.running import log, run

# percent by which two sums of the same costs may differ
_SAME = 1e-9


def measured(name: str, count: int, seconds: float, solvers: Sequence[str]) -> dict[tuple[str, str], Floats]:
    """Costs by solver and part, one for each problem."""
    costs: dict[tuple[str, str], list[float]] = {}
    # what all parts call is compiled on a problem that is not measured
    for number, limit in ((count, 0.3), *((number, seconds) for number in range(count))):
        made = problem(name, number)
        for part in parts.PARTS:
            for solver in (solver for solver in part.solvers if solver in solvers):
                with part.without():
                    cost = run(made, solver, limit, number, **part.parameters)
                if number < count:
                    costs.setdefault((solver, part.words), []).append(cost)
                    log(f"{name}, {number + 1} of {count}: {solver} {part.words}: {cost:.8g}")
    return {key: np.array(found) for key, found in costs.items()}


def claims_of(name: str, seconds: float, costs: dict[tuple[str, str], Floats]) -> list[Claim]:
    """The claims of one problem's costs."""
    group = f"{name}, {seconds:g} s"
    best = np.min(list(costs.values()), axis=0)
    bases = {part.words: part.base for part in parts.PARTS}
    found = [Claim(f"{group}: problems", "", None, len(best))]
    for (solver, words), values in costs.items():
        whole = words == parts.WHOLE
        base = best if whole else costs[solver, bases[words]]
        excess = 100.0 * (values - base) / np.abs(base)
        # the same cover, summed in another order
        excess[np.abs(excess) < _SAME] = 0.0
        interval = mean_interval(excess[:, None])
        what = "the best found" if whole else bases[words]
        found.append(Claim(f"{group}: {solver}, {words}, above {what}", "%", None, float(excess.mean()), interval))
    return found


def experiment(chosen: argparse.Namespace) -> list[Claim]:
    """Measure all parts on these problems."""
    count, seconds = (2, 0.2) if chosen.quick else (chosen.count, chosen.seconds)
    assoc.warm_up({*chosen.solvers})
    found = ((name, measured(name, count, seconds, chosen.solvers)) for name in chosen.names)
    return [claim for name, costs in found for claim in claims_of(name, seconds, costs)]


def _add_options(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("--seconds", type=above_zero, default=2.0, metavar="S", help="of each run (default 2)")
    add("--count", type=whole(2), default=10, metavar="N", help="problems of each name (default 10)")
    add("--solvers", nargs="+", choices=parts.SOLVERS, default=[*parts.SOLVERS], metavar="NAME", help="only these")


program = partial(main, "metaheuristics.ablation", experiment, __doc__, only=PROBLEMS, options=[_add_options])


if __name__ == "__main__":
    raise SystemExit(program())
