"""Who takes part in a comparison: our solvers, and the peers that are installed, on one core each.

A contestant is given a problem, seconds, and a `Log`, to which it tells what it has found and when; it returns the
tuples that it has chosen, and whether it says that they are optimal. Peers that tell of nothing before their end are
started anew, with 1, 5 and all seconds. Most can be limited by the wall's clock alone: on a machine that others use,
too, they are given as much more of that as they got less of the processor shortly before.
"""

import importlib
import math
import resource
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import NDArray

from assoc.problem import AssignmentProblem
from assoc.solution import TracePoint
from assoc.solvers.assign import assign
from experiments.common import peers

CHECKPOINTS = (1.0, 5.0)
"""Seconds before the last at which quality is looked at."""
_WITHOUT_END = ("aco", "genetic", "tabu")
_PROVING = ("exact", "milp", "lagrangian")
_UNLIMITED = 1_000_000_000
# wall time at the most, as a multiple of CPU time, and CPU seconds that the first guess takes
_SLACK, _PROBE = 3.0, 0.05
# who does not keep a limit is stopped at this many times as much CPU time, and seconds more
_LATE, _START = 1.2, 3.0
# a share of its limit within which a peer has ended by itself
_EARLY = 0.7
# a cost this near to the best one that is known, relatively, is the best one
_SAME = 1e-9


@dataclass
class Log:
    """What was found, and when, in seconds of the process's CPU time.

    best: The best cost that is known: a solver that gives no bound has nothing left to find there.
    tell: Called with each point: seconds, cost, and bound or None.
    keep: Called with tuples that are an answer, should no better one follow.
    """

    best: float
    tell: Callable[[list[float | None]], None]
    keep: Callable[[NDArray[np.int32]], None]
    started: float = field(default_factory=time.process_time)

    def allow(self, seconds: float) -> None:
        """Have the system stop this process after so much more CPU time, and some: not all keep their limits."""
        most = math.ceil(time.process_time() + _LATE * seconds + _START)
        resource.setrlimit(resource.RLIMIT_CPU, (most, resource.getrlimit(resource.RLIMIT_CPU)[1]))

    def wall(self, seconds: float) -> float:
        """Wall time in which this process will have had about so much CPU time, going by the last moments."""
        wall, cpu = time.perf_counter(), time.process_time()
        while time.process_time() - cpu < _PROBE:
            pass
        share = (time.process_time() - cpu) / (time.perf_counter() - wall)
        return seconds / min(max(share, 1.0 / _SLACK), 1.0)

    def elapsed(self) -> float:
        """CPU seconds of this process since the start."""
        return time.process_time() - self.started

    def point(self, cost: float, bound: float | None, seconds: float | None = None) -> None:
        """Tell a cost and a bound."""
        known = bound is not None and math.isfinite(bound)
        self.tell([round(self.elapsed() if seconds is None else seconds, 4), cost, bound if known else None])

    def is_best(self, cost: float) -> bool:
        """Whether a cost is the best one that is known, or better."""
        return cost <= self.best + _SAME * max(1.0, abs(self.best))


Answer = tuple[NDArray[np.int32], bool]
Contestant = Callable[[AssignmentProblem, float, Log], Answer]


def _ours(name: str, problem: AssignmentProblem, seconds: float, log: Log) -> Answer:
    last: list[float] = []

    def heard(point: TracePoint) -> bool:
        now = [point.cost, point.lower_bound]
        if now != last:
            last[:] = now
            log.point(*now)
        return log.elapsed() >= seconds or (name not in _PROVING and log.is_best(point.cost))

    options = {"patience": _UNLIMITED, "iterations": _UNLIMITED} if name in _WITHOUT_END else {}
    solution = assign(problem, name, time_limit=_SLACK * seconds, callback=heard, advise=False, **options)
    log.point(solution.cost, solution.lower_bound)
    return solution.tuples, solution.status == "optimal"


def _peer(name: str, problem: AssignmentProblem, seconds: float, log: Log, *, limited: bool = True) -> Answer:
    """A peer that tells of nothing before its end."""
    best, tuples, proven = math.inf, problem.tuples[:0], False
    for limit in (*(one for one in CHECKPOINTS if limited and one < seconds), seconds):
        log.allow(limit)
        most = log.wall(limit) if limited else limit
        answer = peers.PEERS[name](problem, most)
        log.point(answer.cost, answer.bound, min(answer.cpu, limit) if limited else answer.cpu)
        proven = answer.proven
        if answer.cost < best:
            best, tuples = answer.cost, answer.tuples
            log.keep(tuples)
        if proven or answer.seconds < _EARLY * most or (answer.bound is None and log.is_best(best)):
            break
    return tuples, proven


def _cp_sat(problem: AssignmentProblem, seconds: float, log: Log) -> Answer:
    def told(cost: float, bound: float) -> bool:
        log.point(cost, bound)
        return log.elapsed() >= seconds

    answer = peers.cp_sat_1(problem, log.wall(seconds), told)
    log.point(answer.cost, answer.bound, answer.cpu)
    return answer.tuples, answer.proven


OURS: dict[str, Contestant] = {
    name: partial(_ours, name) for name in ("exact", "milp", "lagrangian", "aco", "genetic", "tabu", "greedy")
}
PEERS: dict[str, Contestant] = {
    "cp_sat": _cp_sat,
    "scip": partial(_peer, "scip_1"),
    **{name: partial(_peer, name) for name in ("highs", "chils", "branch_reduce", "mmwis")},
    **{name: partial(_peer, name, limited=False) for name in ("kap", "nrl_tracker", "stone_soup", "sequential")},
}
_PEER_NAMES = {"cp_sat": "cp_sat_1", "scip": "scip_1"}
CONTESTANTS = OURS | PEERS
"""By name. "sequential" is scipy's 2-D assignment, sensor by sensor, as most trackers do it."""


def takes(name: str, problem: AssignmentProblem) -> bool:
    """Whether a contestant is installed and can take a problem."""
    return name in OURS or peers.available(_PEER_NAMES.get(name, name), problem)


def warm_up(name: str) -> None:
    """Import a peer's package, by solving a tiny problem where it can; our solvers are warm already."""
    if name in peers.PACKING_PEERS:
        # on one tuple KaMIS's programs end the process
        importlib.import_module("kap" if name == "kap" else "chszlablib")
    elif name in PEERS:
        peers.warm_up([_PEER_NAMES.get(name, name)])


def is_installed(name: str) -> bool:
    """Whether a contestant's package is there."""
    return takes(name, AssignmentProblem([[1, 1]], [-1.0], [1, 1]))
