"""The comparison inside Stone Soup, at a small size: its programs run, and the figures mean what they say."""

from functools import partial

import numpy as np
import pytest

pytest.importorskip("stonesoup")

from experiments.common.claims import load_json
from experiments.common.command import main
from experiments.common.results import Results
from experiments.trackers import fusion_in_stone_soup as fusion
from experiments.trackers import in_stone_soup

SMALL = fusion.Size(targets=3, scans=6, clutter=1.0, settled=3)


@pytest.mark.slow
def test_experiment(tmp_path):
    files = [str(tmp_path / "a.json"), str(tmp_path / "a.png")]
    words = ["--quick", "--json", files[0], "--figure", files[1]]
    experiment = partial(fusion.experiment, size=SMALL)
    assert main(fusion.NAME, experiment, fusion.__doc__, words, figure=(fusion.draw, (11, 4.6))) == 0
    claims = {c.quantity: c for c in load_json(files[0])}
    assert len(claims) == 3 * 4 + 2 + 2 + 3 + 2
    for way in fusion.WAYS:
        whole = claims[f"{way.name}: GOSPA"].ours
        parts = [claims[f"{way.name}: GOSPA, {part}"].ours for part in fusion.PARTS[1:]]
        assert 0 < max(parts) <= whole + 1e-9 <= sum(parts) + 2e-9
    assert (tmp_path / "a.png").read_bytes()[:4] == b"\x89PNG"


def test_gospa_without_any_track_is_that_of_all_targets_missed():
    _, paths, _ = fusion.simulate(0, SMALL)
    values = fusion.gospa(set(), paths)
    expected = np.sqrt(3 * fusion.CUTOFF**2 / 2)
    np.testing.assert_allclose(values, [[expected, 0.0, expected, 0.0]] * 6)


def test_same_seed_same_scene():
    def vectors(seed):
        stream, _, _ = fusion.simulate(seed, SMALL)
        return [sorted(np.asarray(d.state_vector, float).ravel().tolist() for d in found) for _, found in stream]

    assert vectors(4) == vectors(4) != vectors(5)


def test_the_examples_are_measured_as_they_are_printed():
    """Each way of each script has its GOSPA and time in the result file, and one of them is measured here."""
    results = Results("trackers.in_stone_soup")
    for name in in_stone_soup.EXAMPLES:
        ways = [way for way, *_ in in_stone_soup.example(name).ways(0)]
        for k, way in enumerate(ways):
            assert f"{name}, {way}: CPU time of a scan" in results
            assert (f"{name}, {way}: GOSPA less the first's" in results) == (k > 0)
    known = {("Stone Soup's GNN", 0): (1.0, 2.0)}
    (first, second) = in_stone_soup.measured("fusion", [0], known)
    assert first == ("Stone Soup's GNN", pytest.approx(np.array([[1.0, 2.0]])))
    assert second[0] == "fused" and 50.0 < second[1][0, 0] < 500.0
