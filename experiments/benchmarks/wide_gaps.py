"""Which seeds of ghosts have a linear program far below the optimum: there branch and bound has the most to do.

``python -m experiments.benchmarks.wide_gaps TARGETS`` prints them as it finds them.
"""

import argparse
import sys
from collections.abc import Iterator

from assoc.problem import AssignmentProblem
from experiments.common.command import whole

FIRST, LEAST = 2000, 0.007
"""First seed, and the least gap of the linear program as a share of the optimum."""


def linear_bound(problem: AssignmentProblem) -> float:
    """Return the bound of a problem's linear program."""
    from assoc.packing.bounds.dual_ascent import dual_bound
    from assoc.packing.prepare import prepare
    from assoc.packing.simplex.linear_program import LinearProgram

    prepared = prepare(problem)
    relaxed = LinearProgram(prepared.packing).solve(duals=dual_bound(prepared.packing))
    return relaxed.bound + prepared.offset


def wide_gaps(targets: int, count: int) -> Iterator[tuple[int, float]]:
    """Yield the first seeds from `FIRST` on with a gap of `LEAST` or more, and the gap.

    The optimum is that of tabu search in 5 s, or better: a seed that this calls wide may have a smaller gap.
    """
    import assoc
    from assoc.costs import build_problem
    from experiments.common.instances import scenes

    seed = FIRST
    while count:
        problem = build_problem(scenes.ghost(targets, seed), 0)
        bound = linear_bound(problem)
        start = None
        # from cheap to dear: most scenes are ruled out at once
        for limit in (0.3, 1.0, 5.0):
            start = assoc.assign(problem, "tabu", time_limit=limit, start=start)
            gap = (start.cost - bound) / abs(start.cost)
            if gap < LEAST:
                break
        else:
            yield seed, gap
            count -= 1
        seed += 1


def main(argv: list[str] | None = None) -> int:
    """Print the seeds; returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m experiments.benchmarks.wide_gaps",
        description="Find seeds of ghosts whose linear program is far below the optimum.",
    )
    parser.add_argument("targets", type=whole(1), metavar="TARGETS", help="number of targets")
    parser.add_argument("--count", type=whole(1), default=5, metavar="N", help="how many seeds (default 5)")
    chosen = parser.parse_args(argv)
    for seed, gap in wide_gaps(chosen.targets, chosen.count):
        print(f"{seed} {100 * gap:.3f} %", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
