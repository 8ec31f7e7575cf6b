"""Pairs of measurements in a gate: none missed, and a search whose effort grows with the measurements."""

from functools import partial

import numpy as np
import pytest

from assoc.costs import pairs
from assoc.costs.arrays import scan_arrays, sensor_arrays
from assoc.costs.estimation import fit
from assoc.costs.gating import make_gates
from assoc.simulation import simulate
from tests.costs.reference import make_scene
from tests.sizes import sample


def _arrays(targets, **options):
    scene = simulate("crowd", 5, targets=targets, scans=1, constant_density=True, **options)
    sensors = sensor_arrays(scene)
    gates = make_gates(sensors, 0.999)
    return sensors, scan_arrays(sensors, scene.scan(0), float(gates.pair.max()), 1.0)[0], gates


@pytest.mark.parametrize("options", [{}, {"sensor": "radar"}, {"noise": 700.0}, {"width": 300.0}])
def test_strips_miss_no_pair(options):
    sensors, scan, gates = _arrays(300, **options)
    found = np.concatenate([block for block, _ in pairs.coarse_pairs(sensors, scan, gates.pair)])
    every = pairs._near_all(sensors, scan, gates.pair, 0, len(scan.z))
    assert len(scan.z) ** 2 > pairs._BRUTE and len(every) > 100
    assert {tuple(pair) for pair in found.tolist()} >= {tuple(pair) for pair in every.tolist()}


def test_candidates_grow_with_the_measurements():
    counts = []
    for targets in (500, 2000, 8000):
        sensors, scan, gates = _arrays(targets)
        rows, others = (np.arange(*scan.start[s : s + 2]) for s in range(2))
        windows = pairs._windows(sensors, scan, rows, others, float(gates.pair[0, 1]))
        counts.append((windows.last - windows.first).sum() / targets)
    # windows along one axis: 2 and 4 times as many for each target
    assert counts[2] < 1.3 * counts[1] < 1.6 * counts[0]


@sample("probability", [0.9, 0.999, 1.0], every=3)
@pytest.mark.parametrize(
    "kinds", ["RR", "RRR", "PPP", "ppp", "bbb", "rrr", "Rrb", "PRrb", "bbr", "bbbb", "rp", "Rb", "hhr", "hb"]
)
def test_a_search_in_windows_finds_what_trying_all_finds(kinds, probability):
    for seed in range(4):
        scene, _ = make_scene(kinds, seed)
        sensors = sensor_arrays(scene)
        gates = make_gates(sensors, probability)
        scan = scan_arrays(sensors, scene.scan(0), float(gates.pair.max()), 1.0)[0]
        # so few are all tried
        near = pairs.coarse_pairs(sensors, scan, gates.pair)
        every = pairs.compatible_pairs(scan, partial(fit, sensors, scan), near, gates, number=0, max_tuples=10**6)
        found = np.concatenate([block for block, _ in pairs.coarse_pairs(sensors, scan, gates.pair, brute=-1)])
        expected = set(zip(every.first.tolist(), every.second.tolist(), strict=True))
        assert expected and expected <= {tuple(pair) for pair in found.tolist()}
