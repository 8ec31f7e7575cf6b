"""First scans of crowds: tracks of one scan have any usual speed, and many measurements in their gates.

What a step does is counted, not timed.
"""

import numpy as np
import pytest
from scipy.stats import chi2

from assoc import simulation
from assoc.costs.tracks import gating
from assoc.filters import InteractingMultipleModel
from assoc.tracking import TRACKERS


@pytest.fixture(scope="module")
def crowd():
    return simulation.simulate(
        "crowd", 2, targets=60, scans=2, interval=4.0, width=15_000.0, constant_density=False, detection_probability=0.9
    )


def corrected(name, scene, monkeypatch):
    """States that a tracker corrects in two scans, positions that it corrects alone, and pairs in gates.

    Pairs are those of its tracks and measurements in the second scan. A mixture of a class of its own would correct in
    another way: so the known class counts.
    """
    counts = {3: 0, 6: 0}

    def update(self, state, measured, sensor, known=InteractingMultipleModel.update):
        counts[state.means.shape[2]] += len(state)
        return known(self, state, measured, sensor)

    tracker = TRACKERS[name].for_scene(scene)
    tracker.step(scene.times[0], scene.measurements[0])
    settings = tracker.settings
    predicted = settings.filter.predict(tracker.state.tracks.states, scene.times[1] - scene.times[0])
    gates = [
        settings.filter.distances(predicted, z, sensor) <= chi2.ppf(settings.gate_probability, sensor.dim)
        for sensor, z in zip(scene.sensors, scene.measurements[1], strict=True)
    ]
    monkeypatch.setattr(InteractingMultipleModel, "update", update)
    tracker.step(scene.times[1], scene.measurements[1])
    return counts[6], counts[3], sum(int(gate.sum()) for gate in gates)


@pytest.mark.parametrize(("name", "share"), [("mht", 0.5), ("nearest-neighbour", 0.3)])
def test_states_are_corrected_for_what_is_kept(name, share, crowd, monkeypatch):
    states, positions, pairs = corrected(name, crowd, monkeypatch)
    assert pairs > 500 and 0 < states < share * pairs and positions < 0.6 * pairs, (states, positions, pairs)


def test_the_multi_sensor_tracker_corrects_states_for_the_chosen_tuples_alone(crowd, monkeypatch):
    states, _, _ = corrected("multi-sensor", crowd, monkeypatch)
    assert 100 < states <= sum(len(z) for z in crowd.measurements[1])


@pytest.mark.parametrize("seed", range(8))
def test_pairs_near_each_other_are_those_of_all(seed):
    """Gates of any width, angles among the components, tracks far outside."""
    rng = np.random.default_rng(seed)
    turning = np.array([seed % 4 == 1, seed % 4 > 1, seed % 4 == 3])
    h, z = rng.uniform(-3.0, 3.0, (40, 3)) * rng.choice([0.1, 1.0, 1.5]), rng.uniform(-3.0, 3.0, (60, 3))
    widths = rng.choice([1e-3, 0.3, 2.0, 1e6], (40, 3))
    covariance = widths[:, :, None] ** 2 * np.eye(3)
    off = np.abs(z - h[:, None])
    off = np.where(turning, np.minimum(off % (2 * np.pi), 2 * np.pi - off % (2 * np.pi)), off)
    near = np.argwhere((off <= 3.0 * widths[:, None]).all(axis=2))
    tracks, found, _ = gating._sweep(h, covariance, z, np.where(turning, 2 * np.pi, 0.0), 9.0, 10**6)
    np.testing.assert_array_equal(np.column_stack([tracks, found]), near)


def test_few_pairs_are_looked_at_however_wide_the_area():
    """Windows along one axis hold a share of all measurements that falls with the side, not with the area."""
    looked = []
    for count in (1_000, 16_000):
        rng = np.random.default_rng(count)
        places = rng.uniform(0.0, np.sqrt(count), (2, count, 2))
        covariance = np.broadcast_to(np.eye(2), (count, 2, 2)).copy()
        tracks, _, seen = gating._sweep(*places[:1], covariance, places[1], np.zeros(2, dtype=np.bool_), 4.0, 10**7)
        assert len(tracks) > 10 * count
        looked.append(seen / len(tracks))
    assert looked[1] < 1.2 * looked[0] < 3.0
