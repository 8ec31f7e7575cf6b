"""Identity switches, fragmentation, CT/MT/IT and association accuracy on cases small enough to count by hand."""

import itertools
import math
from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import assoc
from assoc.errors import InvalidInputError
from assoc.metrics import (
    Trajectories,
    ct_mt_it,
    identity,
    identity_after_each,
    label_switches,
    plot_identity_switches,
    summarise,
    track_rmse,
    tracks_of_one_identity,
)
from assoc.metrics.ct_mt_it import RatesSoFar
from assoc.metrics.plot_identity import IdentitiesSoFar


def along_lines(spans):
    """Trajectories from (id, line, first, last): on line y = 1000 * line, at x = 100 t."""
    rows = [(t, one, (100.0 * t, 1000.0 * line, 0.0)) for one, line, first, last in spans for t in range(first, last)]
    return Trajectories([float(t) for t, _, _ in rows], [i for _, i, _ in rows], [p for _, _, p in rows])


def test_a_switch_a_gap_and_a_false_track():
    truth = along_lines([(0, 0, 0, 10), (1, 1, 0, 10)])
    # target 0: track 5, lost at 4 and 5, found again as the same; target 1: track 6, then track 7
    tracks = along_lines([(5, 0, 0, 4), (5, 0, 6, 10), (6, 1, 0, 5), (7, 1, 5, 10), (8, 5, 2, 4)])
    found = identity(truth, tracks, 300.0)
    assert (found.switches, found.fragmentations) == (1, 1)
    assert (found.matches, found.missed, found.false) == (18, 2, 2)
    assert found.mota == pytest.approx(1 - 5 / 20)
    assert found.motp == 0.0
    # one to one throughout: 8 instants of target 0 with track 5, 5 of target 1 with either
    assert found.idf1 == pytest.approx(2 * 13 / (20 + 20))
    assert (found.mostly_tracked, found.mostly_lost, found.targets) == (2, 0, 2)


@settings(max_examples=40)
@given(st.integers(0, 10_000))
def test_pairs_are_as_many_as_brute_force_finds(seed):
    rng = np.random.default_rng(seed)
    m, n = rng.integers(1, 5, 2)
    x, y = rng.uniform(0, 10, (m, 2)), rng.uniform(0, 10, (n, 2))
    found = identity(Trajectories(np.zeros(m), np.arange(m), x), Trajectories(np.zeros(n), np.arange(n), y), 3.0)
    best = (0, 0.0)
    for size in range(min(m, n) + 1):
        for rows in itertools.combinations(range(m), size):
            for columns in itertools.permutations(range(n), size):
                far = [math.dist(x[i], y[j]) for i, j in zip(rows, columns, strict=True)]
                if all(one <= 3.0 for one in far):
                    best = max(best, (size, -sum(far)))
    assert found.matches == best[0]
    if found.matches:
        assert found.motp == pytest.approx(-best[1] / best[0])


def test_identity_switches_of_plots():
    every = np.ones(40, dtype=bool)
    sources = np.tile([0, 1], 20)
    true = sources + 5
    assert plot_identity_switches(sources, true, every) == 0
    # one plot each gone astray is no switch
    stray = true.copy()
    stray[20:22] = [6, 5]
    assert plot_identity_switches(sources, stray, every) == 0
    assert label_switches(sources, stray) == 4
    # a swap gives two, a track begun anew one, also after a pause
    swapped = np.where(np.arange(40) < 20, true, 6 - sources)
    assert plot_identity_switches(sources, swapped, every) == 2
    anew = np.where((np.arange(40) >= 24) & (sources == 0), 9, true)
    anew[16:24] = -1
    assert plot_identity_switches(sources, anew, every) == 1
    # what is not confirmed does not count
    assert plot_identity_switches(sources, swapped, np.arange(40) < 20) == 0
    assert identity_after_each([-1, 0, 1, 1, -1, 1], [3, 3, 3, 3, -1, 4]).tolist() == [-1, 0, 1, 1, -1, 1]
    with pytest.raises(InvalidInputError, match="one shape"):
        plot_identity_switches(sources, true, every[:3])
    for wrong in ([1], [[1, 2]]):
        with pytest.raises(InvalidInputError, match="have one shape"):
            identity_after_each([1, 2], wrong)


