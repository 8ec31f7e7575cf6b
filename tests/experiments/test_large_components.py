"""The experiment on large components, on small ones."""

import pytest

from experiments import large_components


def test_all_kinds_agree_with_the_others():
    tuples, ours, theirs = large_components.candidates(50, 10, "uniform", 1)
    assert 450 <= tuples <= 500 and min(ours, theirs) > 0.0
    for kind in ("uniform", "10", "products"):
        assert large_components.all_pairs((30, 40), kind, 1)[0] == 1200
    tuples, ours, theirs = large_components.with_false_alarms(60, 1)
    assert tuples > 150 and min(ours, theirs) > 0.0
    with pytest.raises(AssertionError, match="the costs differ"):
        large_components.all_pairs((30, 30), "uniform", 1, peer=lambda matrix: (range(30), range(30)))
