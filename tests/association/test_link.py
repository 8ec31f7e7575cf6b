from itertools import pairwise

import numpy as np
import pandas as pd
import pytest
from scipy.optimize import Bounds, LinearConstraint, linear_sum_assignment, milp

import assoc
from assoc.errors import InvalidInputError

SKIP = 2.0


def cost_by_scipy(frames, reach, memory):
    """The least cost of all links of all frames, from a dense matrix of every point with every later one."""
    frame = np.repeat(np.arange(len(frames)), [len(points) for points in frames])
    points = np.concatenate(frames)
    gap = frame[None, :] - frame[:, None]
    square = ((points[:, None] - points) ** 2).sum(axis=2) / np.maximum(gap, 1)
    cost = square + (gap - 1) * SKIP - reach**2 - (SKIP if memory else 0.0)
    cost[(gap < 1) | (gap > 1 + memory) | (cost > 0) | (square > reach**2)] = 0.0
    return cost[linear_sum_assignment(cost)].sum()


@pytest.mark.parametrize(("memory", "dim", "seed"), [(0, 2, 1), (1, 3, 2), (2, 1, 3)])
def test_the_links_of_all_frames_cost_least(memory, dim, seed):
    rng = np.random.default_rng(seed)
    frames = [rng.uniform(0, 10, (rng.integers(0, 15), dim)) for _ in range(8)]
    ids, solution = assoc.link(frames, 3.0, memory=memory, skip=SKIP)
    assert solution.status == "optimal" and np.isclose(solution.cost, cost_by_scipy(frames, 3.0, memory))
    # the same sum from the particles alone
    found, last = 0.0, {}
    for k, (points, particles) in enumerate(zip(frames, ids, strict=True)):
        assert len(set(particles)) == len(points) == len(particles)
        for point, particle in zip(points, particles, strict=True):
            if particle in last:
                when, where = last[particle]
                assert k - when <= 1 + memory
                gap = k - when
                found += ((point - where) ** 2).sum() / gap + (gap - 1) * SKIP - 9.0 - (SKIP if memory else 0.0)
            last[particle] = k, point
    assert np.isclose(found, solution.cost) and list(last) == list(range(len(last)))


def walks(count, missing, false, seed, frames=40, step=1.0, velocity=0.0):
    """Random walks in a square, and the particle of each point, -1 for false ones."""
    rng = np.random.default_rng(seed)
    side = 8.0 * count**0.5
    places, speeds = rng.uniform(0, side, (count, 2)), rng.normal(0, velocity, (count, 2))
    points, truth = [], []
    for _ in range(frames):
        places = places + speeds + rng.normal(0, step, places.shape)
        seen, stray = (
            np.flatnonzero(rng.random(count) >= missing),
            rng.uniform(0, side, (rng.binomial(count, false), 2)),
        )
        points.append(np.concatenate([places[seen], stray]))
        truth.append(np.concatenate([seen, np.full(len(stray), -1)]))
    return points, truth


def links_of(ids):
    """Links as (frame, point, later frame, point); -1 is no particle."""
    last, found = {}, set()
    for k, row in enumerate(ids):
        for m, particle in enumerate(np.asarray(row).tolist()):
            if particle >= 0:
                if particle in last:
                    found.add((*last[particle], k, m))
                last[particle] = k, m
    return found


def recall_and_precision(ids, truth):
    found, true = links_of(ids), links_of(truth)
    return len(found & true) / len(true), len(found & true) / len(found)


@pytest.mark.parametrize("reach", [2.5, 4.0])
def test_memory_does_no_harm_where_nothing_is_missing(reach):
    points, truth = walks(150, 0.0, 0.0, 3)
    without, with_ = (recall_and_precision(assoc.link(points, reach, memory=m).ids, truth) for m in (0, 3))
    assert with_[0] > without[0] - 0.003 and with_[1] > without[1] - 0.003


