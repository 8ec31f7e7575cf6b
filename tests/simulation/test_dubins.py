"""Dubins paths: the printed lengths, a brute search, obstacles, and the scenario."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from assoc.errors import InfeasibleError, InvalidInputError, LimitExceededError
from assoc.simulation import simulate
from assoc.simulation.dubins.kernels import WORDS
from assoc.simulation.dubins.obstacles import around
from assoc.simulation.dubins.paths import Path, Pose, Segment, path, paths, shortest
from assoc.simulation.scenarios.dubins_uav import DubinsUavParameters, no_fly_zones
from tests.sizes import sample

FIRST, LAST = Pose(-500.0, 100.0, math.pi / 3), Pose(0.0, 200.0, 0.0)
poses = st.builds(Pose, st.floats(-3, 3), st.floats(-3, 3), st.floats(-7, 7))


def test_lengths_between_the_ends_of_path_1():
    lengths = {one.word: round(one.length, 3) for one in paths(FIRST, LAST, 100.0)}
    # the paper prints no length: these are ours, of its ends and radius; too far apart for three turns
    assert lengths == {"RSR": 521.13, "LSR": 1129.632, "RSL": 1149.393, "LSL": 1757.394}


def test_path_2_to_the_printed_digits():
    goal = Pose(0.0, 100 + 100 * math.tan(math.radians(15)), 0.0)
    straight = path(FIRST, goal, 100.0, "RSL").segments[1]
    assert (round(straight.start.x, 4), round(straight.start.y, 4)) == (-407.7151, 149.8384)
    assert (round(straight.end.x, 4), round(straight.end.y, 4)) == (-5.6824, 126.9565)


def flown(start: Pose, pieces, radius: float) -> tuple[float, float, float]:
    """Where turns and straights lead, in steps of a hundredth of a radius (midpoint rule)."""
    x, y, h = start.x, start.y, start.heading
    for curvature, length in pieces:
        n = max(int(length / radius * 400), 1)
        for _ in range(n):
            middle = h + 0.5 * curvature * length / n
            x, y = x + math.cos(middle) * length / n, y + math.sin(middle) * length / n
            h += curvature * length / n
    return x, y, h


@given(poses, poses, st.sampled_from(WORDS))
@settings(max_examples=150)
def test_every_word_leads_to_the_goal(start, goal, word):
    one = path(start, goal, 1.0, word)
    if one is None:
        return
    x, y, h = flown(start, [(s.curvature, s.length) for s in one.segments], 1.0)
    assert math.hypot(x - goal.x, y - goal.y) < 1e-3
    assert abs(math.remainder(h - goal.heading, 2 * math.pi)) < 1e-5
    assert all(s.length >= 0 for s in one.segments)
    assert [np.sign(s.curvature) for s in one.segments] == [{"L": 1, "S": 0, "R": -1}[c] for c in word]


@given(poses, poses)
@settings(max_examples=60)
def test_shortest_is_unchanged_by_symmetries_and_obeys_the_triangle(start, goal):
    length = shortest(start, goal, 1.0).length
    mirrored = shortest(Pose(start.x, -start.y, -start.heading), Pose(goal.x, -goal.y, -goal.heading), 1.0)
    assert mirrored.length == pytest.approx(length, abs=1e-6)
    back = shortest(Pose(goal.x, goal.y, goal.heading + math.pi), Pose(start.x, start.y, start.heading + math.pi), 1.0)
    assert back.length == pytest.approx(length, abs=1e-6)
    # a path may end short of its goal by a millionth of its scale, as its own check allows
    assert length >= math.hypot(goal.x - start.x, goal.y - start.y) - 1e-6
    one = shortest(start, goal, 1.0)
    halfway = one.at(0.5 * length)
    assert shortest(start, halfway, 1.0).length <= 0.5 * length + 1e-6


@pytest.mark.slow
def test_no_feasible_polyline_is_shorter():
    """A search over turns and straights in small steps cannot beat the formula."""
    start, goal = Pose(0, 0, 0), Pose(0.5, 1.5, 2.5)
    best = shortest(start, goal, 1.0).length
    rng = np.random.default_rng(0)
    for _ in range(20_000):
        lengths = rng.uniform(0, 3, 3)
        if lengths.sum() >= best - 0.05:
            continue
        x, y, h = 0.0, 0.0, 0.0
        for k, s in zip(rng.choice([-1.0, 0.0, 1.0], 3), lengths, strict=True):
            end = Segment(Pose(x, y, h), float(k), float(s)).end
            x, y, h = end.x, end.y, end.heading
        near = math.hypot(x - goal.x, y - goal.y) + abs(math.remainder(h - goal.heading, 2 * math.pi))
        assert near > 0.01


def test_sampling_at_constant_speed():
    one = shortest(FIRST, LAST, 100.0)
    times, points = one.sample(20.0, 0.5)
    assert times[-1] == pytest.approx(one.length / 20)
    steps = np.hypot(*np.diff(points[:, :2], axis=0).T)
    assert (steps[:-1] <= 10.0 + 1e-9).all() and (steps[:-1] > 9.99).all()
    np.testing.assert_allclose(points[-1, :2], [0, 200], atol=1e-6)
    with pytest.raises(InvalidInputError, match="speed must be"):
        one.sample(0.0, 0.5)


def check(one: Path, start: Pose, goal: Pose, radius: float, obstacles, margin: float = 0.0) -> None:
    assert one.clearance(obstacles) >= margin - 1e-6
    assert all(abs(s.curvature) <= 1 / radius * (1 + 1e-12) for s in one.segments)
    for a, b in zip(one.segments[:-1], one.segments[1:], strict=True):
        assert math.hypot(a.end.x - b.start.x, a.end.y - b.start.y) < 1e-6 * radius
        assert abs(math.remainder(a.end.heading - b.start.heading, 2 * math.pi)) < 1e-6
    first, last = one.segments[0].start, one.segments[-1].end
    assert math.hypot(first.x - start.x, first.y - start.y) < 1e-9
    assert math.hypot(last.x - goal.x, last.y - goal.y) < 1e-5 * radius
    assert abs(math.remainder(last.heading - goal.heading, 2 * math.pi)) < 1e-6
    # and by plain sampling
    points = one.sample(1.0, 0.01 * radius)[1]
    for x, y, r in obstacles:
        assert np.hypot(points[:, 0] - x, points[:, 1] - y).min() >= r + margin - 1e-6


def test_the_papers_obstacle():
    obstacle = [(-250.0, 150.0, 30.0)]
    assert shortest(FIRST, LAST, 100.0).clearance(obstacle) < 0
    one = around(FIRST, LAST, 100.0, obstacle)
    check(one, FIRST, LAST, 100.0, obstacle)
    assert one.length == pytest.approx(521.6, abs=0.05)
    assert one.length > shortest(FIRST, LAST, 100.0).length


@sample("seed", range(4), every=3)
def test_several_obstacles(seed):
    rng = np.random.default_rng(seed)
    start, goal = Pose(-8.0, 0.0, rng.uniform(-3, 3)), Pose(8.0, 0.0, rng.uniform(-3, 3))
    obstacles = [
        (float(x), float(y), float(r))
        for x, y, r in zip(rng.uniform(-5, 5, 5), rng.uniform(-3, 3, 5), rng.uniform(0.2, 2.0, 5), strict=True)
    ]
    one = around(start, goal, 1.0, obstacles, margin=0.1)
    check(one, start, goal, 1.0, obstacles, 0.1)
    # turned by a half circle about the middle it is the same problem
    turned = [(-x, -y, r) for x, y, r in obstacles]
    ends = Pose(8.0, 0.0, start.heading + math.pi), Pose(-8.0, 0.0, goal.heading + math.pi)
    again = around(*ends, 1.0, turned, margin=0.1)
    assert again.length == pytest.approx(one.length, rel=0.02)


def test_clear_refusals():
    wall = [(3 * math.cos(a), 3 * math.sin(a), 1.0) for a in np.arange(0, 2 * math.pi, 0.3)]
    with pytest.raises(InfeasibleError, match="turning radius 1 clears the 21 obstacles"):
        around(Pose(0, 0, 0), Pose(9, 0, 0), 1.0, wall, points=8)
    with pytest.raises(InvalidInputError, match="start lies within obstacle 1"):
        around(Pose(0, 0, 0), Pose(9, 0, 0), 1.0, [(5, 5, 1), (0.5, 0, 1)])
    with pytest.raises(InvalidInputError, match="radius must be"):
        around(Pose(0, 0, 0), Pose(9, 0, 0), 0.0, [])
    with pytest.raises(InvalidInputError, match=r"obstacles must have shape \(n, 3\), .* got \(3, 2\)"):
        around(Pose(0, 0, 0), Pose(9, 0, 0), 1.0, [(5, 5), (1, 5), (5, 1)])
    with pytest.raises(InvalidInputError, match="radii above 0"):
        around(Pose(0, 0, 0), Pose(9, 0, 0), 1.0, [(5, 0, -1)])
    with pytest.raises(InvalidInputError, match="pose"):
        Pose(float("nan"), 0, 0)
    with pytest.raises(InvalidInputError, match="word must be"):
        path(FIRST, LAST, 1.0, "SLS")
    with pytest.raises(LimitExceededError, match="touching points"):
        around(Pose(0, 0, 0), Pose(9, 0, 0), 1.0, [(5, 0, 1)] * 50, points=50)


def test_scenario():
    scene, again = simulate("dubins-uav", 3), simulate("dubins-uav", 3)
    assert all(np.array_equal(a, b) for s, t in zip(scene.measurements, again.measurements, strict=True)
               for a, b in zip(s, t, strict=True))  # fmt: skip
    p = DubinsUavParameters()
    zones = no_fly_zones(p, np.random.default_rng(3))
    places: dict[int, list] = {}
    for k in range(scene.num_scans):
        scan = scene.scan(k)
        for i, where in zip(scan.truth_ids, scan.truth_positions, strict=True):
            places.setdefault(int(i), []).append(where)
        for sensor in scene.sensors:
            assert sensor.in_view(sensor.measure(scan.truth_positions)).all()
    assert len(places) == 4
    for track in map(np.array, places.values()):
        for x, y, r in zones:
            assert np.hypot(track[:, 0] - x, track[:, 1] - y).min() >= r + p.margin - 1e-3
        steps = np.linalg.norm(np.diff(track, axis=0), axis=1)
        assert (steps <= 20 + 1e-9).all() and (steps > 19.9).all()
    with pytest.raises(InvalidInputError, match="width"):
        simulate("dubins-uav", width=100.0)
