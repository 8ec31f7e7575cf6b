"""Problems with one large component, and what is measured of solvers on them."""

import numpy as np
import pytest

import assoc
from assoc.packing.run import Run
from experiments import anytime
from experiments.common.instances.large import cameras, frames, records


@pytest.mark.parametrize(
    "make", [lambda: cameras(150, 3, 2.0, 1), lambda: frames(20, 5, 1), lambda: records(200, 3, 1)]
)
def test_tuples_are_good_and_differ(make):
    problem = make()
    assert problem.num_tuples > 200 and (problem.costs <= 0.0).all()
    assert len(np.unique(problem.tuples, axis=0)) == problem.num_tuples
    assert np.unique(np.count_nonzero(problem.tuples, axis=1)).tolist()[:2] == [1, 2]


def test_cameras_find_particles():
    # little noise: nearly every particle is a tuple of three points or more
    answer = assoc.assign(cameras(100, 4, 0.05, 2))
    assert answer.status == "optimal"
    assert 90 <= np.count_nonzero(np.count_nonzero(answer.tuples, axis=1) >= 3) <= 100


def test_frames_follow_each_other():
    used = frames(15, 6, 3).tuples > 0
    joined = used[used.sum(axis=1) >= 2]
    first, last = joined.argmax(axis=1), 5 - joined[:, ::-1].argmax(axis=1)
    assert ((last - first + 1) == joined.sum(axis=1)).all() and joined.sum(axis=1).max() == 4


def test_curves(capsys):
    clock = Run.runtime
    found = anytime.curves(lambda seed: records(60, 3, seed), 1, [0.5, 1.0], ["exact", "tabu", *anytime.PEERS])
    assert Run.runtime is clock
    optimum = assoc.assign(records(60, 3, 1), "milp").cost
    assert [cost for cost, _ in found["exact"]] == pytest.approx([optimum] * 2)
    for name in ("tabu", *anytime.PEERS):
        assert all(cost >= optimum - 1e-6 and gap >= 0.0 for cost, gap in found[name])
    assert "tabu, 1 s" in capsys.readouterr().out
