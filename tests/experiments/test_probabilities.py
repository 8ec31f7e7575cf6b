"""What the page on probabilities shows, and that sampled ones are compared with exact sums."""

import numpy as np
import pytest

import assoc
from experiments import probabilities, probabilities_beside
from experiments.common.results import Results
from experiments.pages.measured import TABLES


def test_the_page_shows_every_kind_with_its_goal():
    results = Results("probabilities")
    rows = TABLES["probabilities"]().splitlines()[2:]
    assert [row.split(" | ")[0].removeprefix("| ") for row in rows] == list(probabilities.KINDS)
    for name, (_, width, seconds) in probabilities.KINDS.items():
        assert results[f"{name}: mean width"].band == (None, width)
        assert results[f"{name}: seconds"].band == (None, seconds)


@pytest.mark.slow
def test_all_ways_are_near_the_exact_sums_of_a_small_problem():
    # 209 solutions, all of them among the best
    pairs = np.array(list(np.ndindex(4, 4))) + 1
    problem = assoc.AssignmentProblem(pairs, np.random.default_rng(1).normal(-0.5, 1.0, 16), (4, 4))
    truth = dict(zip(map(tuple, (found := assoc.marginals(problem)).tuples.tolist()), found.probability, strict=True))
    assert found.unseen < 1e-9
    for way, call in probabilities_beside.WAYS.items():
        answer = call(problem, 0)
        errors = [abs(answer.get(key, 0.0) - p) for key, p in truth.items() if all(key)]
        # belief propagation is exact on trees alone
        assert max(errors) < (0.2 if way == "loopy belief propagation" else 0.01), way
