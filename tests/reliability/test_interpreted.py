"""Kernels that are not compiled yet: small calls are interpreted, with the same answers to the last bit."""

import ast
import json
import re
from pathlib import Path

import numpy as np
import pytest
from numba.core.errors import NumbaError

import assoc
from assoc._system.compiled import compiled_only, inner_njit, lean_inner_njit, njit
from assoc.simulation import simulate
from tests.running import printed
from tests.sizes import sample

_CALLS = """
import numpy as np
from assoc._system import interpreted
from assoc.packing.cover import chosen_columns

asked = []
interpreted.beside.ask = lambda module, name, kinds: asked.append(name)


def call(rows):
    cols = np.arange(2 * rows, dtype=np.int32).reshape(rows, 2)
    owner = np.repeat(np.arange(rows, dtype=np.int32), 2)
    assert chosen_columns(cols, owner).tolist() == list(range(rows))
    return len(chosen_columns.signatures)


"""


def run(code: str, cache: Path | None, switch: str = "1") -> str:
    """Run code in a process of its own, with its own cache of kernels or the usual one; what it prints."""
    # the process that compiles may still be at a kernel when this one ends
    warnings = ("-W", "error", "-W", "ignore::ResourceWarning")
    own = {"NUMBA_CACHE_DIR": cache} if cache else {}
    return printed(*warnings, "-c", code, ASSOC_INTERPRET=switch, **own)


@sample(
    "code",
    [
        # small calls leave the compiler to another process, which is asked once
        "assert [call(5), call(6), call(7)] == [0, 0, 0] and asked == ['chosen_columns']",
        # a large one waits for the compiler, and small ones have it then
        "assert [call(5), call(5000), call(5)] == [0, 1, 1]",
        # and so does one that was interpreted for long enough
        "interpreted.PATIENCE = -1.0\nassert call(5) == 1 and not asked",
        "with interpreted.compiled_only():\n    assert call(5) == 1",
    ],
    every=4,
)
def test_what_is_interpreted(code, tmp_path):
    run(_CALLS + code, tmp_path)


@pytest.mark.slow
def test_switched_off(tmp_path):
    run(_CALLS + "assert call(5) == 1 and not asked", tmp_path, switch="0")


@pytest.mark.slow
@pytest.mark.parametrize("solver", ["exact", "greedy", "lagrangian", "aco", "genetic", "tabu"])
def test_the_same_answers_with_and_without_compiled_kernels(solver, tmp_path):
    scene = tmp_path / "s.npz"
    simulate("three-radar", seed=5, scans=4).save(scene)
    answers = []
    for switch, cache in (("1", {"NUMBA_CACHE_DIR": str(tmp_path / "cold")}), ("0", {})):
        result = tmp_path / f"{switch}.json"
        words = ["-m", "assoc.solve", scene, "--solver", solver, "--json", result]
        printed(*words, ASSOC_INTERPRET=switch, **cache)
        content = json.loads(result.read_text())
        answers.append([{k: v for k, v in scan.items() if "time" not in k} for scan in content["scans"]])
    assert answers[0] == answers[1]
    assert len(answers[0]) == 4


_RANKING = """
import numpy as np
import assoc

rng = np.random.default_rng(4)
for sizes in ((4, 4, 4), (7, 8), (3, 3, 3, 3)):
    tuples = np.stack(np.meshgrid(*(np.arange(n + 1) for n in sizes), indexing="ij"), -1).reshape(-1, len(sizes))
    tuples = tuples[np.count_nonzero(tuples, axis=1) > 1]
    costs = rng.integers(-3, 3, len(tuples)).astype(float)
    for solution in assoc.kbest(assoc.AssignmentProblem(tuples, costs, sizes), 8):
        print(solution.indices.tolist(), solution.cost, solution.lower_bound)
"""


@pytest.mark.slow
def test_the_same_ranking_with_and_without_compiled_kernels(tmp_path):
    # many solutions of equal cost: which comes first hangs on the order of equal numbers
    assert run(_RANKING, tmp_path / "cold") == run(_RANKING, None, switch="0")


def is_kernel(node: ast.AST, mark: str = "njit") -> bool:
    return isinstance(node, ast.FunctionDef) and any(mark in ast.unparse(one) for one in node.decorator_list)


def all_kernels():
    """The definitions of the package's kernels."""
    files = Path(assoc.__file__).parent.rglob("*.py")
    return [node for path in files for node in ast.walk(ast.parse(path.read_text())) if is_kernel(node)]


def test_inner_kernels_are_called_by_kernels_alone():
    # Python would interpret them, however large their arrays are
    package = Path(assoc.__file__).parent
    trees = {
        ".".join(path.relative_to(package.parent).with_suffix("").parts): ast.parse(path.read_text())
        for path in package.rglob("*.py")
    }
    inner = {(name, node.name) for name, tree in trees.items() for node in tree.body if is_kernel(node, "inner_njit")}
    assert len(inner) > 50
    calls = []
    for name, tree in trees.items():
        known = {one for module, one in inner if module == name}
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom):
                known |= {one.name for one in node.names if (node.module, one.name) in inner}
        for node in tree.body if known else ():
            if not is_kernel(node):
                calls += [f"{name}, line {call.lineno}" for call in ast.walk(node) if isinstance(call, ast.Call)
                          and isinstance(call.func, ast.Name) and call.func.id in known]  # fmt: skip
    assert calls == []


def test_lean_kernels_make_and_return_no_arrays():
    # they count no references: an array that is returned would never be freed, or too early
    kernels = all_kernels()
    plain = {"None", "bool", "int", "float", "tuple", "Three"}
    other = {node.name for node in kernels if not set(re.findall(r"\w+", ast.unparse(node.returns))) <= plain}
    lean = [node for node in kernels if is_kernel(node, "lean_inner_njit") or is_kernel(node, "literal_njit")]
    assert len(other) > 50 and len(lean) > 20
    calls = [ast.unparse(one.func) for node in lean for one in ast.walk(node) if isinstance(one, ast.Call)]
    assert not other & {*calls, *(node.name for node in lean)}
    assert not [call for call in calls if call.startswith("np.")]


@lean_inner_njit
def _copied(x: np.ndarray) -> float:
    y = x + 1.0
    return y[0]


@njit
def _copies(x: np.ndarray) -> float:
    return _copied(x)


def test_lean_kernels_that_make_an_array_are_not_compiled():
    # so what they hold are their callers' arrays, and views of them, which live as long as the call
    with pytest.raises(NumbaError, match="NRT required but not enabled"), compiled_only():
        _copies(np.zeros(3))


@inner_njit
def _less(x: float) -> float:
    return min(x, 2.5)


@njit
def _least(x: float) -> float:
    return min(_less(x), 0.5 * x)


_COUNTED = """
import gc
from numba.core import event
from tests.reliability.test_interpreted import _least

compiled, collecting = [], set()


class Listener(event.Listener):
    def on_start(self, event):
        if "dispatcher" in event.data:
            compiled.append(event.data["dispatcher"].py_func.__qualname__)
        collecting.add(gc.isenabled())

    def on_end(self, event):
        pass


for kind in ("numba:compile", "numba:run_pass"):
    event.register(kind, Listener())
assert (_least(4.0), _least(8.0)) == (2.0, 2.5)
assert gc.isenabled() and collecting == {False}, collecting
print(compiled)
"""


def test_what_kernels_and_inner_ones_call_is_compiled_once(tmp_path):
    compiled = ast.literal_eval(run(_COUNTED, tmp_path, "0"))
    assert len(compiled) == len(set(compiled)) == 3
