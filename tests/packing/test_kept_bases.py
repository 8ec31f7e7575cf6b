"""Bases kept for the other side of a branching, against inverses by numpy and searches that keep none."""

import numpy as np

from assoc.packing.bounds.dual_ascent import dual_bound
from assoc.packing.branching.node import branch, keep_basis, new_work, no_kept_bases, open_node, relax, take_kept
from assoc.packing.branching.open_nodes import OpenNodes
from assoc.packing.branching.root import plain_root
from assoc.packing.simplex.basis import new_basis, refactor
from tests.packing.test_trial import packings, part, solved


def inverse_of(program, basis):
    """The transposed inverse of the columns, slacks and anchors in a basis."""
    num, size = program.weights.size, program.sides.size
    matrix = np.zeros((size, size))
    for i, code in enumerate(basis.variable):
        rows = program.rows[program.start[code] : program.start[code + 1]] if code < num else [(code - num) % size]
        np.add.at(matrix[:, i], rows, 1.0)
    return np.linalg.inv(matrix).T


def assert_basis(program, basis):
    inverse = inverse_of(program, basis)
    np.testing.assert_allclose(basis.inverse, inverse, atol=1e-9)
    np.testing.assert_allclose(basis.values, program.sides @ inverse, atol=1e-9)
    np.testing.assert_allclose(basis.norms, (inverse**2).sum(axis=0), rtol=1e-6)
    num = program.weights.size
    for j in range(num):
        assert basis.position[j] == (np.flatnonzero(basis.variable == j).tolist() or [-1])[0]
    for r in range(program.sides.size):
        assert basis.slack_position[r] == (np.flatnonzero(basis.variable == num + r).tolist() or [-1])[0]


def ready(packing):
    """The program of a packing, its optimal basis, and no basis kept yet."""
    program = plain_root(packing, dual_bound(packing)).program
    return program, solved(packing, program)[0], no_kept_bases(program)


def at_root(packing):
    """A search whose root is relaxed: the root, its stack, its work and the number of its columns."""
    root = plain_root(packing, dual_bound(packing))
    stack = OpenNodes(root).arrays
    work = new_work(packing.arrays, root.program, root.slack)
    num = open_node(work, stack, 0, -1)
    relax(work, num, np.inf, np.inf)
    return root, stack, work, num


def test_what_is_taken_back_is_the_basis_that_was_kept():
    for packing in packings(6, 21):
        program, basis, kept = ready(packing)
        keep_basis(kept, basis)
        other = new_basis(program)
        other.variable[:] = basis.variable
        # doubled right-hand sides change the values and nothing else
        for factor in (1.0, 2.0):
            changed = program._replace(sides=factor * program.sides)
            other.inverse[:] = other.norms[:] = other.values[:] = np.nan
            assert take_kept(kept, changed, other, False)
            assert_basis(changed, other)
            assert other.age[0] == basis.age[0]


def test_a_basis_that_was_not_kept_is_not_taken():
    program, basis, kept = ready(next(packings(1, 22)))
    before = basis.inverse.copy()
    assert not take_kept(kept, program, basis, False)
    keep_basis(kept, basis)
    basis.variable[[0, 1]] = basis.variable[[1, 0]]
    assert not take_kept(kept, program, basis, False)
    np.testing.assert_array_equal(basis.inverse, before)


def test_the_oldest_makes_room_and_what_came_later_is_done():
    program, basis, kept = ready(next(packings(1, 23)))
    count = kept.age.size
    first = basis.variable.copy()
    # the kept ones differ in the order of their variables
    for turn in range(count + 1):
        basis.variable[:] = np.roll(first, turn)
        keep_basis(kept, basis)
    basis.variable[:] = first
    assert not take_kept(kept, program, basis, False)
    basis.variable[:] = np.roll(first, 3)
    assert take_kept(kept, program, basis, False)
    # the next one replaces it, and not the oldest
    basis.variable[:] = np.roll(first, -1)
    keep_basis(kept, basis)
    basis.variable[:] = np.roll(first, 1)
    assert take_kept(kept, program, basis, False)


def test_the_other_side_of_a_branching_starts_from_its_basis():
    rng = np.random.default_rng(24)
    for packing in packings(6, 25):
        root, stack, work, num = at_root(packing)
        at_first = work.basis.variable.copy()
        one, two = packing.cols[0][packing.cols[0] >= 0][:2]
        assert branch(work, stack, 0, num, (one, two), True, -np.inf) == 2
        # below the first side the basis changes
        side = part(root.program, work.node, rng, 0.5)
        num = open_node(work, stack, 1, 1)
        work.node.active[: side.active.size] = side.active
        work.node.columns[:] = side.columns
        relax(work, side.active.size, np.inf, np.inf)
        assert (work.basis.variable != at_first).any()
        work.kept.age[work.kept.latest[0]] = 7
        open_node(work, stack, 0, -1)
        # recomputed, it would be 0
        assert work.basis.age[0] == 7
        np.testing.assert_array_equal(work.basis.variable, at_first)
        assert_basis(root.program, work.basis)
        refactor(root.program, work.node, work.basis)
        np.testing.assert_allclose(work.basis.duals, stack.duals[0], atol=1e-9)


def test_a_search_that_goes_on_at_the_first_side_keeps_the_basis_of_the_other_one():
    packing = next(packings(1, 28))
    _, stack, work, num = at_root(packing)
    pairs = [cols[cols >= 0][:2] for cols in packing.cols]
    branch(work, stack, 0, num, tuple(pairs[0]), False, -np.inf)
    work.kept.age[work.kept.latest[0]] = 7
    # as after a stop: no basis is loaded
    num = open_node(work, stack, 1, -1)
    assert work.basis.age[0] == 7
    relax(work, num, np.inf, np.inf)
    branch(work, stack, 1, num, tuple(pairs[-1]), False, -np.inf)
    open_node(work, stack, 0, -1)
    assert work.basis.age[0] == 7
