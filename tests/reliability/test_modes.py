"""The same answers without the compiler; `make test-uncompiled` runs more of the tests so."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from tests.reliability.answers import answers, differences


@pytest.mark.slow
def test_answers_without_the_compiler():
    parts = ["solutions", "rankings", "costs", "tracks"]
    command = [sys.executable, "-W", "error", "-m", "tests.reliability.answers", "--only", ",".join(parts)]
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run(command, capture_output=True, text=True, timeout=600, env=environment)
    assert done.returncode == 0, done.stderr
    assert differences(done.stdout, answers(parts), 1e-9) == []


def test_the_comparison_sees_differences():
    one = '{"a": [["exact", [1, 2], 3.0]]}'
    assert differences(one, one, 1e-9) == []
    assert differences(one, one.replace("3.0", "3.0000000001"), 1e-9) == []
    assert differences(one, one.replace("3.0", "3.001"), 1e-9) == ["a: numbers differ by up to 0.001"]
    assert differences(one, one.replace("[1, 2]", "[1, 3]"), 1e-9) == ["a: other choices"]
    assert differences(one, one.replace("[1, 2]", "[1, 2, 3]"), 1e-9) == ["a: other choices"]
    assert differences(one, one.replace('"a"', '"b"'), 1e-9) == ["other parts"]
