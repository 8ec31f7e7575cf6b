"""The experiments with trackers, at a small size."""

import numpy as np
import pytest

from assoc import simulation
from assoc.tracking import JointProbabilisticTracker, NearestNeighbourTracker, TrackOrientedMHT
from experiments.common.claims import Claim, load_json, save_json
from experiments.pages import tables as pages
from experiments.trackers import (
    as_they_are,
    asynchronous,
    bearings,
    benchmark,
    biases,
    close_targets,
    comparison,
    judging,
    plane,
)
from experiments.trackers.plane import in_plane


@pytest.mark.slow
def test_comparison_as_a_program(tmp_path, capsys):
    names = ("oracle", "multi-sensor", "static", "mht", "nearest-neighbour")
    assert comparison.program(["--quick", "--json", str(tmp_path / "a.json"), "--only", *names]) == 0
    by_name = {claim.quantity: claim for claim in load_json(tmp_path / "a.json")}
    assert by_name["three radars, multi-sensor: GOSPA"].ours < 300
    assert by_name["three radars, multi-sensor: switches"].ours == 0
    assert "switches" in capsys.readouterr().out


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


def test_a_peer_stops_when_its_time_is_over():
    one = plane.simulate(3, 0.2, 5, 1)
    assert len(benchmark.judged(iter([(0.1, np.zeros((0, 2)))] * 5), one, 0.0).seconds) == 1


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
    case = as_they_are.ROWS[row].make(3)
    for scene in (case.declared, case.known or case.declared):
        assert scene.num_scans >= 10 and len(np.unique(np.concatenate(scene.truth.target_ids))) >= 2
        assert sum(int((one >= 0).sum()) for scan in scene.truth.sources for one in scan) > 100


def test_the_table_of_sensors_as_they_are(capsys):
    arguments = ["--seeds", "1", "--only", "8 g", "ships, radar and AIS", "--trackers", "oracle"]
    assert as_they_are.program(arguments) == 0
    shown = [line for line in capsys.readouterr().out.splitlines() if "oracle  " in line]
    assert [line.split("oracle")[0] for line in shown] == ["8 g, ", "ships, radar and AIS, "]
    with pytest.raises(SystemExit):
        as_they_are.program(["--only", "nothing"])


def test_goals_hold_by_their_intervals():
    values = np.array([0.9, 1.0, 1.1])
    assert judging.goal("x", "", values, 1.3).holds is True
    # the mean is below, a part of the interval is not
    assert judging.goal("x", "", values, 1.2).holds is False
    assert judging.goal("x", "", values, 1.2, surely=False).holds is True
    assert judging.goal("x", "", values, 0.7, surely=False).holds is False
    alone = judging.goal("x", "", values[:1], 0.95)
    assert alone.interval is None and alone.holds is True and alone.source == judging.GOAL


def test_the_table_of_goals(tmp_path):
    """Of all files, in order; met or not as the claim says, whatever the figures."""
    good = judging.goal("late", "m", np.array([1.0, 1.2]), 3.0)
    bad = judging.goal("slow", "ms", np.array([30.0, 31.0]), 20.0)
    save_json(tmp_path / "trackers.one.json", [Claim("other", "m", ours=5.0), good], "trackers.one", 0)
    save_json(tmp_path / "trackers.two.json", [bad], "trackers.two", 0)
    lines = pages.goals(("one", "two"), tmp_path).splitlines()
    assert lines[0] == "1 of 2 goals are met."
    assert lines[-2:] == [
        "| `one` | late | 1.10 ± 1.3 m | at most 3 m | yes |",
        "| `two` | slow | 30.5 ± 6.4 ms | at most 20 ms | **no** |",
    ]


def test_bearings_are_judged_on_the_ground():
    scene = simulation.simulate("bearing-only", 200, targets=2, scans=12)
    found = bearings.judge("nearest-neighbour", scene)
    assert len(found.false) == len(found.tracked) == 12 and 0 <= found.late <= 2
    nothing = bearings.judge("nearest-neighbour", scene.part(0, 2))
    assert nothing.late >= 1 and nothing.tracked[0] == 0.0 and nothing.false[0] == 0


@pytest.mark.slow
@pytest.mark.parametrize("one", [asynchronous, benchmark, biases], ids=lambda one: one.__name__)
def test_other_experiments_as_programs(one, tmp_path, capsys):
    if one is benchmark:
        pytest.importorskip("stonesoup")
    assert one.program(["--quick", "--json", str(tmp_path / "a.json")]) == 0
    claims = load_json(tmp_path / "a.json")
    assert any(claim.quantity.startswith("goal: ") and claim.holds is not None for claim in claims)
    # with a number in the column of the papers a page would name a table of a paper for it
    assert all(claim.paper is None for claim in claims)
    capsys.readouterr()
