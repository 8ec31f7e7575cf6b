"""What each solver has after so many seconds on large open components, and the area under the curve.

Problems of which one component has nearly all tuples: cameras in front of a volume (experiments.common.instances.large
says how), crowds under wide gates, frames of random walks, records in overlapping blocks. Each solver is called once
with each limit, as a user calls it. "behind": how much its answer costs more than the best that any solver has found in
any of these limits, in percent; "area": the mean of it over the logarithm of the time, from the first limit to the
last. The time limit and all figures are processor time of one core, so that other work on the machine does not count;
kernels are compiled. Peers (CP-SAT on one core, HiGHS) keep time by the system's clock: theirs hold on an idle machine.
"""

import argparse
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial

import numpy as np

from assoc.packing.run import Run
from assoc.problem import AssignmentProblem
from experiments.common import contestants
from experiments.common.claims import Claim
from experiments.common.command import main
from experiments.common.instances.large import cameras, frames, records
from experiments.common.instances.synthetic import wide_gates
from experiments.common.measuring import one_core

LIMITS = (1.0, 5.0, 20.0, 60.0)
SOLVERS = ("exact", "aco", "genetic", "tabu", "lagrangian")
PEERS = ("cp_sat_1", "highs")
SEED = 8101
"""No problem of this seed was looked at before it was measured."""
FAMILIES: dict[str, Callable[[int], AssignmentProblem]] = {
    "four cameras, 1,500 particles, 1 point": partial(cameras, 1500, 4, 1.0),
    "three cameras, 2,000 particles, 1.5 points": partial(cameras, 2000, 3, 1.5),
    "crowd, three lists of 2,000": partial(wide_gates, 2000),
    "ten frames of 100 points": partial(frames, 100, 10),
    "four sources of 1,500 records": partial(records, 1500, 4),
}
_BEHIND = 0.01
"""Percent that `exact` may be behind."""


@contextmanager
def _by_processor_time() -> Iterator[None]:
    """Let time limits of solvers be processor time of this process."""
    began: dict[float, tuple[float, float]] = {}
    kept = Run.runtime, Run.deadline

    def runtime(run: Run) -> float:
        # parts of a run have its start
        processor, _ = began.setdefault(run.started, (time.process_time(), time.perf_counter()))
        return time.process_time() - processor

    def deadline(run: Run, share: float = 1.0) -> float:
        spent = runtime(run)
        wall = time.perf_counter() - began[run.started][1]
        # kernels go by the system's clock
        return time.monotonic() + share * run.remaining() * max(1.0, (wall + 0.1) / (spent + 0.1))

    Run.runtime, Run.deadline = runtime, deadline  # type: ignore[method-assign]
    try:
        yield
    finally:
        Run.runtime, Run.deadline = kept  # type: ignore[method-assign]


def curves(
    make: Callable[[int], AssignmentProblem], seed: int, limits: list[float], names: list[str]
) -> dict[str, list[tuple[float, float]]]:
    """Cost and gap of each solver at each limit."""
    problem = make(seed)
    found: dict[str, list[tuple[float, float]]] = {}
    for name in names:
        for limit in limits:
            with _by_processor_time():
                answer = contestants.run(name, problem, limit)
            known = answer.bound is not None and answer.cost < np.inf
            gap = (answer.cost - answer.bound) / abs(answer.cost) if known else np.inf
            found.setdefault(name, []).append((answer.cost, gap))
            print(f"  {name}, {limit:g} s: {answer.cost:.3f}, gap {gap:.2e}, {answer.cpu:.1f} s", flush=True)
    return found


def experiment(options: argparse.Namespace) -> list[Claim]:
    """Every solver on every family that is chosen."""
    limits = options.limits[:2] if options.quick else options.limits
    contestants.warm_up([*SOLVERS, *PEERS])
    claims: list[Claim] = []
    with one_core():
        for name in options.names:
            print(name, flush=True)
            found = curves(FAMILIES[name], SEED, limits, [*SOLVERS, *PEERS])
            best = min(cost for answers in found.values() for cost, _ in answers)
            for solver, answers in found.items():
                behind = [100.0 * (cost - best) / abs(best) for cost, _ in answers]
                least = [100.0 * (min(other[k][0] for other in found.values()) - best) / abs(best)
                         for k in range(len(limits))]  # fmt: skip
                claims += [
                    Claim(f"{name}, {solver}: behind after {limit:g} s", "%", None, value, source="chosen by us",
                          band=(None, first + _BEHIND) if solver == "exact" else None)
                    for limit, value, first in zip(limits, behind, least, strict=True)
                ]  # fmt: skip
                times = np.log(limits)
                area = float(np.trapezoid(behind, times) / (times[-1] - times[0])) if len(limits) > 1 else behind[0]
                claims.append(Claim(f"{name}, {solver}: area", "%", None, area, source="chosen by us"))
                # some peers have no bound in so short a time
                if np.isfinite(answers[-1][1]):
                    gap = 100.0 * answers[-1][1]
                    claims.append(Claim(f"{name}, {solver}: gap", "%", None, gap, source="chosen by us"))
    return claims


def _add_limits(parser: argparse.ArgumentParser) -> None:
    text = "processor seconds that each solver gets (default: 1 5 20 60)"
    parser.add_argument("--limits", nargs="+", type=float, default=[*LIMITS], metavar="S", help=text)


if __name__ == "__main__":
    said = " Limits of {limits} s."
    raise SystemExit(main("anytime", experiment, __doc__, only=FAMILIES, options=[_add_limits], said=said))
