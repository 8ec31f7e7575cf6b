"""The problems of these experiments, by name.

Their seeds were used for nothing else, but for one thing: on twelve scenes of 20 and of 40 targets the defaults of
`aco` were chosen.
"""

from collections.abc import Callable

from assoc.costs import build_problem
from assoc.problem import AssignmentProblem
from experiments.common.instances import scenes, synthetic

# of the first problem of each name; benchmarks begin with 1000, tuning ends before 100
FIRST_SEED = 3000
# the first seeds of 36 targets whose linear program is 0.6 % or more below the optimum
_WIDE_GAPS = (3000, 3012, 3023, 3033, 3035, 3043, 3051, 3054)


def _ghosts(targets: int) -> Callable[[int], AssignmentProblem]:
    return lambda seed: build_problem(scenes.ghost(targets, seed), 0)


def _wide_gap(seed: int) -> AssignmentProblem:
    return _ghosts(36)(_WIDE_GAPS[(seed - FIRST_SEED) % len(_WIDE_GAPS)])


def _known(n: int) -> Callable[[int], AssignmentProblem]:
    return lambda seed: synthetic.axial_known_optimum(n, seed)[0]


PROBLEMS: dict[str, Callable[[int], AssignmentProblem]] = {
    **{f"ghosts {targets}": _ghosts(targets) for targets in (10, 20, 40, 60, 100)},
    "wide gaps 36": _wide_gap,
    # one component of about 1,000 rows, too large for dives
    "wide gates 350": lambda seed: synthetic.wide_gates(350, seed, 1.0),
    "Grundel-Pardalos 30": _known(30),
    "Grundel-Pardalos 50": _known(50),
}
"""Name -> what makes its problem of a seed."""


def problem(name: str, number: int) -> AssignmentProblem:
    """Return the problem of a name, numbers from 0."""
    return PROBLEMS[name](FIRST_SEED + number)
