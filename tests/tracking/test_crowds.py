"""First scans of crowds: tracks of one scan have any usual speed, and many measurements in their gates.

What a step does is counted, not timed.
"""

import pytest

from assoc import simulation
from assoc.costs.tracks import tuples
from assoc.filters import InteractingMultipleModel
from assoc.tracking import TRACKERS


@pytest.fixture(scope="module")
def crowd():
    return simulation.simulate(
        "crowd", 2, targets=60, scans=2, interval=4.0, width=15_000.0, constant_density=False, detection_probability=0.9
    )


@pytest.fixture
def counted(monkeypatch):
    """Pairs of tracks and measurements in gates, and states corrected."""
    count = {"pairs": 0, "corrected": 0}

    def update(self, state, measured, sensor, known=InteractingMultipleModel.update):
        count["corrected"] += len(state)
        return known(self, state, measured, sensor)

    def gated(*arguments, known=tuples._gated):
        found = known(*arguments)
        count["pairs"] += len(found.track)
        return found

    monkeypatch.setattr(InteractingMultipleModel, "update", update)
    monkeypatch.setattr(tuples, "_gated", gated)
    return count


@pytest.mark.parametrize(("name", "share"), [("mht", 0.8), ("multi-sensor", 0.5), ("nearest-neighbour", 0.3)])
def test_states_are_corrected_for_what_is_kept(name, share, crowd, counted):
    tracker = TRACKERS[name].for_scene(crowd)
    for k in range(2):
        tracker.step(crowd.times[k], crowd.measurements[k])
    assert counted["pairs"] > 500
    assert counted["corrected"] < share * counted["pairs"], counted
