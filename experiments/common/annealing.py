"""Simulated annealing as a solver of one's own: the example of docs/own_solver.md, and a row of the benchmark."""

import math
from dataclasses import dataclass, field

import numpy as np

from assoc.solvers import Cover, Outcome, Parameters, names, register


@dataclass(frozen=True)
class AnnealingParameters(Parameters):
    """The schedule."""

    sweeps: int = field(default=200, metadata={"help": "moves tried, for each column"})
    hot: float = field(default=10.0, metadata={"help": "first temperature, in units of cost"})
    cold: float = field(default=1.0, metadata={"help": "last temperature"})

    def __post_init__(self):
        self._require(self.sweeps >= 1, "sweeps", "a whole number above 0")
        self._require(0 < self.cold <= self.hot, "cold", "a number above 0, at most hot")


def solve(packing, parameters, run):
    """Put columns in or take them out at random; the colder, the seldomer a move that costs is made."""
    n, p = packing.num_columns, parameters
    rows = [[r for r in row if r >= 0] for row in packing.cols.tolist()]
    # rows that must be covered are worth more than any column
    fee = 2.0 * np.abs(packing.weights).max(initial=0.0) + 1.0
    weights = [
        w - fee * sum(not packing.slack[r] for r in row) for w, row in zip(packing.weights.tolist(), rows, strict=True)
    ]
    cover = Cover.empty(packing)
    cover.add_greedily(np.argsort(weights))
    owner, best = cover.owner.tolist(), cover.owner.copy()
    now = least = 0.0
    step, steps = 0, p.sweeps * n
    while step < steps and not run.should_stop():
        temperature = p.hot * (p.cold / p.hot) ** (step / steps)
        block = min(1000, steps - step)
        for j, luck in zip(run.rng.integers(n, size=block).tolist(), run.rng.random(block).tolist(), strict=True):
            inside = owner[rows[j][0]] == j
            leaving = {j} if inside else {owner[r] for r in rows[j]} - {-1}
            change = (0.0 if inside else weights[j]) - sum(weights[i] for i in leaving)
            if change > 0.0 and luck >= math.exp(-change / temperature):
                continue
            for i in leaving:
                for r in rows[i]:
                    owner[r] = -1
            if not inside:
                for r in rows[j]:
                    owner[r] = j
            now += change
            if now < least - 1e-9:
                least, best = now, np.array(owner, dtype=np.int32)
        step += block
    cover = Cover(packing, best)
    cover.improve()
    cover.complete(run)
    run.record(step, cover.weight, -np.inf)
    return Outcome(cover.columns(), step)


def make_known():
    """Register the solver, once in a process."""
    if "annealing" not in names():
        register("annealing", AnnealingParameters, solve)
