"""The examples of the page on Stone Soup, and their measured figures."""

import numpy as np
import pytest

pytest.importorskip("stonesoup")

from experiments.common.results import Results
from experiments.trackers import in_stone_soup


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
