"""Time limits: every way to an answer, and how late it comes back.

Lateness is counted from when the time was over, without what the thread waited for a processor since then (Linux tells:
/proc/self/task/*/schedstat), so that a busy machine does no harm.
"""

import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from assoc.problem import AssignmentProblem
from assoc.ranking.kbest import kbest
from assoc.ranking.marginals import marginals
from assoc.solvers.assign import assign

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
