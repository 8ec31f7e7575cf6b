"""Time limits on problems of a million tuples: how late does every solver, ranking and marginals come back?

    python -m tests.reliability.limits [--limit 2] [--ways exact,kbest] [--problems "ghosts 1e6"] [--thread]

What a limit promises is 10 % and 50 ms. Lateness is counted from when the time was over, without what the thread
waited for a processor since then (Linux tells: /proc/self/task/*/schedstat), so that a busy machine does no harm.
"""

import argparse
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from assoc.problem import AssignmentProblem
from assoc.ranking.kbest import kbest
from assoc.ranking.marginals import marginals
from assoc.solvers.assign import assign
from tests.oracles import gated_problem
from tests.reliability.big import BIG, axial, ghosts

Way = Callable[[AssignmentProblem, float], Any]

ENDLESS = {"iterations": 10**9, "patience": 10**9}
WAYS: dict[str, Way] = {
    "greedy": lambda problem, limit: assign(problem, "greedy", time_limit=limit),
    "exact": lambda problem, limit: assign(problem, "exact", time_limit=limit),
    "aco": lambda problem, limit: assign(problem, "aco", time_limit=limit, **ENDLESS),
    "aco paper": lambda problem, limit: assign(problem, "aco", time_limit=limit, mode="paper", iterations=10**9),
    "genetic": lambda problem, limit: assign(problem, "genetic", time_limit=limit, **ENDLESS),
    "tabu": lambda problem, limit: assign(problem, "tabu", time_limit=limit, **ENDLESS),
    "lagrangian": lambda problem, limit: assign(problem, "lagrangian", time_limit=limit),
    "milp scip": lambda problem, limit: assign(problem, "milp", time_limit=limit),
    "milp highs": lambda problem, limit: assign(problem, "milp", backend="highs", time_limit=limit),
    "kbest": lambda problem, limit: kbest(problem, 10, time_limit=limit),
    "marginals": lambda problem, limit: marginals(problem, time_limit=limit),
}


def _waited(thread: int) -> float:
    """Seconds that a thread has waited for a processor."""
    return int(Path(f"/proc/self/task/{thread}/schedstat").read_text().split()[1]) / 1e9


def lateness(work: Callable[[], Any], limit: float) -> tuple[Any, float]:
    """Run some work; its result, and how many seconds after ``limit`` it ended (negative: before)."""
    thread = threading.get_native_id()
    noted: list[tuple[float, float]] = []

    def note() -> None:
        noted.append((time.monotonic(), _waited(thread)))

    timer = threading.Timer(limit, note)
    started = time.monotonic()
    timer.start()
    result = work()
    ended, waited = time.monotonic(), _waited(thread)
    timer.cancel()
    timer.join()
    if not noted or noted[0][0] > ended:
        return result, ended - started - limit
    over, before = noted[0]
    # what the note itself was late counts as the work's
    return result, (over - started - limit) + (ended - over) - (waited - before)


def main(arguments: list[str] | None = None) -> int:
    """Run the program; exit code 1 if something is too late."""
    parser = argparse.ArgumentParser(description="Time limits on a million tuples.")
    parser.add_argument("--limit", type=float, default=2.0)
    parser.add_argument("--ways", default=",".join(WAYS))
    parser.add_argument("--problems", default=",".join(BIG))
    parser.add_argument("--thread", action="store_true", help="not in the main thread")
    chosen = parser.parse_args(arguments)
    import numpy as np

    names = chosen.ways.split(",")
    for name in names:
        # compile
        for small in (gated_problem(np.random.default_rng(0), (6, 6, 6), 0.3), axial(40), ghosts(40, 20_000)):
            WAYS[name](small, 1.0)
    allowed, worst = 0.1 * chosen.limit + 0.05, 0.0
    for title in chosen.problems.split(","):
        problem = BIG[title]()
        for name in names:
            fresh = AssignmentProblem(problem.tuples, problem.costs, problem.sizes, dummy=problem.dummy)

            def work(way: Way = WAYS[name], given: AssignmentProblem = fresh) -> Any:
                return way(given, chosen.limit)

            if chosen.thread:
                with ThreadPoolExecutor(1) as pool:
                    found, late = pool.submit(lateness, work, chosen.limit).result()
            else:
                found, late = lateness(work, chosen.limit)
            worst = max(worst, late)
            mark = "  TOO LATE" if late > allowed else ""
            answer = found[0] if isinstance(found, list) else found
            said = getattr(answer, "stopped_by", "")
            print(f"{title:14} {name:12} {late:+7.3f} s after {chosen.limit:g} s  {said}{mark}", flush=True)
    print(f"allowed {allowed:.3f} s, worst {worst:.3f} s")
    return 1 if worst > allowed else 0


if __name__ == "__main__":
    sys.exit(main())
