"""Mixed problems and steps in one process: a little of endurance.py, which also runs with checked indices."""

from tests.reliability.endurance import guarded, run


def test_mixed_problems_and_steps():
    solved, stepped, faults = run(1, range(30), 16)
    assert (solved, dict(faults)) == (30, {}) and stepped >= 16


def test_faults_are_seen():
    found = type(run(1, range(0), 0)[2])()
    guarded(lambda: [][1], "a kernel", found)
    assert ["IndexError" in kind for kind in found] == [True]
