"""What the page on probabilities shows."""

from experiments import probabilities
from experiments.common.results import Results
from experiments.pages.tables import TABLES


def test_the_page_shows_every_kind_with_its_goal():
    results = Results("probabilities")
    rows = TABLES["probabilities"]().splitlines()[2:]
    assert [row.split(" | ")[0].removeprefix("| ") for row in rows] == list(probabilities.KINDS)
    for name, (_, width, seconds) in probabilities.KINDS.items():
        assert results[f"{name}: mean width"].band == (None, width)
        assert results[f"{name}: seconds"].band == (None, seconds)
