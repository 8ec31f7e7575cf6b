"""The linear programs of ghost scenes and of axial problems: our dual simplex method beside HiGHS.

Each program is that of the largest component of a problem (seeds of the benchmarks). Ours is solved from the
multipliers of the dual ascent, whose time counts, too. Then one column after the other of those that the solution takes
a part of is masked, and both are solved again: ours goes on from its last basis, HiGHS (dual simplex, through scipy,
which keeps nothing) begins anew. All bounds must agree to 1e-9 of the optimum. Processor time of one thread, pinned
to a core, kernels compiled; ratios are of the same programs.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.optimize import linprog
from scipy.sparse import csc_array

from assoc.costs import build_problem
from assoc.packing.bounds.dual_ascent import dual_bound
from assoc.packing.packing import Packing
from assoc.packing.prepare import prepare
from assoc.packing.simplex.linear_program import LinearProgram
from assoc.problem import AssignmentProblem
from experiments.common.claims import Claim
from experiments.common.command import main
from experiments.common.instances import FIRST_SEED, scenes, synthetic
from experiments.common.measuring import one_core, timed

KINDS: dict[str, Callable[[int], AssignmentProblem]] = {
    **{
        f"ghosts {targets}": lambda seed, targets=targets: build_problem(scenes.ghost(targets, seed), 0)
        for targets in (20, 40, 60, 100)
    },
    "axial, random costs, n = 20": lambda seed: synthetic.axial_random(20, seed),
}
SEEDS, MASKED = 5, 5
COLUMNS = ("rows", "columns", "ours", "HiGHS / ours", "ours, a column masked", "HiGHS / ours, a column masked")
"""What is said of each kind: medians; times in ms."""


def component_of(problem: AssignmentProblem) -> Packing:
    """The component of a problem with the most columns."""
    whole = prepare(problem).packing
    return whole.component(int(np.argmax(np.diff(whole.col_start))))


def highs(packing: Packing, columns: np.ndarray[Any, np.dtype[np.bool_]]) -> float:
    """The least weight that HiGHS finds for the linear program with these columns."""
    column, place = np.nonzero(packing.cols >= 0)
    entries = (np.ones(column.size), (packing.cols[column, place], column))
    matrix = csc_array(entries, shape=(packing.num_rows, packing.num_columns))
    must = ~packing.slack
    answer = linprog(
        packing.weights,
        A_ub=matrix[packing.slack] if packing.slack.any() else None,
        b_ub=np.ones(np.count_nonzero(packing.slack)) if packing.slack.any() else None,
        A_eq=matrix[must] if must.any() else None,
        b_eq=np.ones(np.count_nonzero(must)) if must.any() else None,
        # a row bounds a column already where it has one
        bounds=np.column_stack([np.zeros(columns.size), np.where(columns, np.inf, 0.0)]),
        method="highs-ds",
    )
    if answer.status != 0:
        raise AssertionError(f"HiGHS: {answer.message}")
    return float(answer.fun)


def measured(packing: Packing, peer: Callable[[Packing, Any], float] = highs) -> dict[str, float]:
    """Milliseconds and ratios of one program, the same bounds asserted."""
    everything = np.ones(packing.num_columns, dtype=np.bool_)
    program, relaxed = LinearProgram(packing), None

    def ours() -> Any:
        return program.solve(duals=dual_bound(packing))

    relaxed, own = timed(ours)
    least, theirs = timed(lambda: peer(packing, everything))
    check(relaxed.bound, least)
    program.mark()
    used = np.flatnonzero((relaxed.primal > 1e-6) & (relaxed.primal < 1.0 - 1e-6))[:MASKED]
    again, anew = [], []
    # where the solution is whole there is no column in doubt: any that it takes will do
    for j in used if used.size else np.flatnonzero(relaxed.primal > 0.5)[:MASKED]:
        columns = everything.copy()
        columns[j] = False
        program.back()
        warm, spent = timed(lambda columns=columns: program.solve(columns=columns))
        cold, others = timed(lambda columns=columns: peer(packing, columns))
        check(warm.bound, cold)
        again.append(spent)
        anew.append(others / spent)
    values = (
        packing.num_rows, packing.num_columns, 1e3 * own, theirs / own, 1e3 * np.median(again), np.median(anew),
    )  # fmt: skip
    return dict(zip(COLUMNS, map(float, values), strict=True))


def check(ours: float, theirs: float) -> None:
    """Refuse bounds that differ.

    Raises AssertionError: By more than 1e-9 of the optimum.
    """
    if abs(ours - theirs) > 1e-9 * max(1.0, abs(theirs)):
        raise AssertionError(f"the bounds differ: {ours!r}, HiGHS {theirs!r}")


def experiment(quick: bool, rng: np.random.Generator) -> list[Claim]:
    """Solve the programs of every kind."""
    claims: list[Claim] = []
    with one_core():
        for name, make in KINDS.items():
            # compiled, and scipy imported, on a problem that is not measured
            measured(component_of(make(0)))
            found = [measured(component_of(make(FIRST_SEED + number))) for number in range(2 if quick else SEEDS)]
            medians = {what: float(np.median([run[what] for run in found])) for what in COLUMNS}
            claims += [Claim(f"{name}: {what}", "", None, value) for what, value in medians.items()]
    return claims


if __name__ == "__main__":
    raise SystemExit(main("linear_programs", experiment, __doc__))
