"""What the page on probabilities shows."""

from experiments import probabilities
from experiments.common.results import Results
from experiments.pages.tables import TABLES


def test_the_page_shows_every_kind_with_its_goal():
    results = Results("probabilities")
    rows = TABLES["probabilities"]().splitlines()[2:]
    kinds = [*probabilities.SMALL, *probabilities.LARGE]
    assert [row.split(" | ")[0].removeprefix("| ") for row in rows] == kinds
    for name in kinds:
        assert results[f"{name}: mean error"].band == (None, 0.005)
        assert results[f"{name}: within four errors"].band == (0.99, None)
