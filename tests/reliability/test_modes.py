"""The same answers without the compiler; `make test-uncompiled` runs more of the tests so."""

import pytest

from tests.reliability.answers import answers, differences
from tests.running import printed


@pytest.mark.slow
def test_answers_without_the_compiler():
    parts = ["solutions", "rankings", "costs", "tracks"]
    command = ["-W", "error", "-m", "tests.reliability.answers", "--only", ",".join(parts)]
    assert differences(printed(*command, NUMBA_DISABLE_JIT=1), answers(parts), 1e-9) == []


def test_the_comparison_sees_differences():
    one = '{"a": [["exact", [1, 2], 3.0]]}'
    assert differences(one, one, 1e-9) == []
    assert differences(one, one.replace("3.0", "3.0000000001"), 1e-9) == []
    assert differences(one, one.replace("3.0", "3.001"), 1e-9) == ["a: numbers differ by up to 0.001"]
    assert differences(one, one.replace("[1, 2]", "[1, 3]"), 1e-9) == ["a: other choices"]
    assert differences(one, one.replace("[1, 2]", "[1, 2, 3]"), 1e-9) == ["a: other choices"]
    assert differences(one, one.replace('"a"', '"b"'), 1e-9) == ["other parts"]
