"""Mixed problems and steps in one process: a little of endurance.py; and does its watch see what it watches for?"""

import mmap
from collections import Counter

import numpy as np
import pytest

from tests.reliability import endurance, results
from tests.reliability.endurance import Watch, guarded, run


def test_mixed_problems_and_steps():
    counts, faults, _ = run(1, range(30), 16)
    assert (counts["problems"], dict(faults)) == (30, {}) and counts["steps"] >= 16


@pytest.mark.parametrize("number", [121, 307])
def test_sessions_whose_covariances_were_not_symmetric(number, tmp_path):
    """Two unresolved tracks were widened by a product of matrices, symmetric to rounding only."""
    endurance.track_some(8100, number, tmp_path, Counter())


def test_faults_are_seen():
    found = Counter()
    guarded(lambda: [][1], "a kernel", found)
    assert ["IndexError" in kind for kind in found] == [True]


def held(words, **seen):
    """Whether a claim holds of a watch of a hundred looks that saw this."""
    watch = Watch(1)
    for name in ("resident", "objects", "pace"):
        setattr(watch, name, [seen.get(name, lambda place: 1.0)(place) for place in range(100)])
    (claim,) = [claim for claim in watch.claims("x") if words in claim.quantity]
    return claim.holds


def test_what_grows_is_seen():
    assert held("time of a step") and held("resident memory") and held("Python's objects")
    assert held("time of a step", pace=lambda place: 1.0 + place / 400) is False
    assert held("resident memory", resident=lambda place: 100.0 + 0.1 * place) is False
    assert held("Python's objects", objects=lambda place: 100 * place) is False


@pytest.mark.slow
def test_a_leak_is_seen():
    watch, kept = Watch(1), []
    for number in range(1, 21):
        # not of numpy, which may get memory that is there already
        kept.append(mmap.mmap(-1, 2**21))
        kept[-1].write(bytes(2**21))
        watch.add(number)
    memory, *_ = watch.claims("x")
    assert memory.holds is False and memory.ours > 20.0


@pytest.mark.slow
@pytest.mark.parametrize("kind", list(endurance.LONG))
def test_a_short_run_of_each_tracker(kind):
    sound = {claim.quantity: claim for claim in endurance.follow(kind, 40, np.random.default_rng(1), looks=10)}
    assert sound[f"{kind}: least eigenvalue of a correlation matrix"].holds
    assert 0.2 < sound[f"{kind}: distance to the next track, second half / first"].ours < 5.0


def test_the_page_has_the_table_of_the_result_file():
    assert results.TABLE.read_text() == results.table()