def test_ct_mt_it_against_a_plain_reading():
    """Written once more, from the words of the definition, without sharing a line."""
    rng = np.random.default_rng(2)
    for _ in range(20):
        n = 80
        windows = np.sort(rng.integers(0, 9, n))
        sources, tracks = rng.integers(-1, 3, n), rng.integers(-1, 4, n)
        confirmed = rng.random(n) < 0.7
        history: list[list[int]] = []
        expected: dict[int, list[list[bool]]] = {}
        for k in range(n):
            history.append([int(sources[k]), int(tracks[k])])
            cell = expected.setdefault(int(windows[k]), [[], [], []])
            good = maintained = False
            if tracks[k] >= 0:
                last = [s for s, t in history if t == tracks[k]][-6:]
                votes = Counter(s for s in last if s >= 0).most_common()
                leaders = {s for s, count in votes if count == votes[0][1]}
                latest = next((s for s in reversed(last) if s in leaders), None)
                good = bool(confirmed[k]) and sources[k] >= 0 and latest == sources[k]
                own = [t for s, t in history[:-1] if s == sources[k]]
                maintained = bool(confirmed[k]) and sources[k] >= 0 and bool(own) and own[-1] == tracks[k]
                cell[2].append(not good)
            if sources[k] >= 0:
                cell[0].append(good)
                cell[1].append(maintained)
        found = ct_mt_it(windows, sources, tracks, confirmed)
        for axis, mean in enumerate((found.ct, found.mt, found.it)):
            rates = [np.mean(cell[axis]) for cell in expected.values() if cell[axis]]
            assert mean == pytest.approx(100 * np.mean(rates))


def test_plots_in_parts_count_as_all_at_once():
    rng, n = np.random.default_rng(5), 400
    windows, sources = np.arange(n) // 10, rng.integers(-1, 6, n)
    # each track lives for 80 plots
    tracks = np.where(rng.random(n) < 0.2, -1, 3 * (np.arange(n) // 80) + rng.integers(0, 3, n))
    confirmed = rng.random(n) < 0.7
    rates, kept = RatesSoFar(), IdentitiesSoFar()
    for begin in range(0, n, 20):
        rows = slice(begin, begin + 20)
        rates.add(windows[rows], sources[rows], tracks[rows], confirmed[rows])
        kept.add(sources[rows], tracks[rows], confirmed[rows])
        living = {*tracks[begin + 20 :].tolist()}
        rates.keep(living)
        kept.keep(living)
    whole = ct_mt_it(windows, sources, tracks, confirmed)
    np.testing.assert_array_equal(rates.result().per_window, whole.per_window)
    assert kept.result() == tracks_of_one_identity(sources, tracks, confirmed)


def test_rmse():
    truth = along_lines([(0, 0, 0, 4), (1, 1, 0, 4)])
    tracks = Trajectories(truth.times, truth.ids + 3, truth.positions + [0, 30.0, 0])
    overall, by_target = track_rmse(truth, tracks, 100.0)
    assert overall == pytest.approx(30.0)
    assert by_target == pytest.approx({0: 30.0, 1: 30.0})
    # one instant, whose stamps rounding has told apart
    truth = Trajectories([0.1 + 0.2, 0.3], [1, 2], [[0.0, 0.0, 0.0], [50.0, 0.0, 0.0]])
    tracks = Trajectories([0.3, 0.3], [5, 6], [[0.0, 3.0, 0.0], [50.0, 4.0, 0.0]])
    assert track_rmse(truth, tracks, 10.0)[1] == pytest.approx({1: 3.0, 2: 4.0})


def test_the_truth_of_a_scene():
    scene = assoc.Scene(
        sensors=_sensors(),
        times=[0.0, 1.0],
        measurements=[[np.zeros((0, 3))]] * 2,
        truth=_truth(),
    )
    truth = Trajectories.from_scene(scene)
    assert truth.times.tolist() == [0.0, 1.0, 1.0]
    assert truth.ids.tolist() == [4, 2, 4]
    assert summarise(truth, truth, 10.0).gospa == 0.0
    with pytest.raises(InvalidInputError, match="no truth"):
        Trajectories.from_scene(assoc.Scene(_sensors(), [0.0], [[np.zeros((0, 3))]]))


def test_targets_in_several_scans_of_one_time_count_once():
    """Sensors may report one after the other at one time; the last scan of an instant says where a target is."""
    from assoc.scene import Truth

    ids = [np.array([1, 2]), np.array([2, 1]), np.array([1])]
    truth = Truth(ids, [np.zeros((2, 3)), np.ones((2, 3)), np.zeros((1, 3))])
    scene = assoc.Scene(_sensors(), [5.0, 5.0 + 1e-9, 6.0], [[np.zeros((0, 3))]] * 3, truth=truth)
    found = Trajectories.from_scene(scene)
    assert found.ids.tolist() == [1, 2, 1]
    assert found.positions.tolist() == [[1.0] * 3, [1.0] * 3, [0.0] * 3]


def _sensors():
    from assoc.sensors import PositionSensor

    return [PositionSensor(position=np.zeros(3), noise=np.ones(3), field_of_view=[[-9, 9]] * 3)]


def _truth():
    from assoc.scene import Truth

    return Truth([np.array([4]), np.array([4, 2])], [np.zeros((1, 3)), np.ones((2, 3))])
