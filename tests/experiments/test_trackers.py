"""The experiments with trackers, at a small size."""

from __future__ import annotations

import numpy as np
import pytest

from assoc.tracking import NearestNeighbourTracker, TrackOrientedMHT
from experiments.common.claims import load_json
from experiments.trackers import benchmark, close_scenes, close_targets, comparison, plane, warm_starts
from experiments.trackers.goals import three_radar
from experiments.trackers.running import in_plane


@pytest.mark.slow
def test_comparison_as_a_program(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(comparison, "NAMES", ("oracle", "multi-sensor", "static", "mht", "nearest-neighbour"))
    files = [str(tmp_path / "a.json"), str(tmp_path / "a.png")]
    assert comparison.program(["--quick", "--json", files[0], "--figure", files[1]]) == 0
    by_name = {claim.quantity: claim for claim in load_json(files[0])}
    assert by_name["three radars, multi-sensor: mean GOSPA"].ours < 300
    assert by_name["three radars, multi-sensor: identity switches a scene"].ours == 0
    assert "identity switches" in capsys.readouterr().out
    assert (tmp_path / "a.png").read_bytes()[:4] == b"\x89PNG"


def test_stone_soup_and_ours_on_the_same_detections():
    pytest.importorskip("stonesoup")
    one = plane.simulate(3, 0.2, 4, 1)
    from experiments.trackers import stone_soup

    results = {
        "mfa": benchmark.judged(stone_soup.multi_frame(one, 3, 0.999), one, 60.0),
        "gnn": benchmark.judged(stone_soup.nearest(one, 0.999), one, 60.0),
        "mht": benchmark.judged(in_plane(TrackOrientedMHT, one, depth=3), one, 60.0),
        "nearest": benchmark.judged(in_plane(NearestNeighbourTracker, one), one, 60.0),
    }
    for result in results.values():
        assert len(result.gospa) == 4 and (result.gospa < 60).all() and (result.seconds > 0).all()
    # few false alarms, targets apart: all say the same
    np.testing.assert_allclose(results["mht"].gospa, results["mfa"].gospa, atol=4.0)
    ratio, (difference, interval), scans = benchmark._paired([results["mht"]] * 2, [results["mfa"]] * 2)
    assert ratio > 2 and scans == 8 and interval is not None and interval[0] <= difference <= interval[1]


def test_a_peer_stops_when_its_time_is_over():
    one = plane.simulate(3, 0.2, 5, 1)
    assert len(benchmark.judged(iter([(0.1, np.zeros((0, 2)))] * 5), one, 0.0).seconds) == 1


def test_goals_of_the_three_radar_scene():
    found = three_radar(1, 8, single=True)
    assert found.late == found.lost == found.false == 0
    assert found.instants == 21
    assert found.best > 2 * found.multi


def test_close_targets_and_the_oracle():
    scene = close_scenes.simulate(close_scenes.SETTINGS["formations"], 100, 6)
    oracle, mht = (close_targets.judge(name, scene) for name in ("oracle", "mht"))
    assert oracle[1] == 0 and mht[1] <= 2
    assert mht[0] == pytest.approx(oracle[0], rel=0.3)


def test_starts_for_the_problems_of_trackers():
    """What the tracks suggest is a solution of the problem, and answers with and without a start cost the same."""
    scene = close_scenes.simulate(close_scenes.SETTINGS["formations"], 100, 3)
    for name in ("multi-sensor", "mht"):
        given = warm_starts.problems(name, scene)
        assert len(given) == 3 and [known is not None for _, known in given] == [name == "mht"] * 3
        found = warm_starts.compare(given, "exact")
        assert found.shape == (3, 3, 2) and (found[:, :, 0] > 0).all()
        assert np.abs(found[:, :, 1]).max() < 1e-6
    start = warm_starts.by_tracks(given[-1][0])
    assert (start.tuples[:, 0] > 0).any() and (np.count_nonzero(start.tuples, axis=1) > 1).any()
