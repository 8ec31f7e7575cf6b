"""Warnings of problems that are legal but probably a mistake: costs that are not likelihood ratios."""

from __future__ import annotations

import numpy as np

from assoc.problem import AssignmentProblem

# one unlikely target may well be false alarms
_ENOUGH = 2


def cost_warnings(problem: AssignmentProblem) -> tuple[str, ...]:
    """Return a warning if no cost favours a target, as when distances or likelihoods are given instead of costs."""
    several = np.count_nonzero(problem.tuples, axis=1) > 1
    if not problem.dummy or np.count_nonzero(several) < _ENOUGH:
        return ()
    singletons = problem.tuples[~several]
    sensor = singletons.argmax(axis=1)
    alone = np.full((problem.num_sensors, int(problem.sizes.max()) + 1), np.inf)
    alone[:, 0] = 0.0
    # a tuple that is listed twice counts with its smaller cost
    np.minimum.at(alone, (sensor, singletons.max(axis=1)), problem.costs[~several])
    together = alone[np.arange(problem.num_sensors), problem.tuples[several]].sum(axis=1)
    if (problem.costs[several] < together).any():
        return ()
    return (
        f"none of the {np.count_nonzero(several)} tuples costs less than its measurements as false alarms, so that "
        "no target can be found: expected negative log likelihood ratios, below 0 for likely targets",
    )
