"""What the page on probabilities shows, and that sampled ones are compared with exact sums."""

import pytest

from experiments import probabilities
from experiments.common.results import Results
from experiments.pages.measured import probabilities as table


def test_the_page_shows_every_kind_with_its_goal():
    results = Results("probabilities")
    rows = table().splitlines()[2:]
    assert [row.split(" | ")[0].removeprefix("| ") for row in rows] == list(probabilities.KINDS)
    for name, (_, width, seconds) in probabilities.KINDS.items():
        assert results[f"{name}: mean width"].band == (None, width)
        assert results[f"{name}: seconds"].band == (None, seconds)


@pytest.mark.slow
def test_small_crowds_are_summed_exactly():
    claims = {claim.quantity: claim.ours for claim in probabilities.calibration(3)}
    assert claims["small crowds: summed exactly"] >= 1
    assert claims["small crowds: sampled, mean error"] < 0.01
