"""Trials from an unchanged basis, and columns laid out for pricing, against programs solved from scratch."""

import numpy as np
import pytest

from assoc.packing.bounds.dual_ascent import dual_bound
from assoc.packing.prepare import prepare
from assoc.packing.simplex.basis import begin_from_duals, new_basis
from assoc.packing.simplex.cuts import with_cuts
from assoc.packing.simplex.dual import CUT, INFEASIBLE, OPTIMAL, STOPPED, Effort, bound_of, solve_dual
from assoc.packing.simplex.pricing import list_columns, new_pricing, price, sum_rows
from assoc.packing.simplex.program import Allowed, all_allowed, certified, make_feasible, program_of, weight_limit
from assoc.packing.simplex.trial import begin_trials, new_trial, try_dual
from tests.oracles import axial_problem, gated_problem
from tests.packings import matrix_of_program


def packings(count, seed):
    rng = np.random.default_rng(seed)
    for number in range(count):
        if number % 2:
            yield prepare(gated_problem(rng, (7, 7, 7), 0.5)).packing
        else:
            yield prepare(axial_problem(rng, (5, 5, 5), 1.0, "positive")).packing


def solved(packing, program):
    """An optimal basis of the program, and what it allows."""
    allowed = all_allowed(
        program, np.concatenate([packing.slack, np.ones(program.sides.size - packing.num_rows, bool)])
    )
    basis = new_basis(program)
    duals = np.concatenate([dual_bound(packing), np.zeros(program.sides.size - packing.num_rows)])
    make_feasible(program, allowed, duals)
    begin_from_duals(program, allowed, duals, basis)
    assert solve_dual(program, allowed, basis, Effort(weight_limit(program), 10_000, np.inf))[0] == OPTIMAL
    return basis, allowed


def program_with_cuts(packing, rng):
    """A program with cuts of random odd sets, some of them in a column twice."""
    sets = np.zeros((4, packing.num_rows), dtype=bool)
    for one in sets:
        one[rng.choice(packing.num_rows, 5, replace=False)] = True
    return with_cuts(packing.cols, packing.weights, packing.num_rows, sets)


def part(program, allowed, rng, share):
    columns = rng.random(program.weights.size) < share
    return Allowed(
        np.flatnonzero(columns).astype(np.int32), columns, allowed.slack & (rng.random(allowed.slack.size) < 0.95)
    )


def test_prices_are_weights_less_the_multipliers_of_the_rows():
    rng = np.random.default_rng(11)
    for packing in packings(10, 12):
        for program in (program_of(packing.arrays), program_with_cuts(packing, rng)):
            matrix = matrix_of_program(program)
            allowed = part(program, all_allowed(program, np.ones(program.sides.size, bool)), rng, 0.6)
            pricing = new_pricing(program)
            list_columns(program, allowed, pricing)
            duals = rng.normal(size=program.sides.size)
            place = np.where(rng.random(program.weights.size) < 0.1, 0, -1).astype(np.int32)
            least = price(program, duals, place, pricing)
            expected = (program.weights - duals @ matrix)[allowed.active]
            free = place[allowed.active] < 0
            found = pricing.reduced[: allowed.active.size]
            np.testing.assert_allclose(found[free], expected[free], atol=1e-12)
            assert np.isposinf(found[~free]).all() and least == min(0.0, found[free].min(initial=0.0))
            sums = np.zeros(program.weights.size)
            sum_rows(duals, -2.0, pricing, sums)
            expected = -2.0 * (duals @ matrix)[allowed.active]
            np.testing.assert_allclose(sums[: allowed.active.size], expected, atol=1e-12)
            np.testing.assert_array_equal(pricing.position[allowed.active], np.arange(allowed.active.size))


def test_a_trial_ends_at_the_optimum_of_what_is_left():
    """With enough exchanges a trial reaches the bound of a program solved from scratch; its start stays as it was."""
    rng = np.random.default_rng(13)
    ends = dict.fromkeys((OPTIMAL, CUT, INFEASIBLE, STOPPED), 0)
    for packing in packings(60, 14):
        program = program_with_cuts(packing, rng) if rng.random() < 0.5 else program_of(packing.arrays)
        base, allowed = solved(packing, program)
        before = [
            array.copy() for array in (base.variable, base.position, base.values, base.duals, base.inverse, base.norms)
        ]
        trial = new_trial(program, 60)
        begin_trials(program, allowed, base, trial)
        limit = weight_limit(program)
        for _ in range(4):
            side = part(program, allowed, rng, rng.choice([0.9, 0.4]))
            other = new_basis(program)
            duals = base.duals.copy()
            make_feasible(program, side, duals)
            begin_from_duals(program, side, duals, other)
            status, _ = solve_dual(program, side, other, Effort(limit, 10_000, np.inf))
            best = bound_of(program, other)
            cutoff = rng.choice([limit, best - 0.3 * (best - bound_of(program, base)) if status == OPTIMAL else limit])
            end = try_dual(program, side, base, trial, Effort(cutoff, 60, np.inf))
            ends[end] += 1
            reached = bound_of(program, trial.basis)
            room = 1e-9 * max(1.0, abs(best))
            if end == OPTIMAL:
                assert status == OPTIMAL and reached == pytest.approx(best, abs=room)
            elif end == INFEASIBLE:
                assert status == INFEASIBLE and reached >= cutoff - room
            elif end == CUT:
                assert status == INFEASIBLE or cutoff <= reached <= best + room
            # whatever the status, its multipliers are feasible
            found = trial.basis.duals.copy()
            make_feasible(program, side, found)
            assert certified(program, side, found) >= min(reached, limit) - 10 * room
        after = (base.variable, base.position, base.values, base.duals, base.inverse, base.norms)
        for one, other in zip(before, after, strict=True):
            np.testing.assert_array_equal(one, other)
    assert ends[OPTIMAL] > 50 and ends[CUT] > 10 and ends[INFEASIBLE] > 0


def test_a_trial_stops_after_its_exchanges():
    rng = np.random.default_rng(15)
    stopped = 0
    for packing in packings(20, 16):
        program = program_of(packing.arrays)
        base, allowed = solved(packing, program)
        trial = new_trial(program, 3)
        begin_trials(program, allowed, base, trial)
        side = part(program, allowed, rng, 0.7)
        bounds = []
        for most in (0, 1, 3, 50):
            end = try_dual(program, side, base, trial, Effort(weight_limit(program), most, np.inf))
            stopped += end == STOPPED
            bounds.append(bound_of(program, trial.basis))
        # the bound never falls, and there are no more pivots than the trial has room for
        assert bounds[0] <= bounds[1] + 1e-9 and bounds[1] <= bounds[2] + 1e-9 and bounds[2] == bounds[3]
    assert stopped > 20
