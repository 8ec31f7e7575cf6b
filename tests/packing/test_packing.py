"""Packings against a plain reading of the problem: columns, weights, components, and converting back."""

import numpy as np
import pytest

from assoc.packing.prepare import prepare
from assoc.problem import AssignmentProblem
from tests.oracles import small_problems


def plain_columns(problem):
    """Return {tuple's place: (measurements, weight)} of the columns that can matter, and singletons' costs."""
    members = [[(s, i) for s, i in enumerate(row) if i > 0] for row in problem.tuples.tolist()]
    if not problem.dummy:
        return {j: (frozenset(one), problem.costs[j]) for j, one in enumerate(members)}, {}
    alone = {}
    for one, cost in zip(members, problem.costs.tolist(), strict=True):
        if len(one) == 1:
            alone[one[0]] = min(cost, alone.get(one[0], np.inf))
    columns = {}
    for j, one in enumerate(members):
        weight = problem.costs[j]
        for measurement in one:
            weight -= alone.get(measurement, 0.0)
        if len(one) > 1 and weight < 0:
            columns[j] = (frozenset(one), weight)
    return columns, alone


def plain_components(columns, rows):
    """Return the components of rows that columns join, each a set of rows."""
    components = [{row} for row in rows]
    for one in columns:
        joined = [c for c in components if c & one]
        components = [c for c in components if not c & one] + [set().union(*joined)]
    return components


@pytest.mark.parametrize("dummy", [True, False])
def test_prepare_against_a_plain_reading(dummy):
    seen = 0
    for problem in small_problems(150, seed=8, dummy=dummy):
        prepared = prepare(problem)
        packing = prepared.packing
        expected, alone = plain_columns(problem)
        seen += len(expected)
        measurements = [(s, i + 1) for s, size in enumerate(problem.sizes.tolist()) for i in range(size)]
        names = [measurements[r] for r in packing.row_origin]
        assert sorted(packing.origin.tolist()) == sorted(expected)
        for j, place in enumerate(packing.origin.tolist()):
            rows, weight = expected[place]
            assert frozenset(names[r] for r in packing.cols[j] if r >= 0) == rows
            assert packing.weights[j] == weight
        least = problem.sizes.min()
        slack = [dummy or problem.sizes[s] > least for s, _ in names]
        assert packing.slack.tolist() == slack
        if dummy:
            assert prepared.offset == pytest.approx(sum(alone.values()), abs=1e-12)
            for r, measurement in enumerate(measurements):
                assert prepared.single_cost[r] == alone.get(measurement, 0.0)
                if prepared.single[r] >= 0:
                    assert problem.costs[prepared.single[r]] == alone[measurement]
        else:
            assert prepared.offset == 0.0 and prepared.single.size == 0
        whole = bool(packing.weights.size) and bool((packing.weights == np.floor(packing.weights)).all())
        if not dummy:
            assert packing.granularity == float(whole)
        check_components(packing)
    assert seen > 200


def check_components(packing):
    """Check the order by component and the index by row."""
    sets = [frozenset(row[row >= 0].tolist()) for row in packing.cols]
    expected = {frozenset(c) for c in plain_components(sets, range(packing.num_rows))}
    starts = packing.row_start.tolist()
    found = [frozenset(range(a, b)) for a, b in zip(starts[:-1], starts[1:], strict=True)]
    assert set(found) == expected and len(found) == packing.num_components
    for c, rows in enumerate(found):
        for j in range(packing.col_start[c], packing.col_start[c + 1]):
            assert sets[j] <= rows
    assert packing.col_start[-1] == packing.num_columns
    for r in range(packing.num_rows):
        listed = packing.row_cols[packing.row_ptr[r] : packing.row_ptr[r + 1]].tolist()
        assert listed == [j for j, one in enumerate(sets) if r in one]


def test_components_are_packings_of_their_own():
    for problem in small_problems(60, seed=10):
        whole = prepare(problem).packing
        for c in range(whole.num_components):
            one = whole.component(c)
            assert one.num_components == 1
            check_components(one)
            assert (one.weights == whole.weights[one.origin]).all()
            assert (one.slack == whole.slack[one.row_origin]).all()
            moved = np.where(one.cols >= 0, one.row_origin[one.cols], -1)
            assert (moved == whole.cols[one.origin]).all()


def test_restrict_keeps_the_columns_asked_for_and_the_rows_that_must_be_covered():
    rng = np.random.default_rng(2)
    for problem in small_problems(60, seed=11):
        whole = prepare(problem).packing
        keep = rng.random(whole.num_columns) < 0.5
        part = whole.restrict(keep)
        assert sorted(part.origin.tolist()) == np.flatnonzero(keep).tolist()
        assert set(np.flatnonzero(~whole.slack).tolist()) <= set(part.row_origin.tolist())
        moved = np.where(part.cols >= 0, part.row_origin[part.cols], -1)
        assert (moved == whole.cols[part.origin]).all()
        check_components(part)


def test_a_problem_is_prepared_once():
    problem = AssignmentProblem([[1, 1]], [-1.0], [1, 1])
    assert prepare(problem) is prepare(problem)
