"""numba stays as it was for everybody else in the process, and kernels work without what numba does not promise."""

import json

import pytest

from tests.running import printed

UNTOUCHED = """
import sys
import types
import numba
import numpy as np
from numba import njit
from numba.core import config

# what numba itself does at its first kernel is done
njit(lambda x: x + 1)(1)
PLAIN = (int, float, str, bool, type(None), list)


def states():
    found = {}
    for name, module in sorted(sys.modules.items()):
        if name.partition(".")[0] not in ("numba", "llvmlite") or not isinstance(module, types.ModuleType):
            continue
        for key, value in vars(module).items():
            if isinstance(value, type) and value.__module__.partition(".")[0] in ("numba", "llvmlite"):
                # pickle adds __slotnames__ to all classes
                for attribute in vars(value).keys() - {"__slotnames__"}:
                    found[f"{name}.{key}.{attribute}"] = described(vars(value)[attribute])
            found[f"{name}.{key}"] = described(value)
    return found


def described(value):
    return repr(value) if isinstance(value, PLAIN) else id(value)


before = states()
import assoc
problem = assoc.AssignmentProblem([[1, 1], [1, 2], [2, 1]], [-1.0, -3.0, -2.0], [2, 2])
assert assoc.assign(problem, "exact").cost == -5.0
after = states()
changed = [name for name in before if after.get(name) != before[name]]
print(changed + [name for name in after if name not in before and name.rpartition(".")[0] in before])
print({kind for kind, heard in numba.core.event._registered.items() if heard})
"""
SOLVED = """
import json
import sys
from numba.core import caching, options
{spoil}
import assoc
from assoc._system import compiled
from assoc.simulation import simulate

scene = simulate("three-radar", 5, scans=1)
found = assoc.associate(scene, "exact").solutions[0]
print(json.dumps([compiled.private is None, found.tuples.tolist(), found.cost]))
"""

# before 0.61 with an underscore
IN_TREE = "delattr(caching, next(name for name in vars(caching) if name.endswith('InTreeCacheLocator')))"


def run(code, **variables):
    return printed("-c", code, **{"ASSOC_INTERPRET": 0, **variables}).splitlines()


@pytest.mark.parametrize("interpret", ["0", "1"])
def test_nothing_of_numba_is_replaced(interpret, tmp_path):
    cold = {"NUMBA_CACHE_DIR": str(tmp_path)} if interpret == "1" else {}
    assert run(UNTOUCHED, ASSOC_INTERPRET=interpret, **cold) == ["[]", "set()"]


@pytest.mark.slow
@pytest.mark.parametrize("spoil", ["del options.DefaultOptions.no_cpython_wrapper", IN_TREE])
def test_the_same_answer_without_private_names(spoil, tmp_path):
    with_them, without = (
        json.loads(run(SOLVED.format(spoil=one), NUMBA_CACHE_DIR=str(tmp_path / str(len(one))))[-1])
        for one in ("", spoil)
    )
    assert (with_them[0], without[0]) == (False, True)
    assert with_them[1:] == without[1:]
