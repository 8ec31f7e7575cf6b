"""The rotating radar reports what an antenna can see, in the steps and with the losses that it promises."""

import math

import numpy as np
import pytest

from assoc.errors import InvalidInputError
from assoc.recordings import GARBLED_CODES
from assoc.simulation import simulate_recording

NMI = 1852.0


@pytest.fixture(scope="module")
def several():
    return [simulate_recording("rotating-radar", seed) for seed in range(8)]


def test_it_is_scenario_s1(several):
    turns = 1130 / 9.5
    looks_, hits, lost, false, wrong = (0.0, 0.0, 0.0, 0.0, 0.0)
    for one in several:
        recording, real = one.recording, one.recording.sources >= 0
        assert len(np.unique(one.truth.ids)) == 14
        assert recording.times.max() <= 1130
        ranges, bearings = recording.ranges / NMI, np.degrees(recording.bearings) / (1440 / 4095)
        assert np.abs(ranges - ranges.round()).max() < 1e-9
        assert ranges.max() <= 255
        assert np.abs(bearings - bearings.round()).max() < 1e-6
        looks_, hits = looks_ + len(one.truth), hits + real.sum()
        lost += (~recording.decoded & real).sum()
        false += (~real).sum()
        wrong += np.isin(np.round(recording.altitudes[real] / 30.48), GARBLED_CODES).sum()
        codes = [np.unique(recording.identities[(recording.sources == k) & recording.decoded]) for k in range(14)]
        assert all(len(code) <= 1 for code in codes)
        assert len({int(code[0]) for code in codes if len(code)}) == sum(len(code) for code in codes)
    # four standard deviations
    assert hits / looks_ == pytest.approx(0.78, abs=4 * math.sqrt(0.78 * 0.22 / looks_))
    assert lost / hits == pytest.approx(0.05, abs=4 * math.sqrt(0.05 * 0.95 / hits))
    assert wrong / hits == pytest.approx(0.10, abs=4 * math.sqrt(0.1 * 0.9 / hits))
    assert false / (8 * turns) == pytest.approx(2.5, abs=4 * math.sqrt(2.5 / (8 * turns)))


def test_the_antenna_is_where_the_plot_is(several):
    """Time and bearing agree with an antenna that turns clockwise, up to half a step of the bearing."""
    for one in several:
        recording = one.recording
        off = recording.times / 9.5 - recording.bearings / (2 * math.pi)
        off -= np.round(off)
        assert np.abs(off).max() <= 0.5 / 1023 + 1e-9
        truth = one.truth
        bearing = np.arctan2(truth.positions[:, 0], truth.positions[:, 1]) / (2 * math.pi)
        off = truth.times / 9.5 - bearing
        assert np.abs(off - np.round(off)).max() < 1e-5


def test_plots_lie_where_the_aircraft_are(several):
    for one in several:
        recording, truth = one.recording, one.truth
        row = {(int(i), round(float(t), 6)): x for i, t, x in zip(truth.ids, truth.times, truth.positions, strict=True)}
        for k in np.flatnonzero(recording.sources >= 0)[::7]:
            place = row[int(recording.sources[k]), round(float(recording.times[k]), 6)]
            assert abs(np.linalg.norm(place) - recording.ranges[k]) <= 0.5 * NMI + 1e-6
            turn = math.atan2(place[1], place[0]) - recording.azimuths[k]
            assert abs(math.remainder(turn, 2 * math.pi)) <= math.radians(0.5 * 1440 / 4095) + 1e-9


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"traffic": "jam"}, "traffic: expected one of random, crossing, parallel, head-on, got 'jam'"),
        ({"traffic": "crossing", "aircraft": 14}, "aircraft: is of random traffic; crossing is a pair"),
        ({"identity_loss": 1.0}, "identity_loss: expected a share"),
        ({"separation": 5.0}, "separation: is of a pair"),
        ({"duration": 1e300}, "duration: expected at most 1e7 rotations"),
        ({"speed": 3.0}, "speed: no parameter of scenario 'rotating-radar'"),
    ],
)
def test_bad_parameters(values, message):
    with pytest.raises(InvalidInputError, match=message):
        simulate_recording("rotating-radar", **values)
