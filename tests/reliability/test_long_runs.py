"""Does the watch of long runs see what it watches for?"""

import numpy as np
import pytest

from tests.reliability import long_runs
from tests.sizes import few_or_all


def watched(seconds=lambda place: 1.0, unchanging=lambda place: 1.0):
    """Return a watch of a hundred looks, with the times of a step and of the unchanging work by the look's number."""
    # not through all objects of the process that tests
    watch = long_runs.Watch(1, count=lambda: 0)
    for place in range(100):
        watch.look(seconds(place), unchanging(place))
    return watch


def held(watch, words):
    (claim,) = [claim for claim in watch.claims("x") if words in claim.quantity]
    return claim.holds


def test_a_slow_machine_is_no_fault_of_ours():
    slower = watched(lambda place: 1.0 + place / 50, lambda place: 1.0 + place / 50)
    assert held(slower, "over that of unchanging work") is True


def test_steps_that_become_slower_are_seen():
    assert held(watched(lambda place: 1.0 + place / 400), "over that of unchanging work") is False


def test_memory_that_grows_is_seen():
    watch = watched()
    assert held(watch, "resident memory") is True
    watch.resident = [100.0 + 0.1 * place for place in range(100)]
    assert held(watch, "resident memory") is False
    watch.objects = list(range(0, 10_000, 100))
    assert held(watch, "Python's objects") is False


@pytest.mark.slow
@pytest.mark.parametrize("kind", list(long_runs.KINDS))
def test_a_short_run_of_each_tracker(kind):
    claims, watch = long_runs.track(kind, 40, np.random.default_rng(1), looks=10)
    sound = {claim.quantity: claim for claim in claims}
    assert sound[f"{kind}: least eigenvalue of a correlation matrix"].holds
    assert 1.0 < sound[f"{kind}: that distance (cut at 1 km)"].ours < 200.0
    assert len(watch.seconds) == 10 and min(watch.unchanging) > 0.0


@few_or_all("count", 50, 350)
def test_a_short_run_of_the_solvers(count):
    claims, watch = long_runs.solve(count, np.random.default_rng(1), looks=10)
    assert claims[-1].holds and len(watch.seconds) == 10
