"""What each part of `aco`, `genetic` and `tabu` contributes, and what a second core does.

Each solver runs with one part taken out (parts.py) on the same problems as the whole, with the same seeds and the
same processor time (with two workers: of each core). A figure is the mean over the problems of the cost with the part
out, less the cost of the whole, in percent of it: above 0, the part helps. Parts that one solver alone has are also
taken out of it without refinement ("alone"), where they can be seen. Intervals are 95 %, from resampling problems.
The first row gives how far the whole is above the best cost that any of these runs found. With --workers the whole on
one core is compared with two workers on two.

--publish replaces the rows of the problems, of the budget and of the solvers that were measured, with --parts those of
these parts alone, so that the whole table can be measured in several runs.
"""

import argparse
from collections.abc import Sequence
from functools import partial

import numpy as np

import assoc
from assoc._types import Floats
from assoc.sweeps.bootstrap import mean_interval
from experiments.common.claims import Claim
from experiments.common.command import above_zero, add_files, report, whole, without_subjects
from experiments.metaheuristics import parts
from experiments.metaheuristics.problems import PROBLEMS, problem
from experiments.metaheuristics.running import log, run

NAME = "metaheuristics.ablation"
WORKERS = ", workers"
"""How the name of a group of claims ends that is about workers."""
_BASES = (parts.WHOLE, parts.ALONE)
# percent by which two sums of the same costs may differ
_SAME = 1e-9


def measured(name: str, count: int, seconds: float, chosen: Sequence[parts.Part]) -> dict[tuple[str, str], Floats]:
    """Costs by solver and part, one for each problem; after Ctrl-C of the problems that were done."""
    costs: list[dict[tuple[str, str], float]] = []
    try:
        for number in range(count):
            made = problem(name, number)
            found = {}
            for part in chosen:
                for solver in part.solvers:
                    with part.without():
                        found[solver, part.words] = run(made, solver, seconds, number, **part.parameters)
            costs.append(found)
            log(f"{name}, {number + 1} of {count}:")
            log("\n".join(f"    {solver} {words}: {cost:.8g}" for (solver, words), cost in found.items()))
    except KeyboardInterrupt:
        if len(costs) < 2:
            raise
    return {key: np.array([found[key] for found in costs]) for key in costs[0]}


def _warm_up(name: str, number: int, chosen: Sequence[parts.Part]) -> None:
    """Compile what all parts call, on a problem that is not measured."""
    assoc.warm_up({solver for part in chosen for solver in part.solvers})
    made = problem(name, number)
    for part in chosen:
        for solver in part.solvers:
            with part.without():
                run(made, solver, 0.3, 0, **part.parameters)


def claims_of(name: str, seconds: float, costs: dict[tuple[str, str], Floats]) -> list[Claim]:
    """The claims of one problem's costs."""
    group = prefix(name, seconds)
    if any(words == parts.TWO_WORKERS.words for _, words in costs):
        # measured apart from the parts, and published apart
        group += WORKERS
    best = np.min(list(costs.values()), axis=0)
    bases = {part.words: part.base for part in (*parts.PARTS, parts.TWO_WORKERS)}
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


def prefix(name: str, seconds: float) -> str:
    """How the quantities of one problem and budget begin."""
    return f"{name}, {seconds:g} s"


def subject(claim: Claim) -> str:
    """Problem, budget and solver of a claim."""
    group, what = claim.quantity.split(": ", 1)
    return f"{group}: {what.split(',')[0]}"


def program(arguments: Sequence[str] | None = None) -> int:
    """Run the experiment; returns its exit code."""
    parser = argparse.ArgumentParser(prog=f"python -m experiments.{NAME}", description=(__doc__ or "").split("\n")[0])
    add = parser.add_argument
    text = ", ".join(PROBLEMS)
    add("--problems", nargs="+", choices=PROBLEMS, default=["ghosts 40"], metavar="NAME", help=text)
    add("--seconds", type=above_zero, default=2.0, metavar="S", help="of each run (default 2)")
    add("--count", type=whole(2), default=10, metavar="N", help="problems of each name (default 10)")
    add("--solvers", nargs="+", choices=parts.SOLVERS, default=[*parts.SOLVERS], metavar="NAME", help="only these")
    what = parser.add_mutually_exclusive_group()
    words = [part.words for part in parts.PARTS if part.words not in _BASES]
    what.add_argument("--parts", nargs="+", choices=words, metavar="WORDS", help="only these, as the table names them")
    what.add_argument("--workers", action="store_true", help="no parts: one worker against two, on two cores")
    add_files(parser, NAME)
    chosen = parser.parse_args(arguments)
    taken = (parts.PARTS[0], parts.TWO_WORKERS) if chosen.workers else parts.PARTS
    if chosen.parts:
        named = [part for part in taken if part.words in chosen.parts]
        bases = {part.base for part in named} | {parts.WHOLE}
        solvers = {solver for part in named for solver in part.solvers}
        chosen.solvers = [solver for solver in chosen.solvers if solver in solvers]
        if not chosen.solvers:
            parser.error(f"--solvers: none of them has a part of --parts; these have: {', '.join(sorted(solvers))}")
        taken = (*(part for part in taken if part.words in bases), *named)
    taken = tuple(part._replace(solvers=tuple(s for s in part.solvers if s in chosen.solvers)) for part in taken)
    claims: list[Claim] = []
    for name in chosen.problems:
        _warm_up(name, chosen.count, taken)
        costs = measured(name, chosen.count, chosen.seconds, taken)
        found = claims_of(name, chosen.seconds, costs)
        if chosen.parts:
            # how good the whole and the bare metaheuristic are is told by a run of all parts
            found = [claim for claim in found if any(f", {words}, above " in claim.quantity for words in chosen.parts)]
        claims += found
    of = (lambda claim: claim.quantity) if chosen.parts else subject
    report(chosen, claims, NAME, __doc__, kept=partial(without_subjects, of))
    return 0


if __name__ == "__main__":
    raise SystemExit(program())
