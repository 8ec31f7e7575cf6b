"""Short searches below a solved linear program, against scipy's MILP."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import Bounds, LinearConstraint, milp

from assoc.packing.bounds.dual_ascent import dual_bound
from assoc.packing.branching.depth_first import Limits
from assoc.packing.branching.short_search import Part, ShortSearch
from assoc.packing.simplex.linear_program import LinearProgram
from tests.packing.test_trial import packings


def begun(packing):
    """Its program, solved, and the search below it."""
    linear = LinearProgram(packing)
    relaxed = linear.solve(duals=dual_bound(packing))
    linear.mark()
    return linear, relaxed, ShortSearch(packing, linear)


def best_of(packing, columns):
    """Least weight of a cover of these columns."""
    matrix = np.zeros((packing.num_rows, packing.num_columns))
    for j in range(packing.num_columns):
        matrix[packing.cols[j][packing.cols[j] >= 0], j] = 1.0
    rows = LinearConstraint(matrix, np.where(packing.slack, 0.0, 1.0), 1.0)
    answer = milp(
        packing.weights, integrality=np.ones(packing.num_columns), bounds=Bounds(0.0, columns.astype(float)),
        constraints=rows,
    )  # fmt: skip
    return answer.fun if answer.status == 0 else np.inf


def test_what_is_found_is_the_best_of_its_part():
    """And nothing, where that is not below the cutoff; again and again with the same room."""
    rng = np.random.default_rng(3)
    limits = Limits(1e-9, np.inf, 100_000, np.inf)
    feasible = 0
    for packing in packings(8, 41):
        linear, _, search = begun(packing)
        for share in (1.0, 0.8, 0.6):
            columns = rng.random(packing.num_columns) < share
            linear.back()
            relaxed = linear.solve(columns=columns)
            part = Part(columns, packing.slack, relaxed.bound)
            best = best_of(packing, columns)
            found, done = search.run(part, np.inf, limits)
            assert done
            if best == np.inf:
                assert not found.size
                continue
            feasible += 1
            assert columns[found].all()
            rows = packing.cols[found]
            rows = rows[rows >= 0]
            assert np.unique(rows).size == rows.size and np.isin(np.flatnonzero(~packing.slack), rows).all()
            assert packing.weights[found].sum() == pytest.approx(best, abs=1e-8)
            linear.back()
            linear.solve(columns=columns)
            found, done = search.run(part, best - 1e-6, limits)
            assert done and not found.size
    assert feasible > 10


def test_it_begins_with_the_basis_at_hand():
    begun_fractional = 0
    for packing in packings(8, 42):
        linear, relaxed, search = begun(packing)
        linear.basis.age[0] = 7
        search.run(Part(np.ones(packing.num_columns, dtype=bool), packing.slack, relaxed.bound), np.inf,
                   Limits(1e-9, np.inf, 1, np.inf))  # fmt: skip
        # computed anew it would be younger; and the program's own stays as it is
        assert search._work.basis.age[0] >= 7 and linear.basis.age[0] == 7
        fractional = (relaxed.primal > 1e-6) & (relaxed.primal < 1.0 - 1e-6)
        begun_fractional += fractional.any()
    assert begun_fractional


def test_what_is_known_of_pairs_is_shared():
    packing = next(packings(1, 43))
    linear, relaxed, search = begun(packing)
    other = ShortSearch(packing, linear, search)
    assert other.trials.gain is search.trials.gain and other.trials.tried is search.trials.tried
    assert other.trials.mass is not search.trials.mass


def test_a_search_of_few_nodes_says_that_it_did_not_end():
    ended = []
    for packing in packings(8, 44):
        linear, relaxed, search = begun(packing)
        part = Part(np.ones(packing.num_columns, dtype=bool), packing.slack, relaxed.bound)
        ended += [search.run(part, np.inf, Limits(1e-9, np.inf, nodes, np.inf))[1] for nodes in (1, 100_000)]
        assert ended[-1]
        linear.back()
    assert not all(ended)