def test_memory_finds_what_was_missing():
    points, truth = walks(150, 0.1, 0.05, 4)
    without, with_ = (recall_and_precision(assoc.link(points, 4.0, memory=m).ids, truth) for m in (0, 3))
    assert with_[0] > without[0] + 0.03 and with_[1] > without[1] - 0.02


def test_fast_particles_are_sought_where_they_lead():
    points, truth = walks(60, 0.02, 0.05, 5, step=0.3, velocity=3.0)
    plain, ahead = (
        recall_and_precision(assoc.link(points, 6.0, memory=1, predict=p).ids, truth) for p in (False, True)
    )
    assert min(ahead) > 0.94 and plain[0] < 0.9


def test_a_table_is_its_frames_whatever_its_order():
    points, _ = walks(20, 0.1, 0.0, 6, frames=10)
    points[4] = np.empty((0, 2))
    table = pd.DataFrame(np.concatenate(points), columns=["x", "y"])
    table["frame"] = np.repeat(np.arange(3, 13), [len(one) for one in points])
    expected = assoc.link(points, 4.0, memory=2)
    np.testing.assert_array_equal(expected.particle, np.concatenate(expected.ids))
    assert [one.tolist() for one in assoc.link(table, 4.0, memory=2).ids] == [one.tolist() for one in expected.ids]
    mixed = table.sample(frac=1.0, random_state=1).rename(columns={"x": "a", "y": "b", "frame": "t"})
    for one in (
        assoc.link(mixed, 4.0, memory=2, frame="t", columns=["a", "b"]),
        assoc.link(mixed.groupby("t"), 4.0, memory=2, columns=["a", "b"]),
    ):
        together = pd.DataFrame({"particle": one.particle, "then": expected.particle[mixed.index]})
        # the same particles, whatever their numbers
        assert (together.groupby("particle")["then"].nunique() == 1).all()
        assert (together.groupby("then")["particle"].nunique() == 1).all()


def cost_by_milp(frames, reach, divisions, merges):
    """The least cost of links, divisions and merges, each listed, start and end half of the squared range each."""
    half, index = 0.5 * reach**2, np.cumsum([0, *map(len, frames)])
    columns, costs = [], []
    for k, (one, other) in enumerate(pairwise(frames)):
        square = ((one[:, None] - other) ** 2).sum(axis=2)
        near = square <= reach**2
        for i, j in np.argwhere(near):
            columns.append(([index[k] + i], [index[k + 1] + j]))
            costs.append(square[i, j] - 2 * half)
            for other_j in np.flatnonzero(near[i, j + 1 :]) + j + 1:
                columns.append(([index[k] + i], [index[k + 1] + j, index[k + 1] + other_j]))
                costs.append(square[i, j] + square[i, other_j] + divisions - 3 * half)
            for other_i in np.flatnonzero(near[i + 1 :, j]) + i + 1:
                columns.append(([index[k] + i, index[k] + other_i], [index[k + 1] + j]))
                costs.append(square[i, j] + square[other_i, j] + merges - 3 * half)
    rows = np.zeros((2 * index[-1], len(columns)))
    for c, (sources, targets) in enumerate(columns):
        rows[sources, c] = 1
        rows[index[-1] + np.array(targets), c] = 1
    found = milp(np.array(costs), constraints=LinearConstraint(rows, ub=1), bounds=Bounds(0, 1),
                 integrality=np.ones(len(costs)), options={"mip_rel_gap": 1e-9})  # fmt: skip
    return found.fun


@pytest.mark.parametrize("seed", range(6))
def test_divisions_and_merges_cost_least(seed):
    rng = np.random.default_rng(seed)
    frames = [rng.uniform(0, 8, (rng.integers(3, 9), 2)) for _ in range(5)]
    links = assoc.link(frames, 3.0, divisions=1.0, merges=1.5)
    assert links.solution.status == "optimal"
    assert np.isclose(links.solution.cost, cost_by_milp(frames, 3.0, 1.0, 1.5))


