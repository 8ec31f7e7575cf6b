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
    # who says what leaving costs knows that pairs may cost more, as beyond a threshold
    if problem.costs[~several].any() or (problem.costs[several] < 0.0).any():
        return ()
    return (
        f"none of the {np.count_nonzero(several)} tuples costs less than its measurements as false alarms, so that "
        "no target can be found: expected negative log likelihood ratios, below 0 for likely targets",
    )
