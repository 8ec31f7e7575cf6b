"""What ``warm_up`` promises: hard scenes meet no kernel that is not loaded."""

import pytest

import assoc
from assoc.errors import InvalidInputError
from tests.running import process

_PROGRAM = """
import assoc
from assoc._system.compiled import loaded
from assoc.costs import build_problem
from experiments.common.instances import scenes, synthetic

problems = [build_problem(scenes.ghost(20, 2), 0), build_problem(scenes.gated(4, 40, 1), 0)]
problems += [synthetic.axial_random(11, 0), synthetic.planted(5, 0)[0]]
assoc.assign(problems[3], "greedy")
print(assoc.warm_up())
before, _ = loaded()
for problem in problems:
    for solver in ("exact", "lagrangian", "aco", "genetic", "tabu", "greedy"):
        for limit in (None, 60.0):
            assoc.assign(problem, solver, time_limit=limit, **({} if limit is None else {"seed": 1}))
print(loaded()[0] - before)
"""


@pytest.mark.slow
def test_no_kernel_is_left_to_load():
    done = process("-c", _PROGRAM)
    assert done.returncode == 0, done.stderr
    seconds, more = done.stdout.split()
    assert float(seconds) > 0.0
    assert int(more) == 0


def test_unknown_solver():
    with pytest.raises(InvalidInputError, match="solver: unknown name 'antz'"):
        assoc.warm_up(["antz"])
