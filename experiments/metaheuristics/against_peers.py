"""`aco`, `genetic` and `tabu` after seconds against other programs after a minute, on scenes full of ghosts.

    python -m experiments.metaheuristics.against_peers [--problems NAME ...] [--count N] [--answers FILE] [--publish]

Everybody has one core and the same tuples. Ours get their seconds as processor time; peers count their own limit on the
clock, and the processor time that they took is told, too. The seeds were used for nothing else. A figure is the mean
excess, in percent, over the best cost that anybody found; intervals are 95 %, from resampling problems; the goal is
judged on the worst problem.

CHILS, the nearest rival, also runs for one second and for five, and again on two cores beside two workers of ours; what
it costs more than ours is told for the same time, and for its minute beside our five seconds.

With --answers each answer is kept in a file as soon as it is there, and what the file holds is not run again: a long
run may be stopped and taken up again.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import NamedTuple

import numpy as np

import assoc
from assoc._files.output import write_text
from assoc.problem import AssignmentProblem
from assoc.sweeps.bootstrap import mean_interval
from experiments.benchmarks.run import one_core
from experiments.common import peers
from experiments.common.claims import Claim, load_json, print_table, save_json
from experiments.common.command import add_publish, publish
from experiments.common.results import result_file
from experiments.metaheuristics.parts import SOLVERS
from experiments.metaheuristics.problems import PROBLEMS, problem
from experiments.metaheuristics.running import log, run

NAME = "metaheuristics.against_peers"
TITLE = "The metaheuristics after seconds, peers after a minute"
# numbers of problems before this one are those of the ablation
FIRST = 100
_GOAL = "goal: at or below the others on every problem"


class Entry(NamedTuple):
    """Somebody with a limit.

    Attributes
    ----------
    who : str
        Solver or peer.
    seconds : float
        Its limit.
    cores : int
        On which it runs; as many workers of ours.
    """

    who: str
    seconds: float
    cores: int = 1

    @property
    def ours(self) -> bool:
        """Whether it is one of the three."""
        return self.who in SOLVERS

    @property
    def words(self) -> str:
        """How it is reported."""
        return f"{self.who}, {self.seconds:g} s" + (f" on {self.cores} cores" if self.cores > 1 else "")


PEERS = ("chils", "branch_reduce", "mmwis", "kap", "cp_sat_1", "highs", "scip_1")
BESIDE = ((1.0, 1.0), (5.0, 5.0), (5.0, 60.0))
"""Seconds of ours, and those of CHILS with which they are compared."""
CORES = (1, 2)
ENTRIES = (
    *(Entry(name, seconds, cores) for cores in CORES for seconds in (5.0, 1.0) for name in SOLVERS),
    *(Entry("chils", seconds, cores) for cores in CORES for seconds in (1.0, 5.0, 60.0)),
    *(Entry(name, 60.0) for name in PEERS if name != "chils"),
)


class Answers:
    """Answers so far: cost and processor seconds, by problem and entry; kept in a file if there is one."""

    def __init__(self, path: Path | None) -> None:
        self._path = path
        self._known: dict[str, list[float | None]] = {}
        if path is not None and path.exists():
            self._known = json.loads(path.read_text(encoding="utf-8"))

    def of(self, name: str, number: int, entry: Entry) -> tuple[float, float]:
        """Return an answer, found now if it is not known."""
        key = f"{name} {number}: {entry.words}"
        if key not in self._known:
            cost, seconds = _ask(problem(name, number), entry, number)
            self._known[key] = [cost if math.isfinite(cost) else None, seconds]
            if self._path is not None:
                write_text(self._path, json.dumps(self._known, indent=1) + "\n")
            log(f"{key}: {cost:.9g} ({seconds:.1f} s of processor time)")
        known, taken = self._known[key]
        return math.inf if known is None else known, taken or 0.0


def _ask(one: AssignmentProblem, entry: Entry, seed: int) -> tuple[float, float]:
    began = time.process_time()
    with one_core() if entry.cores == 1 else nullcontext():
        if entry.ours:
            cost = run(one, entry.who, entry.seconds, seed, workers=entry.cores)
        elif peers.available(entry.who, one):
            try:
                cost = peers.PEERS[entry.who](one, entry.seconds).cost
            except MemoryError:
                cost = math.inf
        else:
            raise SystemExit(f"{entry.who} is not installed: pip install assoc[peers]")
    return cost, time.process_time() - began


def claims_of(name: str, costs: dict[Entry, list[float]], taken: dict[Entry, list[float]]) -> list[Claim]:
    """The claims of the problems of one name; costs and processor seconds of each problem."""
    table = {entry: np.array(values) for entry, values in costs.items()}
    best = np.min(list(table.values()), axis=0)
    found = [Claim(f"{name}: problems", "", None, len(best))]
    for entry, values in table.items():
        solved = np.isfinite(values)
        found.append(Claim(f"{name}: {entry.words}, problems without an answer", "", None, int((~solved).sum())))
        if solved.all():
            excess = 100.0 * (values - best) / np.abs(best)
            interval = mean_interval(excess[:, None])
            found.append(Claim(f"{name}: {entry.words}, excess", "%", None, float(excess.mean()), interval))
        if not entry.ours:
            seconds = float(np.mean(taken[entry]))
            found.append(Claim(f"{name}: {entry.words}, processor time", "s", None, seconds))
    for ours in filter(lambda entry: entry.ours, table):
        for seconds in (theirs for own, theirs in BESIDE if own == ours.seconds):
            chils = Entry("chils", seconds, ours.cores)
            if chils in table and np.isfinite(table[chils]).all():
                more = 100.0 * (table[chils] - table[ours]) / np.abs(table[ours])
                words = f"{name}: {chils.words}, less {ours.words}"
                interval = mean_interval(more[:, None])
                found.append(Claim(words, "%", None, float(more.mean()), interval))
                found.append(Claim(f"{words}, least", "%", None, float(more.min()), band=(-1e-7, None), source=_GOAL))
    rivals = [values for entry, values in table.items() if not entry.ours]
    if rivals and np.isfinite(least := np.min(rivals, axis=0)).all():
        for entry, values in table.items():
            if entry.ours:
                worst = float((100.0 * (values - least) / np.abs(least)).max())
                words = f"{name}: {entry.words}, worst less the best peer"
                found.append(Claim(words, "%", None, worst, band=(None, 1e-7), source=_GOAL))
    return found


def program(arguments: Sequence[str] | None = None) -> int:
    """Run the experiment; returns its exit code."""
    parser = argparse.ArgumentParser(prog=f"python -m experiments.{NAME}", description=f"{TITLE}.")
    default = ["ghosts 40", "ghosts 60", "ghosts 100"]
    parser.add_argument("--problems", nargs="+", default=default, metavar="NAME", help=", ".join(PROBLEMS))
    parser.add_argument("--count", type=int, default=3, metavar="N", help="problems of each name (default 3)")
    every = list(dict.fromkeys(entry.who for entry in ENTRIES))
    parser.add_argument("--only", nargs="+", default=every, metavar="NAME", help=f"of {', '.join(every)}")
    parser.add_argument("--answers", metavar="FILE", type=Path, help="keep answers here, take those that are there")
    parser.add_argument("--json", metavar="FILE", help="write the results here")
    add_publish(parser, NAME)
    chosen = parser.parse_args(arguments)
    for label, given, known in (("--problems", chosen.problems, PROBLEMS), ("--only", chosen.only, every)):
        for one in given:
            if one not in known:
                parser.error(f"{label}: unknown {one!r}; known: {', '.join(known)}")
    if chosen.count < 2:
        parser.error("expected --count of at least 2")
    answers = Answers(chosen.answers)
    entries = [entry for entry in ENTRIES if entry.who in chosen.only]
    _warm_up(chosen.problems[0], entries)
    claims: list[Claim] = []
    for name in chosen.problems:
        numbers = range(FIRST, FIRST + chosen.count)
        # each answer is asked for before the next problem, so that a stopped run has whole problems
        rows = [[answers.of(name, number, entry) for entry in entries] for number in numbers]
        costs = {entry: [row[place][0] for row in rows] for place, entry in enumerate(entries)}
        taken = {entry: [row[place][1] for row in rows] for place, entry in enumerate(entries)}
        claims += claims_of(name, costs, taken)
    if chosen.publish and result_file(NAME).exists():
        groups = {claim.quantity.split(": ")[0] for claim in claims}
        claims = [c for c in load_json(result_file(NAME)) if c.quantity.split(": ")[0] not in groups] + claims
    print_table(claims, TITLE)
    if chosen.json:
        save_json(chosen.json, claims, NAME, 0, __doc__ or "")
    if chosen.publish:
        publish(claims, NAME, 0, __doc__)
    return 0


def _warm_up(name: str, entries: Sequence[Entry]) -> None:
    """Compile the kernels, load the packages, and learn how fast the machine is (running.py)."""
    peers.warm_up(sorted({entry.who for entry in entries if not entry.ours}))
    solvers = sorted({entry.who for entry in entries if entry.ours})
    assoc.warm_up(solvers)
    for solver in solvers:
        run(problem(name, FIRST - 1), solver, 0.3, 0)


if __name__ == "__main__":
    raise SystemExit(program())
