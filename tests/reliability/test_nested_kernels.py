"""Kernels that kernels call: for which types they are compiled, and those that Python cannot call compiled."""

import json

import pytest

from tests.running import printed

_PROGRAM = """
import json
import os
import numpy as np
from numba.core import event
from assoc._system.compiled import inner_njit, literal_njit, njit

@njit
def plain(j, up):
    return j + 1 if up else j

@literal_njit
def literal(j):
    return j + 1

@njit
def paired(pair, up):
    one, two = pair
    return plain(one, up) + two

@inner_njit
def inner(values):
    if values.size == 0:
        raise ValueError("nothing to add", values.size)
    total = 0.0
    for i in range(values.size):
        total += values[i]
    return total

@njit
def outer(values, rows):
    total = inner(values)
    for r in rows:
        total += plain(r, True) + paired((r, 1), False)
    done = 0
    while done < 2:
        total += plain(done, rows.size > 1)
        done += 1
    return total + plain(2, False) + paired((rows.size, rows.size), True) + literal(3) + literal(rows.size)

@njit
def other(values):
    return 2.0 * inner(values)

compiled = event.RecordingListener()
event.register("numba:compile", compiled)
rows = np.arange(3, dtype=np.int32)
found = [outer(np.ones(4), rows)]
# compiled code is silent about overflow
np.seterr(over="raise")
found += [inner(np.ones(3)), inner(np.array([1e308, 1e308]))]
if "OTHER" in os.environ:
    found.append(other(np.ones(4)))
try:
    outer(np.ones(0), rows)
except ValueError as problem:
    found.append(list(problem.args))
overloads = [len(one.signatures) for one in (plain, literal, paired, inner, outer)]
print(json.dumps([found, overloads, sum(one.is_start for _, one in compiled.buffer)]))
"""


def run(tmp_path, **variables):
    program = tmp_path / "program.py"
    program.write_text(_PROGRAM)
    return json.loads(printed(program, NUMBA_CACHE_DIR=tmp_path / "cache", ASSOC_INTERPRET=0, **variables))


@pytest.mark.slow
def test_one_overload_for_all_whole_numbers_and_inner_kernels_from_python(tmp_path):
    # 4; 1 + 2 + 3 and 1 + 2 + 3; 1 + 2; 2; 7; 4 and 4
    expected = [36.0, 3.0, float("inf"), ["nothing to add", 0]]
    assert run(tmp_path) == [expected, [1, 2, 1, 1, 1], 6]
    # what was kept is loaded, with all that it calls in it
    assert run(tmp_path) == [expected, [0, 0, 0, 0, 1], 0]


@pytest.mark.slow
def test_a_kept_inner_kernel_is_linked_into_a_new_one(tmp_path):
    run(tmp_path)
    found, overloads, compiled = run(tmp_path, OTHER="1")
    assert found == [36.0, 3.0, float("inf"), 8.0, ["nothing to add", 0]]
    # the new one alone is compiled; the inner one is loaded for it
    assert compiled == 1
    assert overloads == [0, 0, 0, 1, 1]
