"""An independent reading of "this is a solution": plain Python, nothing shared with the solvers."""

from collections import Counter

import numpy as np
from numpy.typing import ArrayLike

from assoc.problem import AssignmentProblem


class InfeasibleAnswerError(AssertionError):
    """A solver's answer breaks a constraint of the problem; the message says which."""


def check_answer(problem: AssignmentProblem, tuples: ArrayLike) -> float:
    """Check that tuples solve the problem and return what they cost.

    Returns their total cost, read from the problem and not from the solver.
    Raises InfeasibleAnswerError: A tuple that the problem does not list, or a measurement used too often or not at all.
    """
    prices: dict[tuple[int, ...], float] = {}
    for row, cost in zip(problem.tuples.tolist(), problem.costs.tolist(), strict=True):
        # one listed twice counts with its smaller cost
        prices[tuple(row)] = min(cost, prices.get(tuple(row), np.inf))
    chosen = [tuple(int(i) for i in row) for row in np.asarray(tuples).reshape(-1, problem.num_sensors)]
    for key in chosen:
        if key not in prices:
            raise InfeasibleAnswerError(f"tuple {key} is not in the problem")
    smallest = min(problem.sizes.tolist())
    for sensor, size in enumerate(problem.sizes.tolist()):
        used = Counter(key[sensor] for key in chosen if key[sensor] != 0)
        must_cover = problem.dummy or size == smallest
        for index in range(1, size + 1):
            if used[index] > 1 or (must_cover and used[index] == 0):
                raise InfeasibleAnswerError(
                    f"sensor {sensor + 1}: measurement {index} is in {used[index]} chosen tuples"
                )
    return float(sum(prices[key] for key in chosen))