def test_a_cell_that_divides_has_two_children():
    before = [np.array([[0.0, 0.0], [20.0, 0.0]])] * 3
    after = [np.array([[-1.0, 0.0], [1.0, 0.0], [20.0, 0.0]]) + [[-0.5 * k, 0], [0.5 * k, 0], [0, 0]] for k in range(3)]
    links = assoc.link(before + after, 3.0, divisions=2.0)
    assert [one.tolist() for one in links.ids] == [[0, 1]] * 3 + [[2, 3, 1]] * 3
    assert links.lineage.tolist() == [[0, 2], [0, 3]]
    together = assoc.link((before + after)[::-1], 3.0, merges=2.0)
    assert together.lineage.tolist() == [[0, 3], [1, 3]] and together.solution.status == "optimal"
    assert assoc.link(before + after, 3.0).lineage.shape == (0, 2)


def test_ends_may_be_dear_or_cheap():
    frames = [np.array([[0.0]]), np.array([[2.0]])]
    assert len(assoc.link(frames, 3.0, start=2.5, end=2.5).lineage) == 0
    assert assoc.link(frames, 3.0, start=2.5, end=2.5).ids[1].tolist() == [0]
    assert assoc.link(frames, 3.0, start=1.5, end=1.5).ids[1].tolist() == [1]


def test_ends_cost_what_links_say():
    """Beside a price of the range alone, that of trackpy, and one that makes all links that can be, as laptrack's."""
    found = {}
    for seed in range(4):
        frames, truth = walks(200, 0.1, 0.05, seed)
        for half in (None, 0.5 * 3.0**2, 1.05 * 3.0**2):
            ids = assoc.link(frames, 3.0, start=half, end=half).ids
            found.setdefault(half, []).append(recall_and_precision(ids, truth))
    (recall, precision), range_alone, all_links = (np.mean(rows, axis=0) for rows in found.values())
    assert recall > range_alone[0] and precision > all_links[1]
    # of a range as wide as this an end and a beginning are likelier than a step to its edge
    wide, as_range = assoc.link(frames, 6.0), assoc.link(frames, 6.0, start=18.0, end=18.0)
    np.testing.assert_allclose(wide.solution.cost, as_range.solution.cost, rtol=1e-8)


@pytest.mark.parametrize(("scale", "dim"), [(1e-150, 2), (1e11, 3), (1e-12, 400), (1.0, 400)])
def test_what_ends_cost_of_any_size(scale, dim):
    frames = [scale * (np.arange(3)[:, None] + np.full(dim, 0.01 * k)) for k in range(4)]
    ids = assoc.link(frames, scale * 0.5 * dim**0.5).ids
    assert [one.tolist() for one in ids] == [[0, 1, 2]] * 4


@pytest.mark.parametrize(
    ("frames", "options", "words"),
    [
        ([[1.0, 2.0]], {}, "frames must be arrays of shape"),
        ([[[1.0, 2.0]], [[1.0]]], {}, "with the same D"),
        ([[[1.0, np.nan]]], {}, r"frames\[0\] must be finite"),
        ([[[1.0]]], {"search_range": 0}, "search_range must be a number above 0"),
        ([[[1.0]]], {"velocity": [1.0, 2.0]}, r"velocity must have shape \(1,\)"),
        (pd.DataFrame({"x": [1.0]}), {}, "the table has no column 'frame'"),
        (pd.DataFrame({"frame": [1]}), {}, "no columns x, y, z"),
        (pd.DataFrame({"frame": [1.5], "x": [1.0]}), {}, "must hold whole numbers"),
        (pd.DataFrame({"frame": [0, 10**12], "x": [1.0, 2.0]}), {}, "at most 1e7 count"),
    ],
)
def test_bad_input(frames, options, words):
    with pytest.raises(InvalidInputError, match=words):
        assoc.link(frames, **{"search_range": 1.0, **options})
