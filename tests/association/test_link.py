import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

import assoc
from assoc.errors import InvalidInputError, LimitExceededError


def cost_by_scipy(frames, reach, memory):
    """The least cost of all links of all frames, from a dense matrix of every point with every later one."""
    frame = np.repeat(np.arange(len(frames)), [len(points) for points in frames])
    points = np.concatenate(frames)
    cost = ((points[:, None] - points) ** 2).sum(axis=2) - reach**2
    gap = frame[None, :] - frame[:, None]
    cost[(gap < 1) | (gap > 1 + memory) | (cost > 0)] = 0.0
    return cost[linear_sum_assignment(cost)].sum()


@pytest.mark.parametrize(("memory", "dim", "seed"), [(0, 2, 1), (1, 3, 2), (2, 1, 3)])
def test_the_links_of_all_frames_cost_least(memory, dim, seed):
    rng = np.random.default_rng(seed)
    frames = [rng.uniform(0, 10, (rng.integers(0, 15), dim)) for _ in range(8)]
    ids, solution = assoc.link(frames, 3.0, memory=memory)
    assert solution.status == "optimal" and np.isclose(solution.cost, cost_by_scipy(frames, 3.0, memory))
    # the same sum from the particles alone
    found, last = 0.0, {}
    for k, (points, particles) in enumerate(zip(frames, ids, strict=True)):
        assert len(set(particles)) == len(points) == len(particles)
        for point, particle in zip(points, particles, strict=True):
            if particle in last:
                when, where = last[particle]
                assert k - when <= 1 + memory
                found += ((point - where) ** 2).sum() - 9.0
            last[particle] = k, point
    assert np.isclose(found, solution.cost) and list(last) == list(range(len(last)))


def test_particles_keep_their_numbers_where_one_is_missing():
    steps = np.arange(30)[:, None, None]
    places = np.array([[0.0, 0.0], [0.0, 5.0], [9.0, 9.0]]) + steps * [0.4, 0.1]
    frames = [np.delete(frame, 1, axis=0) if k % 7 == 3 else frame for k, frame in enumerate(places)]
    assert len(set(np.concatenate(assoc.link(frames, 1.0, memory=1).ids))) == 3
    assert len(set(np.concatenate(assoc.link(frames, 1.0).ids))) == 3 + 4


def test_a_step_as_long_as_the_search_range_is_a_link():
    """As by trackpy: points on whole pixels often move by just so much."""
    frames = np.array([[[0.0, 0.0], [50.0, 0.0]], [[3.0, 4.0], [50.0, 5.0]], [[3.0, 9.0], [46.0, 8.0]]])
    assert [ids.tolist() for ids in assoc.link(frames, 5.0).ids] == [[0, 1]] * 3
    assert len(set(np.concatenate(assoc.link(frames, 4.999).ids))) == 6


def test_nothing_to_link():
    assert assoc.link([], 1.0).ids == []
    assert [list(ids) for ids in assoc.link([[], [[1.0, 2.0]], []], 1.0).ids] == [[], [0], []]


@pytest.mark.parametrize(
    ("frames", "options", "words"),
    [
        ([[1.0, 2.0]], {}, "frames must be arrays of shape"),
        ([[[1.0, 2.0]], [[1.0]]], {}, "with the same D"),
        ([[[1.0, np.nan]]], {}, r"frames\[0\] must be finite"),
        ([[[1.0]]], {"search_range": 0}, "search_range must be a number above 0"),
        ([[[1.0]]], {"memory": 1.5}, "memory must be an integer"),
        (5, {}, "frames must be"),
    ],
)
def test_bad_input(frames, options, words):
    with pytest.raises(InvalidInputError, match=words):
        assoc.link(frames, **{"search_range": 1.0, **options})


def test_pairs_beyond_the_memory_are_refused(monkeypatch):
    monkeypatch.setattr("assoc._system.memory.available", lambda here=True: 1e7)
    with pytest.raises(LimitExceededError, match="pairs within search_range would take about"):
        assoc.link(np.zeros((3, 1000, 2)), 1.0)
