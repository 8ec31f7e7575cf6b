"""The experiments with trackers, at a small size."""

import numpy as np
import pytest

from assoc.tracking import JointProbabilisticTracker, NearestNeighbourTracker, TrackOrientedMHT
from experiments.common.claims import load_json
from experiments.trackers import (
    as_they_are,
    benchmark,
    close_targets,
    judging,
    plane,
)
from experiments.trackers.plane import in_plane


def test_stone_soup_and_ours_on_the_same_detections():
    pytest.importorskip("stonesoup")
    one = plane.simulate(3, 0.2, 4, 1)
    from experiments.trackers import stone_soup

    results = {
        "mfa": benchmark.judged(stone_soup.multi_frame(one, 3, 0.999), one, 60.0),
        "gnn": benchmark.judged(stone_soup.nearest(one, 0.999), one, 60.0),
        "mht": benchmark.judged(in_plane(TrackOrientedMHT, one, depth=3), one, 60.0),
        "nearest": benchmark.judged(in_plane(NearestNeighbourTracker, one), one, 60.0),
        "jpda": benchmark.judged(stone_soup.probabilistic(one, 0.999), one, 60.0),
        "joint": benchmark.judged(in_plane(JointProbabilisticTracker, one), one, 60.0),
    }
    for result in results.values():
        assert len(result.gospa) == 4 and (result.gospa < 60).all() and (result.seconds > 0).all()
    # few false alarms, targets apart: all say the same
    np.testing.assert_allclose(results["mht"].gospa, results["mfa"].gospa, atol=4.0)
    np.testing.assert_allclose(results["joint"].gospa, results["jpda"].gospa, atol=4.0)
    ratio, (difference, interval), scans = benchmark._paired([results["mht"]] * 2, [results["mfa"]] * 2)
    assert ratio > 0 and scans == 8 and interval is not None and interval[0] <= difference <= interval[1]


def test_the_labelled_filter_on_the_same_detections():
    pytest.importorskip(plane.PACKAGE)
    one = plane.simulate(3, 0.2, 4, 1)
    theirs = benchmark.judged(plane.labelled(one), one, 60.0)
    ours = benchmark.judged(in_plane(JointProbabilisticTracker, one), one, 60.0)
    assert len(theirs.gospa) == 4 and (theirs.seconds > 0).all()
    np.testing.assert_allclose(theirs.gospa, ours.gospa, atol=4.0)


def test_close_targets_and_the_oracle():
    scene = close_targets.simulate(close_targets.SETTINGS["formations"], 100, 6)
    oracle, mht = (judging.judge(name, scene) for name in ("oracle", "mht"))
    assert oracle.switches == 0 and mht.switches <= 2
    assert mht.distances.mean() == pytest.approx(oracle.distances.mean(), rel=0.3)
    assert len(mht.distances) == 6 and mht.milliseconds > 0 and 0 < mht.ospa2 < judging.CUTOFF
    claims = {claim.quantity: claim for claim in judging.claims_of("formations", "mht", [mht, oracle])}
    low, high = claims["formations, mht: GOSPA"].interval
    assert low < mht.distances.mean() < high and low < oracle.distances.mean() < high
    assert claims["formations, mht: switches"].ours == mht.switches / 2


@pytest.mark.parametrize("row", as_they_are.ROWS)
def test_rows_of_sensors_as_they_are(row):
    """Each row has its targets, with the source of each measurement."""
    case = as_they_are.ROWS[row](3)
    for scene in (case.declared, case.known or case.declared):
        assert scene.num_scans >= 10 and len(np.unique(np.concatenate(scene.truth.target_ids))) >= 2
        assert sum(int((one >= 0).sum()) for scan in scene.truth.sources for one in scan) > 100


@pytest.mark.slow
@pytest.mark.parametrize("one", [benchmark], ids=lambda one: one.__name__)
def test_other_experiments_as_programs(one, tmp_path, capsys):
    if one is benchmark:
        pytest.importorskip("stonesoup")
    assert one.program(["--quick", "--json", str(tmp_path / "a.json")]) == 0
    claims = load_json(tmp_path / "a.json")
    assert any(claim.quantity.startswith("goal: ") and claim.holds is not None for claim in claims)
    # with a number in the column of the papers a page would name a table of a paper for it
    assert all(claim.paper is None for claim in claims)
    capsys.readouterr()
