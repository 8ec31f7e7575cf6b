"""Kernels that are not compiled yet: small calls are interpreted, with the same answers to the last bit."""

import json
import os
import subprocess
import sys

import pytest

from assoc.simulation import simulate

_CALLS = """
import numpy as np
from assoc._system import interpreted
from assoc.packing.neighbourhoods.cover import chosen_columns

asked = []
interpreted._compile_beside = lambda function, kinds: asked.append(function.__name__)


def call(rows):
    cols = np.arange(2 * rows, dtype=np.int32).reshape(rows, 2)
    owner = np.repeat(np.arange(rows, dtype=np.int32), 2)
    assert chosen_columns(cols, owner).tolist() == list(range(rows))
    return len(chosen_columns.signatures)


"""


def run(code: str, cache: object, switch: str = "1") -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "ASSOC_INTERPRET": switch, "NUMBA_CACHE_DIR": str(cache)}
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, env=environment, timeout=300
    )
    assert (done.returncode, done.stderr) == (0, "")
    return done


@pytest.mark.parametrize(
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
)
def test_what_is_interpreted(code, tmp_path):
    run(_CALLS + code, tmp_path)


def test_switched_off(tmp_path):
    run(_CALLS + "assert call(5) == 1 and not asked", tmp_path, switch="0")


@pytest.mark.parametrize("solver", ["exact", "aco", "greedy", "lagrangian", "genetic", "tabu"])
def test_the_same_answers_with_and_without_compiled_kernels(solver, tmp_path):
    scene = tmp_path / "s.npz"
    simulate("three-radar", seed=5, scans=4).save(scene)
    answers = []
    for switch, cache in (("1", {"NUMBA_CACHE_DIR": str(tmp_path / "cold")}), ("0", {})):
        result = tmp_path / f"{switch}.json"
        words = ["-m", "assoc.solve", str(scene), "--solver", solver, "--json", str(result)]
        environment = {**os.environ, "ASSOC_INTERPRET": switch, **cache}
        subprocess.run([sys.executable, *words], check=True, capture_output=True, env=environment, timeout=300)
        content = json.loads(result.read_text())
        answers.append([{k: v for k, v in scan.items() if "time" not in k} for scan in content["scans"]])
    assert answers[0] == answers[1]
    assert len(answers[0]) == 4
