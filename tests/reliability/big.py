"""Problems of up to a million tuples, made in a second or two: for limits of time and memory."""

import numpy as np

from assoc.problem import AssignmentProblem


def axial(side: int, seed: int = 0) -> AssignmentProblem:
    """Dense axial problem of ``side``^3 tuples, uniform costs: no gap in sight, one component."""
    rng = np.random.default_rng(seed)
    return AssignmentProblem.from_dense(rng.random((side, side, side)), dummy=False)


def gated(targets: int, per_target: int, seed: int = 0) -> AssignmentProblem:
    """Sparse problem of four sensors with about ``targets * per_target`` tuples in many components."""
    rng = np.random.default_rng(seed)
    home = np.repeat(np.arange(1, targets + 1), per_target)
    tuples = home[:, None] + rng.integers(-2, 3, (home.size, 4))
    tuples = np.clip(tuples, 1, targets)
    tuples[rng.random(tuples.shape) < 0.15] = 0
    tuples = tuples[np.count_nonzero(tuples, axis=1) >= 2]
    return AssignmentProblem(tuples, rng.normal(-5.0, 6.0, len(tuples)), [targets] * 4)


def ghosts(side: int, tuples: int, seed: int = 0) -> AssignmentProblem:
    """One component of three sensors in which everything competes with everything, as bearings' ghosts do."""
    rng = np.random.default_rng(seed)
    rows = rng.integers(1, side + 1, (tuples, 3))
    rows = np.unique(rows, axis=0)
    return AssignmentProblem(rows, -rng.exponential(6.0, len(rows)), [side] * 3)


BIG = {
    "axial 100^3": lambda: axial(100),
    "gated 1e6": lambda: gated(20_000, 50),
    "ghosts 1e6": lambda: ghosts(150, 1_200_000),
}
