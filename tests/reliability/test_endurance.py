"""Mixed problems and steps in one process: a little of endurance.py, and more of it with checked indices."""

import pytest

from tests.reliability.endurance import guarded, run
from tests.running import printed


def test_mixed_problems_and_steps():
    solved, stepped, faults = run(1, range(30), 16)
    assert (solved, dict(faults)) == (30, {}) and stepped >= 16


def test_faults_are_seen():
    found = type(run(1, range(0), 0)[2])()
    guarded(lambda: [][1], "a kernel", found)
    assert ["IndexError" in kind for kind in found] == [True]


@pytest.mark.slow
def test_no_kernel_leaves_its_arrays(tmp_path):
    """Compiled anew with checks of indices; freed memory is overwritten."""
    checks = {"NUMBA_BOUNDSCHECK": "1", "NUMBA_CACHE_DIR": tmp_path, "PYTHONMALLOC": "debug"}
    words = "-m", "tests.reliability.endurance", "--problems", "24", "--steps", "12", "--seed", "2"
    assert ": 0 faults" in printed(*words, **checks, MALLOC_PERTURB_=165)
