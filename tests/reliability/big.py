"""Problems of up to a million tuples, made in a second or two: for limits of time and memory."""

import numpy as np

from assoc.problem import AssignmentProblem


def axial(side: int, seed: int = 0) -> AssignmentProblem:
    """Dense axial problem of ``side``^3 tuples, uniform costs: no gap in sight, one component."""
    rng = np.random.default_rng(seed)
    return AssignmentProblem.from_dense(rng.random((side, side, side)), dummy=False)


def ghosts(side: int, tuples: int, seed: int = 0) -> AssignmentProblem:
    """One component of three sensors in which everything competes with everything, as bearings' ghosts do."""
    rng = np.random.default_rng(seed)
    rows = rng.integers(1, side + 1, (tuples, 3))
    rows = np.unique(rows, axis=0)
    return AssignmentProblem(rows, -rng.exponential(6.0, len(rows)), [side] * 3)
