"""The experiment on large components, on small ones."""

import pytest

from experiments import large_components


def test_all_kinds_agree_with_the_others():
    assert large_components.gates(60, 1, True)[0] > 500
    tuples, ours, theirs = large_components.candidates(50, 1)
    assert 450 <= tuples <= 500 and min(ours, theirs) > 0.0
    for kind in ("uniform", "product"):
        assert large_components.dense(kind, 1, 30)[0] == 900
    with pytest.raises(AssertionError, match="the costs differ"):
        large_components.dense("uniform", 1, 30, peer=lambda matrix: (range(30), range(30)))
