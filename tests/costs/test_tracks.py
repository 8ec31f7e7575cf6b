import math

import numpy as np
import pytest

from assoc.costs.tracks import gating
from assoc.costs.tracks.scores import log_birth, sequential_threshold
from assoc.filters.base import Expected


@pytest.mark.parametrize("angular", [(False, False, False), (False, True, False), (True, True, True)])
@pytest.mark.parametrize("seed", range(3))
def test_no_pair_within_the_gate_is_left_out(angular, seed):
    rng = np.random.default_rng(seed)
    tracks, found, gate = 120, 150, 16.0
    h = np.stack(
        [rng.uniform(0, 1000, tracks), rng.uniform(-math.pi, math.pi, tracks), rng.normal(0, 1, tracks)], axis=1
    )
    if angular[0]:
        h[:, 0] = rng.uniform(-math.pi, math.pi, tracks)
    z = np.stack([rng.uniform(0, 1000, found), rng.uniform(-math.pi, math.pi, found), rng.normal(0, 1, found)], axis=1)
    if angular[0]:
        z[:, 0] = rng.uniform(-math.pi, math.pi, found)
    root = rng.normal(0, 1, (tracks, 3, 3)) * np.array([0.05 if angular[0] else 20.0, 0.05, 0.1])[:, None]
    S = root @ root.transpose(0, 2, 1)
    v = z[None] - h[:, None]
    turning = np.array(angular)
    v[..., turning] -= 2 * math.pi * np.round(v[..., turning] / (2 * math.pi))
    square = np.einsum("bmi,bij,bmj->bm", v, np.linalg.inv(S), v)
    wanted = set(zip(*np.nonzero(square <= gate), strict=True))
    assert wanted
    reach = np.sqrt(gate * np.einsum("bii->bi", S)) * (1 + 1e-9)
    boxed = set(zip(*np.nonzero((np.abs(v) <= reach[:, None]).all(axis=2)), strict=True))
    rows, columns = gating.near_pairs(Expected(h, S), z, tuple(2 * math.pi * turning), gate)
    assert set(zip(rows, columns, strict=True)) == boxed >= wanted
    assert (np.diff(rows * 1000 + columns) > 0).all()
    # the box is not everything
    assert len(boxed) < 0.3 * tracks * found
    # partial tuples of the tracks in reverse, whose gates are half as wide
    track, narrow = np.arange(tracks)[::-1].copy(), Expected(h[::-1].copy(), S[::-1] / 4.0)
    near = gating.Near(np.searchsorted(rows, np.arange(tracks + 1)), columns)
    half = {(t, k) for t, k in boxed if (np.abs(v[t, k]) <= reach[t] / 2.0).all()}
    both = gating.near_both(narrow, track, near, z, tuple(2 * math.pi * turning), gate, 10**6)
    assert list(zip(*both, strict=True)) == sorted((tracks - 1 - t, k) for t, k in half)
    assert gating.near_both(narrow, track, near, z, tuple(2 * math.pi * turning), gate, 2)[0].size == min(len(half), 3)


CUBE = np.array([[0.0, 1e3]] * 3)


def test_birth_integrated_over_a_linear_position():
    rng = np.random.default_rng(0)
    root = rng.normal(0, 5, (3, 3))
    P = root @ root.T + np.eye(3)
    # the integral of exp(-x' P^-1 x / 2) over space, times birth rate / volume
    found = log_birth(P[None], CUBE, 0.2)[0]
    assert found == pytest.approx(0.5 * np.linalg.slogdet(2 * math.pi * P)[1] + math.log(0.2 / 1e9))
    assert log_birth(1e30 * P[None], CUBE, 0.2)[0] == pytest.approx(math.log(0.2))
    # a region of one height: the same in the plane
    flat = np.array([[0.0, 1e3], [-2e3, 0.0], [500.0, 500.0]])
    found = log_birth(P[None], flat, 0.2)[0]
    assert found == pytest.approx(0.5 * np.linalg.slogdet(2 * math.pi * P[:2, :2])[1] + math.log(0.2 / 2e6))
    assert log_birth(P[None], np.zeros((3, 2)), 0.2)[0] == pytest.approx(math.log(0.2))
    # a height that nothing measures, in a region lower than its prior: births are no denser in the plane
    low = np.array([[-1.0, 1.0], [-1.0, 1.0], [-0.5, 0.5]]) * 1000.0 ** np.array([[1], [1], [0]])
    tall = np.diag([9.0, 4.0, 1e4])
    expected = math.log(0.2 * 2.0 * math.pi * 6.0 / 4e6)
    assert log_birth(tall[None], low, 0.2)[0] == pytest.approx(expected)


def test_walds_threshold():
    assert sequential_threshold(1e-6, 0.5) == pytest.approx(math.log(0.5e6))
